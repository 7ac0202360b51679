"""Brute force about shifts: it holds where fingers can, finds short ways, and contradicts a refusal that is false."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.problems.problem import GoalSection, Problem, compute_contact_directions
from dexplan.problems.read import load_problem
from dexplan.witness import brute_force
from dexplan.witness.brute_force import Journey, find_hold
from dexplan.witness.shifts import Attempt, Question, draw_questions, judge_refusal, list_ways, record


@pytest.fixture(scope="module")
def problem() -> Problem:
    problem = load_problem("hold_two")
    return replace(problem, goal=GoalSection(rotation=problem.goal.rotation, translation_m=(0.03, 0.0, 0.0)))


@pytest.fixture(scope="module")
def hand(problem: Problem) -> HandModel:
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brute_force, "HOLDING", 300)
    monkeypatch.setattr(brute_force, "COMING", 120)


def refuse(problem: Problem, status: str) -> Attempt:
    """Return an attempt that a planner has given up, whatever it might have found."""
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    X = hand.object.X_WO_home.copy()
    X[:3, 3] += problem.goal.translation_m
    plan = replace(pipeline.plan(load_problem("hold_two")), status=status, X_WO_goal=X)
    return Attempt(Question(0, "shift", problem), plan, 0.0)


def test_questions_come_from_their_seed_alone(problem: Problem) -> None:
    one, again = list(draw_questions(problem, "shift", 3, 8)), list(draw_questions(problem, "shift", 2, 9))
    assert [q.number for q in one] == [8, 9, 10]
    assert one[1].problem == again[0].problem
    starts = [q.problem.start.contacts_deg for q in one]
    assert starts[0] == "auto"
    assert starts[1] == problem.start.contacts_deg
    assert all(np.abs(q.problem.goal.translation_m).max() <= 0.04 for q in one)
    (turn,) = draw_questions(problem, "shift and turn", 1, 8)
    assert turn.problem.goal.rotation is not None
    assert turn.problem.goal.rotation.angle_deg != 0.0
    first, second = list_ways(turn.problem, np.eye(4))
    assert np.allclose(first[-1], second[-1])
    assert np.allclose(first[1][:3, 3], 0.0)
    assert np.allclose(second[1][:3, :3], np.eye(3))


def test_fingers_hold_within_reach_and_not_beyond(hand: HandModel) -> None:
    judge, X = Admissibility(hand), hand.object.X_WO_home.copy()
    held = find_hold(hand, X, judge)
    assert held is not None
    (_, one), (_, two) = held
    assert one @ two < -0.7 * 0.035**2
    X[1, 3] += 0.3
    assert find_hold(hand, X, judge) is None


def test_a_short_way_is_found_and_no_way_to_nowhere(problem: Problem, hand: HandModel) -> None:
    start = compute_contact_directions(problem.start.contacts_deg)  # type: ignore[arg-type]
    (way,) = list_ways(problem, hand.object.X_WO_home)
    assert Journey(hand, way[:5], start).run() == (True, True)
    far = way[:2].copy()
    far[1, 1, 3] += 0.3
    assert Journey(hand, far, start).run(states=40)[0] is False


def test_a_false_refusal_is_contradicted(problem: Problem) -> None:
    for status, why in (("goal_unreachable", "at the goal hold"), ("start_unreachable", "the start holds")):
        done = refuse(problem, status)
        verdict = judge_refusal(done)
        assert not verdict.agrees
        assert why in verdict.why
        assert record(done, verdict)["agrees"] is False
    far = replace(problem, goal=replace(problem.goal, translation_m=(0.0, 0.3, 0.0)))
    assert judge_refusal(refuse(far, "goal_unreachable")).agrees
