"""From a plan of rolling contacts to stretches in time: what each finger does, and where the object is to be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from dexplan.brief import brief_repr
from dexplan.control.reference import ObjectState
from dexplan.kinematics.arcs import interpolate
from dexplan.plans.actions import Action, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Placement, list_holding
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.plan import Plan
from dexplan.spatial import Array, lock_arrays, rotate_about

SETTLE = 0.25
"""How long the fingers hold still after a motion of the object [s]."""


class Doing(StrEnum):
    """What goes on in a stretch."""

    HOLD = "hold"
    MOVE = "move"
    TRAVEL = "travel"
    APPROACH = "approach"
    LOAD = "load"
    UNLOAD = "unload"
    RETREAT = "retreat"


@dataclass(frozen=True)
class RollingTiming:
    """How long things take [s], and how fast they may go.

    ``object_speed`` [rad/s] and ``shift_speed`` [m/s] are means over a motion.  ``touch_speed`` [m/s] is that of a tip over the
    last ``near`` [m] before it touches: faster ones hit with 4 to 10 N and move the object.
    """

    first_hold: float = 0.3
    last_hold: float = 1.0
    travel: float = 1.0
    approach: float = 0.5
    load: float = 0.25
    unload: float = 0.15
    retreat: float = 0.4
    object_speed: float = float(np.radians(26.0))
    shift_speed: float = 0.010
    touch_speed: float = 0.005
    near: float = 0.0015
    timeout: float = 2.0


@dataclass(frozen=True, eq=False)
class Stretch:
    """One stretch: ``holding`` fingers bear the object, which goes through ``motion``.

    ``finger`` is the one that moves or is loaded; on its way it passes ``postures`` (K, J); its contact is ``placement``.
    """

    doing: Doing
    duration: float
    action_index: int
    phase_index: int
    holding: tuple[int, ...]
    motion: ObjectMotion
    finger: int | None = None
    postures: Array | None = None
    placement: Placement | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def sample_object(self, t: float) -> ObjectState:
        """Return where the object is to be ``t`` [s] after the start, and its velocity and acceleration."""
        motion, T = self.motion, self.duration
        x = min(max(t / T, 0.0), 1.0) if self.doing is Doing.MOVE else 0.0
        done = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate, acceleration = 30.0 * x**2 * (1.0 - x) ** 2 / T, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / T**2
        X = motion.X_WO_start.copy()
        X[:3, :3] = rotate_about(motion.axis_W, done * motion.angle) @ X[:3, :3]
        X[:3, 3] += done * motion.shift_W
        direction = np.concatenate([motion.shift_W, motion.angle * motion.axis_W])
        return ObjectState(X, rate * direction, acceleration * direction)

    def sample_gap(self, t: float, hover: float, timing: RollingTiming) -> float:
        """Return how far [m] a finger that comes down or leaves is to be off the object: from ``hover``, or up to it.

        Past the end an approach goes on slowly until it touches.
        """
        x = min(t / self.duration, 1.0)
        done = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        if self.doing is not Doing.APPROACH:
            return hover * done
        late = max(0.0, t - self.duration)
        return hover + (timing.near - hover) * done - timing.touch_speed * late

    def sample_way(self, t: float) -> Array:
        """Return the posture (J,) on the finger's way at ``t`` [s]."""
        assert self.postures is not None
        x = min(max(t / self.duration, 0.0), 1.0)
        return interpolate(self.postures, np.array([x**3 * (10.0 - 15.0 * x + 6.0 * x * x)]))[0]


def build_stretches(plan: Plan, timing: RollingTiming) -> tuple[Stretch, ...]:
    """Return the stretches of a plan, one after the other."""
    rows, contacts = list[Stretch](), plan.start_contacts
    for k, action in enumerate(plan.actions):
        is_last = k == len(plan.actions) - 1
        rows += _stretch(k, action, contacts, timing, is_last)
        contacts = action.contacts_end
    return tuple(rows)


def _stretch(
    k: int, action: Action, before: Sequence[Placement | None], timing: RollingTiming, is_last: bool
) -> Iterator[Stretch]:
    both = list_holding(tuple(before))
    still = rest_at(action.X_WO_end)
    if isinstance(action, Hold | Roll):
        yield Stretch(Doing.HOLD, timing.last_hold if is_last else timing.first_hold, k, 0, both, still)
    elif isinstance(action, MoveObject):
        motion = action.motion
        lasts = max(
            abs(motion.angle) / timing.object_speed,
            float(np.linalg.norm(motion.shift_W)) / timing.shift_speed,
        )
        yield Stretch(Doing.MOVE, max(lasts, 0.5), k, 0, both, motion)
        yield Stretch(Doing.HOLD, SETTLE, k, 0, both, still)
    else:
        assert isinstance(action, Relocate)
        finger, way = action.finger, action.ways[0].postures
        others = tuple(f for f in both if f != finger)
        if action.is_placing:
            landing = action.contacts_end[finger]
            yield Stretch(Doing.TRAVEL, timing.travel, k, 0, others, still, finger, way, landing)
            yield Stretch(Doing.APPROACH, timing.approach, k, 1, others, still, finger, None, landing)
            yield Stretch(Doing.LOAD, timing.load, k, 2, (*others, finger), still, finger, None, landing)
        else:
            left = before[finger]
            yield Stretch(Doing.UNLOAD, timing.unload, k, 0, both, still, finger, None, left)
            yield Stretch(Doing.RETREAT, timing.retreat, k, 1, others, still, finger, None, left)
            yield Stretch(Doing.TRAVEL, timing.travel, k, 2, others, still, finger, way, left)
