"""The object's way as motions one after another, with stops at which fingers may be relocated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dexplan.plans.motion import ObjectMotion
from dexplan.spatial import Array

STOP_ANGLE, STOP_SHIFT = float(np.radians(12.0)), 6e-3
"""Stops are at most so far apart [rad, m]."""


@dataclass(frozen=True, eq=False)
class Track:
    """The ``motions`` of the object, each beginning where the one before ended; at least one, which may be none at all."""

    motions: tuple[ObjectMotion, ...]

    @cached_property
    def steps(self) -> tuple[ObjectMotion, ...]:
        """The motions from stop to stop; none where the object stands still."""
        return tuple(step for motion in self.motions for step in _cut(motion))

    @cached_property
    def poses(self) -> tuple[Array, ...]:
        """The object's pose (4, 4) at every stop, the first and the last included."""
        poses: list[Array] = [self.motions[0].X_WO_start]
        for motion in self.motions:
            if count := _count(motion):
                poses += list(motion.poses(count + 1)[1:])
        return tuple(poses)

    @property
    def turned(self) -> float:
        """How far the object turns in all [rad], whichever way."""
        return float(sum(abs(motion.angle) for motion in self.motions))


def _count(motion: ObjectMotion) -> int:
    """Return into how many steps a motion is cut."""
    turns = abs(motion.angle) / STOP_ANGLE
    shifts = float(np.linalg.norm(motion.shift_W)) / STOP_SHIFT
    return int(np.ceil(max(turns, shifts) - 1e-9))


def _cut(motion: ObjectMotion) -> Iterator[ObjectMotion]:
    count = _count(motion)
    yield from (motion.part(k / count, (k + 1) / count) for k in range(count))
