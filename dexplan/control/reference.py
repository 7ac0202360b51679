"""From a plan to curves in time: object pose, free fingertips, contact demands and load factors.

A reference is a sequence of phases.  Within a phase everything is a smooth function of the time since it began; a phase ends
after its duration, or, where a finger comes down, when the touch sensor of that finger answers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dexplan.planning.plan import Action, Placement, Plan
from dexplan.planning.travel import build_travel, compute_hover, wrap_near
from dexplan.scene.chain import solve_ik
from dexplan.scene.description import FingerDescription
from dexplan.spatial import Array, read_only, rotation_matrix


@dataclass(frozen=True)
class Timing:
    """How long things take [s], how far [m] and how fast."""

    first_hold: float = 0.5
    last_hold: float = 1.0
    travel: float = 0.45
    approach: float = 0.35
    load: float = 0.25
    unload: float = 0.25
    retreat: float = 0.22
    ramp: float = 0.30
    """Time to bring the object up to speed, and to rest again."""
    touch_timeout: float = 0.15
    """How much longer than planned a finger may take to find the object."""
    hover: float = 0.008
    """Where an approach starts and a retreat ends, off the surface [m]."""
    touch_speed: float = 0.010
    """Normal speed at which a finger meets the object [m/s]."""
    object_speed: float = float(np.radians(30.0))


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

    def sample(self, t: float) -> tuple[Array, Array, Array]:
        """Return X_WO (4, 4), its twist (v, w) and acceleration (6,) in world axes, ``t`` [s] after the start."""
        s, ds, dds = _cruise(t, self.duration, self.ramp)
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
    full load (0..1).  ``finger`` moves freely: from where it is along the ``postures`` (K, J), or along its contact normal over the
    gap ``gap_start`` to ``gap_end`` [m] off ``X_OF`` (its landing pose in the object frame; None: wherever it is carried).
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
    """Return the quintic from 0 to 1 that starts and ends at rest without acceleration."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, eq=False)
class Reference:
    """The phases of a whole plan, the fingers' initial contacts and the normal force [N] of a fully loaded contact."""

    phases: tuple[Phase, ...]
    start: tuple[Array | None, ...]
    normal_force: float
    timing: Timing

    @property
    def duration(self) -> float:
        """Planned duration [s]; touch-down may lengthen or shorten a run by hundredths."""
        return sum(p.duration for p in self.phases)


def build_reference(plan: Plan, fingers: tuple[FingerDescription, ...], timing: Timing) -> Reference:
    """Return the reference that carries out ``plan``."""
    phases: list[Phase] = []
    contacts = plan.start_contacts
    for index, action in enumerate(plan.actions):
        phases.extend(_build_phases(index, action, contacts, fingers, timing))
        contacts = action.contacts_end
    start = tuple(None if c is None else c.X_OF for c in plan.start_contacts)
    return Reference(tuple(phases), start, plan.normal_force, timing)


def _build_phases(
    index: int,
    action: Action,
    before: tuple[Placement | None, ...],
    fingers: tuple[FingerDescription, ...],
    timing: Timing,
) -> list[Phase]:
    full = read_only([float(c is not None) for c in before])
    after = read_only([float(c is not None) for c in action.contacts_end])
    still = ObjectPath(action.X_WO_start, action.axis_W, 0.0, np.zeros(3), 1.0, 0.3)
    held = tuple(int(k) for k in np.flatnonzero(full))

    def phase(k: int, duration: float, **changes: object) -> Phase:
        values: dict[str, object] = {
            "object_path": still,
            "holding": held,
            "load_start": full,
            "load_end": full,
            **changes,
        }
        return Phase(index, k, action.phases[k].name, duration, **values)  # type: ignore[arg-type]

    if action.kind == "hold":
        last = index > 0
        return [phase(0, timing.last_hold if last else timing.first_hold)]
    if action.kind == "move_object":
        shift = action.X_WO_end[:3, 3] - action.X_WO_start[:3, 3]
        cruise = abs(action.angle) / timing.object_speed
        duration = max(cruise + timing.ramp, 2.0 * timing.ramp, np.linalg.norm(shift) / 0.02 + timing.ramp)
        path = ObjectPath(action.X_WO_start, action.axis_W, action.angle, shift, duration, timing.ramp)
        return [phase(0, duration, object_path=path)]
    assert action.finger is not None
    finger = action.finger
    who, X_WO = fingers[finger], action.X_WO_start
    if action.kind == "place":
        placement = action.contacts_end[finger]
        assert placement is not None
        both = (*held, finger)
        hover = compute_hover(who, X_WO, placement.X_OF, placement.normal_O, placement.q, timing.hover)
        landing = {"finger": finger, "X_OF": placement.X_OF, "normal_O": placement.normal_O}
        return [
            phase(0, timing.travel, finger=finger, postures=build_travel(who, who.q_home, hover, X_WO[:3, 3])),
            phase(1, timing.approach, **landing, gap_start=timing.hover, ends_on_touch=True),
            phase(2, timing.load, holding=tuple(sorted(both)), load_end=after),
        ]
    placement = before[finger]
    assert placement is not None
    posture, _ = solve_ik(who.chain, (X_WO @ placement.X_OF)[None], placement.q[None], iterations=60)
    posture = wrap_near(posture[0], placement.q)
    lifted = compute_hover(who, X_WO, placement.X_OF, placement.normal_O, posture, timing.hover)
    two = {"finger": finger, "holding": tuple(k for k in held if k != finger), "load_start": after, "load_end": after}
    return [
        phase(0, timing.unload, load_end=after),
        phase(1, timing.retreat, **two, normal_O=placement.normal_O, gap_end=timing.hover),
        phase(2, timing.travel, **two, postures=build_travel(who, lifted, who.q_home, X_WO[:3, 3])),
    ]
