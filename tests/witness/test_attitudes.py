"""Questions for the planner: drawn without it, the same from the same seed, and as problems the very same questions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dexplan import pipeline
from dexplan.grasp.closed_forms.pair import check_sphere_pair
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.problems.read import load_problem
from dexplan.sim.trace import Trace
from dexplan.witness import attitudes
from dexplan.witness.attitudes import Attempt, Question, attempt, carry_out, draw_questions

COUNT = 30
SEED = 1


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem("any_attitude")


@pytest.fixture(scope="module")
def hand(problem: Problem) -> HandModel:
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


@pytest.fixture(scope="module")
def questions(hand: HandModel) -> list[Question]:
    return list(draw_questions(hand, COUNT, SEED))


def test_questions_come_from_the_seed_alone(hand: HandModel, questions: list[Question]) -> None:
    again, other = list(draw_questions(hand, 3, SEED)), list(draw_questions(hand, 3, SEED + 1))
    for one, same, another in zip(questions, again, other, strict=False):
        assert one.number == same.number == another.number
        assert one.as_problem(load_problem("any_attitude")) == same.as_problem(load_problem("any_attitude"))
        assert np.array_equal(one.goal.X_WO_goal, same.goal.X_WO_goal)
        assert not np.allclose(one.goal.X_WO_goal, another.goal.X_WO_goal)
    assert [q.number for q in questions] == list(range(COUNT))


def test_starts_are_two_contacts_that_close_and_goals_are_all_over(
    hand: HandModel, questions: list[Question]
) -> None:
    pairs, angles = set(), []
    for question in questions:
        held = [n for n in question.start if n is not None]
        assert len(question.start) == len(hand.fingers)
        assert len(held) == 2
        assert np.allclose(np.linalg.norm(held, axis=1), 1.0)
        assert check_sphere_pair(held[0], held[1], hand.friction.sliding).margin > 0.0
        pairs.add(tuple(n is None for n in question.start))
        assert question.goal.is_attitude
        assert np.array_equal(question.goal.X_WO_start, hand.object.X_WO_home)
        angles.append(question.goal.angle)
    assert len(pairs) == 3
    # Of uniform rotations the mean turn is pi/2 + 2/pi.
    assert np.mean(angles) == pytest.approx(0.5 * np.pi + 2.0 / np.pi, abs=0.35)


def test_a_question_as_a_problem_is_the_same_question(
    problem: Problem, hand: HandModel, questions: list[Question]
) -> None:
    """Contacts told in object axes by azimuth and elevation, the goal by its quaternion: read back, they are what they were."""
    for question in questions[:6]:
        posed = question.as_problem(problem)
        assert posed.name == f"any_attitude_{question.number}"
        assert (posed.hand, posed.object, posed.friction) == (problem.hand, problem.object, problem.friction)
        assert not isinstance(posed.start.contacts_deg, str)
        read = compute_contact_directions(posed.start.contacts_deg)
        for one, two in zip(question.start, read, strict=True):
            assert (one is None) == (two is None)
            if one is not None and two is not None:
                assert np.allclose(hand.object.X_WO_home[:3, :3] @ two, one, atol=1e-12)
        w, *xyz = np.array(posed.goal.orientation_wxyz, dtype=float)
        assert np.allclose(Rotation.from_quat([*xyz, w]).as_matrix(), question.goal.X_WO_goal[:3, :3])


def test_an_attempt_is_what_the_pipeline_plans(
    problem: Problem, hand: HandModel, questions: list[Question]
) -> None:
    """The question that is planned and the problem that is carried out are one: the same actions come of both."""
    done = attempt(problem, hand, questions[1], 2000)
    assert done.plan.is_solved
    assert done.is_fair
    assert 0.0 < done.planning_s < 60.0
    assert done.plan.statistics["plans"] == 1
    posed = done.question.as_problem(problem)
    same = pipeline.plan(posed)
    assert same.is_solved
    kinds = [[(a.name, a.grasping, round(a.motion.angle, 6)) for a in p.actions] for p in (done.plan, same)]
    assert same.statistics["first_cost"] == pytest.approx(done.plan.statistics["cost"], abs=1e-6)
    assert kinds[0][0] == kinds[1][0]


def test_starts_that_do_not_hold_are_no_question(
    problem: Problem, hand: HandModel, questions: list[Question]
) -> None:
    """Drawn by reach and closure alone, some starts do not hold: told apart from failures, by the planner's own word."""
    attempts = [attempt(problem, hand, questions[n], 50) for n in (3, 7)]
    assert [a.plan.status for a in attempts] == ["start_unreachable", "start_inadmissible"]
    assert not any(a.is_fair for a in attempts)
    refused = Attempt(questions[1], attempt(problem, hand, questions[1], 1).plan, 0.0)
    assert refused.plan.status == "budget_exhausted"
    assert refused.is_fair


def test_plans_are_carried_out_as_posed(
    problem: Problem, questions: list[Question], full_plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The simulator and the validator get the question's own problem and the attempt's own plan."""
    seen: list[tuple[str, Problem, Plan]] = []
    trace = object()

    def run(posed: Problem, plan: Plan) -> object:
        seen.append(("rollout", posed, plan))
        return trace

    def judge(posed: Problem, plan: Plan, done: Trace) -> str:
        assert done is trace
        seen.append(("validate", posed, plan))
        return "the verdict"

    monkeypatch.setattr(attitudes.pipeline, "rollout", run)
    monkeypatch.setattr(attitudes.pipeline, "validate", judge)
    done = Attempt(questions[2], full_plan, 0.0)
    assert carry_out(problem, done) == "the verdict"
    assert [name for name, _, _ in seen] == ["rollout", "validate"]
    for _, posed, plan in seen:
        assert plan is full_plan
        assert posed == questions[2].as_problem(problem)


@pytest.fixture(scope="module")
def full_plan(problem: Problem, hand: HandModel, questions: list[Question]) -> Plan:
    return attempt(problem, hand, questions[2], 1).plan
