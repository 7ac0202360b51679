"""The last step of planning: what a controller needs beyond the symbols is written into the actions.

That is the way of every finger that travels, and how long everything takes.  Both depend on postures that follow from the
actions before, so a plan is walked through from its start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from dexplan.kinematics.arcs import build_travel, compute_hover, interpolate
from dexplan.kinematics.finger import FingerDescription
from dexplan.planning.actions.drift import follow_contacts
from dexplan.plans.actions import AbstractAction, Action, FingerWay, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Contacts
from dexplan.plans.pace import Pace, smooth_step
from dexplan.plans.plan import Plan
from dexplan.plans.speed import PlannedSpeed
from dexplan.plans.timing import Timing
from dexplan.spatial import Array

A = TypeVar("A", bound=AbstractAction)
SAMPLE = float(np.radians(2.0))
"""Holding fingers are followed through a motion this often [rad of the object's turn]."""
BEND_LOOKS = 257
"""The bends of a detour are looked at this often."""


def time_plan(plan: Plan, fingers: Sequence[FingerDescription], timing: Timing) -> Plan:
    """Return the plan with the arcs of its free fingers, the durations of its phases and the speed that is reached.

    A plan that has been timed before is timed anew: detours, and ways during a motion of the object, stay; arcs are made again.
    Raises ValueError where a finger would have to travel during a motion that does not know its way, as in files of format 1.
    """
    if not plan.actions:
        return plan
    _check_travels(plan)
    contacts = plan.start_contacts
    schedule = _Schedule(tuple(fingers), timing, {c.finger: c.q for c in contacts if c is not None})
    actions: list[Action] = []
    for index, action in enumerate(plan.actions):
        actions.append(schedule.time(action, contacts, is_first=index == 0))
        contacts = action.contacts_end
    speed = PlannedSpeed.of_actions(actions, timing.object_speed)
    return replace(plan, actions=tuple(actions), touchdown=timing.touchdown, speed=speed)


@dataclass(eq=False)
class _Schedule:
    """Times action after action; ``postures`` holds those of the fingers that touch, as they follow from all before."""

    fingers: tuple[FingerDescription, ...]
    timing: Timing
    postures: dict[int, Array]

    def time(self, action: Action, before: Contacts, is_first: bool) -> Action:
        """Return the action with its ways and times; ``before`` are the contacts before it."""
        match action:
            case Hold():
                return _with_durations(action, self.timing.first_hold if is_first else self.timing.last_hold)
            case Roll() | MoveObject():
                return self._time_motion(action, before)
            case Relocate():
                return self._time_placing(action) if action.is_placing else self._time_lifting(action, before)

    def _time_motion(self, action: Roll | MoveObject, before: Contacts) -> Action:
        timing, motion = self.timing, action.motion
        turned = max((roll.tip_angle for roll in action.rolls), default=0.0)
        cruises = {
            "drift": self._carry(action, before, turned),
            "object_speed": abs(motion.angle) / timing.object_speed,
            "shift_speed": float(np.linalg.norm(motion.shift_W)) / timing.shift_speed,
            "roll_speed": turned / timing.roll_speed,
        }
        if action.ways:
            cruises["travel"] = max(self._travel_time(way) for way in action.ways)
        slowest = max(cruises, key=lambda name: cruises[name])
        duration = max(cruises[slowest] + timing.ramp, 2.0 * timing.ramp)
        if cruises[slowest] < timing.ramp:
            slowest = "ramp"
        settle = timing.roll_settle if action.rolls else 0.0
        timed = _with_durations(action, duration + settle)
        return replace(timed, pace=Pace(duration, timing.ramp, slowest))

    def _carry(self, action: Roll | MoveObject, before: Contacts, turned: float) -> float:
        """Follow the holding fingers through the motion; return how long it has to take [s] so that no contact drifts too much.

        ``turned`` [rad], the greatest turn of a rolling tip, counts into what drift is allowed per radian.
        """
        timing, motion = self.timing, action.motion
        rolls = {roll.finger: roll for roll in action.rolls}
        count = max(3, int(np.ceil(abs(motion.angle) / SAMPLE)) + 1, *(r.count for r in action.rolls))
        push = follow_contacts(self.fingers, before, rolls, motion.poses(count), self.postures)
        push = timing.contact_time * max(push, 1e-9)
        arm = max(float(np.linalg.norm(c.X_OF[:3, 3])) for c in before if c is not None)
        carried = abs(motion.angle) + float(np.linalg.norm(motion.shift_W)) / arm + turned
        per_radian = push / (timing.drift_per_radian * carried) if carried > 0.0 else 0.0
        return max(float(np.sqrt(push / timing.drift)), per_radian)

    def _time_placing(self, action: Relocate) -> Relocate:
        timing, finger, X_WO = self.timing, action.finger, action.X_WO_start
        placement, who = action.contacts_end[finger], self.fingers[finger]
        assert placement is not None
        self.postures[finger] = placement.q
        if not action.has_travel:
            return _with_durations(action, timing.approach, timing.load)
        way = _find_detour(action)
        if way is None:
            gap = timing.touchdown.hover
            hover = compute_hover(who, X_WO, placement.X_OF, placement.normal_O, placement.q, gap)
            way = FingerWay(finger, build_travel(who, who.q_home, hover, X_WO[:3, 3]))
        timed = _with_durations(action, self._travel_time(way), timing.approach, timing.load)
        return replace(timed, ways=(way,))

    def _time_lifting(self, action: Relocate, before: Contacts) -> Relocate:
        timing, finger, X_WO = self.timing, action.finger, action.X_WO_start
        placement, who = before[finger], self.fingers[finger]
        assert placement is not None
        posture = self.postures.pop(finger)
        if not action.has_travel:
            return _with_durations(action, timing.unload, timing.retreat)
        way = _find_detour(action)
        if way is None:
            gap = timing.touchdown.hover
            lifted = compute_hover(who, X_WO, placement.X_OF, placement.normal_O, posture, gap)
            # The arc back is the arc there: planned, and checked for clearance, from home.
            way = FingerWay(finger, build_travel(who, who.q_home, lifted, X_WO[:3, 3])[::-1])
        timed = _with_durations(action, timing.unload, timing.retreat, self._travel_time(way))
        return replace(timed, ways=(way,))

    def _travel_time(self, way: FingerWay) -> float:
        """Return how long a free finger takes [s] for its way."""
        postures = way.postures
        # The smooth step's greatest speed is 15/8 of its mean, and the way is walked at even shares of its postures.
        fastest = 1.875 * float(np.abs(np.diff(postures, axis=0)).max()) * (len(postures) - 1)
        duration = max(self.timing.travel, fastest / self.timing.joint_speed)
        if not way.is_detour:
            return duration
        # Bends cost acceleration, which falls with the square of the time.
        share = np.array([smooth_step(t) for t in np.linspace(0.0, 1.0, BEND_LOOKS)])
        bends = np.gradient(np.gradient(interpolate(postures, share), axis=0), axis=0) * (BEND_LOOKS - 1) ** 2
        return max(duration, float(np.sqrt(np.abs(bends).max() / self.timing.joint_acceleration)))


def _check_travels(plan: Plan) -> None:
    """Raise ValueError unless a motion of the object brings the finger of each relocation that has no travel of its own."""
    for k, action in enumerate(plan.actions):
        if isinstance(action, Relocate) and not action.has_travel:
            beside = k - 1 if action.is_placing else k + 1
            moving = plan.actions[beside] if 0 <= beside < len(plan.actions) else None
            if moving is None or all(way.finger != action.finger for way in moving.ways):
                raise ValueError(
                    f"action {k + 1} ({action.name}): the motion beside it has no way of {plan.fingers[action.finger]};"
                    " plan again"
                )


def _find_detour(action: Relocate) -> FingerWay | None:
    """Return the way that was planned around something, None where the finger takes the arc."""
    return next((way for way in action.ways if way.is_detour), None)


def _with_durations(action: A, *durations: float) -> A:
    """Return the action with the durations [s] of its phases."""
    phases = tuple(
        replace(phase, duration=duration) for phase, duration in zip(action.phases, durations, strict=True)
    )
    return replace(action, phases=phases)
