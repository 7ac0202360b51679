"""Fingertips that roll in MuJoCo, and tips that only pretend to: every check of rolling against a simulation that fails it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from short_runs import build_plan_reference, failed, simulate

from dexplan import pipeline
from dexplan.contact.rolling.manoeuvre import RollingTriangle
from dexplan.control.reference import Reference
from dexplan.planning.actions.gaits import build_hold
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.rolling.rolling_carry import plan_rolling_turn
from dexplan.planning.rolling.rolls import as_roll, build_roll
from dexplan.plans.motion import rest_at
from dexplan.plans.plan import Plan
from dexplan.plans.tip_roll import TipRoll
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.trace import Trace
from dexplan.witness.rolling import (
    Stand,
    build_roll_problem,
    compute_heading,
    measure_trial,
)

ANGLE = np.radians(20.0)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return build_roll_problem()


@pytest.fixture(scope="module")
def plan(problem: Problem) -> Plan:
    """Return the plan in which finger 3 rolls 20 degrees along the ball while the others hold."""
    stand = Stand.build(problem)
    heading = compute_heading(stand.start, 0.6)
    plan, why = stand.plan_roll([build_roll(stand.hand, stand.start, heading, ANGLE, 25)])
    assert plan is not None, why
    return plan


@pytest.fixture(scope="module")
def trace(problem: Problem, plan: Plan) -> Trace:
    return pipeline.rollout(problem, plan)


def with_way(reference: Reference, change: object) -> Reference:
    """Return the reference with every rolled way replaced by ``change`` of it."""
    phases = []
    for phase in reference.phases:
        rolls = {finger: change(roll) for finger, roll in phase.rolls.items()}  # type: ignore[operator]
        phases.append(replace(phase, rolls=rolls))
    return replace(reference, phases=tuple(phases))


def without_turning(roll: TipRoll) -> TipRoll:
    """The tip goes where it should but keeps its attitude: it has to slide."""
    X = roll.X_OF.copy()
    X[:, :3, :3] = X[0, :3, :3]
    return TipRoll(roll.finger, X, roll.normal_O)


def half_way(roll: TipRoll) -> TipRoll:
    """The tip rolls well, but only half as far as planned."""
    rows = [roll.sample(s) for s in np.linspace(0.0, 0.5, roll.count)]
    return TipRoll(roll.finger, np.stack([X for X, _ in rows]), np.stack([n for _, n in rows]))


def test_tip_rolls_where_theory_says(problem: Problem, plan: Plan, trace: Trace) -> None:
    report = pipeline.validate(problem, plan, trace)
    assert report.is_passed, report.table()
    trial = measure_trial(plan, trace, report, 0.0)
    assert trial.rolled_mm == pytest.approx(np.degrees(0.035 * ANGLE) * np.pi / 180.0 * 1e3, rel=0.01)
    assert trial.net_mm == pytest.approx(trial.net_planned_mm, rel=0.01)
    assert abs(trial.spin_deg) < 0.1
    assert trial.contact_error_deg < 0.1
    assert trial.slip_mm < 0.05
    assert trial.ball_mm < 0.05
    # Theory: 20 deg along a ball of 35 mm are 38.9 deg along a tip of 18 mm.
    angle = report["tip_contact_angle_max"].value
    assert angle == pytest.approx(20.0 * 35.0 / 18.0, abs=0.2)


def test_rolling_is_judged_as_moving_not_as_rest(problem: Problem, plan: Plan, trace: Trace) -> None:
    note = pipeline.validate(problem, plan, trace)["creep_rate_max"].note
    assert "at rest" in note
    assert "moving" in note


def test_tip_that_slides_is_caught(problem: Problem, plan: Plan) -> None:
    slid = simulate(problem, with_way(build_plan_reference(problem, plan), without_turning))
    wrong = failed(pipeline.validate(problem, plan, slid))
    assert {"rolling_error_max", "roll_path_error_max", "coulomb_slip_max"} <= wrong


def test_tip_that_rolls_elsewhere_is_caught(problem: Problem, plan: Plan) -> None:
    """Honest rolling, wrong place: only the comparison with the plan can see it."""
    short = simulate(problem, with_way(build_plan_reference(problem, plan), half_way))
    report = pipeline.validate(problem, plan, short)
    assert "roll_path_error_max" in failed(report)
    assert "rolling_error_max" not in failed(report)
    assert report["roll_path_error_max"].value == pytest.approx(
        np.degrees(0.5 * ANGLE) * (1.0 + 35.0 / 18.0), abs=0.5
    )


def lifted(roll: TipRoll) -> TipRoll:
    """The way leaves the ball by 4 mm."""
    X = roll.X_OF.copy()
    X[:, :3, 3] += np.linspace(0.0, 4e-3, roll.count)[:, None] * roll.normal_O
    return TipRoll(roll.finger, X, roll.normal_O)


def test_force_not_position_keeps_the_rolling_tip_on_the_ball(problem: Problem, plan: Plan) -> None:
    """A way that is wrong by 4 mm along the normal changes the run next to nothing; without wanted forces it loses the ball."""
    reference = with_way(build_plan_reference(problem, plan), lifted)
    kept = pipeline.validate(problem, plan, simulate(problem, reference))
    assert kept.is_passed, kept.table()
    lost = simulate(problem, reference, pipeline.build_options(problem, feedforward=0.0))
    report = pipeline.validate(problem, plan, lost)
    assert "contact_schedule" in failed(report)
    assert "lost contact" in report["roll_path_error_max"].note


def test_plan_with_rolls_survives_its_file(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("plan") / "plan.json"
    plan.save(path)
    again = Plan.load(path)
    assert again.as_dict() == plan.as_dict()
    again.save(path)
    assert Plan.load(path).as_dict() == plan.as_dict()
    (roll,) = again.actions[1].rolls
    np.testing.assert_allclose(roll.X_OF, plan.actions[1].rolls[0].X_OF, atol=1e-11)


def test_a_triangle_wider_than_gamma_fails() -> None:
    """One run of a rolling triangle with an apex of 60 deg: right for a tip that may go round by 75 deg, wrong for one by 45."""
    stand = Stand.build(build_roll_problem(place_deg=(226.0, 0.0)), (226.0, 0.0))
    triangle = RollingTriangle(0.018, 0.035, np.radians(18.0), np.radians(60.0))
    path = triangle.roll(stand.start.X_OF, compute_heading(stand.start, 0.0), 61)
    plan, why = stand.plan_roll([as_roll(stand.start.finger, path, k) for k in range(3)])
    assert plan is not None, why
    trace = pipeline.rollout(stand.problem, plan)
    report = pipeline.validate(stand.problem, plan, trace)
    assert report.is_passed, report.table()
    assert report["tip_rotation_max"].value == pytest.approx(60.0, abs=1.5)
    narrow = replace(stand.problem, hand=replace(stand.problem.hand, tip_rotation_limit_deg=45.0))
    assert failed(pipeline.validate(narrow, plan, trace)) == {"tip_rotation_max"}


def test_object_turns_on_rolling_contacts() -> None:
    """Three tips keep their attitude and roll on the ball while it turns: coordinated manipulation without fixed contacts."""
    contacts = [[-38.0, 0.0], [102.0, 0.0], [212.0, 10.0]]
    angle = 25.0
    problem = load_problem("hold_three", {"start.contacts_deg": contacts, "goal.rotation.angle_deg": angle})
    still = pipeline.plan(load_problem("hold_three", {"start.contacts_deg": contacts}))
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    up = np.array([0.0, 0.0, 1.0])
    turn = plan_rolling_turn(
        hand, Admissibility(hand), still.X_WO_start, still.start_contacts, up, np.radians(angle), 1.0
    )
    assert turn.action is not None
    assert turn.limit is None
    end = rest_at(turn.action.X_WO_end, up)
    last = build_hold(turn.action.contacts_end, end, "the goal is reached")
    plan = replace(
        still,
        actions=(still.actions[0], turn.action, last),
        X_WO_goal=turn.action.X_WO_end,
        axis_W=up,
        turned_angle=turn.action.motion.angle,
    )
    plan = pipeline.time_plan(problem, plan)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    assert report.is_passed, report.table()
    # The contacts went round with the ball by R / (R + r) of its turn, so back on it by the rest; 35 / 18 as far on the tip.
    back = angle * 18.0 / 53.0
    assert report["tip_contact_angle_max"].value == pytest.approx(back * 35.0 / 18.0, abs=0.2)
