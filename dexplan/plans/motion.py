"""A motion of the object as one value: a turn about a fixed axis with a straight shift."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dexplan.brief import brief_repr
from dexplan.spatial import VERTICAL, Array, lock_arrays, read_only, rotate_about

STEP = float(np.radians(2.0))
"""Spacing of stations of a turn, and of the samples at which it is checked [rad]."""


SHIFT_STEP = 1.5e-3
"""Largest spacing of stations of a shift [m]."""


@dataclass(frozen=True, eq=False)
class ObjectMotion:
    """A turn of the object by ``angle`` [rad] about the unit world axis ``axis_W`` (3,) through its origin, with a straight
    ``shift_W`` (3,) [m], from the pose ``X_WO_start`` (4, 4).  Angles beyond a turn mean more turns.
    """

    X_WO_start: Array
    axis_W: Array
    angle: float
    shift_W: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @classmethod
    def between(cls, X_WO_start: Array, X_WO_end: Array, axis_W: Array, angle: float) -> ObjectMotion:
        """Return the turn by ``angle`` [rad] about ``axis_W`` (3,) that shifts the centre as from one pose to the other."""
        return cls(X_WO_start, axis_W, angle, X_WO_end[:3, 3] - X_WO_start[:3, 3])

    @property
    def is_still(self) -> bool:
        """Whether nothing moves."""
        return abs(self.angle) < 1e-9 and not np.any(self.shift_W)

    def poses(self, count: int | None = None) -> Array:
        """Return the object's poses (K, 4, 4) at evenly spaced progress, ``count`` of them or as near as checks need them."""
        if count is None:
            steps = max(abs(self.angle) / STEP, float(np.linalg.norm(self.shift_W)) / SHIFT_STEP)
            count = max(3, int(np.ceil(steps)) + 1)
        share = np.linspace(0.0, 1.0, count)
        X = np.tile(self.X_WO_start, (count, 1, 1))
        X[:, :3, :3] = rotate_about(self.axis_W, share * self.angle) @ self.X_WO_start[:3, :3]
        X[:, :3, 3] += share[:, None] * self.shift_W
        return X

    @cached_property
    def X_WO_end(self) -> Array:
        """The pose (4, 4) at the end."""
        return read_only(self.poses(2)[-1])

    def part(self, first: float, last: float) -> ObjectMotion:
        """Return the motion between two shares of its progress."""
        start = ObjectMotion(self.X_WO_start, self.axis_W, first * self.angle, first * self.shift_W).X_WO_end
        return ObjectMotion(start, self.axis_W, (last - first) * self.angle, (last - first) * self.shift_W)


def rest_at(X_WO: Array, axis_W: Array = VERTICAL) -> ObjectMotion:
    """Return no motion, at ``X_WO`` (4, 4); ``axis_W`` (3,) is noted, since a motion has an axis."""
    return ObjectMotion(X_WO, axis_W, 0.0, np.zeros(3))
