"""Several goals in a row are one plan: every piece begins with the grasp, tips and postures in which the one before ended."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.builders import build_goals
from dexplan.plans.actions import Hold, Relocate, Roll
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem

EGG = {"shape": {"kind": "ellipsoid", "semi_axes_m": [0.030, 0.030, 0.040]}, "mass_kg": 0.151}
RAISE = {"translation_m": [0.002, 0.004, 0.007]}
TURN = {"rotation": {"axis": [0.1, 0.0, 1.0], "angle_deg": 160.0}}
TILT = {"rotation": {"axis": [1.0, -0.4, 0.0], "angle_deg": 17.0}, "translation_m": [0.0, -0.004, -0.003]}
LEAN = {"rotation": {"axis": [1.0, -0.4, 0.2], "angle_deg": -12.0}}
AWAY = {"translation_m": [0.0, 0.0, 0.5]}


def read(waypoints: list[dict[str, Any]], thing: dict[str, Any]) -> Problem:
    return build_problem({"format": 1, "object": thing, "goal": {"waypoints": waypoints}}, "p.toml", "p")


def check_chain(plan: Plan) -> None:
    """Assert that objects and tips are everywhere where the action before left them."""
    before, X_WO = plan.start_contacts, plan.X_WO_start
    for action in plan.actions:
        np.testing.assert_allclose(action.motion.X_WO_start, X_WO, atol=1e-9)
        moved = {action.finger} if isinstance(action, Relocate) else {r.finger for r in action.rolls}
        for a, b in zip(before, action.contacts_end, strict=True):
            finger = next((c.finger for c in (a, b) if c is not None), None)
            if finger is None or finger in moved or isinstance(action, Roll):
                continue
            assert a is not None
            assert b is not None
            np.testing.assert_allclose(a.X_OF, b.X_OF, atol=1e-6)
        before, X_WO = action.contacts_end, action.X_WO_end


@pytest.mark.parametrize(("thing", "row"), [({}, [TURN, LEAN]), (EGG, [TILT, RAISE])], ids=["ball", "egg"])
def test_goals_are_reached_in_a_row(thing: dict[str, Any], row: list[dict[str, Any]]) -> None:
    problem = read(row, thing)
    plan = pipeline.plan(problem)
    assert plan.is_solved, plan.reason
    check_chain(plan)
    # The ball's turn takes gaits: what follows begins with another grasp than the first.
    assert bool(thing) or any(isinstance(action, Relocate) for action in plan.actions)
    holds = [action for action in plan.actions if isinstance(action, Hold)]
    assert len(holds) == 1 + len(row)
    assert [hold.why for hold in holds[1:-1]] == [
        f"waypoint {k} of {len(row)} is reached" for k in range(1, len(row))
    ]
    for hold, goal in zip(holds[1:], build_goals(problem, plan.X_WO_start), strict=True):
        np.testing.assert_allclose(hold.X_WO_end, goal.X_WO_goal, atol=1e-9)
    assert np.array_equal(plan.X_WO_goal, goal.X_WO_goal)


def test_a_row_says_how_far_it_came() -> None:
    plan = pipeline.plan(read([LEAN, AWAY, TILT], {}))
    assert plan.status is Status.GOAL_UNREACHABLE
    assert plan.reason.startswith("waypoint 2 of 3: no two fingers can hold the object at the goal")
    assert plan.statistics["waypoints"] == 1
    assert isinstance(plan.actions[-1], Hold)
    assert plan.actions[-1].why == "waypoint 1 of 3 is reached"
