"""Who touches, where, and whether it rolls: schedule, order, clearance, rolling, slip, creep, depth."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks_case import (
    MAY,
    MUST,
    MUST_NOT,
    UNKNOWN,
    Case,
    CheckResult,
    Series,
    close_gaps,
    fail,
    find_runs,
    judge,
    judge_all,
    judge_count,
    judge_worst,
    widen,
)
from dexplan.sim.judge.object_shape import measure_edge_distance
from dexplan.sim.judge.replay import OBSTACLE_KINDS
from dexplan.spatial import Array

MM, UM = 1e3, 1e6


def check_contact_schedule(case: Case) -> CheckResult:
    """Who must touch touches, who must not does not, and touching or letting go takes no longer than the
    window.
    """
    active, required = case.replay.contact_active, case.required
    wrong = ((required == MUST) & ~active) | ((required == MUST_NOT) & active) | (required == UNKNOWN)
    reach = round(case.limit("contact_window_s") / case.sample_time)
    for k in range(case.finger_count):
        # Phases that follow each other with "may" are one window: one change, however the plan cuts it.
        for start, stop in find_runs(required[:, k] == MAY):
            touching = np.flatnonzero(active[start:stop, k])
            if len(touching) == 0:
                continue
            was_touching = active[start - 1, k] if start else active[start, k]
            if was_touching:
                wrong[start + reach + 1 : stop, k] |= active[start + reach + 1 : stop, k]
            else:
                # Between the first touch and the phase's end all beyond the window is too early.
                wrong[start + touching[0] : max(stop - reach, start), k] = True
    note = f"quiet {100 * case.quiet.mean():.1f} % of the time" if case.sample_count else ""
    return judge_count(
        "contact_schedule",
        wrong,
        case.replay.time,
        case.limit("contact_schedule"),
        note,
        case.replay.world.fingers,
    )


def check_finger_order_kept(case: Case) -> CheckResult:
    """Around the object, seen from above, the tips stand in the same cyclic order as the fingers' bases."""
    replay = case.replay
    base = replay.world.base_position - replay.world.home_pose[:3]
    order = np.argsort(np.arctan2(base[:, 1], base[:, 0]))
    tips = replay.tip_position[:, order] - replay.object_pose[:, None, :3]
    azimuth = np.arctan2(tips[..., 1], tips[..., 0])
    # In order, the steps from tip to tip go around exactly once.
    around = np.mod(np.roll(azimuth, -1, axis=1) - azimuth, 2 * np.pi).sum(axis=1)
    wrong = ~(np.abs(around - 2 * np.pi) < np.pi) if case.finger_count > 1 else np.isnan(around)
    return judge_count("finger_order_kept", wrong, replay.time, case.limit("finger_order_kept"))


def check_unexpected_contacts(case: Case) -> CheckResult:
    """Nothing touches but fingertips and the object."""
    met: dict[str, int] = {}
    for contact in case.replay.other_contacts:
        pair = " with ".join(contact.geoms)
        met[pair] = met.get(pair, 0) + 1
    note = "; ".join(f"{pair}: {count}" for pair, count in sorted(met.items()))
    first = case.replay.other_contacts[0].sample if met else None
    moment = None if first is None else float(case.replay.time[first])
    if not case.sample_count:
        return fail("unexpected_contacts", "count", "there are no samples")
    return judge(
        "unexpected_contacts", sum(met.values()), case.limit("unexpected_contacts"), "count", moment, note
    )


def check_contact_region(case: Case) -> CheckResult:
    """No fingertip touches the object outside the cones that the problem allows, at any sample."""
    name, limit = "contact_region_error_max", case.limit("contact_region_error_max_deg")
    points = case.replay.contact_point_O
    unit = points / np.linalg.norm(points, axis=-1, keepdims=True)
    outside = np.full(points.shape[:2], np.inf)
    for cone in case.problem["object"]["allowed_regions"]:
        axis = np.asarray(cone["axis"]) / np.linalg.norm(cone["axis"])
        angle = np.degrees(np.arccos(np.clip(unit @ axis, -1.0, 1.0)))
        outside = np.minimum(outside, np.maximum(0.0, angle - cone["half_angle_deg"]))
    outside = np.where(case.replay.contact_active, outside, 0.0)
    return judge_worst(name, Series(outside, case.replay.time, case.replay.world.fingers), limit, "deg")


def check_edge_distance(case: Case) -> CheckResult:
    """Distance of contacts from the object's sharp edges, at every sample: beside one a contact soon leaves its face."""
    name, limit, replay = "edge_distance_min", case.limit("edge_distance_min_mm"), case.replay
    active = replay.contact_active
    distance = np.full(active.shape, np.inf)
    if active.any():
        distance[active] = measure_edge_distance(case.problem["object"], replay.contact_point_O[active]) * MM
    fingers = replay.world.fingers
    return judge_worst(name, Series(distance, replay.time, fingers), limit, "mm", at_least=True)


def check_object_support_other(case: Case) -> CheckResult:
    """No force on the object from links, floor or obstacles."""
    name, limit = "object_support_other", case.limit("object_support_other_N")
    ball = case.replay.world.geom_names[case.replay.world.object_geom]
    held = [contact for contact in case.replay.other_contacts if ball in contact.geoms]
    if not held:
        return judge(name, 0.0 if case.sample_count else np.nan, limit, "N")
    worst = max(held, key=lambda contact: np.inf if np.isnan(contact.force) else contact.force)
    # A touch without force is still a support that should not be there.
    force = max(worst.force, float(np.nextafter(0.0, 1.0)))
    return judge(name, force, limit, "N", float(case.replay.time[worst.sample]), " with ".join(worst.geoms))


def check_free_finger_clearance(case: Case) -> CheckResult:
    """A finger that must not touch stays clear; beside a touch window only the object may be nearer."""
    name, limit, replay = "free_finger_clearance_min", case.limit("free_finger_clearance_min_mm"), case.replay
    samples = replay.clearance_samples
    if len(samples) == 0 or np.isnan(replay.clearance).any():
        return fail(name, "mm", "a clearance is missing", limit)
    free = (case.required == MUST_NOT)[samples]
    near = widen(case.required == MAY, round(case.limit("clearance_grace_s") / case.sample_time))[samples]
    distance = np.where(free[..., None], replay.clearance, replay.clearance_horizon)
    to_object = OBSTACLE_KINDS.index("object")
    distance[..., to_object] = np.where(near, replay.clearance_horizon, distance[..., to_object])
    labels = tuple(f"{finger} to {kind}" for finger in replay.world.fingers for kind in OBSTACLE_KINDS)
    flat, sight = distance.reshape(len(samples), -1) * MM, replay.clearance_horizon * MM
    note = "" if free.any() else "no finger is ever free"
    if free.any() and flat.min() >= sight:
        # Nobody measured that distance: it is where looking ends.
        note = f"at least {sight:g} mm: nothing came so near, and distances beyond are not measured"
        return judge(name, sight, limit, "mm", None, note, at_least=True)
    return judge_worst(name, Series(flat, replay.time[samples], labels), limit, "mm", note, at_least=True)


def check_coulomb_slip_max(case: Case) -> CheckResult:
    """Distance slid at the friction limit, per finger and contact episode."""
    name, limit, replay = "coulomb_slip_max", case.limit("coulomb_slip_max_mm"), case.replay
    sliding = replay.contact_active & (case.utilisation >= case.limit("coulomb_utilisation"))
    speed = np.linalg.norm(replay.contact_slip_velocity[..., :2], axis=-1)
    if (
        np.isnan(speed[replay.contact_active]).any()
        or np.isnan(case.utilisation[replay.contact_active]).any()
    ):
        return fail(name, "mm", "a slip velocity or a force is not a number", limit)
    if not replay.contact_active.any():
        return fail(name, "mm", "no finger ever touches", limit)
    path = np.where(sliding, np.nan_to_num(speed), 0.0) * case.sample_time * MM
    reach = round(case.limit("episode_gap_s") / case.sample_time)
    worst, moment = np.zeros(case.finger_count), 0.0
    for k in range(case.finger_count):
        # Bounces of one touch belong to one episode: a short gap does not end it.
        for start, stop in find_runs(close_gaps(replay.contact_active[:, k], reach)):
            slid = float(path[start:stop, k].sum())
            if slid > worst[k]:
                moment = (
                    float(replay.time[start + int(path[start:stop, k].argmax())])
                    if slid > worst.max()
                    else moment
                )
                worst[k] = slid
    note = ", ".join(f"{name} {slid:.3f}" for name, slid in zip(replay.world.fingers, worst, strict=True))
    return judge(name, float(worst.max()), limit, "mm", moment, note)


def check_creep_rate_max(case: Case) -> CheckResult:
    """Drift of a settled contact inside its cone: mean slip over quiet windows, at rest and moving apart.

    The slip of every sample is added as a vector in the object frame, so that what comes back does not count.
    A contact that is carried drifts with the speed at which it is carried, so a window in which something moves
    is judged per radian turned: its rate is told as at ``creep_moving_speed_deg_s``, where the limit is
    ``creep_moving_um_s``.  Motion too slow for that counts as rest.
    """
    name, replay = "creep_rate_max", case.replay
    is_portable = case.problem["control"]["physics_profile"] == "portable"
    factor = case.limit("creep_portable_factor") if is_portable else 1.0
    window = max(1, round(case.limit("creep_window_s") / case.sample_time))
    duration = window * case.sample_time
    rest, moving = case.limit("creep_rest_um_s"), case.limit("creep_moving_um_s")
    anchor = max(case.limit("creep_moving_speed_deg_s"), 1e-9)
    slip, turned = compute_slip_path(case), compute_carried_angle(case)
    # While one tip rolls all contacts are pushed about, as when the object moves.
    moves = case.is_rolling[1:] | np.any(case.reference[1:] != case.reference[:-1], axis=1)
    rows: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    for k in range(case.finger_count):
        for start, stop in find_runs(case.settled[:, k]):
            if stop - start <= window:
                continue
            steps = slice(start, stop - 1)
            rate = np.linalg.norm(_sum_windows(slip[steps, k], window), axis=1) / duration * UM
            speed = np.degrees(_sum_windows(turned[steps, k], window)) / duration
            # Motion so slow that it would be judged more strictly than rest is judged as rest.
            is_moving = _sum_windows(moves[steps].astype(np.float64), window) > 0
            is_moving &= ~(moving * speed < rest * anchor)
            rate = np.where(is_moving, rate * anchor / np.where(is_moving, speed, 1.0), rate)
            for value, kind, t in zip(rate, is_moving, replay.time[start : stop - window], strict=True):
                rows[bool(kind)].append((float(value), float(t)))
    parts = []
    for kind, limit, word in (
        (False, rest, "at rest"),
        (True, moving, "moving, as at the speed of the limit"),
    ):
        if rows[kind]:
            values, times = np.array(rows[kind]).T
            worst = values.max() if not np.isnan(values).any() else np.nan
            parts.append(
                judge_worst(name, Series(values, times), factor * limit, "µm/s", f"{word} {worst:.2f}")
            )
    if not parts:
        return fail(name, "µm/s", "no contact is quiet for as long as the window")
    return judge_all(name, parts)


def compute_slip_path(case: Case) -> Array:
    """Return how far (T - 1, F, 3) [m] each tip's surface slips over the object's from sample to sample, object axes.

    Whatever a contact point moves by on the object more than on the tip was slip, whatever it was in between:
    the servos are told something new once per sample, and a slip *velocity* read at that very instant, always in
    the same phase of the ripple, says 41 um/s of a light ball whose contact moves by 3.
    """
    replay = case.replay
    R_WO = _as_matrices(replay.object_pose)[:, None]
    R_OF = R_WO.swapaxes(-1, -2) @ replay.tip_rotation
    p_OF = np.einsum(
        "tfji,tfj->tfi",
        np.broadcast_to(R_WO, R_OF.shape),
        replay.tip_position - replay.object_pose[:, None, :3],
    )
    point_F = np.einsum("tfji,tfj->tfi", R_OF, replay.contact_point_O - p_OF)
    halfway = 0.5 * (R_OF[1:] + R_OF[:-1])
    moved = np.diff(replay.contact_point_O, axis=0)
    moved -= np.einsum("tfij,tfj->tfi", halfway, np.diff(point_F, axis=0))
    # What is left along the normal is a change of depth.
    normal = replay.contact_rotation_O[1:, :, :, 2] + replay.contact_rotation_O[:-1, :, :, 2]
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.asarray(moved - (moved * normal).sum(axis=-1, keepdims=True) * normal)


def compute_carried_angle(case: Case) -> Array:
    """Return the angle (T - 1, F) [rad] by which each tip is carried around from sample to sample, as it is planned.

    A shift counts as the turn about the object's centre that takes the tip's centre as far; while a tip rolls, its turn
    against the object counts for all.
    """
    replay, reference = case.replay, case.reference
    turned = _measure_turns(_as_matrices(reference))[:, None]
    arm = np.linalg.norm(replay.tip_position - replay.object_pose[:, None, :3], axis=-1)[1:]
    shifted = np.linalg.norm(np.diff(reference[:, :3], axis=0), axis=1)[:, None] / arm
    R_WO = _as_matrices(replay.object_pose)[:, None]
    R_OF = R_WO.swapaxes(-1, -2) @ replay.tip_rotation
    both = replay.contact_active[1:] & replay.contact_active[:-1] & case.is_rolling[1:, None]
    rolled = np.where(both, _measure_turns(R_OF), 0.0).max(axis=1, keepdims=True)
    return np.asarray(turned + shifted + rolled)


def _as_matrices(pose: Array) -> Array:
    """Return the rotations (T, 3, 3) of poses (T, 7); NaN where a pose is none."""
    known = np.isfinite(pose).all(axis=1) & (np.linalg.norm(pose[:, 3:], axis=1) > 0.0)
    quat = np.where(known[:, None], pose[:, 3:], [1.0, 0.0, 0.0, 0.0])
    R = Rotation.from_quat(quat, scalar_first=True).as_matrix()
    return np.where(known[:, None, None], R, np.nan)


def _measure_turns(R: Array) -> Array:
    """Return the angles (T - 1, ...) [rad] between successive rotations (T, ..., 3, 3), precise where they are small."""
    # The distance between two rotations as matrices is 2 sqrt(2) sin(angle / 2).
    distance = np.sqrt(np.square(R[1:] - R[:-1]).sum(axis=(-2, -1)))
    return np.asarray(2.0 * np.arcsin(np.minimum(distance / np.sqrt(8.0), 1.0)))


def _sum_windows(steps: Array, window: int) -> Array:
    """Return the sums of every ``window`` successive ``steps`` (N, ...)."""
    total = np.cumsum(np.concatenate([np.zeros((1, *steps.shape[1:])), steps]), axis=0)
    return total[window:] - total[:-window]


def check_penetration_max(case: Case) -> CheckResult:
    """Depth of the tips in the object."""
    depth = np.where(case.replay.contact_active, case.replay.penetration, 0.0) * UM
    limit, fingers = case.limit("penetration_max_um"), case.replay.world.fingers
    return judge_worst("penetration_max", Series(depth, case.replay.time, fingers), limit, "µm")


def check_tip_contact_angle_max(case: Case) -> CheckResult:
    """Angle between a tip's pole and its contact, against the hand's polar limit."""
    angle = np.degrees(np.where(case.replay.contact_active, case.replay.tip_contact_angle, 0.0))
    limit = float(case.problem["hand"]["tip_polar_limit_deg"]) + case.limit("tip_contact_angle_slack_deg")
    fingers = case.replay.world.fingers
    return judge_worst("tip_contact_angle_max", Series(angle, case.replay.time, fingers), limit, "deg")
