"""``[margins]`` of a problem: they reach planner and controller, plans keep them, and the judge's limits do not move."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.control.options import ControlOptions
from dexplan.planning.admissible.limits import AdmissibleLimits
from dexplan.plans.plan import Plan
from dexplan.problems.as_run import PROBLEM, describe_run
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem


def _build_limits(problem: Problem) -> AdmissibleLimits:
    return pipeline.build_limits(problem, pipeline.build_squeeze(problem, pipeline.build_scene(problem)))


def test_a_problem_that_asks_for_none_has_the_usual_ones() -> None:
    problem = load_problem("hold_two")
    assert _build_limits(problem) == AdmissibleLimits()
    assert pipeline.build_options(problem).torque_fraction == ControlOptions(1.0, 1.0).torque_fraction


def test_what_is_asked_for_reaches_planner_and_controller() -> None:
    changes = {"joint_deg": 8.0, "clearance_mm": 3.5, "cone_share": 0.9, "torque_share": 0.5}
    problem = load_problem("hold_two", {f"margins.{key}": value for key, value in changes.items()})
    limits = _build_limits(problem)
    assert np.degrees(limits.joint_margin) == pytest.approx(8.0)
    assert limits.travel_margin == AdmissibleLimits.travel_margin
    assert (limits.clearance, limits.cone_share, limits.torque_share) == pytest.approx((0.0035, 0.9, 0.5))
    assert pipeline.build_options(problem).torque_fraction == pytest.approx(0.57)
    assert describe_run(problem, {})[PROBLEM]["margins"] == changes
    assert (
        describe_run(problem, {})[PROBLEM]["acceptance"] == load_problem("hold_two").as_dict()["acceptance"]
    )


def test_free_fingers_keep_no_more_than_holding_ones() -> None:
    limits = _build_limits(load_problem("hold_two", {"margins.joint_deg": 1.5}))
    assert limits.travel_margin == limits.joint_margin == pytest.approx(np.radians(1.5))


TURN = {"goal.rotation.angle_deg": 180.0, "gait.improvement": 0.0}


def _find_worst(plan: Plan, margin: str) -> float:
    """Return the least of a margin over a plan; of the share of torque, which is the better the less, the greatest, negated."""
    sign = -1.0 if margin == "torque_share" else 1.0
    return min(sign * action.margins[margin] for action in plan.actions if margin in action.margins)


@pytest.fixture(scope="module")
def usual() -> Plan:
    return pipeline.plan(load_problem("fig4_substitution", TURN))


@pytest.mark.parametrize(
    ("key", "value", "margin", "least"),
    [
        ("margins.joint_deg", 36.0, "joint_deg", 36.0),
        ("margins.clearance_mm", 4.0, "clearance_mm", 4.0),
        ("margins.torque_share", 0.6, "torque_share", -0.6),
    ],
)
def test_plans_keep_what_is_asked_for(usual: Plan, key: str, value: float, margin: str, least: float) -> None:
    """The usual plan would not do, or this would say nothing."""
    asked = pipeline.plan(load_problem("fig4_substitution", {**TURN, key: value}))
    assert asked.is_solved, asked.reason
    assert _find_worst(usual, margin) < least <= _find_worst(asked, margin) + 1e-9


def test_a_smaller_share_of_the_cone_refuses_a_start_that_uses_more() -> None:
    plan = pipeline.plan(load_problem("fig4_substitution", {**TURN, "margins.cone_share": 0.9}))
    assert plan.status == "start_inadmissible"
    assert not plan.actions
