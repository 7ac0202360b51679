"""Where every finger can land on one leg: the contacts of its orbits that it reaches, and gets to.

Tables of turns depend on the axis, the sense and the object's place alone; those of the last axes are kept, since the routes of
one goal share many of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.lone_clearance import remember_clearances
from dexplan.planning.contacts.held import Candidates
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.orbits import Orbit, build_orbits
from dexplan.spatial import Array, build_frame, make_pose

POLAR_SPACING = float(np.radians(7.0))
"""Angle between neighbouring orbits of a turn [rad]."""
DIRECTIONS = 700
"""Directions around the object at which contacts of a shift are tried."""


@dataclass(frozen=True, eq=False)
class Landings:
    """One finger's orbits on a leg, the ``rows`` of stations on them where it can land, and those at which it can ``stand``: some
    of these it comes to with the object only, landing is refused there.
    """

    orbits: tuple[Orbit, ...]
    rows: Candidates
    stand: Candidates

    def numbered_from(self, first: int) -> Candidates:
        """Return the rows with orbits counted from ``first`` on."""
        return replace(self.rows, orbit=self.rows.orbit + first)


def find_landings(hand: HandModel, leg: Leg) -> tuple[Landings, ...]:
    """Return every finger's landings: all around the axis of a turn, or all over the object where it is shifted."""
    if not leg.is_shift:
        return _find_around(hand, tuple(leg.axis_W.tolist()), leg.sense, tuple(leg.center.tolist()))
    directions = spread_directions(DIRECTIONS)
    return tuple(_find(hand, leg, finger, directions) for finger in range(len(hand.fingers)))


@lru_cache(maxsize=32)
def _find_around(
    hand: HandModel, axis: tuple[float, ...], sense: int, center: tuple[float, ...]
) -> tuple[Landings, ...]:
    polars, frame = np.arange(POLAR_SPACING, np.pi - 1e-6, POLAR_SPACING), build_frame(np.array(axis))
    meridian = np.cos(polars)[:, None] * frame[:, 2] + np.sin(polars)[:, None] * frame[:, 0]
    leg = Leg(make_pose(p=np.array(center)), np.array(axis), float(sense))
    return tuple(_find(hand, leg, finger, meridian) for finger in range(len(hand.fingers)))


def _find(hand: HandModel, leg: Leg, finger: int, first: Array) -> Landings:
    """Return the landings on the orbits that pass through the directions ``first`` (M, 3) at station 0."""
    orbits = build_orbits(hand, leg, finger, build_aligned(hand, finger, leg.center, first), first)
    which, station = np.nonzero(np.stack([o.is_reached for o in orbits]))
    normals = np.stack([o.normals for o in orbits])[which, station]
    free: NDArray[np.bool_] = np.ones(len(which), dtype=bool)
    if not leg.is_shift:
        blocked = remember_clearances(hand).refuse_landing(finger, leg.center, normals)
        free = np.array([refusal is None for refusal in blocked], dtype=bool)
    carry = np.stack([o.carry for o in orbits])[which, station]
    rows = Candidates(which[free], station[free], normals[free], carry[free])
    return Landings(tuple(orbits), rows, Candidates(which, station, normals, carry))
