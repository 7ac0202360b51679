"""Every check has a run that fails it: another simulation where that is easy, a tampered replay elsewhere."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from held_ball import (
    AZIMUTHS,
    HOME,
    RADIUS,
    TIP,
    make_case,
    make_contacts,
    make_plan,
    make_problem,
    record,
    slide,
    solve_posture,
)
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks import compute_twist
from dexplan.sim.judge.checks_case import Case, find_runs, widen
from dexplan.sim.judge.checks_closure import compute_closure_slack, compute_load_margin
from dexplan.sim.judge.replay import OtherContact
from dexplan.sim.judge.validate import CHECKS, NOT_APPLICABLE, load_default_limits, run_checks
from dexplan.spatial import as_pose7, make_pose, rotate_about

NAMES = [name for name, _ in CHECKS]


@lru_cache
def held() -> Case:
    """A ball held still for one second."""
    return make_case()


@lru_cache
def dropped() -> Case:
    """The fingers open and the ball falls onto the floor."""
    _, hold = solve_posture()
    open_hand = hold.copy()
    open_hand[2::6] += 0.5
    return make_case(record(ctrl=np.concatenate([np.tile(hold, (50, 1)), np.tile(open_hand, (200, 1))])))


@lru_cache
def sheared() -> Case:
    """Wrists turn the tips on the spot: the contacts are sheared until they slide."""
    _, hold = solve_posture()
    ctrl = np.tile(hold, (250, 1))
    ctrl[:, 0::6] += np.linspace(0.0, 1.2, 250)[:, None] * np.array([1.0, -1.0, 0.0])
    return make_case(record(ctrl=ctrl))


@lru_cache
def dragged() -> Case:
    """One finger sweeps sideways until its tip, and the ball under the others, slide."""
    _, hold = solve_posture()
    ctrl = np.tile(hold, (250, 1))
    ctrl[:, 0] += np.linspace(0.0, 0.1, 250)
    return make_case(record(ctrl=ctrl))


def planned_roll() -> Case:
    """The plan lets finger 1 roll by 10 degrees; in the run it holds still."""
    pose = as_pose7(
        make_pose(rotate_about([0.0, 0.0, 1.0], np.radians(10.0)), [0.0522, 0.0092, 0.0])
    ).tolist()
    plan = make_plan()
    first = as_pose7(make_pose(None, [0.053, 0.0, 0.0])).tolist()
    plan["actions"][0]["rolls"] = [{"finger": "finger_1", "X_OF": [first, pose]}]
    return replace(held(), plan=plan)


@lru_cache
def squeezed() -> Case:
    """One finger presses with all its elbow can give."""
    _, hold = solve_posture()
    ctrl = np.tile(hold, (50, 1))
    ctrl[:, 2] -= 1.0
    return make_case(record(ctrl=ctrl))


def with_replay(**changes: Any) -> Case:
    """Return the held case with changed replay columns."""
    return replace(held(), replay=replace(held().replay, **changes))


def with_columns(**changes: Any) -> Case:
    """Return the held case with changed recorded columns."""
    return replace(held(), columns={**held().columns, **changes})


def with_problem(**sections: Any) -> Case:
    """Return the held case judged by another problem."""
    return replace(held(), problem=make_problem(**sections))


def leap() -> np.ndarray:
    """Return a rise (250, 1) within 0.1 s from 0 to 1 m: at 0.5 s it asks for 440 m/s^2."""
    share = np.clip((held().replay.time[:, None] - 0.4865) / 0.1, 0.0, 1.0)
    return share**2 * (3.0 - 2.0 * share)


def changed(array: np.ndarray, index: Any, value: Any) -> np.ndarray:
    """Return a copy of ``array`` with one entry set."""
    out = np.array(array)
    out[index] = value
    return out


def about_z(degrees: np.ndarray) -> Rotation:
    """Return turns (T,) about the vertical."""
    return Rotation.from_rotvec(np.outer(np.radians(degrees), [0.0, 0.0, 1.0]))


def turned_reference(degrees: np.ndarray) -> np.ndarray:
    """Return reference poses turned about the vertical."""
    pose = np.tile(HOME, (len(degrees), 1))
    pose[:, 3:] = about_z(degrees).as_quat(scalar_first=True)
    return pose


def plan_with_contacts(azimuths: dict[str, float]) -> dict[str, Any]:
    """Return the hold with other planned contacts, held by the fingers named."""
    plan = make_plan()
    plan["start"]["contacts"] = plan["actions"][0]["contacts_end"] = make_contacts(azimuths)
    plan["actions"][0]["grasping"] = list(azimuths)
    return plan


def spun_tip() -> np.ndarray:
    """Return tip rotations of a finger that turns by 10 deg on the spot, as a sliding tip does."""
    turn = about_z(np.linspace(0, 10, len(held().replay.time))).as_matrix()
    rotation = np.array(held().replay.tip_rotation)
    rotation[:, 0] = turn @ rotation[:, 0]
    return rotation


def rounded_tip() -> np.ndarray:
    """Return tip rotations of a finger whose contact goes out on the tip by 30 deg, round by 80 deg, and back."""
    time = np.linspace(0.0, 3.0, len(held().replay.time))
    out, around = np.interp(time, [0, 1, 2, 3], [0, 30, 30, 0]), np.interp(time, [0, 1, 2, 3], [0, 0, 80, 80])
    rotation = np.array(held().replay.tip_rotation)
    inward = held().replay.object_pose[0, :3] - held().replay.tip_position[0, 0]
    first = rotation[0, 0].T @ inward / np.linalg.norm(inward)
    aside = np.cross(first, [0.0, 1.0, 0.0]) / np.linalg.norm(np.cross(first, [0.0, 1.0, 0.0]))
    axes = Rotation.from_rotvec(np.radians(around)[:, None] * first).apply(aside)
    rotation[:, 0] = rotation[:, 0] @ Rotation.from_rotvec(-np.radians(out)[:, None] * axes).as_matrix()
    return rotation


def free_third() -> Case:
    """A plan by which finger 3 must not touch, while it is near."""
    table = {"finger_1": "must", "finger_2": "must", "finger_3": "must_not"}
    return replace(held(), plan=make_plan([table]))


def edited_plan(change: Callable[[dict[str, Any]], Any], **sections: Any) -> Case:
    """Return the held case with its plan edited, perhaps judged by another problem."""
    plan = copy.deepcopy(make_plan())
    change(plan)
    return replace(held(), plan=plan, problem=make_problem(**sections))


R = "replay"
FAILURES: list[tuple[str, str, Callable[[], Case]]] = [
    ("replay_matches", "one bit", lambda: with_columns(qpos=np.nextafter(held().replay.qpos, 9.0))),
    ("replay_matches", "nan", lambda: with_columns(qpos=changed(held().replay.qpos, (9, 3), np.nan))),
    ("replay_matches", "shape", lambda: with_columns(qpos=held().replay.qpos[:-1])),
    ("trace_consistent", "force", lambda: with_columns(contact_force=held().replay.contact_force * 1.01)),
    ("trace_consistent", "time", lambda: with_columns(time=held().replay.time * 1.1)),
    ("trace_consistent", "active", lambda: with_columns(contact_active=~held().replay.contact_active)),
    ("trace_consistent", "point", lambda: with_columns(contact_point_O=held().replay.contact_point_O + 1e-3)),
    ("physics_untouched", "heavier", lambda: with_problem(object={"mass_kg": 0.05})),
    ("files_agree", "status", lambda: edited_plan(lambda p: p.update(status="no_gait"))),
    ("files_agree", "no actions", lambda: edited_plan(lambda p: p.update(actions=[]))),
    ("files_agree", "fingers", lambda: edited_plan(lambda p: p.update(fingers=["a", "b", "c"]))),
    ("files_agree", "kind", lambda: edited_plan(lambda p: p["goal"].update(kind="grasp_adjustment"))),
    (
        "files_agree",
        "start",
        lambda: edited_plan(lambda p: p["start"].update(object_pose=[*HOME[:2], 0.17, *HOME[3:]])),
    ),
    ("files_agree", "goal", lambda: with_problem(goal={"translation_m": [0.0, 0.0, 0.01]})),
    (
        "files_agree",
        "whole turns",
        lambda: with_problem(goal={"rotation": {"axis": [0, 0, 1], "angle_deg": 360.0}}),
    ),
    (
        "files_agree",
        "start contacts",
        lambda: with_problem(start={"contacts_deg": [[1.0, 0], [120.0, 0], [240.0, 0]]}),
    ),
    (
        "files_agree",
        "free at the start",
        lambda: with_problem(start={"contacts_deg": [[0, 0], [120, 0], "free"]}),
    ),
    (
        "files_agree",
        "goal contacts",
        lambda: with_problem(goal={"contacts_deg": [[0, 0], [120, 0], [242, 0]]}),
    ),
    (
        "files_agree",
        "chain",
        lambda: edited_plan(
            lambda p: p["actions"].append({**p["actions"][0], "object_pose_start": [0.01, *HOME[1:]]})
        ),
    ),
    ("files_agree", "told by the folder", lambda: replace(held(), contradictions=("two models",))),
    ("phases_in_order", "no such", lambda: with_columns(action_index=np.ones(250, dtype=int))),
    ("phases_in_order", "left out", lambda: replace(held(), plan=make_plan([{}, {}]))),
    (
        "phases_in_order",
        "back",
        lambda: replace(
            with_columns(phase_index=np.repeat([0, 1, 0], [100, 100, 50])), plan=make_plan([{}, {}])
        ),
    ),
    (
        "reference_position_error_max",
        "drifts in a hold",
        lambda: with_columns(object_pose_reference=changed(held().reference, (100, 0), 1e-3)),
    ),
    (
        "reference_rotation_error_max",
        "drifts in a hold",
        lambda: with_columns(object_pose_reference=turned_reference(np.linspace(0, 5, 250))),
    ),
    (
        "reference_rotation_error_max",
        "goal missed",
        lambda: with_problem(goal={"rotation": {"axis": [0, 0, 1], "angle_deg": 90.0}}),
    ),
    (
        "reference_speed_max",
        "jump",
        lambda: with_columns(object_pose_reference=turned_reference(np.repeat([0.0, 1.0], 125))),
    ),
    ("object_support_other", "floor", dropped),
    ("not_dropped", "dropped", dropped),
    ("position_error_max", "dropped", dropped),
    (
        "rotation_error_max",
        "reference turns away",
        lambda: with_columns(object_pose_reference=turned_reference(np.linspace(0, 2, 250))),
    ),
    ("position_error_final", "dropped", dropped),
    ("position_error_final", "elsewhere", lambda: with_problem(goal={"translation_m": [0.0, 0.0, 0.01]})),
    (
        "rotation_error_final",
        "attitude",
        lambda: with_problem(goal={"rotation": None, "orientation_wxyz": [0.0, 0.0, 0.0, 1.0]}),
    ),
    (
        "turned_angle",
        "a whole turn short",
        lambda: with_problem(goal={"rotation": {"axis": [0, 0, 1], "angle_deg": 360.0}}),
    ),
    (
        "contact_error_final",
        "elsewhere",
        lambda: with_problem(goal={"contacts_deg": [[0.0, 0.0], [123.0, 0.0], [240.0, 0.0]]}),
    ),
    (
        "contact_error_final",
        "should be off",
        lambda: with_problem(goal={"contacts_deg": [[0.0, 0.0], [120.0, 0.0], "free"]}),
    ),
    ("contact_schedule", "dropped", dropped),
    ("contact_schedule", "must not", free_third),
    (
        "contact_schedule",
        "window",
        lambda: replace(
            held(), plan=make_plan([{"finger_1": "must", "finger_2": "must", "finger_3": "may"}])
        ),
    ),
    (
        "finger_order_kept",
        "two tips swapped",
        lambda: with_replay(tip_position=held().replay.tip_position[:, [1, 0, 2]]),
    ),
    (
        "plan_force_closure",
        "pair too near",
        lambda: replace(held(), plan=plan_with_contacts({"finger_1": 0.0, "finger_2": 130.0})),
    ),
    ("plan_force_closure", "one finger", lambda: replace(held(), plan=plan_with_contacts({"finger_1": 0.0}))),
    (
        "plan_load_margin",
        "barely closed",
        lambda: replace(held(), plan=plan_with_contacts({"finger_1": 0.0, "finger_2": 134.5})),
    ),
    ("force_qp_feasible", "status", lambda: with_columns(qp_status=changed(np.zeros(250), 7, 1))),
    ("force_qp_feasible", "residual", lambda: with_columns(qp_wrench_residual=np.full(250, 0.03 * 0.5886))),
    (
        "force_qp_feasible",
        "too slippery",
        lambda: with_replay(contact_friction=0.01 * held().replay.contact_friction),
    ),
    (
        "force_qp_feasible",
        "ceiling",
        lambda: replace(held(), plan={**make_plan(), "normal_ceiling_N": 0.1}),
    ),
    (
        "force_qp_feasible",
        "reference leaps",
        lambda: with_columns(object_pose_reference=held().reference + np.eye(7)[2] * leap()),
    ),
    ("force_qp_feasible", "nan", lambda: with_columns(qp_wrench_residual=np.full(250, np.nan))),
    (
        "force_cone_margin_min",
        "torsion",
        lambda: with_columns(
            contact_force_reference=changed(held().replay.contact_force, (9, 1, 3), 40.0 * 0.0025 / 1.3)
        ),
    ),
    ("friction_utilisation_max", "slides", sheared),
    ("friction_utilisation_max", "belief too high", lambda: with_problem(friction={"sliding": 0.05})),
    ("coulomb_slip_max", "slides", sheared),
    ("creep_rate_max", "creeps", lambda: slide(held(), 3e-6)),
    (
        "creep_rate_max",
        "creeps while moving",
        lambda: slide(with_columns(object_pose_reference=turned_reference(np.linspace(0, 1, 250))), 3e-5),
    ),
    ("rolling_error_max", "slides", dragged),
    ("roll_path_error_max", "stays where it is", planned_roll),
    (
        "contact_region_error_max",
        "elsewhere",
        lambda: with_problem(object={"allowed_regions": [{"axis": [0.0, 0.0, 1.0], "half_angle_deg": 80.0}]}),
    ),
    (
        "edge_distance_min",
        "beside an edge",
        lambda: with_problem(object={"shape": {"kind": "box", "half_sizes_m": [RADIUS, 0.0025, 0.03]}}),
    ),
    ("rolling_error_max", "turns on the spot", lambda: with_replay(tip_rotation=spun_tip())),
    ("penetration_max", "deep", lambda: with_replay(penetration=held().replay.penetration + 2e-4)),
    (
        "tip_contact_angle_max",
        "rim",
        lambda: with_replay(tip_contact_angle=held().replay.tip_contact_angle + 1.5),
    ),
    ("tip_rotation_max", "goes round", lambda: with_replay(tip_rotation=rounded_tip())),
    (
        "force_prediction_error",
        "overestimates",
        lambda: with_columns(contact_force_reference=held().replay.contact_force * 1.05),
    ),
    (
        "force_prediction_error",
        "no plan",
        lambda: with_columns(contact_force_reference=np.full((250, 3, 4), np.nan)),
    ),
    ("tip_tracking_error_max", "lags", lambda: with_columns(tip_tracking_error=np.full(250, 1e-3))),
    ("ik_at_limit", "stuck", lambda: with_columns(ik_at_limit=changed(np.zeros(250), 5, 1))),
    ("free_finger_clearance_min", "near", free_third),
    ("unexpected_contacts", "floor", dropped),
    (
        "unexpected_contacts",
        "links",
        lambda: with_replay(
            other_contacts=(OtherContact(3, ("finger_1/stem", "finger_2/link_4"), 1.0, 0.0),)
        ),
    ),
    (
        "joint_limit_margin_min",
        "at a stop",
        lambda: with_replay(qpos=changed(held().replay.qpos, (5, 0), 1.49)),
    ),
    ("torque_utilisation_max", "saturated", squeezed),
]


def test_held_ball_passes_every_check() -> None:
    everywhere = [{"axis": [0.0, 0.0, 1.0], "half_angle_deg": 180.0}]
    problem = make_problem(
        goal={"contacts_deg": [[a, 0.0] for a in AZIMUTHS]}, object={"allowed_regions": everywhere}
    )
    results = run_checks(replace(held(), problem=problem))
    # A ball has no edges.
    assert [r.name for r in results if r.status != "pass"] == ["edge_distance_min"]
    assert [r.name for r in results] == NAMES


@pytest.mark.parametrize(("name", "how", "build"), FAILURES, ids=[f"{n}: {h}" for n, h, _ in FAILURES])
def test_check_fails(name: str, how: str, build: Callable[[], Case]) -> None:
    result = dict(CHECKS)[name](build())
    assert (result.name, result.status) == (name, "fail")


def test_every_check_has_a_failure() -> None:
    assert {name for name, _, _ in FAILURES} == set(NAMES)


def test_not_applicable_comes_from_the_problem() -> None:
    case = with_problem(goal={"rotation": None, "orientation_wxyz": HOME[3:], "contacts_deg": None})
    idle = {r.name for r in run_checks(case) if r.status == "not_applicable"}
    goal = {"turned_angle", "contact_error_final"}
    assert idle == {*goal, "contact_region_error_max", "edge_distance_min"} <= set(NOT_APPLICABLE)


@pytest.mark.parametrize("samples", [1, 2, 7])
def test_short_runs_are_judged(samples: int) -> None:
    results = run_checks(make_case(record(samples=samples)))
    assert all(r.status == "fail" for r in results if r.name == "creep_rate_max")
    assert len(results) == len(NAMES)


REPLAYED = ("object_pose", "tip_position", "contact_point_O", "contact_force", "contact_slip_velocity")


@pytest.mark.parametrize(
    "column", [*REPLAYED, "penetration", "tip_contact_angle", "actuator_force", "clearance"]
)
def test_nan_never_passes(column: str) -> None:
    values = np.full_like(getattr(held().replay, column), np.nan)
    assert any(r.status == "fail" for r in run_checks(with_replay(**{column: values})))


@pytest.mark.parametrize("column", ["object_pose_reference", "action_index", "contact_force_reference"])
def test_nan_in_the_record_never_passes(column: str) -> None:
    values = np.full(held().columns[column].shape, np.nan)
    assert any(r.status == "fail" for r in run_checks(with_columns(**{column: values})))


def test_limits_hold_for_the_portable_profile() -> None:
    case = slide(held(), 3e-6)
    portable = replace(case, problem=make_problem(control={"physics_profile": "portable"}))
    check = dict(CHECKS)["creep_rate_max"]
    assert (check(case).status, check(portable).status) == ("fail", "pass")
    assert check(portable).limit == pytest.approx(4.0)


def schedule(required: list[str], active: list[bool]) -> float | None:
    """Return the count of the schedule check for one finger's demands and touches, one tenth of a second
    each.
    """
    T = len(required) * 25
    table = [{"finger_1": r, "finger_2": "must", "finger_3": "must"} for r in required]
    touches = changed(np.ones((T, 3), dtype=bool), (slice(None), 0), np.repeat(active, 25))
    case = make_case(record(samples=T), plan=make_plan(table))
    columns = {**case.columns, "phase_index": np.repeat(np.arange(len(required)), 25)}
    case = replace(case, columns=columns, replay=replace(case.replay, contact_active=touches))
    return dict(CHECKS)["contact_schedule"](case).value


@pytest.mark.parametrize(
    ("required", "active", "is_kept"),
    [
        # A touch within the window's last quarter of a second, with a bounce; approaching may take as long as
        # it likes.
        (["must_not", *["may"] * 5, "must"], [0, 0, 0, 0, 1, 0, 1], True),
        (["must_not", *["may"] * 5, "must"], [0, 0, 0, 0, 1, 1, 1], True),
        (["must_not", *["may"] * 5, "must"], [0, 0, 1, 0, 0, 1, 1], False),
        (["must", *["may"] * 4, "must_not"], [1, 1, 0, 1, 0, 0], False),
        (["must", *["may"] * 4, "must_not"], [1, 1, 1, 0, 0, 0], True),
    ],
)
def test_touch_window(required: list[str], active: list[int], is_kept: bool) -> None:
    wrong = schedule(required, [bool(a) for a in active])
    assert (wrong == 0) == is_kept


def test_quiet_keeps_its_distance() -> None:
    active = changed(held().replay.contact_active, (slice(125, None), 0), False)
    quiet = with_replay(contact_active=active).quiet
    assert find_runs(~quiet) == [(99, 152)]


def test_widen_spreads_both_ways() -> None:
    assert widen(np.arange(7) == 3, 2).tolist() == [False, True, True, True, True, True, False]


def rolled_case(slide_share: float) -> Case:
    """Return a tip that rolls 30 deg around the ball's equator; the share of its spin that is slid away
    instead.
    """
    T = 200
    phi = np.radians(np.linspace(0, 30, T))
    direction = np.stack([np.cos(phi), np.sin(phi), np.zeros(T)], axis=1)
    # Pure rolling on a resting ball: the tip turns (R + r)/r times as fast as its centre goes round.
    spin = (1 - slide_share) * phi * (RADIUS + TIP) / TIP
    tip = about_z(np.degrees(spin)) * Rotation.from_euler("y", -90, degrees=True)
    base = make_case(record(samples=T)).replay
    position, rotation = np.array(base.tip_position), np.array(base.tip_rotation)
    position[:, 0] = base.object_pose[0, :3] + (RADIUS + TIP) * direction
    rotation[:, 0] = tip.as_matrix()
    rolled = replace(
        base, tip_position=position, tip_rotation=rotation, object_pose=np.tile(base.object_pose[0], (T, 1))
    )
    return replace(held(), replay=rolled)


@pytest.mark.parametrize("gamma", [60.0, 75.0, 85.0])
def test_a_tip_goes_round_as_far_as_the_problem_lets_it(gamma: float) -> None:
    """Out and back is no rotation, however far; what is rolled across is, seen from where the contact set out."""
    tampered = replace(
        with_problem(hand={"tip_rotation_limit_deg": gamma}).replay, tip_rotation=rounded_tip()
    )
    case = replace(with_problem(hand={"tip_rotation_limit_deg": gamma}), replay=tampered)
    found = dict(CHECKS)["tip_rotation_max"](case)
    assert found.value == pytest.approx(80.0, abs=0.3)
    assert found.status == ("pass" if gamma > 80.0 else "fail")
    assert found.limit == pytest.approx(gamma + load_default_limits()["tip_rotation_slack_deg"])


def test_rolling_is_told_from_sliding() -> None:
    check = dict(CHECKS)["rolling_error_max"]
    pure, slid = check(rolled_case(0.0)), check(rolled_case(0.1))
    assert pure.status == "pass"
    assert pure.value == pytest.approx(0.0, abs=1e-3)
    # A tenth of 30 deg was slid: the contacts on ball and tip are both that far from where rolling takes
    # them.
    assert slid.value == pytest.approx(3.0, rel=0.02)


def test_turned_angle_counts_whole_turns() -> None:
    T = 250
    pose = np.tile(held().replay.object_pose[0], (T, 1))
    pose[:, 3:] = about_z(np.linspace(0, 800, T)).as_quat(scalar_first=True)
    goal = {"rotation": {"axis": [0, 0, 2], "angle_deg": 800.0}}
    case = replace(with_replay(object_pose=pose), problem=make_problem(goal=goal))
    assert dict(CHECKS)["turned_angle"](case).value == pytest.approx(0.0, abs=1e-6)


def pair(phi_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points and outward normals of two equatorial contacts."""
    phi = np.radians([0.0, phi_deg])
    normals = np.stack([np.cos(phi), np.sin(phi), np.zeros(2)], axis=1)
    return RADIUS * normals, normals


@pytest.mark.parametrize(("mu", "phi_min"), [(0.3, 146.60151), (0.5, 126.86990), (0.8, 102.68038)])
def test_closure_of_a_pair(mu: float, phi_min: float) -> None:
    slack = np.degrees(compute_closure_slack(*pair(phi_min + 2.0), mu, 0.0025))
    assert slack == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(
    ("azimuths", "is_closed"), [((0, 60, 150), True), ((0, 40, 80), False), ((0, 120, 240), True)]
)
def test_closure_of_three(azimuths: tuple[float, ...], is_closed: bool) -> None:
    a = np.radians(azimuths)
    normals = np.stack([np.cos(a), np.sin(a), np.zeros(3)], axis=1)
    assert (compute_closure_slack(RADIUS * normals, normals, 0.5, 0.0025) > 0) == is_closed


@pytest.mark.parametrize("phi", [136.0, 140.0, 150.0])
def test_load_margin_of_a_pair_is_the_closed_form(phi: float) -> None:
    mu, mu_t, squeeze, weight = 0.55 / 1.3, 0.0025 / 1.3, 10.0, 0.06 * 9.81
    beta = np.radians(90 - phi / 2)
    need = (weight / (2 * mu)) ** 2 + (weight * RADIUS * np.tan(beta) / (2 * mu_t)) ** 2
    expected = 1 - np.sqrt(need / squeeze**2 + (np.tan(beta) / mu) ** 2)
    margin = compute_load_margin(*pair(phi), np.array([0.0, 0.0, -weight]), mu, mu_t, squeeze)
    assert margin == pytest.approx(expected, abs=2e-3)


def test_every_limit_is_a_number() -> None:
    assert all(isinstance(value, bool | int | float) for value in load_default_limits().values())


def test_twist_starts_within_half_a_turn_whichever_quaternion_says_so() -> None:
    angles = np.radians(np.linspace(0.0, 400.0, 81))
    quat = np.stack([np.cos(angles / 2), 0 * angles, 0 * angles, np.sin(angles / 2)], axis=1)
    for sign in (1.0, -1.0):
        turns = Rotation.from_quat(sign * quat, scalar_first=True)
        assert np.allclose(compute_twist(turns, [0.0, 0.0, 2.0]), angles, atol=1e-9)
