"""The judge asks for every waypoint at the hold that marks it, and takes the poses from the problem alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from held_ball import make_case, make_problem

from dexplan.sim.judge.checks import check_position_error_final, check_rotation_error_final
from dexplan.sim.judge.checks_case import Case
from dexplan.sim.judge.checks_files import check_files_agree
from dexplan.sim.judge.goals import compute_goal_poses, find_moments

STAY: dict[str, Any] = {}
UP = {"translation_m": [0.0, 0.0, 0.002]}
DOWN = {"rotation": {"axis": [0.0, 0.0, 2.0], "angle_deg": 360.0}, "translation_m": [0.0, 0.0, -0.002]}


def make_row(waypoints: list[dict[str, Any]], lift: float) -> Case:
    """Return the held ball with a plan that settles, holds in samples 100 to 150 ``lift`` [m] higher, and holds at home."""
    case = make_case()
    plan = {**case.plan, "actions": [dict(case.plan["actions"][0]) for _ in range(3)]}
    raised = [*case.plan["start"]["object_pose"]]
    raised[2] += lift
    plan["actions"][1].update(object_pose_start=raised, object_pose_end=raised)
    action = np.repeat([0, 1, 2], [100, 50, case.sample_count - 150])
    pose = np.array(case.replay.object_pose)
    pose[100:150, 2] += lift
    problem = make_problem(goal={"rotation": None, "waypoints": waypoints})
    columns = {**case.columns, "action_index": action, "phase_index": 0 * action}
    return replace(
        case, plan=plan, problem=problem, columns=columns, replay=replace(case.replay, object_pose=pose)
    )


def test_every_waypoint_is_judged_at_its_hold() -> None:
    case = make_row([UP, DOWN], 0.002)
    np.testing.assert_allclose(compute_goal_poses(case)[:, 2], [0.162, 0.160])
    assert find_moments(case) == [149, case.sample_count - 1]
    assert check_position_error_final(case).status == "pass"
    assert check_rotation_error_final(case).status == "pass"
    pose = np.array(case.replay.object_pose)
    pose[149, 0] += 0.02
    missed = check_position_error_final(replace(case, replay=replace(case.replay, object_pose=pose)))
    assert missed.status == "fail"
    assert missed.value == pytest.approx(20.0, abs=0.5)
    assert missed.note == "waypoint 1 of 2"
    assert missed.worst_time_s == case.replay.time[149]


def test_a_waypoint_without_a_hold_fails() -> None:
    case = make_row([UP, DOWN], 0.001)
    for check in (check_position_error_final, check_rotation_error_final):
        result = check(case)
        assert (result.status, result.note) == ("fail", "waypoint 1 of 2 is marked by no hold")
    assert "the plan holds nowhere at waypoint 1 of 2" in check_files_agree(case).note


def test_one_hold_marks_one_waypoint() -> None:
    assert find_moments(make_row([STAY, STAY], 0.0))[0] == 149
    assert find_moments(make_row([STAY, STAY, STAY, STAY], 0.0))[2] is None
