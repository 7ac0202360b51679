"""How a motion goes in time: from rest to rest, with continuous velocity and acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

PACES = {
    "drift": "the drift of the contacts that are carried",
    "object_speed": "control.speed_deg_s",
    "shift_speed": "the speed at which the object's centre may be shifted",
    "roll_speed": "the speed at which a fingertip may roll",
    "travel": "the joint speed of the finger that travels meanwhile",
    "ramp": "the time that it takes to get up to speed and to rest again",
}
"""What may keep a motion of the object from being faster, in words."""


class Progress(NamedTuple):
    """How much of a motion is done (0..1), and the rate [1/s] and acceleration [1/s^2] of that."""

    done: float
    rate: float
    acceleration: float


@dataclass(frozen=True)
class Pace:
    """A motion of the object takes ``duration`` [s].  Its speed rises and falls over ``ramp`` [s] along a raised cosine.

    ``limit`` says what keeps the motion from being faster, one of :data:`PACES`' keys.  Raises ValueError for any other, and for
    times that are not positive.
    """

    duration: float
    ramp: float
    limit: str

    def __post_init__(self) -> None:
        if not (self.duration > 0.0 and self.ramp > 0.0):
            raise ValueError(
                f"a motion of {self.duration} s with ramps of {self.ramp} s; more than 0 is accepted"
            )
        if self.limit not in PACES:
            raise ValueError(f"the unknown limit {self.limit!r}; {', '.join(PACES)} are accepted")

    @property
    def greatest_rate(self) -> float:
        """Rate [1/s] at which the motion is done between the ramps."""
        return 1.0 / (self.duration - min(self.ramp, 0.5 * self.duration))

    def progress(self, t: float) -> Progress:
        """Return the progress ``t`` [s] after the start; before it and after the end there is rest."""
        duration = self.duration
        t = min(max(t, 0.0), duration)
        ramp = min(self.ramp, 0.5 * duration)
        speed = 1.0 / (duration - ramp)
        if t < ramp:
            return _rise(t, ramp, speed)
        if t > duration - ramp:
            s, ds, dds = _rise(duration - t, ramp, speed)
            return Progress(1.0 - s, ds, -dds)
        return Progress(speed * (0.5 * ramp + t - ramp), speed, 0.0)


def _rise(t: float, ramp: float, speed: float) -> Progress:
    """Return the progress ``t`` [s] after rest; the rate is ``speed`` (1 - cos(pi t / ramp)) / 2."""
    phase = math.pi * t / ramp
    return Progress(
        speed * 0.5 * (t - ramp / math.pi * math.sin(phase)),
        speed * 0.5 * (1.0 - math.cos(phase)),
        speed * 0.5 * math.pi / ramp * math.sin(phase),
    )


def smooth_step(s: float) -> float:
    """Return the quintic from 0 to 1 that starts and ends at rest without acceleration; flat outside."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))
