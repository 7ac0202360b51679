"""From a plan to curves in time: object pose, free fingertips, contact demands and load factors.

A reference is a sequence of phases, as the plan has them; nothing is planned here, and no duration computed.  Within a phase
everything is a smooth function of the time since it began; a phase ends after its duration, or, where a finger comes down, when
the touch sensor of that finger answers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from dexplan.brief import brief_repr
from dexplan.plans.actions import Action, FingerWay, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Contacts, list_holding
from dexplan.plans.forces import NormalForces
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.pace import Pace, Progress, smooth_step
from dexplan.plans.plan import Plan
from dexplan.plans.timing import Touchdown
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, read_only, rotate_about

REST = Pace(1.0, 0.3, "ramp")
"""The pace of an object that stays where it is; any will do."""


class ObjectState(NamedTuple):
    """Where an object is to be: ``X_WO`` (..., 4, 4), and in W its ``twist`` (v, w) (..., 6) and ``acceleration`` (..., 6)."""

    X_WO: Array
    twist: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class ObjectPath:
    """A motion of the object in time."""

    motion: ObjectMotion
    pace: Pace

    __repr__ = brief_repr

    def progress(self, t: float) -> Progress:
        """Return how much of the motion is done ``t`` [s] after its start (0..1), and two derivatives in time."""
        return self.pace.progress(t)

    def sample(self, t: float) -> ObjectState:
        """Return where the object is to be ``t`` [s] after the start."""
        X, twist, acceleration = self.sample_many([t])
        return ObjectState(X[0], twist[0], acceleration[0])

    def sample_many(self, times: Sequence[float]) -> ObjectState:
        """Return where the object is to be at ``times`` (N,) [s] after the start, one row each."""
        motion = self.motion
        done, rate, acceleration = np.array([self.progress(t) for t in times]).T
        X = np.tile(motion.X_WO_start, (len(times), 1, 1))
        X[:, :3, :3] = rotate_about(motion.axis_W, done * motion.angle) @ motion.X_WO_start[:3, :3]
        X[:, :3, 3] += np.outer(done, motion.shift_W)
        direction = np.concatenate([motion.shift_W, motion.angle * motion.axis_W])
        return ObjectState(X, np.outer(rate, direction), np.outer(acceleration, direction))


@dataclass(frozen=True, eq=False)
class Phase:
    """A stretch of the reference.

    ``holding`` (F,) says which fingers carry the object in the force QP, ``load_start`` and ``load_end`` (F,) how much of their
    full load (0..1); ``rolls`` how some of them roll meanwhile, at the progress of ``object_path``, which such a phase outlasts.
    ``finger`` moves freely: from where it is along the ``postures`` (K, J), or along its contact normal over the gap
    ``gap_start`` to ``gap_end`` [m] off ``X_OF`` (its landing pose in the object frame; None: wherever it is carried).
    """

    action_index: int
    phase_index: int
    name: str
    duration: float
    object_path: ObjectPath
    holding: tuple[int, ...]
    load_start: Array
    load_end: Array
    finger: int | None = None
    postures: Array | None = None
    X_OF: Array | None = None
    normal_O: Array | None = None
    gap_start: float = 0.0
    gap_end: float = 0.0
    ends_on_touch: bool = False
    rolls: Mapping[int, TipRoll] = field(default_factory=dict)

    __repr__ = brief_repr

    def travelled(self, t: float) -> float:
        """Return how much of its ``postures`` a free finger has passed at ``t`` (0..1).

        While the object moves the finger goes by the object's progress, so that where both are at once does not depend on timing.
        """
        is_moving = not self.object_path.motion.is_still
        return smooth_step(self.object_path.progress(t).done if is_moving else t / self.duration)

    def sample_gap(self, t: float, touch_speed: float) -> float:
        """Return the gap [m] at ``t``; past the end an approach goes on at ``touch_speed`` [m/s] until it touches."""
        s = min(max(t / self.duration, 0.0), 1.0)
        if not self.ends_on_touch:
            return self.gap_start + (self.gap_end - self.gap_start) * smooth_step(s)
        # Cubic that starts at rest and arrives with the touch speed.
        length, arrival = self.gap_start - self.gap_end, touch_speed * self.duration
        shape = s * s * (3.0 - 2.0 * s) * length + s * s * (s - 1.0) * arrival
        return self.gap_start - shape - touch_speed * max(0.0, t - self.duration)


@dataclass(frozen=True, eq=False)
class Reference:
    """The phases of a whole plan, where the fingers start, and the normal forces [N] of a fully loaded contact.

    ``start`` holds per finger the tip in the object frame (4, 4) and its posture (J,), None for a finger that starts at home.
    ``touchdown`` says how fingers meet and leave the object.
    """

    phases: tuple[Phase, ...]
    start: tuple[tuple[Array, Array] | None, ...]
    normal_force: float
    touchdown: Touchdown
    normal_floor: float = NormalForces.floor
    normal_ceiling: float = NormalForces.ceiling

    __repr__ = brief_repr

    @property
    def duration(self) -> float:
        """Planned duration [s]; touch-down may lengthen or shorten a run by hundredths."""
        return sum(p.duration for p in self.phases)


def build_reference(plan: Plan) -> Reference:
    """Return the reference that carries out ``plan``.  Raises ValueError for a plan that has not been timed."""
    phases: list[Phase] = []
    contacts = plan.start_contacts
    for index, action in enumerate(plan.actions):
        phases.extend(_PhaseBuilder(index, action, contacts, plan.touchdown).build())
        contacts = action.contacts_end
    start = tuple(None if c is None else (c.X_OF, c.q) for c in plan.start_contacts)
    return Reference(
        tuple(phases), start, plan.normal_force, plan.touchdown, plan.normal_floor, plan.normal_ceiling
    )


@dataclass(frozen=True, eq=False)
class _PhaseBuilder:
    """Turns one action into phases; ``before`` are the contacts before it."""

    index: int
    action: Action
    before: Contacts
    touchdown: Touchdown

    def build(self) -> list[Phase]:
        """Return the phases of the action.  Raises ValueError where the plan says too little, or what makes no sense."""
        action, name = self.action, f"action {self.index + 1} ({self.action.name})"
        if not action.is_timed:
            raise ValueError(f"{name} has not been timed; time the plan first")
        expected = 2 + action.has_travel if isinstance(action, Relocate) else 1
        if len(action.phases) != expected:
            raise ValueError(f"{name} has {len(action.phases)} phases; {expected} are accepted")
        match action:
            case Hold():
                return [self._phase(0)]
            case Roll() | MoveObject():
                return [self._move(action)]
            case Relocate():
                return self._place(action) if action.is_placing else self._lift(action)

    def _shares(self) -> tuple[Array, Array]:
        """Return the load shares (F,) after the action, and with the changing finger pressing just a little.

        A finger that has just touched, or is about to leave, presses enough not to bounce.
        """
        before, after = (
            np.array([float(c is not None) for c in contacts])
            for contacts in (self.before, self.action.contacts_end)
        )
        return read_only(after), read_only(np.where(before == after, before, self.touchdown.light_load))

    def _phase(self, k: int) -> Phase:
        """Return phase ``k`` of the action for an object that rests and is held as before."""
        planned = self.action.phases[k]
        assert planned.duration is not None
        before = read_only([float(c is not None) for c in self.before])
        rest, holding = ObjectPath(self.action.motion, REST), list_holding(self.before)
        return Phase(self.index, k, planned.name, planned.duration, rest, holding, before, before)

    def _move(self, action: Roll | MoveObject) -> Phase:
        assert action.pace is not None
        rolls = {roll.finger: roll for roll in action.rolls}
        path = ObjectPath(action.motion, action.pace)
        return replace(self._phase(0), object_path=path, rolls=rolls, **_travel(action.ways))

    def _place(self, action: Relocate) -> list[Phase]:
        finger = action.finger
        placement = action.contacts_end[finger]
        assert placement is not None
        after, light = self._shares()
        # Where the object's motion before has brought the finger here there is no way left.
        k = int(action.has_travel)
        approach = replace(
            self._phase(k),
            finger=finger,
            X_OF=placement.X_OF,
            normal_O=placement.normal_O,
            gap_start=self.touchdown.hover,
            ends_on_touch=True,
        )
        load = replace(
            self._phase(k + 1),
            holding=list_holding(action.contacts_end),
            load_start=light,
            load_end=after,
        )
        return [*([replace(self._phase(0), **_travel(action.ways))] if k else []), approach, load]

    def _lift(self, action: Relocate) -> list[Phase]:
        finger = action.finger
        placement = self.before[finger]
        assert placement is not None
        after, light = self._shares()
        unload = replace(self._phase(0), load_end=light)
        gone, *travel = (
            replace(
                self._phase(k), holding=list_holding(action.contacts_end), load_start=after, load_end=after
            )
            for k in range(1, len(action.phases))
        )
        retreat = replace(gone, finger=finger, normal_O=placement.normal_O, gap_end=self.touchdown.hover)
        return [unload, retreat, *(replace(phase, **_travel(action.ways)) for phase in travel)]


def _travel(ways: tuple[FingerWay, ...]) -> dict[str, Any]:
    """Return which finger travels, and its postures; nothing where none does."""
    if len(ways) > 1:
        raise ValueError(
            f"{len(ways)} fingers travel at once; the controller moves one free finger at a time"
        )
    return {"finger": ways[0].finger, "postures": ways[0].postures} if ways else {}
