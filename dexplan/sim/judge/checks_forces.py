"""What the fingers and servos carry: friction, predicted forces, torque, joint room, and the grasps that were
planned.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks_case import (
    Case,
    CheckResult,
    Series,
    compute_utilisation,
    fail,
    judge,
    judge_all,
    judge_count,
    judge_worst,
)
from dexplan.sim.judge.checks_closure import compute_closure_slack, compute_load_margin
from dexplan.spatial import GRAVITY, Array

MM = 1e3


def check_friction_utilisation_max(case: Case) -> CheckResult:
    """Largest part of the simulator's friction cone in use at quiet samples; 1 slides."""
    name, limit = "friction_utilisation_max", case.limit("friction_utilisation_max")
    if not case.settled.any():
        return fail(name, "–", "no finger touches at a quiet sample", limit)
    used = np.where(case.settled, case.utilisation, 0.0)
    return judge_worst(name, Series(used, case.replay.time, case.replay.world.fingers), limit, "–")


def check_force_prediction_error(case: Case) -> CheckResult:
    """Measured against planned normal forces at quiet samples: median and 95th percentile of the relative
    difference.
    """
    name, limit = "force_prediction_error", case.limit("force_prediction_p95_pct")
    planned = case.column("contact_force_reference", (case.finger_count, 4))
    if planned is None:
        return fail(name, "%", "the record has no planned forces", limit)
    if np.isnan(planned[case.settled]).any():
        return fail(name, "%", "a finger touches for which no force was planned", limit)
    pressed = case.settled & (planned[..., 2] > 0)
    if not pressed.any():
        return fail(name, "%", "no planned force at a quiet sample", limit)
    error = 100 * np.abs(case.replay.contact_force[pressed][:, 2] / planned[pressed][:, 2] - 1.0)
    median, high = float(np.median(error)), float(np.percentile(error, 95))
    half = case.limit("force_prediction_median_pct")
    return judge_all(
        name,
        [
            judge(name, median, half, "%", note=f"median {median:.2f}"),
            judge(name, high, limit, "%", note=f"95th percentile {high:.2f}"),
        ],
    )


def check_force_cone_margin_min(case: Case) -> CheckResult:
    """Planned forces inside the exact believed cone, torsion included: 1 - utilisation, smallest."""
    name, limit = "force_cone_margin_min", case.limit("force_cone_margin_min")
    planned = case.column("contact_force_reference", (case.finger_count, 4))
    if planned is None:
        return fail(name, "–", "the record has no planned forces", limit)
    if not np.isfinite(planned).all(axis=-1).any():
        return fail(name, "–", "no force was ever planned", limit)
    used = compute_utilisation(planned, *case.believed_friction)
    # Rows that are all missing are fingers without a plan; a row missing in part is an error.
    used = np.where(np.isnan(planned).all(axis=-1), -np.inf, np.where(planned[..., 2] < 0, np.inf, used))
    worst = np.where(np.isnan(used), np.nan, np.clip(1.0 - used, -1.0, 1.0))
    fingers = case.replay.world.fingers
    return judge_worst(name, Series(worst, case.replay.time, fingers), limit, "–", at_least=True)


def check_torque_utilisation_max(case: Case) -> CheckResult:
    """Servo torque over its limit."""
    world = case.replay.world
    used = np.abs(case.replay.actuator_force) / world.torque_limit
    limit = case.limit("torque_utilisation_max")
    return judge_worst(
        "torque_utilisation_max", Series(used, case.replay.time, world.actuator_names), limit, "–"
    )


def check_joint_limit_margin_min(case: Case) -> CheckResult:
    """Joint angles to the nearer stop."""
    world = case.replay.world
    q = case.replay.qpos[:, world.joint_qpos]
    margin = np.degrees(np.minimum(q - world.joint_range[:, 0], world.joint_range[:, 1] - q))
    limit = case.limit("joint_limit_margin_min_deg")
    return judge_worst(
        "joint_limit_margin_min",
        Series(margin, case.replay.time, world.joint_names),
        limit,
        "deg",
        at_least=True,
    )


def check_tip_tracking_error_max(case: Case) -> CheckResult:
    """What inverse kinematics left over of the commanded tip positions, as recorded (T,) or (T, F) [m]."""
    name, limit = "tip_tracking_error_max", case.limit("tip_tracking_error_max_mm")
    error = case.column("tip_tracking_error")
    if error is None:
        error = case.column("tip_tracking_error", (case.finger_count,))
    if error is None:
        return fail(name, "mm", "the record has no tip_tracking_error", limit)
    return judge_worst(name, Series(np.abs(error) * MM, case.replay.time), limit, "mm")


def check_ik_at_limit(case: Case) -> CheckResult:
    """Ticks in which inverse kinematics ran into a limit, as recorded."""
    name, limit = "ik_at_limit", case.limit("ik_at_limit")
    flags = case.column("ik_at_limit")
    if flags is None:
        flags = case.column("ik_at_limit", (case.finger_count,))
    if flags is None:
        return fail(name, "count", "the record has no ik_at_limit", limit)
    return judge_count(name, flags != 0, case.replay.time, limit)


def check_plan_force_closure(case: Case) -> CheckResult:
    """Friction angle to spare before a planned grasp would no longer be force closed, worst grasp of the
    plan.
    """
    believed = case.believed_friction
    limit = case.limit("plan_force_closure_min_deg")

    def slack(points: Array, normals: Array, poses: Array) -> float:
        return float(np.degrees(compute_closure_slack(points, normals, *believed)))

    return _judge_grasps(case, "plan_force_closure", slack, limit, "deg")


def check_plan_load_margin(case: Case) -> CheckResult:
    """Part of the believed cones left over when a planned grasp carries the true weight, worst grasp and pose of
    the plan.
    """
    believed = case.believed_friction
    # What the plan itself allows may be less: a light object is not to be entered by the tips.
    allowed = float(case.plan.get("normal_ceiling_N", np.inf))
    squeeze, limit = (
        min(case.limit("plan_normal_force_max_N"), allowed),
        case.limit("plan_load_margin_min"),
    )
    weight = float(case.problem["object"]["mass_kg"]) * GRAVITY
    world = case.replay.world
    com = world.model.body_ipos[world.object_body]
    done: dict[bytes, float] = {}

    def margin(points: Array, normals: Array, poses: Array) -> float:
        down_O = Rotation.from_quat(poses[:, 3:], scalar_first=True).inv().apply([0.0, 0.0, -weight])
        values = []
        for load in down_O:
            # A turn about the vertical leaves the load as it was: solve each load of each grasp once.
            key = np.concatenate([points.ravel(), normals.ravel(), load]).round(9).tobytes()
            if key not in done:
                done[key] = compute_load_margin(points - com, normals, load, *believed, squeeze)
            values.append(done[key])
        return min(values)

    return _judge_grasps(case, "plan_load_margin", margin, limit, "–")


def _judge_grasps(
    case: Case, name: str, measure: Callable[[Array, Array, Array], float], limit: float, unit: str
) -> CheckResult:
    """Judge the smallest ``measure`` over the grasps of all actions; a touch to come is not counted on, a
    lift is gone.
    """
    values, notes = [], []
    done: dict[bytes, float] = {}
    before: dict[str, Any] = case.plan["start"]["contacts"]
    for number, action in enumerate(case.plan["actions"], start=1):
        held = [(before[finger], action["contacts_end"][finger]) for finger in action["grasping"]]
        for moment, grasp in (("start", [h[0] for h in held]), ("end", [h[1] for h in held])):
            where = f"action {number} {moment}: {', '.join(action['grasping'])}"
            if any(contact is None for contact in grasp) or not grasp:
                return fail(name, unit, f"{where}: a grasping finger has no contact", limit)
            points = np.array([contact["point_O"] for contact in grasp], dtype=np.float64)
            normals = np.array([contact["normal_O"] for contact in grasp], dtype=np.float64)
            poses = np.array([action["object_pose_start"], action["object_pose_end"]], dtype=np.float64)
            if not (np.isfinite(points).all() and np.isfinite(normals).all() and np.isfinite(poses).all()):
                return fail(name, unit, f"{where}: a number is missing", limit)
            key = np.concatenate([points.ravel(), normals.ravel(), poses.ravel()]).tobytes()
            if key not in done:
                done[key] = measure(points, normals, poses)
            values.append(done[key])
            notes.append(where)
        before = action["contacts_end"]
    if not values:
        return fail(name, unit, "the plan has no actions", limit)
    worst = int(np.argmin(values))
    return judge(name, values[worst], limit, unit, note=notes[worst], at_least=True)
