"""A dextrous manipulation in MuJoCo: a finger travels while two others turn the ball, then all three hold it at its goal."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from held_ball import make_case

from dexplan import pipeline
from dexplan.problems.read import load_problem
from dexplan.sim.judge.checks import check_reference_position
from dexplan.sim.judge.validate import NOT_APPLICABLE


def test_simultaneous_motion_passes_every_check() -> None:
    problem = load_problem(
        "hold_two",
        {
            "start.contacts_deg": [[-38.0, 0.0], [102.0, 0.0], "free"],
            "goal": {
                "kind": "dextrous_manipulation",
                "order": "simultaneous",
                "rotation": {"axis": [0.1, 0.0, 1.0], "angle_deg": 24.0},
                "contacts_deg": [[-38.0, 0.0], [102.0, 0.0], [205.0, 10.0]],
            },
        },
    )
    plan = pipeline.plan(problem)
    assert [a.name for a in plan.actions] == ["hold", "move_object", "place", "hold"]
    assert [way.finger for way in plan.actions[1].ways] == [2]
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    assert report.is_passed, report.table()
    value = report["contact_error_final"].value
    assert value is not None
    assert value < 0.5


@pytest.mark.parametrize(
    ("goal", "status"),
    [
        ({"kind": "object_manipulation"}, "fail"),
        ({"kind": "grasp_adjustment"}, "pass"),
        ({"kind": "grasp_adjustment", "keep_object": True}, "fail"),
    ],
)
def test_only_a_grasp_adjustment_may_leave_the_object_elsewhere(goal: dict[str, Any], status: str) -> None:
    """The plan ends 1 mm from where the problem wants the object."""
    case = make_case()
    problem = {**case.problem, "goal": {**case.problem["goal"], **goal, "translation_m": [0.0, 0.0, 1e-3]}}
    assert check_reference_position(replace(case, problem=problem)).status == status
    for name in ("position_error_final", "rotation_error_final"):
        assert NOT_APPLICABLE[name][0](problem) == (status == "pass")
