"""The object's path as legs: a turn about a fixed axis through its centre, or a straight shift.

A contact fixed on the object goes along with a leg through *stations*: on a circle around the axis for a turn, on a straight
line for a shift.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dexplan.plans.motion import SHIFT_STEP, STEP
from dexplan.spatial import Array, read_only, rotate_about

CIRCLE = 180
"""Stations of a whole turn."""


@dataclass(frozen=True, eq=False)
class Leg:
    """The object goes from ``X_WO_start`` (4, 4): by ``angle`` [rad] about the unit world axis ``axis_W`` (3,) through its
    origin, or, where the angle is zero, by ``shift_W`` (3,) [m] without turning.  Both zero: it is held still.
    """

    X_WO_start: Array
    axis_W: Array
    angle: float = 0.0
    shift_W: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        for name in ("X_WO_start", "axis_W", "shift_W"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        if self.angle != 0.0 and np.any(self.shift_W):
            raise ValueError(
                "a leg either turns or shifts the object; one of angle and shift_W has to be zero"
            )

    @cached_property
    def is_shift(self) -> bool:
        """Whether the object is shifted; else it turns, or stays."""
        return bool(np.any(self.shift_W))

    @property
    def center(self) -> Array:
        """The object's centre (3,) [m] at the start."""
        return self.X_WO_start[:3, 3]

    @property
    def sense(self) -> int:
        """+1 or -1: which way stations are passed through."""
        return 1 if self.angle >= 0.0 else -1

    @cached_property
    def stations(self) -> int:
        """Stations of the whole leg; the last of a turn may be a short one."""
        if self.is_shift:
            return max(2, int(np.ceil(np.linalg.norm(self.shift_W) / SHIFT_STEP - 1e-9)))
        return int(np.ceil(abs(self.angle) / STEP - 1e-9))

    @cached_property
    def track_length(self) -> int:
        """Number of stations K that a contact may be at: all around the axis, or from end to end of a shift."""
        return self.stations + 1 if self.is_shift else CIRCLE

    @cached_property
    def motions(self) -> tuple[Array, Array]:
        """Rotations (K, 3, 3) about the centre and shifts (K, 3) [m] that take a contact from station 0 to every station."""
        count = self.track_length
        if self.is_shift:
            share = np.arange(count) / self.stations
            return np.broadcast_to(np.eye(3), (count, 3, 3)), share[:, None] * self.shift_W
        return rotate_about(self.axis_W, STEP * np.arange(count)), np.zeros((count, 3))

    def turned(self, done: int) -> float:
        """Return the signed turn [rad] at progress ``done`` [stations]; the last station ends at the goal exactly."""
        return 0.0 if self.is_shift else self.sense * min(done * STEP, abs(self.angle))

    def pose(self, done: int) -> Array:
        """Return the object's pose (4, 4) at progress ``done`` [stations]."""
        X = self.X_WO_start.copy()
        if self.is_shift:
            X[:3, 3] += min(done / self.stations, 1.0) * self.shift_W
        else:
            X[:3, :3] = rotate_about(self.axis_W, self.turned(done)) @ X[:3, :3]
        return X

    @property
    def X_WO_end(self) -> Array:
        """The object's pose (4, 4) at the end."""
        return self.pose(self.stations)
