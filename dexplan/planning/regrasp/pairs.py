"""Which pairs of places are of use: tips have room, the pair is force closed; at a pose it is in order and bears the weight."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench, sure_share
from dexplan.planning.admissible.order import ORDER_GAP
from dexplan.planning.contacts.spot_pairs import SpotPairs
from dexplan.spatial import Array

Pair = tuple[int, int]
"""Two fingers."""
Bools = NDArray[np.bool_]


@dataclass(eq=False)
class PlacePairs:
    """Places on the object, numbered as they become known, and tables (P, P) of their pairs; tables are kept, and grow.

    ``lean_max`` [rad]: two contacts are force closed where their chord leans less than this from both normals.
    """

    hand: HandModel
    lean_max: float
    _numbers: dict[bytes, int] = field(default_factory=dict)
    _points: list[Array] = field(default_factory=list)
    _normals: list[Array] = field(default_factory=list)
    _closed: Bools = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    _bearing: dict[tuple[float, ...], Bools] = field(default_factory=dict)
    _orders: dict[tuple[float, ...], dict[Pair, Bools]] = field(default_factory=dict)
    _apart: dict[Pair, Bools] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self._points)

    @property
    def points(self) -> Array:
        """Where the places are, (P, 3) [m] in object axes."""
        return np.array(self._points).reshape(-1, 3)

    @property
    def normals(self) -> Array:
        """The outward normals (P, 3) there, object axes."""
        return np.array(self._normals).reshape(-1, 3)

    def number(self, point_O: Array, normal_O: Array) -> int:
        """Return the number of a place, a new one if it is not known yet."""
        key = point_O.tobytes()
        if key not in self._numbers:
            self._numbers[key] = len(self._points)
            self._points.append(point_O)
            self._normals.append(normal_O)
        return self._numbers[key]

    def number_all(self, points_O: Array, normals_O: Array) -> NDArray[np.intp]:
        """Return the numbers (N,) of many places."""
        rows = [self.number(p, n) for p, n in zip(points_O, normals_O, strict=True)]
        return np.array(rows, dtype=np.intp)

    def find_apart(self) -> dict[Pair, Bools]:
        """Return per pair of fingers at which two places their tips have room beside each other."""
        if any(len(rows) != len(self) for rows in self._apart.values()) or not self._apart:
            centers = self._list_centers()
            for a, b in combinations(range(len(centers)), 2):
                radii = self.hand.fingers[a].tip_radius + self.hand.fingers[b].tip_radius
                room = self.hand.limits.clearance + radii
                gap = np.linalg.norm(centers[a][:, None] - centers[b][None], axis=2)
                self._apart[a, b] = gap >= room
        return self._apart

    def _list_centers(self) -> list[Array]:
        """Return per finger where its tip's centre is at every place, (P, 3) [m] in object axes."""
        points, normals = self.points, self.normals
        return [points + finger.tip_radius * normals for finger in self.hand.fingers]

    def find_closed(self) -> Bools:
        """Return which two places are force closed with a margin."""
        table, new = _grow(self._closed, len(self))
        if new.any():
            table[new] = self._take(new).leans < self.lean_max
            self._closed = table
        return self._closed

    def find_bearing(self, R_WO: Array) -> Bools:
        """Return which two places, of those that are force closed, bear the object at rest at ``R_WO`` (3, 3).

        As far as the quick loads say for sure, which do not depend on how the object stands about the vertical.
        """
        key = tuple(np.round(R_WO[2], 6).tolist())
        table, new = _grow(self._bearing.get(key, np.zeros((0, 0), dtype=bool)), len(self))
        # Who of the two is first makes no difference.
        new &= self.find_closed() & np.tri(len(self), dtype=bool)
        if new.any():
            wrench = compute_object_wrench(self.hand, None, R_WO)
            table[new] = self._take(new).turned(R_WO).compute_loads(self.hand, wrench) <= sure_share(
                self.hand
            )
            table |= table.T
        self._bearing[key] = table
        return table

    def _take(self, which: Bools) -> SpotPairs:
        i, j = np.nonzero(which)
        points, normals = self.points, self.normals
        return SpotPairs(np.stack([normals[i], normals[j]], 1), np.stack([points[i], points[j]], 1))

    def keep_order(self, R_WO: Array) -> dict[Pair, Bools]:
        """Return at which two places tips have room, and are in the order of the fingers' bases where both are on one side.

        Fingers never change their order around the vertical [paper §4]; of two tips on different sides of the object nothing is
        known before the third.  ``R_WO`` (3, 3): the object's attitude.
        """
        key = (float(len(self)), *R_WO.ravel().tolist())
        if key not in self._orders:
            home = self.hand.object.X_WO_home[:2, 3]
            bases = [_measure_azimuths(f.chain.offsets[0][:2, 3] - home) for f in self.hand.fingers]
            azimuths = [_measure_azimuths(rows @ R_WO.T) for rows in self._list_centers()]
            kept: dict[Pair, Bools] = {}
            for (a, b), apart in self.find_apart().items():
                between = _wrap(azimuths[b][None] - azimuths[a][:, None])
                sense = np.sign(_wrap(bases[b] - bases[a]))
                kept[a, b] = apart & ((np.abs(between) > 0.5 * np.pi) | (sense * between >= ORDER_GAP))
            self._orders[key] = kept
        return self._orders[key]


def _grow(table: Bools, size: int) -> tuple[Bools, Bools]:
    """Return ``table`` with room for ``size`` places, and which entries are new."""
    grown, new = np.zeros((size, size), dtype=bool), np.ones((size, size), dtype=bool)
    old = slice(0, len(table))
    grown[old, old], new[old, old] = table, False
    return grown, new


def _measure_azimuths(arms: Array) -> Array:
    return np.asarray(np.arctan2(arms[..., 1], arms[..., 0]))


def _wrap(angle: Array) -> Array:
    return np.asarray(angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi)))
