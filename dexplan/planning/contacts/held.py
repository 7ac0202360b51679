"""Contacts on orbits as a search hands them on, and where on them fingers may land."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array, lock_arrays


@dataclass(frozen=True)
class Held:
    """A contact as the search knows it: a finger on an orbit, where it landed, how far it came, how far it can still go."""

    finger: int
    orbit: int
    landed: int
    steps: int
    left: int

    def carried(self, steps: int) -> Held:
        """Return the contact ``steps`` stations further on."""
        return Held(self.finger, self.orbit, self.landed, self.steps + steps, self.left - steps)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Landing places of one finger: rows of orbit index, station, outward normal in W (N, 3) and carry."""

    orbit: NDArray[np.intp]
    station: NDArray[np.intp]
    normals: Array
    carry: NDArray[np.intp]

    def __post_init__(self) -> None:
        lock_arrays(self)

    def pick(self, finger: int, row: int) -> Held:
        """Return the contact of one row."""
        return Held(finger, int(self.orbit[row]), int(self.station[row]), 0, int(self.carry[row]))
