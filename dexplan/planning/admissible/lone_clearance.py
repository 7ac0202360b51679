"""Does a finger that touches, or hovers over its contact, come too near to anything, wherever the other fingers are?

Only what does not depend on them counts: itself, the object, the floor, obstacles.  Another finger may hold anywhere, and only
one that stays free is at home; who is where is known where whole grasps are judged.

Asked once per finger, place and direction.  A tip that touches a sphere with its pole along the normal holds the finger's links
in one place whatever the spin, so that the answer belongs to the direction alone.  Directions are those of a grid as fine as the
stations at which orbits are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dexplan.icosphere import build_icosphere
from dexplan.kinematics.spherical_wrist import solve_tip_pose
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.refusal import Refusal
from dexplan.spatial import Array, make_pose

LEVEL = 4
"""The icosphere's level: directions about 5 deg apart."""


@dataclass(eq=False)
class LoneClearance:
    """Answers for one hand, kept as they come.

    A memo, not a model: what it returns does not depend on what was asked before.
    """

    hand: HandModel
    _known: dict[tuple[int, tuple[float, float, float], int], tuple[Refusal | None, Refusal | None]] = field(
        default_factory=dict
    )

    def refuse_contact(self, finger: int, center: Array, normals: Array) -> list[Refusal | None]:
        """Return for outward ``normals`` (N, 3) what comes too near to a finger that touches there; None where nothing does.

        The object is at ``center`` (3,) [m].  Where the grid's own direction is out of reach the answer is None: whatever a plan
        goes through is looked at exactly anyway.
        """
        return [contact for contact, _ in self._ask(finger, center, normals)]

    def refuse_landing(self, finger: int, center: Array, normals: Array) -> list[Refusal | None]:
        """Return the same for a finger that touches there, or hovers where it would come from."""
        return [contact or over for contact, over in self._ask(finger, center, normals)]

    def _ask(self, finger: int, center: Array, normals: Array) -> list[tuple[Refusal | None, Refusal | None]]:
        x, y, z = (float(v) for v in np.round(center, 7) + 0.0)
        _, nearest = _build_tree().query(normals)
        missing = [v for v in np.unique(nearest).tolist() if (finger, (x, y, z), v) not in self._known]
        if missing:
            for vertex, refusals in zip(
                missing, self._look(finger, np.array([x, y, z]), np.array(missing)), strict=True
            ):
                self._known[finger, (x, y, z), vertex] = refusals
        return [self._known[finger, (x, y, z), int(v)] for v in nearest]

    def _look(
        self, finger: int, center: Array, vertices: NDArray[np.intp]
    ) -> list[tuple[Refusal | None, Refusal | None]]:
        hand, normals = self.hand, build_icosphere(LEVEL).vertices[vertices]
        X_WF = build_aligned(hand, finger, center, normals)
        over = X_WF.copy()
        over[:, :3, 3] += hand.hover * normals
        contact = self._refuse(finger, center, X_WF, (finger,))
        return list(zip(contact, self._refuse(finger, center, over, ()), strict=True))

    def _refuse(
        self, finger: int, center: Array, X_WF: Array, touching: tuple[int, ...]
    ) -> list[Refusal | None]:
        hand, X_WO, clearance = self.hand, make_pose(p=center), self.hand.limits.clearance
        refusals: list[Refusal | None] = []
        posture, others = hand.q_home.copy(), list_others(hand, finger)
        for q, is_reached in zip(*solve_tip_pose(hand.workspaces[finger], X_WF), strict=True):
            posture[finger] = q
            nearest = hand.probe.find_nearest(posture, X_WO, touching, others) if is_reached else None
            is_near = nearest is not None and nearest.distance < clearance
            refusals.append(refuse_nearness(nearest, clearance) if nearest and is_near else None)
        return refusals


def list_others(hand: HandModel, finger: int) -> tuple[int, ...]:
    """Return all fingers but one."""
    return tuple(f for f in range(len(hand.fingers)) if f != finger)


@lru_cache(maxsize=8)
def remember_clearances(hand: HandModel) -> LoneClearance:
    """Return the memo of a hand, the same one every time."""
    return LoneClearance(hand)


@lru_cache(maxsize=1)
def _build_tree() -> cKDTree:
    return cKDTree(build_icosphere(LEVEL).vertices)
