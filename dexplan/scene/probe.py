"""Questions to the compiled hand that planning may ask without seeing MuJoCo: how clear is it, what does its weight ask?"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from dexplan.scene.description import OBJECT, STANDING, Nearness
from dexplan.scene.scene import Scene
from dexplan.spatial import Array

SIGHT = 0.02
"""Distances are measured up to this far [m]; anything farther counts as this far."""
SAMPLES = 12
"""Random postures in which a distance has to be the same for it to count as constant."""


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
        self._owner = [self._find_owner(g) for g in range(self._model.ngeom)]
        self._constant = self._find_constant_pairs()

    def _find_owner(self, geom: int) -> int:
        """Return whose a geom is: a finger's number, OBJECT or STANDING."""
        if geom == self._scene.object_geom:
            return OBJECT
        first = self._model.geom(geom).name.split("/")[0]
        names = [finger.name for finger in self._scene.fingers]
        return names.index(first) if first in names else STANDING

    def _find_constant_pairs(self) -> dict[tuple[int, int], float]:
        """Return the pairs of geoms whose distance no posture changes, with that distance [m]."""
        rng = np.random.default_rng(0)
        lower, upper = (
            np.stack([getattr(f.chain, k) for f in self._scene.fingers]) for k in ("lower", "upper")
        )
        seen: dict[tuple[int, int], list[float]] = {}
        for _ in range(SAMPLES):
            # The object moves too: its distance to what stands still is a clearance like any other.
            X_WO = self._scene.object.X_WO_home.copy()
            X_WO[:3, 3] += rng.uniform(-0.005, 0.005, 3)
            self._place(rng.uniform(lower, upper), X_WO)
            for pair, distance in self._read_distances().items():
                seen.setdefault(pair, []).append(distance)
        return {
            pair: min(rows) for pair, rows in seen.items() if len(rows) == SAMPLES and np.ptp(rows) < 1e-9
        }

    def _read_distances(self) -> dict[tuple[int, int], float]:
        """Return the least distance [m] of every pair of geoms that see each other."""
        least: dict[tuple[int, int], float] = {}
        contact = self._data.contact
        for (a, b), distance in zip(contact.geom.tolist(), contact.dist.tolist(), strict=True):
            pair = (min(a, b), max(a, b))
            least[pair] = min(distance, least.get(pair, SIGHT))
        return least

    def _place(self, q: Array, X_WO: Array) -> None:
        self._data.qpos[:] = self._scene.as_qpos(q, X_WO)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)

    def find_overlaps(self) -> tuple[Nearness, ...]:
        """Return the bodies that touch or overlap whatever the hand does, the deepest first: no plan can be carried out."""
        found = [(d, pair) for pair, d in self._constant.items() if d <= 0.0]
        return tuple(self._tell(d, pair) for d, pair in sorted(found))

    def compute_clearance(
        self, q: Array, X_WO: Array, touching: tuple[int, ...], absent: tuple[int, ...] = ()
    ) -> tuple[float, str]:
        """Return the smallest distance [m] between two bodies that should not touch, and which they are.

        Arguments as for :meth:`find_nearest`.
        """
        nearest = self.find_nearest(q, X_WO, touching, absent)
        return nearest.distance, nearest.names

    def find_nearest(
        self, q: Array, X_WO: Array, touching: tuple[int, ...], absent: tuple[int, ...] = ()
    ) -> Nearness:
        """Return which two bodies that should not touch are nearest to one another.

        ``q`` (F, J) [rad]; tips of the fingers in ``touching`` may touch the object.  What belongs to ``absent``, fingers or
        STANDING, counts as not there, for questions about one finger wherever the others are.  Distances that no posture changes
        count where a finger is free, which has to keep clear of whatever is not its own; what they are between fingers that hold
        makes no difference.
        """
        self._place(q, X_WO)
        allowed = {self._touch_pairs[i] for i in touching}
        owner, held = self._owner, {OBJECT, STANDING, *touching}
        least, nearest = SIGHT, None
        contact = self._data.contact
        for (a, b), distance in zip(contact.geom.tolist(), contact.dist.tolist(), strict=True):
            if distance >= least or (pair := (min(a, b), max(a, b))) in allowed:
                continue
            i, j = owner[a], owner[b]
            if i in absent or j in absent or (pair in self._constant and (i == j or {i, j} <= held)):
                continue
            least, nearest = distance, (a, b)
        if nearest is None:
            return Nearness(SIGHT, "nothing near")
        return self._tell(least, nearest)

    def _tell(self, distance: float, geoms: tuple[int, int]) -> Nearness:
        bodies = tuple(self._model.geom(g).name for g in geoms)
        return Nearness(distance, " and ".join(bodies), tuple(self._owner[g] for g in geoms), bodies)

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
