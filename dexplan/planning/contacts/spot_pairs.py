"""Many pairs of contacts at once: their chords, and which share of the believed friction cones they use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.grasp.pairs import measure_chord_lean
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_pair_loads
from dexplan.spatial import Array, lock_arrays


@dataclass(frozen=True, eq=False)
class SpotPairs:
    """N pairs of contacts: outward ``normals`` and ``arms`` [m] from the object's origin, (N, 2, 3) each, in W."""

    normals: Array
    arms: Array

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def leans(self) -> Array:
        """The larger angle (N,) [rad] of each pair's chord from its normals."""
        return measure_chord_lean(self.arms, self.normals)

    def compute_loads(self, hand: HandModel, wrench: Array) -> Array:
        """Return which share (N,) of the believed cone it takes to exert ``wrench`` (6,) about the origin."""
        if not len(self.normals):
            return np.zeros(0)
        first, second = self.normals[:, 0], self.normals[:, 1]
        arms = self.arms[:, 0], self.arms[:, 1]
        return compute_pair_loads(hand, first, second, wrench, arms).utilisation

    def compute_closed_loads(self, hand: HandModel, wrench: Array, lean_max: float) -> Array:
        """Return the loads (N,); inf where the chord leans from a normal by ``lean_max`` [rad] or more."""
        closed = self.leans < lean_max
        used = np.full(len(closed), np.inf)
        used[closed] = self.take(closed).compute_loads(hand, wrench)
        return used

    def turned(self, R: Array) -> SpotPairs:
        """Return the pairs turned by R (3, 3) about the object's origin."""
        return SpotPairs(self.normals @ R.T, self.arms @ R.T)

    def take(self, rows: NDArray[np.bool_]) -> SpotPairs:
        """Return those pairs that ``rows`` (N,) names."""
        return SpotPairs(self.normals[rows], self.arms[rows])


def pair_all(first: Array, second: Array) -> SpotPairs:
    """Return the N * M pairs of the contacts ``first`` (N, 2, 3) with ``second`` (M, 2, 3), given as normal and arm in W."""
    shape = len(first), len(second), 3
    normals, arms = (
        np.stack(
            [np.broadcast_to(first[:, None, k], shape), np.broadcast_to(second[:, k], shape)], axis=2
        ).reshape(-1, 2, 3)
        for k in (0, 1)
    )
    return SpotPairs(normals, arms)
