"""No plan is an answer: the status, and a reason that is the cure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.problems.problem import ContactSpec, Problem, Rotation, StartSection
from dexplan.problems.read import load_problem


def start_from(problem: Problem, *contacts: ContactSpec) -> Problem:
    """Return ``problem`` with these start contacts."""
    return replace(problem, start=StartSection(contacts))


def slippery(problem: Problem, sliding: float) -> Problem:
    """Return ``problem`` with this friction and a start that the planner chooses."""
    return replace(problem, friction=replace(problem.friction, sliding=sliding), start=StartSection("auto"))


def refused(plan: Plan, status: str) -> str:
    """Return the reason of a plan that has to be refused with ``status``."""
    assert plan.status == status, plan.reason
    assert not plan.is_solved
    assert plan.actions == ()
    return plan.reason


def test_friction_too_low_for_any_pair(problem: Problem) -> None:
    # atan(0.02 / 1.3) is below one degree: less than the margin that a pair has to keep.
    reason = refused(pipeline.plan(slippery(problem, 0.02)), "no_force_closure_pair")
    assert "no two fingers reach contacts" in reason
    assert "raise the friction" in reason


def test_friction_too_low_for_a_gait(problem: Problem) -> None:
    # 174 degrees apart: there are such pairs, but no third finger that would hold with one of them.
    reason = refused(pipeline.plan(slippery(problem, 0.10)), "no_gait")
    assert "raise the friction" in reason


def test_start_pair_too_near_to_hold(problem: Problem) -> None:
    reason = refused(
        pipeline.plan(start_from(problem, (-20.0, 0.0), (80.0, 0.0), "free")), "start_inadmissible"
    )
    assert "nearer to opposite" in reason
    needed = 180.0 - 2.0 * np.degrees(np.arctan(problem.friction.believed_sliding))
    assert needed <= float(reason.split(" deg or more apart")[0].split()[-1]) < needed + 5.0


def test_three_fingers_of_which_no_two_hold_begin_with_rolling(problem: Problem) -> None:
    plan = pipeline.plan(start_from(problem, (0.0, 0.0), (120.0, 0.0), (240.0, 0.0)))
    assert plan.is_solved, plan.reason
    assert all(contact is not None for contact in plan.start_contacts)
    kinds = [action.name for action in plan.actions]
    assert "roll" in kinds
    assert kinds.index("roll") < kinds.index("lift")


def test_start_contact_out_of_reach(problem: Problem) -> None:
    reason = refused(
        pipeline.plan(start_from(problem, (140.0, 0.0), (-80.0, 0.0), "free")), "start_unreachable"
    )
    assert "finger_1" in reason
    assert '"auto"' in reason


def test_small_node_budget(problem: Problem) -> None:
    plan = pipeline.plan(replace(problem, gait=replace(problem.gait, node_budget=1)))
    assert "raise gait.node_budget" in refused(plan, "budget_exhausted")
    assert plan.statistics["nodes"] == 1


def test_goal_out_of_the_workspaces(problem: Problem) -> None:
    far = replace(problem, goal=replace(problem.goal, translation_m=(0.0, 0.3, 0.0)))
    reason = refused(pipeline.plan(far), "goal_unreachable")
    assert "(0.0, 300.0, 0.0) mm from its start" in reason
    assert "shorten goal.translation_m" in reason


@pytest.mark.parametrize("name", ["hold_two", "hold_three"])
def test_holding_still_needs_no_pair_to_lift_from(name: str) -> None:
    plan = pipeline.plan(load_problem(name))
    assert plan.is_solved, plan.reason
    assert {a.name for a in plan.actions} == {"hold"}


def test_turn_within_reach_needs_no_placement(problem: Problem) -> None:
    near = replace(problem, goal=replace(problem.goal, rotation=Rotation((0.0, 0.0, 1.0), 20.0)))
    plan = pipeline.plan(near)
    assert [a.name for a in plan.actions] == ["hold", "move_object", "hold"]
