"""Figure 3, frames 1 to 2, in MuJoCo: rolling makes a pair of three contacts of which no two hold, and why it is needed."""

from __future__ import annotations

import pytest
from short_runs import failed

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.witness.three_to_two import build_three_to_two


def make_plan(problem: Problem, *, rolls: bool) -> Plan:
    """Return the plan that holds with three fingers, perhaps rolls, lifts the third, and holds with two."""
    plan, why = build_three_to_two(problem, is_early=not rolls)
    assert plan is not None, why
    return plan


def ring(**changes: object) -> Problem:
    return load_problem("hold_three", changes)


def test_rolling_makes_a_pair_that_holds() -> None:
    problem = ring()
    plan = make_plan(problem, rolls=True)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    assert report.is_passed, report.table()
    assert "conservative" not in report["roll_path_error_max"].note


def test_lifting_before_rolling_drops_the_ball() -> None:
    """At mu 0.55 two contacts hold from 122.4 degrees apart; these are 120."""
    problem = ring()
    plan = make_plan(problem, rolls=False)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    assert {"not_dropped", "plan_force_closure", "contact_schedule"} <= failed(report)


def test_caution_is_called_caution() -> None:
    """At a true mu of 0.65 a lift would hold; the planner believes 0.5, rolls, and the report says so."""
    problem = ring(**{"friction.sliding": 0.65})
    plan = make_plan(problem, rolls=True)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    assert report.is_passed, report.table()
    assert "conservative: with the simulator's friction" in report["roll_path_error_max"].note
    # 120 degrees apart: the chord leans by 30 degrees, atan 0.65 is 33.0
    assert "by 3.0 deg" in report["roll_path_error_max"].note

    early = make_plan(problem, rolls=False)
    trusting = pipeline.build_options(problem, sliding=0.65, torsional=0.0025)
    judged = pipeline.validate(problem, early, pipeline.rollout(problem, early, options=trusting))
    assert judged["not_dropped"].status == "pass"
    assert judged["position_error_final"].status == "pass"


@pytest.mark.parametrize("sliding", [0.5])
def test_planner_rolls_where_no_pair_holds(sliding: float) -> None:
    problem = load_problem("fig3_rewind", {"friction.sliding": sliding, "goal.rotation.angle_deg": 20.0})
    plan = pipeline.plan(problem)
    assert plan.is_solved, plan.reason
    # within reach of three fixed contacts nothing has to roll; a whole turn has to begin with it
    assert [a.name for a in plan.actions] == ["hold", "move_object", "hold"]
    whole = pipeline.plan(load_problem("fig3_rewind", {"friction.sliding": sliding}))
    assert whole.is_solved, whole.reason
    assert [a.name for a in whole.actions[:3]] == ["hold", "roll", "lift"]
