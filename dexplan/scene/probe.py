"""Questions to the compiled hand that planning may ask without seeing MuJoCo: how clear is it, what does its weight ask?"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from dexplan.scene.scene import Scene
from dexplan.spatial import Array

SIGHT = 0.02
"""Distances are measured up to this far [m]; anything farther counts as this far."""


class HandProbe:
    """Clearances and gravity torques of a scene's hand at any posture; keeps its own model and data.

    One collision pass over a copy of the model whose geoms see each other from ``SIGHT`` away yields all distances at once.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._model = copy.copy(scene.model)
        self._model.geom_margin[:] = SIGHT
        self._data = mujoco.MjData(self._model)
        self._gravity = np.zeros(self._model.nv)

    def compute_clearance(self, q: Array, X_WO: Array, touching: tuple[int, ...]) -> tuple[float, str]:
        """Return the smallest distance [m] between two bodies that should not touch, and which they are.

        ``q`` (F, J) [rad]; tips of the fingers in ``touching`` may touch the object.
        """
        data = self._data
        data.qpos[:] = self._scene.as_qpos(q, X_WO)
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_collision(self._model, data)
        if not data.ncon:
            return SIGHT, "nothing near"
        geoms, dist = data.contact.geom, data.contact.dist.copy()
        for i in touching:
            pair = np.sort([self._scene.tip_geoms[i], self._scene.object_geom])
            dist[(np.sort(geoms, axis=1) == pair).all(axis=1)] = SIGHT
        k = int(np.argmin(dist))
        if dist[k] >= SIGHT:
            return SIGHT, "nothing near"
        names = (self._model.geom(g).name for g in geoms[k])
        return float(dist[k]), " and ".join(names)

    def compute_gravity_torque(self, q: Array) -> Array:
        """Return the joint torques (F, J) [N m] that hold the fingers' own weight at ``q`` (F, J)."""
        data = self._data
        data.qpos[:] = self._scene.as_qpos(q, self._scene.object.X_WO_home)
        data.qvel[:] = 0.0
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_comVel(self._model, data)
        mujoco.mj_rne(self._model, data, 0, self._gravity)
        return self._gravity[self._scene.joint_dof]
