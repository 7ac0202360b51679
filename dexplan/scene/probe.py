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
        # Made from the geoms' margins when the model was compiled; bodies farther apart are not looked at.
        self._model.body_margin[:] = SIGHT
        self._data = mujoco.MjData(self._model)
        self._gravity = np.zeros(self._model.nv)
        tips = scene.tip_geoms.tolist()
        self._touch_pairs = [(min(t, scene.object_geom), max(t, scene.object_geom)) for t in tips]
        self._constant = self._find_constant_pairs()

    def _find_constant_pairs(self) -> set[tuple[int, int]]:
        """Return the pairs of geoms whose distance no posture changes: they say nothing about clearance."""
        rng = np.random.default_rng(0)
        lower, upper = (
            np.stack([getattr(f.chain, k) for f in self._scene.fingers]) for k in ("lower", "upper")
        )
        seen: dict[tuple[int, int], list[float]] = {}
        for _ in range(12):
            # The object moves too: its distance to what stands still is a clearance like any other.
            X_WO = self._scene.object.X_WO_home.copy()
            X_WO[:3, 3] += rng.uniform(-0.005, 0.005, 3)
            self._place(rng.uniform(lower, upper), X_WO)
            for (a, b), distance in zip(
                self._data.contact.geom.tolist(), self._data.contact.dist.tolist(), strict=True
            ):
                seen.setdefault((min(a, b), max(a, b)), []).append(distance)
        return {pair for pair, rows in seen.items() if len(rows) == 12 and np.ptp(rows) < 1e-9}

    def _place(self, q: Array, X_WO: Array) -> None:
        self._data.qpos[:] = self._scene.as_qpos(q, X_WO)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)

    def compute_clearance(self, q: Array, X_WO: Array, touching: tuple[int, ...]) -> tuple[float, str]:
        """Return the smallest distance [m] between two bodies that should not touch, and which they are.

        ``q`` (F, J) [rad]; tips of the fingers in ``touching`` may touch the object.
        """
        self._place(q, X_WO)
        allowed = self._constant | {self._touch_pairs[i] for i in touching}
        least, nearest = SIGHT, None
        for (a, b), distance in zip(
            self._data.contact.geom.tolist(), self._data.contact.dist.tolist(), strict=True
        ):
            if distance < least and (min(a, b), max(a, b)) not in allowed:
                least, nearest = distance, (a, b)
        if nearest is None:
            return SIGHT, "nothing near"
        return least, " and ".join(self._model.geom(g).name for g in nearest)

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
