"""The record and the object's motion: is this the run it claims to be, did the object go where it should?"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks_case import (
    Case,
    CheckResult,
    Series,
    fail,
    find_runs,
    judge,
    judge_count,
    judge_worst,
)
from dexplan.sim.judge.goals import as_direction, compute_goal_poses, find_moments
from dexplan.sim.judge.object_shape import find_on_ray
from dexplan.spatial import Array, angles_from_direction

MM = 1e3


def check_replay_matches(case: Case) -> CheckResult:
    """The record's qpos is what MuJoCo gives, bit for bit on the machine and version that recorded it.

    Elsewhere the last bits differ and contacts let them grow: there the difference is told, and the run is judged from the
    replay alone.  No other check reads the recorded motion, so a record that names a false machine gains nothing by it.
    """
    name, limit = "replay_matches", case.limit("replay_matches")
    recorded = case.column("qpos", (case.replay.qpos.shape[1],))
    if recorded is None:
        return fail(name, "–", "the record has no qpos of the replay's shape", limit)
    difference = np.abs(recorded - case.replay.qpos).max(axis=1)
    result = judge_worst(name, Series(difference, case.replay.time), limit, "–")
    if not case.differences or result.value is None:
        return result
    note = f"recorded elsewhere ({'; '.join(case.differences)}): largest difference {result.value:.3g}"
    return replace(result, status="not_applicable", limit=None, note=note)


def check_trace_consistent(case: Case) -> CheckResult:
    """The recorded times, velocities and contacts are the replayed ones; vectors are compared in the object
    frame.

    Of a run recorded elsewhere the times alone have to be the replayed ones: contacts are told, since they follow from
    a motion that differs in its last bits.  Nothing else is judged by the recorded ones.
    """
    name, limit, replay = "trace_consistent", case.limit("trace_consistent"), case.replay
    F = case.finger_count
    shapes: dict[str, tuple[int, ...]] = {
        "time": (),
        "qvel": (replay.qvel.shape[1],),
        "contact_active": (F,),
        "contact_point_O": (F, 3),
        "contact_rotation_O": (F, 3, 3),
        "contact_force": (F, 4),
    }
    columns = {key: case.column(key, shape) for key, shape in shapes.items() if key in case.columns}
    bad = [key for key, column in columns.items() if column is None]
    if bad:
        return fail(name, "count", f"recorded columns of a wrong shape: {', '.join(bad)}", limit)
    wrong: dict[str, NDArray[Any]] = {}
    for key, column in columns.items():
        assert column is not None
        if key == "time":
            wrong[key] = ~(np.abs(column - replay.time) <= case.limit("trace_time_tolerance_s"))
        elif key == "qvel":
            wrong[key] = np.any(column != replay.qvel, axis=1)
        elif key == "contact_active":
            wrong[key] = np.any(column.astype(bool) != replay.contact_active, axis=1)
        elif key == "contact_point_O":
            miss = np.linalg.norm(np.nan_to_num(column - replay.contact_point_O, nan=0.0), axis=-1) * MM
            differs = (miss > case.limit("trace_point_tolerance_mm")) | _is_missing(
                column, replay.contact_point_O
            )
            wrong[key] = differs.any(axis=1)
        elif key == "contact_force":
            mine = _as_object_force(replay.contact_rotation_O, replay.contact_force)
            theirs = _as_object_force(columns.get("contact_rotation_O"), column)
            # No contact and no force are the same thing to a force.
            miss = np.abs(np.nan_to_num(mine) - np.nan_to_num(theirs)).max(axis=-1)
            wrong[key] = (miss > case.limit("trace_force_tolerance_N")).any(axis=1)
    if not wrong:
        return fail(name, "count", "the record holds nothing to compare", limit)
    note = "; ".join(f"{key}: {int(mask.sum())}" for key, mask in wrong.items() if mask.any())
    result = judge_count(name, np.any(list(wrong.values()), axis=0), replay.time, limit, note)
    if not case.differences or result.value is None or wrong.get("time", np.zeros(1)).any():
        return result
    return replace(
        result, status="not_applicable", limit=None, note=f"recorded elsewhere: {note or 'no difference'}"
    )


def check_phases_in_order(case: Case) -> CheckResult:
    """The claimed actions and phases exist, never go back, leave none out, begin with the first and end with
    the last.
    """
    name, limit = "phases_in_order", case.limit("phases_in_order")
    claimed = case.claimed_phase
    if len(claimed) == 0:
        return fail(name, "count", "there are no samples", limit)
    unknown = claimed < 0
    backward = np.concatenate([[False], np.diff(claimed) < 0]) & ~unknown
    left_out = sorted(set(range(len(case.phases))) - set(claimed.tolist()))
    note = []
    if unknown.any():
        note.append(f"samples that claim no phase of the plan: {unknown.sum()}")
    if backward.any():
        note.append(f"steps back: {backward.sum()}")
    if left_out:
        a, p = case.phases[left_out[0]]
        note.append(f"phases never reached: {len(left_out)}, first: action {a + 1}, phase {p + 1}")
    count = int(unknown.sum() + backward.sum()) + len(left_out)
    # An empty plan has no phase that a sample could claim, so it cannot pass here.
    return judge(name, count, limit, "count", float(case.replay.time[-1]) if count else None, "; ".join(note))


def check_reference_position(case: Case) -> CheckResult:
    """The reference visits the plan's poses and rests where the plan does: positions."""
    miss, where = _reference_misses(case)
    limit = case.limit("reference_position_error_max_mm")
    return judge_worst("reference_position_error_max", Series(miss[:, 0] * MM, where), limit, "mm")


def check_reference_rotation(case: Case) -> CheckResult:
    """The same for rotations, the turn within each action included."""
    miss, where = _reference_misses(case)
    limit = case.limit("reference_rotation_error_max_deg")
    return judge_worst("reference_rotation_error_max", Series(np.degrees(miss[:, 1]), where), limit, "deg")


def check_reference_speed(case: Case) -> CheckResult:
    """The reference turns no faster than the problem's speed allows."""
    name = "reference_speed_max"
    limit = case.limit("reference_speed_factor") * float(case.problem["control"]["speed_deg_s"])
    if case.sample_count < 2:
        return judge(name, 0.0 if _is_finite(case.reference) else np.nan, limit, "deg/s")
    step = np.degrees(_angle_between(case.reference[1:], case.reference[:-1]))
    return judge_worst(name, Series(step / case.sample_time, case.replay.time[1:]), limit, "deg/s")


def check_not_dropped(case: Case) -> CheckResult:
    """The object's centre stays near its reference height."""
    fallen = (case.reference[:, 2] - case.replay.object_pose[:, 2]) * MM
    return judge_worst("not_dropped", Series(fallen, case.replay.time), case.limit("not_dropped_mm"), "mm")


def check_position_error_max(case: Case) -> CheckResult:
    """Distance of the object's centre from its reference, whole run."""
    miss = np.linalg.norm(case.replay.object_pose[:, :3] - case.reference[:, :3], axis=1) * MM
    return judge_worst(
        "position_error_max", Series(miss, case.replay.time), case.limit("position_error_max_mm"), "mm"
    )


def check_rotation_error_max(case: Case) -> CheckResult:
    """Angle between the object and its reference, whole run."""
    miss = np.degrees(_angle_between(case.replay.object_pose, case.reference))
    return judge_worst(
        "rotation_error_max", Series(miss, case.replay.time), case.limit("rotation_error_max_deg"), "deg"
    )


def check_position_error_final(case: Case) -> CheckResult:
    """Distance of the object's centre from the problem's goal at the end; with waypoints the worst of them, each at its hold."""
    return _judge_goals(
        case, "position_error_final", "mm", lambda pose, goal: _distance_between(pose, goal) * MM
    )


def check_rotation_error_final(case: Case) -> CheckResult:
    """Angle between the object and the problem's goal at the end; with waypoints the worst of them, each at its hold."""
    return _judge_goals(
        case, "rotation_error_final", "deg", lambda pose, goal: np.degrees(_angle_between(pose, goal))
    )


def _judge_goals(case: Case, name: str, unit: str, measure: Callable[[Array, Array], Array]) -> CheckResult:
    """Judge how far the object is from what the problem asks for, by ``measure`` of poses (1, 7), where it is farthest."""
    goals, limit = compute_goal_poses(case), case.limit(f"{name}_{unit}")
    results = []
    for k, (goal, at) in enumerate(zip(goals, find_moments(case), strict=True), start=1):
        here = slice(0, 0) if at is None else slice(at, at + 1)
        miss = measure(case.replay.object_pose[here], goal[None])
        note = f"waypoint {k} of {len(goals)}" if len(goals) > 1 else ""
        note += " is marked by no hold" if note and at is None else ""
        results.append(judge_worst(name, Series(miss, case.replay.time[here]), limit, unit, note))
    return max(results, key=lambda result: np.inf if result.value is None else result.value)


def _distance_between(a: Array, b: Array) -> Array:
    """Return the distances (N,) [m] between the positions of poses (N, 7) and (1, 7)."""
    distances: Array = np.linalg.norm(a[:, :3] - b[:, :3], axis=1)
    return distances


def check_turned_angle(case: Case) -> CheckResult:
    """Turn about the goal's axis, counted through whole turns, against the goal's angle."""
    name, limit = "turned_angle", case.limit("turned_angle_deg")
    rotation = case.problem["goal"]["rotation"]
    if not _is_finite(case.replay.object_pose) or not case.sample_count:
        return fail(name, "deg", "the object's pose is not a number", limit)
    start = _rotations(case.replay.world.home_pose[None])
    # Both the twist about the axis and the turn itself are continuous; unwrap counts the whole turns.
    turned = np.degrees(compute_twist(_rotations(case.replay.object_pose) * start.inv(), rotation["axis"]))
    note = f"turned {turned[-1]:.3f} of {rotation['angle_deg']:.3f} deg"
    moment = float(case.replay.time[-1])
    return judge(name, abs(turned[-1] - float(rotation["angle_deg"])), limit, "deg", moment, note)


def check_contact_error_final(case: Case) -> CheckResult:
    """Final contacts against the goal's, on a ball as angles seen from its centre, else as distances; who should be off must
    be off.
    """
    unit = "mm" if case.problem["object"].get("shape") else "deg"
    name, limit = "contact_error_final", case.limit(f"contact_error_final_{unit}")
    goal = case.problem["goal"]["contacts_deg"]
    if not case.sample_count or len(goal) != case.finger_count:
        return fail(name, unit, "there is nothing to compare the goal's contacts with", limit)
    worst, note = 0.0, []
    for k, wanted in enumerate(goal):
        finger, is_touching = case.replay.world.fingers[k], bool(case.replay.contact_active[-1, k])
        if (wanted == "free") == is_touching:
            return fail(name, unit, f"{finger} {'touches' if is_touching else 'does not touch'}", limit)
        if wanted == "free":
            continue
        point = case.replay.contact_point_O[-1, k]
        direction = as_direction(wanted)
        if unit == "deg":
            miss = float(np.degrees(_angle_of(point, direction)))
            azimuth, elevation = angles_from_direction(point / np.linalg.norm(point))
            note.append(f"{finger} at ({azimuth:.2f}, {elevation:.2f})")
        else:
            miss = MM * float(np.linalg.norm(point - find_on_ray(case.problem["object"], direction)))
            note.append(f"{finger} at ({', '.join(f'{MM * x:.2f}' for x in point)}) mm")
        worst = max(worst, miss)
    return judge(name, worst, limit, unit, float(case.replay.time[-1]), "; ".join(note))


def compute_twist(turns: Rotation, axis: Any) -> Array:
    """Return the unwrapped angle (T,) [rad] of each rotation about the world ``axis``, the first within half
    a turn.
    """
    axis = np.asarray(axis, dtype=np.float64)
    # A quaternion and its negative are one rotation: without a choice the first angle could be a whole turn off.
    quat = turns.as_quat(canonical=True, scalar_first=True)
    return np.unwrap(2 * np.arctan2(quat[:, 1:] @ (axis / np.linalg.norm(axis)), quat[:, 0]))


def _reference_misses(case: Case) -> tuple[Array, Array]:
    """Return (N, 2) distances [m] and angles [rad] of the reference from the plan's poses, and their times
    (N,) [s].
    """
    reference, times = case.reference, case.replay.time
    if not case.sample_count or not _is_finite(reference):
        return np.full((min(case.sample_count, 1), 2), np.nan), times[:1]
    rows: list[tuple[float, float, float]] = []

    def compare(samples: slice, pose: Any) -> None:
        pose = np.broadcast_to(np.asarray(pose, dtype=np.float64), reference[samples].shape)
        distance = np.linalg.norm(reference[samples, :3] - pose[:, :3], axis=1)
        rows.extend(zip(distance, _angle_between(reference[samples], pose), times[samples], strict=True))

    compare(slice(0, 1), case.plan["start"]["object_pose"])
    compare(slice(0, 1), case.replay.world.home_pose)
    compare(slice(-1, None), case.plan["goal"]["object_pose"])
    goal = case.problem["goal"]
    if goal["kind"] != "grasp_adjustment" or goal.get("keep_object"):
        # A grasp adjustment may leave the object where the plan says.
        for pose, at in zip(compute_goal_poses(case), find_moments(case), strict=True):
            if at is not None:
                compare(slice(at, at + 1), pose)
    action_of = np.array([a for a, _ in case.phases] + [-1])[case.claimed_phase]
    for a, action in enumerate(case.plan["actions"]):
        start, end = np.asarray(action["object_pose_start"]), np.asarray(action["object_pose_end"])
        turn = np.radians(float((action.get("rotation") or {}).get("angle_deg", 0.0)))
        is_resting = turn == 0.0 and np.allclose(start, end)
        for begin, stop in find_runs(action_of == a):
            if is_resting:
                compare(slice(begin, stop), end)
                continue
            compare(slice(begin, begin + 1), start)
            # The last action of a run that ended early is judged by phases_in_order, not here.
            if stop < case.sample_count or a == len(case.plan["actions"]) - 1:
                compare(slice(stop - 1, stop), end)
                if turn:
                    relative = _rotations(reference[begin:stop]) * _rotations(start[None]).inv()
                    done = compute_twist(relative, action["rotation"]["axis_W"])[-1]
                    rows.append((0.0, abs(done - turn), times[stop - 1]))
    table = np.array(rows)
    return table[:, :2], table[:, 2]


def _rotations(pose: Array) -> Rotation:
    """Return the rotations of poses (N, 7)."""
    return Rotation.from_quat(pose[:, 3:], scalar_first=True)


def _angle_between(a: Array, b: Array) -> Array:
    """Return the angles (N,) [rad] between poses (N, 7) and (N, 7); NaN where a pose is not one."""
    if len(a) == 0:
        return np.zeros(0)
    pa, pb = a[:, 3:], np.broadcast_to(b[:, 3:], a[:, 3:].shape)
    usable = np.isfinite(pa + pb).all(axis=1) & (pa != 0).any(axis=1) & (pb != 0).any(axis=1)
    out = np.full(len(a), np.nan)
    if usable.any():
        first = Rotation.from_quat(pa[usable], scalar_first=True)
        out[usable] = (first * Rotation.from_quat(pb[usable], scalar_first=True).inv()).magnitude()
    return out


def _angle_of(a: Array, b: Array) -> float:
    """Return the angle [rad] between two vectors (3,)."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))


def _as_object_force(rotation_O: Array | None, force: Array) -> Array:
    """Return (T, F, 4): the force in the object frame and the torque about the normal; as it is without a
    frame.
    """
    if rotation_O is None:
        return force
    turned = np.einsum("tfij,tfj->tfi", rotation_O, force[..., :3])
    return np.concatenate([turned, force[..., 3:]], axis=-1)


def _is_missing(a: Array, b: Array) -> Array:
    """Return where one of two arrays (T, F, K) has a number and the other has none (T, F)."""
    return np.isnan(a).any(axis=-1) != np.isnan(b).any(axis=-1)


def _is_finite(array: Array) -> bool:
    """Return whether all of ``array`` is finite."""
    return bool(np.isfinite(array).all())
