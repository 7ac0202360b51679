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
NOTHING_NEAR = Nearness(SIGHT, "nothing near")
_BITS = 31
"""Bits of MuJoCo's collision masks that are used here."""


def leave_out(model: mujoco.MjModel, pairs: list[tuple[int, int]]) -> None:
    """Change a model's collision masks so that these pairs of its geoms are not looked at, while all others are as before.

    A geom of every pair gets a bit of its own, which the other one of the pair does not ask for; where there are more of these
    geoms than bits, the pairs of the last ones stay.  All geoms that collide have to collide with one another.
    """
    marked = list(
        dict.fromkeys(max(pair, key=lambda g: sum(g in other for other in pairs)) for pair in pairs)
    )
    bits = {geom: 2 << k for k, geom in enumerate(marked[: _BITS - 1])}
    every = 1 | sum(bits.values())
    for geom in np.flatnonzero(model.geom_contype).tolist():
        others = {a if b == geom else b for a, b in pairs if geom in (a, b)}
        model.geom_contype[geom] = bits.get(geom, 1)
        # A geom with a bit of its own is asked for by those without, and need not ask for them.
        asked = every - 1 if geom in bits else every
        model.geom_conaffinity[geom] = asked - sum(bits.get(other, 0) for other in others)


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
        # Bodies of one to three geoms: to sort these first takes longer than to look at all of them.
        self._model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        self._data = mujoco.MjData(self._model)
        self._qpos = self._data.qpos
        self._qpos[:] = 0.0
        self._object_at = b""
        self._gravity = np.zeros(self._model.nv)
        self._rest()
        tips = scene.tip_geoms.tolist()
        self._touch_pairs = [(min(t, scene.object_geom), max(t, scene.object_geom)) for t in tips]
        self._names = [self._model.geom(g).name for g in range(self._model.ngeom)]
        self._owner = [self._find_owner(g) for g in range(self._model.ngeom)]
        self._constant = self._find_constant_pairs()
        self._counting: dict[tuple[tuple[int, ...], tuple[int, ...]], dict[tuple[int, int], bool]] = {}
        own = [(a, b) for a, b in self._constant if self._owner[a] == self._owner[b]]
        leave_out(self._model, own)  # nobody asks how near a finger always is to itself

    def _rest(self) -> None:
        """Set the velocities to nothing, for good: whatever is asked is asked at rest."""
        self._data.qvel[:] = 0.0
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)

    def _find_owner(self, geom: int) -> int:
        """Return whose a geom is: a finger's number, OBJECT or STANDING."""
        if geom == self._scene.object_geom:
            return OBJECT
        first = self._names[geom].split("/")[0]
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
        self._move(q, X_WO)
        mujoco.mj_collision(self._model, self._data)

    def _move(self, q: Array, X_WO: Array) -> None:
        """Take the fingers to ``q`` (F, J) and the object to ``X_WO`` (4, 4), where it mostly is already."""
        if (at := X_WO.tobytes()) != self._object_at:
            self._qpos[:] = self._scene.as_qpos(q, X_WO)
            self._object_at = at
        else:
            self._qpos[self._scene.joint_qpos] = q
        mujoco.mj_kinematics(self._model, self._data)

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
        counting = self._counting.setdefault((touching, absent), {})
        least, nearest = SIGHT, None
        contact = self._data.contact
        for pair, distance in zip(map(tuple, contact.geom.tolist()), contact.dist.tolist(), strict=True):
            if distance < least:
                counts = counting.get(pair)
                if counts is None:
                    counts = counting[pair] = self._counts(pair, touching, absent)
                if counts:
                    least, nearest = distance, pair
        if nearest is None:
            return NOTHING_NEAR
        return self._tell(least, nearest)

    def _counts(self, geoms: tuple[int, int], touching: tuple[int, ...], absent: tuple[int, ...]) -> bool:
        """Return whether it matters how near these geoms are to one another."""
        pair = (min(geoms), max(geoms))
        owners = {self._owner[g] for g in geoms}
        if pair in {self._touch_pairs[i] for i in touching} or not owners.isdisjoint(absent):
            return False
        return pair not in self._constant or not (len(owners) == 1 or owners <= {OBJECT, STANDING, *touching})

    def _tell(self, distance: float, geoms: tuple[int, int]) -> Nearness:
        bodies = self._names[geoms[0]], self._names[geoms[1]]
        owners = self._owner[geoms[0]], self._owner[geoms[1]]
        return Nearness(distance, f"{bodies[0]} and {bodies[1]}", owners, bodies)

    def compute_gravity_torque(self, q: Array) -> Array:
        """Return the joint torques (F, J) [N m] that hold the fingers' own weight at ``q`` (F, J)."""
        self._move(q, self._scene.object.X_WO_home)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_rne(self._model, self._data, 0, self._gravity)
        return self._gravity[self._scene.joint_dof]
