"""Whether tips roll: contacts against rolling geometry, and rolled ways against the planned ones."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks_case import Case, CheckResult, close_gaps, fail, find_runs, judge
from dexplan.sim.judge.checks_closure import compute_closure_slack
from dexplan.sim.judge.world import Indices
from dexplan.spatial import Array


def check_rolling_error_max(case: Case) -> CheckResult:
    """Contacts on object and tip against pure rolling, for spheres of radii R and r.

    With the outward normal n_O at the contact and the tip's rotation relative to the object, w, rolling
    without sliding gives dn_O/dt = r/(R + r) w x n_O on the object and, with the direction m_F = -n seen from
    the tip, dm_F/dt = -R/(R + r) w x m_F. Both are integrated over each contact from its first sample and
    compared with the direction between the two centres.  A tip that bounces goes on rolling: gaps no longer
    than ``episode_gap_s`` do not start the measurement afresh.
    """
    name, limit, replay = "rolling_error_max", case.limit("rolling_error_max_deg"), case.replay
    R, r = replay.world.object_radius, replay.world.tip_radius
    worst, moment, label, measured = 0.0, None, "", False
    reach = round(case.limit("episode_gap_s") / case.sample_time)
    if not (np.isfinite(replay.object_pose).all() and np.isfinite(replay.tip_rotation).all()):
        return fail(name, "deg", "a pose is not a number", limit)
    if not case.sample_count or np.isnan(R):
        return fail(name, "deg", "there is nothing to measure", limit)
    R_WO = Rotation.from_quat(replay.object_pose[:, 3:], scalar_first=True)
    for k in range(case.finger_count):
        R_OF = R_WO.inv() * Rotation.from_matrix(replay.tip_rotation[:, k])
        centre = R_WO.inv().apply(replay.tip_position[:, k] - replay.object_pose[:, :3])
        n_O = centre / np.linalg.norm(centre, axis=1, keepdims=True)
        m_F = R_OF.inv().apply(-n_O)
        # Turn of the tip against the object from sample to sample, in object axes and in tip axes.
        step_O = (R_OF[1:] * R_OF[:-1].inv()).as_rotvec()
        step_F = (R_OF[:-1].inv() * R_OF[1:]).as_rotvec()
        share = r[k] / (R + r[k])
        for start, stop in find_runs(close_gaps(replay.contact_active[:, k], reach)):
            measured = True
            for kind, steps, seen, rate in (
                ("object", step_O, n_O, share),
                ("tip", step_F, m_F, share - 1.0),
            ):
                rolled = _roll(seen[start], rate * steps[start : stop - 1])
                error = np.degrees(_angles(rolled, seen[start:stop]))
                if error.max() > worst:
                    worst, moment = float(error.max()), float(replay.time[start + int(error.argmax())])
                    label = f"{replay.world.fingers[k]}, contact on the {kind}"
    if not measured:
        return fail(name, "deg", "no finger ever touches", limit)
    return judge(name, worst, limit, "deg", moment, label)


def check_roll_path_error_max(case: Case) -> CheckResult:
    """Every rolled way against the plan: contact on the object at every sample, contact and tip attitude at the end.

    On the way the contact is compared with the nearest place of the planned way, for the plan does not say when it is where.
    The attitude of the tip in the object, spin included, is what a way that was slid instead of rolled gets wrong.
    """
    name, limit, replay = "roll_path_error_max", case.limit("roll_path_error_max_deg"), case.replay
    action_index = case.column("action_index")
    if action_index is None:
        return fail(name, "deg", "the record has no action_index", limit)
    if not case.sample_count or not np.isfinite(replay.object_pose).all():
        return fail(name, "deg", "a pose is not a number or there are no samples", limit)
    R_WO = Rotation.from_quat(replay.object_pose[:, 3:], scalar_first=True)
    found: list[_RollError] = []
    for index, action in enumerate(case.plan["actions"]):
        samples = np.flatnonzero(action_index == index)
        for roll in action.get("rolls", ()):
            if roll["finger"] not in replay.world.fingers:
                return fail(name, "deg", f"action {index + 1} rolls a finger that the model lacks", limit)
            k = replay.world.fingers.index(roll["finger"])
            if not len(samples) or not replay.contact_active[samples, k].all():
                return fail(
                    name, "deg", f"{roll['finger']} lost contact or never rolled in action {index + 1}", limit
                )
            found += _compare_roll(case, R_WO, k, samples, roll)
    if not found:
        return judge(
            name, 0.0 if case.sample_count else np.nan, limit, "deg", note="the plan rolls no finger"
        )
    worst = max(found)
    note = "; ".join([worst.what, *_find_conservative(case)])
    return judge(name, worst.error_deg, limit, "deg", worst.time, note)


def check_tip_rotation_max(case: Case) -> CheckResult:
    """How far contacts go round on the tips, against the hand's rotation limit: the paper's gamma.

    The place on the tip where a contact set out is the pole of the paper's longitudes.  Seen from there, the contact's azimuth
    may change by gamma while it is away: for the manoeuvre A-B-C-D that is the equator leg B-C, for a rolling triangle its apex,
    and for a straight way nothing, however far it goes.  What comes by the tip's own pole sets out anew from there.
    """
    name, replay = "tip_rotation_max", case.replay
    limit = float(case.problem["hand"]["tip_rotation_limit_deg"]) + case.limit("tip_rotation_slack_deg")
    if not (np.isfinite(replay.object_pose).all() and np.isfinite(replay.tip_rotation).all()):
        return fail(name, "deg", "a pose is not a number", limit)
    if not replay.contact_active.any():
        return fail(name, "deg", "no finger ever touches", limit)
    near = np.radians(case.limit("tip_rotation_reach_deg"))
    gap = round(case.limit("contact_window_s") / case.sample_time)
    worst, moment, label = 0.0, None, "no contact went round on its tip"
    for k in range(case.finger_count):
        centre = replay.object_pose[:, :3] - replay.tip_position[:, k]
        seen = np.einsum("tji,tj->ti", replay.tip_rotation[:, k], centre)
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        for start, stop in find_runs(close_gaps(replay.contact_active[:, k], gap)):
            for part in _find_outsets(seen[start:stop], near):
                swept, sample = _measure_sweep(seen[start + part.first : start + part.last], part.about, near)
                if swept > worst:
                    worst, moment = swept, float(replay.time[start + part.first + sample])
                    label = replay.world.fingers[k]
    return judge(name, worst, limit, "deg", moment, label)


class _Outset(NamedTuple):
    """A part of a contact's way on its tip: samples ``first`` to ``last`` (exclusive), and the place (3,) where it set out."""

    first: int
    last: int
    about: Array


def _find_outsets(seen: Array, near: float) -> list[_Outset]:
    """Return the parts of a contact's way on its tip (T, 3); one ends where the contact comes by the pole."""
    pole_angle = np.arctan2(np.linalg.norm(seen[:, :2], axis=1), seen[:, 2])
    parts, first, about = [], 0, seen[0]
    for start, stop in find_runs(pole_angle < near):
        if np.arctan2(np.linalg.norm(about[:2]), about[2]) < near:
            continue
        nearest = start + int(pole_angle[start:stop].argmin())
        parts.append(_Outset(first, nearest + 1, about))
        first, about = nearest, seen[nearest]
    return [*parts, _Outset(first, len(seen), about)]


def _measure_sweep(seen: Array, about: Array, near: float) -> tuple[float, int]:
    """Return by how much [deg] the azimuth of ``seen`` (T, 3) about a place (3,) changes at most while it is farther than
    ``near`` [rad] from there, and the sample at which that is so.
    """
    aside = np.cross(about, np.eye(3)[int(np.abs(about).argmin())])
    aside /= np.linalg.norm(aside)
    x, y = seen @ aside, seen @ np.cross(about, aside)
    away = np.arctan2(np.hypot(x, y), seen @ about) > near
    worst, sample = 0.0, 0
    for start, stop in find_runs(away):
        azimuth = np.degrees(np.unwrap(np.arctan2(y[start:stop], x[start:stop])))
        grown = np.maximum.accumulate(azimuth) - np.minimum.accumulate(azimuth)
        if grown[-1] > worst:
            worst, sample = float(grown[-1]), start + int((grown >= grown[-1]).argmax())
    return worst, sample


def _find_conservative(case: Case) -> list[str]:
    """Return a note for every rolled-apart pair that could have held alone with the simulator's own friction.

    Planner and controller believe less friction than there is: rolling first is then caution, not need.
    """
    friction, notes = case.problem["friction"], []
    before = case.plan["start"]["contacts"]
    for action, following in pairwise(case.plan["actions"]):
        lifts = following["kind"] == "lift" and action["kind"] == "roll"
        pair = [before[finger] for finger in following["grasping"]] if lifts else []
        if len(pair) == 2 and None not in pair:
            points, normals = (np.array([c[key] for c in pair]) for key in ("point_O", "normal_O"))
            slack = compute_closure_slack(points, normals, friction["sliding"], friction["torsional_m"])
            if slack > 0.0:
                names = " and ".join(following["grasping"])
                notes.append(
                    f"conservative: with the simulator's friction {names} are force closed before they roll, by "
                    f"{np.degrees(slack):.1f} deg"
                )
        before = action["contacts_end"]
    return notes


class _RollError(NamedTuple):
    """An error [deg] of a rolled way, when [s], and of what.  Orders by the error."""

    error_deg: float
    time: float
    what: str


def _compare_roll(
    case: Case, R_WO: Rotation, k: int, samples: Indices, roll: dict[str, Any]
) -> list[_RollError]:
    """Return the largest errors of one rolled way."""
    replay, finger = case.replay, roll["finger"]
    points = replay.contact_point_O[samples, k]
    seen = points / np.linalg.norm(points, axis=1, keepdims=True)
    planned = np.array([pose[:3] for pose in roll["X_OF"]])
    if case.problem["object"].get("shape"):
        # On a ball the contact is where the tip's centre is seen from the origin; elsewhere a tip's radius under that centre.
        planned -= case.problem["hand"]["tip_radii_m"][k] * np.array(roll["normal_O"])
    planned /= np.linalg.norm(planned, axis=1, keepdims=True)
    # Dense enough for the nearest place to be known to a few thousandths of a degree.
    share = np.linspace(0.0, len(planned) - 1.0, 40 * (len(planned) - 1) + 1)
    dense = np.stack([np.interp(share, np.arange(len(planned)), column) for column in planned.T], axis=1)
    dense /= np.linalg.norm(dense, axis=1, keepdims=True)
    off = np.degrees(np.arccos(np.clip((seen @ dense.T).max(axis=1), -1.0, 1.0)))
    last = int(samples[-1])
    end = float(np.degrees(np.arccos(np.clip(seen[-1] @ planned[-1], -1.0, 1.0))))
    tip = R_WO[last].inv() * Rotation.from_matrix(replay.tip_rotation[last, k])
    turn = tip * Rotation.from_quat(roll["X_OF"][-1][3:], scalar_first=True).inv()
    time = replay.time
    turned, moment = float(np.degrees(turn.magnitude())), float(time[last])
    return [
        _RollError(
            float(off.max()), float(time[samples[int(off.argmax())]]), f"{finger}, contact off its way"
        ),
        _RollError(end, moment, f"{finger}, contact at the end of its way"),
        _RollError(turned, moment, f"{finger}, tip attitude at the end of its way"),
    ]


def _roll(direction: Array, steps: Array) -> Array:
    """Return the directions (N + 1, 3) that ``direction`` (3,) takes under the successive rotation vectors
    (N, 3).
    """
    out = np.empty((len(steps) + 1, 3))
    out[0] = direction
    matrices = Rotation.from_rotvec(steps).as_matrix() if len(steps) else np.zeros((0, 3, 3))
    for i, matrix in enumerate(matrices):
        out[i + 1] = matrix @ out[i]
    return out


def _angles(a: Array, b: Array) -> Array:
    """Return the angles (N,) [rad] between unit vectors (N, 3)."""
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=1) / 2, 0.0, 1.0))
