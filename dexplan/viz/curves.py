"""What the summary draws over time: forces, friction used, errors, goals and the turn, from a trace's columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.contact.bodies.smooth import BallBody
from dexplan.plans.plan import Plan
from dexplan.sim.judge.limits import load_default_limits
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, lock_arrays
from dexplan.viz.body import read_body
from dexplan.viz.timeline import choose_axis, compute_turned_angle

LEAST_FORCE = 0.05
"""Below this normal force [N] a ratio to it says nothing."""
Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Curves:
    """What is drawn over time (T,): forces [N], utilisation and how far contacts are from their goals, in
    ``goal_unit`` (T, F), errors [mm], [deg],
    turns [deg] and shifts [mm].

    ``is_quiet`` (T,): farther than ``quiet_distance_s`` from every planned or actual change of contacts; only there the judge
    looks at friction, creep and predicted forces.
    """

    time: Array
    normal_force: Array
    normal_force_reference: Array
    utilisation: Array
    position_error_mm: Array
    rotation_error_deg: Array
    turned_deg: Array
    turned_reference_deg: Array
    shifted_mm: Array
    shifted_reference_mm: Array
    goal_error: Array
    goal_unit: str
    is_quiet: Flags

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def compute_curves(problem: Mapping[str, Any] | None, plan: Plan, trace: Trace) -> Curves:
    """Return the curves of a run; missing numbers stay NaN and leave gaps.

    ``problem`` is the data of ``problem.toml``, whose limits are shown; without it those of the package are.
    """
    model = mujoco.MjModel.from_xml_string(trace.model_xml)
    is_ball = isinstance(read_body(model), BallBody | None)
    address = int(model.joint("object/free/").qposadr[0])
    pose, reference = trace["qpos"][:, address : address + 7], trace["object_pose_reference"]
    # A run that diverged ends in samples that are no numbers; curves stop before them.
    is_good = np.isfinite(pose).all(axis=1) & np.isfinite(reference).all(axis=1)
    sliding, torsional = _read_friction(model)
    axis = choose_axis(plan)
    rotation_error, turned, turned_reference = (np.full(len(pose), np.nan) for _ in range(3))
    if is_good.any():
        actual = Rotation.from_quat(pose[is_good, 3:], scalar_first=True)
        wanted = Rotation.from_quat(reference[is_good, 3:], scalar_first=True)
        rotation_error[is_good] = np.degrees((wanted.inv() * actual).magnitude())
        turned[is_good] = np.degrees(compute_turned_angle(pose[is_good], axis))
        turned_reference[is_good] = np.degrees(compute_turned_angle(reference[is_good], axis))
    force, start = trace["contact_force"], plan.X_WO_start[:3, 3]
    # Other controllers than ours plan no forces.
    planned = trace.columns.get("contact_force_reference", np.full(force.shape, np.nan))
    return Curves(
        time=trace["time"],
        normal_force=force[..., 2],
        normal_force_reference=planned[..., 2],
        utilisation=compute_utilisation(force, sliding, torsional),
        position_error_mm=1e3 * np.linalg.norm(pose[:, :3] - reference[:, :3], axis=1),
        rotation_error_deg=rotation_error,
        turned_deg=turned,
        turned_reference_deg=turned_reference,
        shifted_mm=1e3 * np.linalg.norm(pose[:, :3] - start, axis=1),
        shifted_reference_mm=1e3 * np.linalg.norm(reference[:, :3] - start, axis=1),
        goal_error=compute_goal_error(plan, trace, is_ball),
        goal_unit="deg" if is_ball else "mm",
        is_quiet=find_quiet(plan, trace, read_limit(problem, "quiet_distance_s")),
    )


def read_limit(problem: Mapping[str, Any] | None, name: str) -> float:
    """Return a limit of the checks: the problem's, or the packaged default where it names none; NaN for no such limit."""
    acceptance = {} if problem is None else problem.get("acceptance", {})
    return float(acceptance.get(name, load_default_limits().get(name, np.nan)))


def compute_utilisation(force: Array, sliding: float, torsional: float) -> Array:
    """Return the share (...) of the soft-finger friction cone that contact forces (..., 4) use; 1 slides.

    ``sqrt(|f_t|^2 / mu^2 + tau^2 / mu_t^2) / f_n``; NaN where there is next to no normal force.
    """
    tangential = np.hypot(force[..., 0], force[..., 1]) / sliding
    normal = np.where(force[..., 2] > LEAST_FORCE, force[..., 2], np.nan)
    used: Array = np.hypot(tangential, force[..., 3] / torsional) / normal
    return used


def compute_goal_error(plan: Plan, trace: Trace, is_ball: bool) -> Array:
    """Return how far (T, F) each contact is from its finger's goal contact.

    On a ball the angle [deg] seen from its centre, on any other body the distance [mm].  NaN where a finger does not touch, or
    has no goal contact.
    """
    point = trace["contact_point_O"]
    fingers = len(plan.fingers)
    off: Array = np.full((len(point), fingers), np.nan)
    for finger, contact in enumerate(plan.goal_contacts or ()):
        if contact is None or finger >= fingers:
            continue
        here = point[:, finger]
        if not is_ball:
            off[:, finger] = 1e3 * np.linalg.norm(here - contact.point_O, axis=1)
            continue
        goal = contact.point_O / np.linalg.norm(contact.point_O)
        # atan2 keeps small angles, which the arc cosine loses.
        across = np.linalg.norm(np.cross(here, goal), axis=1)
        off[:, finger] = np.degrees(np.arctan2(across, here @ goal))
    return np.where(trace["contact_active"], off, np.nan)


def find_arrivals(curves: Curves, limit: float) -> tuple[float | None, ...]:
    """Return per finger the time [s] from which on its contact stays within ``limit`` of its goal, None where it does not.

    The limit is in the curves' ``goal_unit``.
    """
    found: list[float | None] = []
    for off in curves.goal_error.T:
        is_off = np.flatnonzero(~(off <= limit))
        first = int(is_off[-1]) + 1 if len(is_off) else 0
        found.append(float(curves.time[first]) if first < len(off) else None)
    return tuple(found)


def find_quiet(plan: Plan, trace: Trace, distance: float) -> Flags:
    """Return which samples (T,) are farther than ``distance`` [s] from every planned or actual change of contacts."""
    time, active = trace["time"], trace["contact_active"]
    if len(time) < 2:
        return np.ones(len(time), dtype=bool)
    changes = np.zeros(len(time), dtype=bool)
    for states in (_list_demands(plan, trace), active):
        changes[1:] |= np.any(states[1:] != states[:-1], axis=1)
    # A change that is seen at a sample happened after the one before.
    reach = int(np.ceil(distance / float(np.median(np.diff(time))))) + 1
    quiet: Flags = ~maximum_filter1d(changes, 2 * reach + 1, mode="constant", cval=0)
    return quiet


def _list_demands(plan: Plan, trace: Trace) -> NDArray[Any]:
    """Return what the plan asks of each finger at each sample (T, F); empty text where it says nothing."""
    actions = trace["action_index"]
    phases = trace["phase_index"] if "phase_index" in trace else np.zeros_like(actions)
    rows = {
        (a, p): phase.touch for a, action in enumerate(plan.actions) for p, phase in enumerate(action.phases)
    }
    nothing = ("",) * trace["contact_active"].shape[1]
    pairs = zip(actions.tolist(), phases.tolist(), strict=True)
    return np.array([rows.get(pair, nothing) for pair in pairs])


def _read_friction(model: Any) -> tuple[float, float]:
    """Return sliding [-] and torsional [m] friction between tip and object, as the run had it, whatever was believed."""
    tips = [k for k in range(model.ngeom) if model.geom(k).name.endswith("/tip")]
    # MuJoCo takes the larger friction of the two geoms.
    pair = model.geom_friction[[*tips[:1], model.geom("object/surface").id]].max(axis=0)
    return float(pair[0]), float(pair[1])
