"""How near does a finger that touches come to anything, all others at home?  Asked once per finger, place and direction.

A tip that touches a sphere with its pole along the normal holds the finger's links in one place whatever the spin, so that the
answer belongs to the direction alone.  Directions are those of a grid as fine as the stations at which orbits are looked at.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dexplan.planning.aligned import build_aligned
from dexplan.planning.hand import HandModel
from dexplan.planning.icosphere import build_icosphere
from dexplan.planning.spherical_wrist import solve_tip_pose
from dexplan.spatial import Array, make_pose

LEVEL = 4
"""The icosphere's level: directions about 5 deg apart."""


@dataclass(eq=False)
class LoneClearance:
    """Answers for one hand, kept as they come.

    A memo, not a model: what it returns does not depend on what was asked before.
    """

    hand: HandModel
    _known: dict[tuple[int, tuple[float, float, float], int], str] = field(default_factory=dict)

    def refuse(self, finger: int, center: Array, normals: Array) -> list[str]:
        """Return for outward ``normals`` (N, 3) what comes too near to a finger that touches there; "" where nothing does.

        The object is at ``center`` (3,) [m].  Where the grid's own direction is out of reach the answer is "": whatever a plan
        goes through is looked at exactly anyway.
        """
        x, y, z = (float(v) for v in np.round(center, 7) + 0.0)
        _, nearest = _build_tree().query(normals)
        missing = [v for v in np.unique(nearest).tolist() if (finger, (x, y, z), v) not in self._known]
        if missing:
            for vertex, refusal in zip(missing, self._look(finger, center, np.array(missing)), strict=True):
                self._known[finger, (x, y, z), vertex] = refusal
        return [self._known[finger, (x, y, z), int(v)] for v in nearest]

    def _look(self, finger: int, center: Array, vertices: NDArray[np.intp]) -> list[str]:
        hand = self.hand
        X_WF = build_aligned(hand, finger, center, build_icosphere(LEVEL).vertices[vertices])
        q, reached = solve_tip_pose(hand.workspaces[finger], X_WF)
        X_WO, posture, refusals = make_pose(p=center), hand.q_home, []
        for row, is_reached in zip(q, reached, strict=True):
            refusals.append("")
            if not is_reached:
                continue
            posture[finger] = row
            clearance, names = hand.probe.compute_clearance(posture, X_WO, (finger,))
            if clearance < hand.limits.clearance:
                refusals[-1] = f"{names} too near"
        return refusals


@lru_cache(maxsize=8)
def remember_clearances(hand: HandModel) -> LoneClearance:
    """Return the memo of a hand, the same one every time."""
    return LoneClearance(hand)


@lru_cache(maxsize=1)
def _build_tree() -> cKDTree:
    return cKDTree(build_icosphere(LEVEL).vertices)
