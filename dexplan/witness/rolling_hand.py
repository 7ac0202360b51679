"""A hand of three joints per finger turns a ball: planned by search on contacts that roll, carried out and measured in MuJoCo."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.control.rolling_controller import RollingBelief, RollingController
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.limits import AdmissibleLimits
from dexplan.planning.contacts.rolling_contacts import RollingContacts
from dexplan.planning.contacts.rolling_stations import RollingGrip
from dexplan.planning.contacts.track import Track
from dexplan.planning.tasks.rolling_fingers import build_rolling_contacts, plan_rolling
from dexplan.plans.actions import MoveObject, Relocate, count_placements
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.scene.description import SceneParameters
from dexplan.scene.library import TRIFINGER_BALL, load_scene_with
from dexplan.scene.probe import HandProbe
from dexplan.scene.scene import Scene
from dexplan.sim.judge.replay import replay
from dexplan.sim.record.rollout import rollout_driver
from dexplan.sim.trace import Trace
from dexplan.spatial import VERTICAL, Array, direction_from_angles

SAFETY = 1.3
"""The believed friction is the true one over this."""
LIMITS = AdmissibleLimits(
    joint_margin=float(np.radians(3.0)),
    torque_share=0.95,
    clearance=1e-3,
    normal_floor=1.5,
    normal_ceiling=4.0,
)
"""What plans leave to spare.  The fingers have 0.396 N m: two to three newtons at 0.1 m, which leaves little torque to spare."""
NORMAL = 2.8
"""What a loaded contact aims at [N]."""
POLAR_LIMIT = float(np.radians(100.0))
"""Largest angle of a contact from the tip's pole: the tip is a sphere up to 120 degrees [rad]."""
START_AZIMUTHS, START_ELEVATION = (135.0, 347.0, 187.0), 3.0
"""Where the fingers hold at the start [deg]: the second and the third opposite enough to hold alone, the first used up."""
RING = (100.0, -20.0, -140.0)
"""Where fingers hold for single motions [deg]: evenly around the object."""
TILTS = {"x": (90.0, -15.0, 195.0), "y": START_AZIMUTHS}
"""Where fingers hold for tilts by 90 degrees [deg]: two of them opposite enough to hold alone, for these take placements."""
BUDGET = 400
"""Nodes that a search may open."""
AT_LIMIT = 0.95
"""A joint that gives this share of its torque limit counts as being at it."""


@dataclass(frozen=True)
class RollingRun:
    """What was asked, planned and measured; degrees, millimetres, newtons, seconds.

    Per finger over the whole run: ``slip_mm`` along the object and ``pivot_deg`` about the normal, as measured, and ``law_mm``,
    the slip that the law of pivoting contacts gives for the planned forces and turns.  ``held_used`` is the largest share of the
    true cone in use while two fingers hold, ``moving_used`` that of sideways friction in motions.  ``at_torque_limit`` is the
    share of samples in which a joint gives 95 % of its limit or more; ``replay_difference`` the largest in qpos.
    """

    name: str
    status: str
    reason: str
    placements: int
    nodes: int
    planning_s: float
    duration_s: float = 0.0
    failure: str | None = None
    end_mm: float = np.inf
    end_deg: float = np.inf
    worst_mm: float = np.inf
    worst_deg: float = np.inf
    slip_mm: tuple[float, ...] = ()
    law_mm: tuple[float, ...] = ()
    pivot_deg: tuple[float, ...] = ()
    held_used: float = 0.0
    moving_used: float = np.inf
    most_normal_N: float = np.inf
    at_torque_limit: float = 1.0
    unbalanced_ticks: int = 0
    other_contacts: int = 0
    replay_difference: float = np.inf

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class RollingTrial:
    """A trial's ``plan``, the ``trace`` of its run (None where there is no plan), and what was ``measured``."""

    scene: Scene
    plan: Plan
    trace: Trace | None
    measured: RollingRun

    __repr__ = brief_repr


def build_rolling_hand(scene: Scene, nominal: SoftFinger, limits: AdmissibleLimits = LIMITS) -> HandModel:
    """Return what planning may know of a scene whose fingers have three joints."""
    return HandModel(
        fingers=scene.fingers,
        object=scene.object,
        workspaces=(),
        friction=nominal.scaled(1.0 / SAFETY),
        probe=HandProbe(scene),
        limits=limits,
        normal_force=NORMAL,
        hover=0.010,
        tip_polar_limit=POLAR_LIMIT,
    )


def build_question(
    scene: Scene, motions: tuple[ObjectMotion, ...], azimuths: tuple[float | None, ...] = START_AZIMUTHS
) -> tuple[RollingContacts, RollingGrip]:
    """Return the oracle for motions of the object, and the grip with contacts at azimuths [deg] in the world."""
    model = scene.model
    nominal = SoftFinger(*(float(x) for x in model.geom_friction[scene.object_geom, :2]))
    contacts = build_rolling_contacts(build_rolling_hand(scene, nominal), nominal, Track(motions))
    R = motions[0].X_WO_start[:3, :3]
    grip: list[int | None] = []
    for finger, azimuth in enumerate(azimuths):
        if azimuth is None:
            grip.append(None)
            continue
        direction = R.T @ direction_from_angles(azimuth, START_ELEVATION)
        touch = contacts.touches.land_at(finger, direction)
        if touch is None:
            raise ValueError(
                f"finger {finger} does not reach azimuth {azimuth}; a place nearer to it is accepted"
            )
        grip.append(touch)
    return contacts, tuple(grip)


def turn_ball(turn_deg: float, parameters: SceneParameters = TRIFINGER_BALL) -> RollingTrial:
    """Plan and run a turn of the ball about the vertical."""
    return move_object(f"turn by {turn_deg:g} deg", VERTICAL, turn_deg, parameters=parameters)


def list_moves() -> Iterator[tuple[str, Array, float, Array]]:
    """Yield names, axes (3,), turns [deg] and shifts (3,) [m] of single motions: shifts by 10 mm, turns by 30 degrees."""
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        for sign in (1.0, -1.0):
            yield f"shift {name} {10 * sign:+g} mm", VERTICAL, 0.0, 0.01 * sign * axis
            yield f"turn {name} {30 * sign:+g} deg", axis, 30.0 * sign, np.zeros(3)


def run_tilts() -> Iterator[RollingTrial]:
    """Run turns by 90 degrees about x and y, one after the other."""
    for axis, name in zip(np.eye(3), "xy", strict=False):
        yield move_object(f"turn {name} +90 deg", axis, 90.0, azimuths=TILTS[name])


def move_object(
    name: str,
    axis_W: Array,
    turn_deg: float,
    shift_W: Array | None = None,
    *,
    azimuths: tuple[float | None, ...] = START_AZIMUTHS,
    parameters: SceneParameters = TRIFINGER_BALL,
) -> RollingTrial:
    """Plan and run one motion of the object from its home: a turn about ``axis_W`` (3,), and a shift (3,) [m]."""
    scene = load_scene_with(parameters)
    shift = np.zeros(3) if shift_W is None else shift_W
    motion = ObjectMotion(scene.object.X_WO_home, axis_W, float(np.radians(turn_deg)), shift)
    begun = time.process_time()
    contacts, start = build_question(scene, (motion,), azimuths)
    found = plan_rolling(contacts, start, BUDGET)
    plan = found.plan
    asked = RollingRun(
        name,
        str(plan.status),
        plan.reason,
        count_placements(plan.actions),
        int(plan.statistics["nodes"]),
        time.process_time() - begun,
    )
    if not plan.is_solved:
        return RollingTrial(scene, plan, None, asked)
    believed, nominal = contacts.hand.friction, contacts.hold.nominal
    controller = RollingController(scene, plan, RollingBelief(believed, nominal))
    q = np.stack([f.q_home for f in scene.fingers])
    for placement in plan.start_contacts:
        if placement is not None:
            q[placement.finger] = placement.q
    trace = rollout_driver(scene, controller, q, plan.X_WO_start, controller.tick, controller.duration)
    return RollingTrial(scene, plan, trace, _measure(asked, scene, plan, trace, controller, found.slips))


def _measure(
    asked: RollingRun, scene: Scene, plan: Plan, trace: Trace, controller: RollingController, law: Array
) -> RollingRun:
    columns: Mapping[str, NDArray[np.generic]] = trace.columns
    address, tick = scene.object_qpos, controller.tick
    qpos = np.asarray(columns["qpos"], dtype=np.float64)
    pose, reference = qpos[:, address : address + 7], np.asarray(columns["object_pose_reference"])
    off = np.linalg.norm(pose[:, :3] - reference[:, :3], axis=1)
    turns = [Rotation.from_quat(rows[:, 3:], scalar_first=True) for rows in (reference, pose)]
    turned = (turns[0] * turns[1].inv()).magnitude()
    # Everything about contacts is read off a replay, which knows nothing of planner and controller.
    steps = int(np.asarray(columns["physics_steps_per_sample"]))
    ctrl, state = (np.asarray(columns[name], dtype=np.float64) for name in ("ctrl", "initial_state"))
    seen = replay(scene.xml, state, ctrl, steps)
    speed, active = np.nan_to_num(seen.contact_slip_velocity), seen.contact_active
    force = np.nan_to_num(seen.contact_force)
    normal = np.maximum(force[..., 2], 1e-9)
    mu, mu_t = (float(x) for x in scene.model.geom_friction[scene.object_geom, :2])
    sideways = np.linalg.norm(force[..., :2], axis=-1) / (mu * normal)
    used = np.where(active, np.hypot(sideways, force[..., 3] / (mu_t * normal)), 0.0)
    index = np.asarray(columns["action_index"], dtype=np.intp)
    is_moving = np.array([isinstance(action, MoveObject) for action in plan.actions])[index]
    reach = scene.model.actuator_forcerange[:, 1]
    torque = np.abs(seen.actuator_force) / reach
    is_loaded = normal > 0.5 * plan.normal_floor
    # A tip that has just touched, or is about to leave, is no holder yet.
    is_placing = np.array([isinstance(action, Relocate) for action in plan.actions])[index]
    on_two = is_placing & (active.sum(axis=1) == 2) & (is_loaded | ~active).all(axis=1)
    return replace(
        asked,
        duration_s=float(seen.time[-1]),
        failure=trace.meta["failure"],
        end_mm=1e3 * float(off[-1]),
        end_deg=float(np.degrees(turned[-1])),
        worst_mm=1e3 * float(off.max()),
        worst_deg=float(np.degrees(turned.max())),
        slip_mm=tuple((1e3 * tick * np.linalg.norm(speed[..., :2], axis=-1).sum(axis=0)).tolist()),
        law_mm=tuple((1e3 * law).tolist()),
        pivot_deg=tuple(np.degrees(tick * np.abs(speed[..., 2]).sum(axis=0)).tolist()),
        held_used=float(np.max(used[on_two], initial=0.0)),
        moving_used=float(np.max(sideways[is_moving[:, None] & active & is_loaded], initial=0.0)),
        most_normal_N=float(force[..., 2].max()),
        at_torque_limit=float(np.mean((torque >= AT_LIMIT).any(axis=1))),
        unbalanced_ticks=controller.unbalanced,
        other_contacts=len(seen.other_contacts),
        replay_difference=float(np.abs(seen.qpos - qpos).max()),
    )
