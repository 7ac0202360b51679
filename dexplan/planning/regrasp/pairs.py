"""Which pairs of places are of use at a pose of the object: whose fingers do not cross, and which bear its weight."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench, sure_share
from dexplan.planning.admissible.order import ORDER_GAP
from dexplan.planning.contacts.still import SpotPairs
from dexplan.spatial import Array

Pair = tuple[int, int]
"""Two fingers."""
Bools = NDArray[np.bool_]


def keep_order_of_pairs(
    hand: HandModel, R_WO: Array, centers: list[Array], is_apart: dict[Pair, Bools]
) -> dict[Pair, Bools]:
    """Return which pairs of tips, of those ``is_apart``, are in the order of the fingers' bases where both are on one side.

    Fingers never change their order around the vertical [paper §4]; of two tips on different sides of the object nothing is
    known before the third.

    Args:
        hand: the fingers and where their bases are.
        R_WO: attitude (3, 3) of the object.
        centers: per finger the tips' centres (N, 3) [m] at its places, object axes.
        is_apart: per pair of fingers (N, M): which places of the two leave their tips room.
    """
    home = hand.object.X_WO_home[:2, 3]
    bases = [_measure_azimuths(finger.chain.offsets[0][:2, 3] - home) for finger in hand.fingers]
    azimuths = [_measure_azimuths(rows @ R_WO.T) for rows in centers]
    kept: dict[Pair, Bools] = {}
    for (a, b), apart in is_apart.items():
        between = _wrap(azimuths[b][None] - azimuths[a][:, None])
        sense = np.sign(_wrap(bases[b] - bases[a]))
        kept[a, b] = apart & ((np.abs(between) > 0.5 * np.pi) | (sense * between >= ORDER_GAP))
    return kept


def _measure_azimuths(arms: Array) -> Array:
    return np.asarray(np.arctan2(arms[..., 1], arms[..., 0]))


def _wrap(angle: Array) -> Array:
    return np.asarray(np.arctan2(np.sin(angle), np.cos(angle)))


@dataclass(eq=False)
class Burden:
    """Which pairs of places bear the object's weight; answers are kept by the direction of gravity in object axes."""

    hand: HandModel
    _borne: dict[tuple[object, ...], Bools] = field(default_factory=dict)

    def keep_bearing(
        self, R_WO: Array, points: list[Array], normals: list[Array], holds: dict[Pair, Bools]
    ) -> dict[Pair, Bools]:
        """Return which pairs, of those that ``holds`` says are force closed, bear the object at rest at ``R_WO`` (3, 3).

        ``points`` [m] and outward ``normals`` (N, 3) per finger, object axes; as far as the quick loads say for sure.
        """
        wrench = compute_object_wrench(self.hand, None, R_WO)
        kept: dict[Pair, Bools] = {}
        for (a, b), closed in holds.items():
            key = a, b, tuple(np.round(R_WO[2], 6)), closed.shape
            if key not in self._borne:
                i, j = np.nonzero(closed)
                pairs = SpotPairs(
                    np.stack([normals[a][i], normals[b][j]], 1), np.stack([points[a][i], points[b][j]], 1)
                )
                used = pairs.turned(R_WO).compute_loads(self.hand, wrench)
                self._borne[key] = np.zeros_like(closed)
                self._borne[key][i, j] = used <= sure_share(self.hand)
            kept[a, b] = self._borne[key] & closed
        return kept
