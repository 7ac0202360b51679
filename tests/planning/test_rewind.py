"""Finger rewind: only one pair of fingers ever moves the object, and the actions say so [paper §2.2]."""

from __future__ import annotations

from dataclasses import replace

import pytest
from recheck import Recheck

from dexplan import pipeline
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem, Rotation


def rewind(problem: Problem, angle_deg: float) -> Plan:
    """Return the plan that turns the object about the vertical by rewinds only."""
    return pipeline.plan(
        replace(
            problem,
            gait=replace(problem.gait, primitives=("rewind",)),
            goal=replace(problem.goal, rotation=Rotation((0.0, 0.0, 1.0), angle_deg)),
        )
    )


@pytest.fixture(scope="module")
def plan(problem: Problem) -> Plan:
    return rewind(problem, 360.0)


def test_one_pair_moves_the_object(hand: HandModel, plan: Plan) -> None:
    assert plan.is_solved, plan.reason
    moves = [a.grasping for a in plan.actions if a.name == "move_object"]
    assert len(moves) >= 2
    assert len(set(moves)) == 1
    assert len(moves[0]) == 2
    assert Recheck(hand, plan).faults == []


def test_actions_between_moves_say_that_they_rewind(plan: Plan) -> None:
    moves = [k for k, a in enumerate(plan.actions) if a.name == "move_object"]
    between = plan.actions[moves[0] + 1 : moves[-1]]
    relocations = [a for a in between if a.name in ("place", "lift")]
    assert relocations
    assert all(a.why.startswith("finger rewind: ") for a in relocations)


def test_substitution_needs_fewer_placements(full_turn: Plan, plan: Plan) -> None:
    """As the paper observes [paper §2.2]."""
    counts = [sum(a.name == "place" for a in p.actions) for p in (full_turn, plan)]
    assert counts[0] < counts[1]


def test_a_turn_that_the_pair_can_make_alone_needs_no_rewind(problem: Problem) -> None:
    assert [a.name for a in rewind(problem, 40.0).actions] == ["hold", "move_object", "hold"]
