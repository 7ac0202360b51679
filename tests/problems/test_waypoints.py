"""Several goals in a row: each is asked of the object where the one before left it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dexplan.builders import build_goals
from dexplan.errors import ProblemError
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem
from dexplan.problems.words import describe_problem
from dexplan.spatial import make_pose, rotate_about

TURN = {"rotation": {"axis": [0, 0, 2], "angle_deg": 370}}
TILT = {"rotation": {"axis": [1, 0, 0], "angle_deg": 60}, "translation_m": [0.0, 0.0, 0.01]}
BACK = {"orientation_wxyz": [1, 0, 0, 0], "translation_m": [0.0, 0.002, -0.01]}


def read(goal: dict[str, Any]) -> Problem:
    return build_problem({"format": 1, "goal": goal}, "p.toml", "p")


def test_goals_follow_one_another(tmp_path: Path) -> None:
    problem = read({"waypoints": [TURN, TILT, BACK]})
    assert Problem.load(problem.save(tmp_path / "copy.toml")) == problem
    start = make_pose(rotate_about([0.0, 1.0, 0.0], 0.3), [0.0, 0.0, 0.16])
    turn, tilt, back = build_goals(problem, start)
    assert turn.angle == pytest.approx(np.radians(370.0))
    np.testing.assert_array_equal(tilt.X_WO_start, turn.X_WO_goal)
    np.testing.assert_array_equal(back.X_WO_start, tilt.X_WO_goal)
    np.testing.assert_allclose(back.X_WO_goal, make_pose(np.eye(3), [0.0, 0.002, 0.16]), atol=1e-12)
    words = dict(describe_problem(problem))["goal"]
    assert words.startswith(
        "turn the object by 370 deg about (0, 0, 2) of the world; then turn the object by 60 deg"
    )


def test_one_goal_is_a_row_of_one() -> None:
    problem = read(TILT)
    assert problem.goal.waypoints is None
    assert "waypoints" not in problem.as_dict()["goal"]
    (goal,) = build_goals(problem, np.eye(4))
    np.testing.assert_allclose(goal.X_WO_goal[:3, 3], [0.0, 0.0, 0.01])


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ({"waypoints": []}, "goal.waypoints: [] names no goal; accepted: a list of one or more"),
        ({"waypoints": [TILT], **TURN}, "goal.waypoints: given beside another motion; accepted: one of the two"),
        ({"waypoints": [TILT], "contacts_deg": [[0, 0], [180, 0], "free"]}, 'given for kind = "grasp_adjustment"'),
        ({"waypoints": [TILT, {**TILT, **BACK}]}, "goal.waypoints[1]: both rotation and orientation_wxyz"),
        ({"waypoints": [{"rotation": {"axis": [0, 0, 0], "angle_deg": 1}}]}, "goal.waypoints[0].rotation.axis: [0.0, 0.0, 0.0]"),
        ({"waypoints": [TILT, {"turn": 3}]}, "goal.waypoints[1].turn: unknown key 'turn'"),
        ({"waypoints": [{"translation_m": [0, 0, 11]}]}, "goal.waypoints[0].translation_m[2]: 11.0 is out of range"),
        ({"waypoints": TILT}, "goal.waypoints"),
    ],
)  # fmt: skip
def test_what_is_no_row_of_goals(goal: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemError) as caught:
        read(goal)
    assert words in str(caught.value)
