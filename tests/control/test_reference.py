"""Curves in time: derivatives, borders, speed bounds, approaches, load shares, and the phases of a whole plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.control.reference import ObjectPath, Phase, Reference, build_reference
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.pace import Pace, smooth_step
from dexplan.plans.phases import MAY
from dexplan.plans.plan import Plan
from dexplan.plans.timing import Timing
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.spatial import rotation_vector

AXIS = np.array([0.36, -0.48, 0.80])
STILL = ObjectPath(rest_at(np.eye(4)), Pace(1.0, 0.3, "ramp"))


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem(
        "fig4_substitution",
        {"goal.rotation.angle_deg": 15.0, "start.contacts_deg": [[36.0, 0.0], [180.0, 0.0], "free"]},
    )


@pytest.fixture(scope="module")
def plan(problem: Problem) -> Plan:
    planned = pipeline.plan(problem)
    assert planned.is_solved, planned.reason
    return planned


@pytest.fixture(scope="module")
def reference(plan: Plan) -> Reference:
    return build_reference(plan)


def make_path(angle: float = 0.7, duration: float = 1.9, ramp: float = 0.3) -> ObjectPath:
    X = np.eye(4)
    X[:3, :3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    X[:3, 3] = [0.01, -0.02, 0.16]
    motion = ObjectMotion(X, AXIS, angle, np.array([0.004, 0.0, -0.006]))
    return ObjectPath(motion, Pace(duration, ramp, "drift"))


def cruise(t: float, duration: float, ramp: float) -> tuple[float, float, float]:
    return Pace(duration, ramp, "drift").progress(t)


# -- one motion ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("duration", "ramp"), [(1.9, 0.3), (0.6, 0.3), (0.4, 0.3)])
def test_cruise_derivatives_agree_with_differences(duration: float, ramp: float) -> None:
    h = 1e-6
    for t in np.linspace(2 * h, duration - 2 * h, 41):
        (s0, ds0, _), (_, ds, dds), (s1, ds1, _) = (cruise(t + d, duration, ramp) for d in (-h, 0.0, h))
        assert ds == pytest.approx((s1 - s0) / (2 * h), abs=1e-7)
        # Acceleration has corners where a ramp meets the cruise; there a difference is off by its jump times the step.
        assert dds == pytest.approx((ds1 - ds0) / (2 * h), abs=2e-4)


@pytest.mark.parametrize(("duration", "ramp"), [(1.9, 0.3), (0.6, 0.3), (0.4, 0.3)])
def test_cruise_starts_and_ends_at_rest_and_never_turns_back(duration: float, ramp: float) -> None:
    assert cruise(0.0, duration, ramp) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert cruise(duration, duration, ramp) == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)
    # Before and after there is rest, not extrapolation.
    assert cruise(-1.0, duration, ramp)[0] == 0.0
    assert cruise(duration + 1.0, duration, ramp)[0] == pytest.approx(1.0)
    speeds = np.array([cruise(t, duration, ramp)[1] for t in np.linspace(0.0, duration, 500)])
    assert speeds.min() >= -1e-12
    assert speeds.max() <= 1.0 / (duration - min(ramp, duration / 2)) + 1e-12


def test_cruise_is_continuous_where_ramps_meet() -> None:
    duration, ramp, step = 1.9, 0.3, 1e-9
    for border in (ramp, duration - ramp):
        before, after = cruise(border - step, duration, ramp), cruise(border + step, duration, ramp)
        assert after == pytest.approx(before, abs=1e-6)


def test_object_path_twist_and_acceleration_agree_with_differences() -> None:
    path, h = make_path(), 1e-5
    for t in np.linspace(0.01, path.pace.duration - 0.01, 23):
        X0, V0, _ = path.sample(t - h)
        _, V, A = path.sample(t)
        X1, V1, _ = path.sample(t + h)
        v = (X1[:3, 3] - X0[:3, 3]) / (2 * h)
        w = rotation_vector(X1[:3, :3] @ X0[:3, :3].T) / (2 * h)
        np.testing.assert_allclose(V, [*v, *w], atol=1e-7)
        np.testing.assert_allclose(A, (V1 - V0) / (2 * h), atol=1e-3)


@pytest.mark.parametrize("angle", [0.7, -0.7, 4.0])
def test_object_path_goes_from_start_to_end(angle: float) -> None:
    path = make_path(angle)
    X0, X1 = path.sample(0.0)[0], path.sample(path.pace.duration)[0]
    np.testing.assert_allclose(X0, path.motion.X_WO_start, atol=1e-12)
    np.testing.assert_allclose(X1[:3, 3], path.motion.X_WO_start[:3, 3] + path.motion.shift_W, atol=1e-12)
    turn = X1[:3, :3] @ X0[:3, :3].T
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(rotation_vector(turn), wrapped * AXIS, atol=1e-9)


# -- gaps ---------------------------------------------------------------------------------------------------


def make_gap(**changes: object) -> Phase:
    zero = np.zeros(3)
    return Phase(0, 0, "approach", 0.35, STILL, (0, 1), zero, zero, finger=2, **changes)  # type: ignore[arg-type]


def test_approach_closes_monotonically_and_meets_the_object_at_touch_speed() -> None:
    phase, speed, h = make_gap(gap_start=0.008, ends_on_touch=True), 0.010, 1e-6
    gap = np.array([phase.sample_gap(t, speed) for t in np.linspace(0.0, 0.6, 601)])
    assert gap[0] == pytest.approx(0.008)
    assert (np.diff(gap) <= 1e-15).all()
    assert phase.sample_gap(0.35, speed) == pytest.approx(0.0, abs=1e-12)
    for t in (0.35 - 2 * h, 0.35 + 2 * h, 0.5):
        rate = (phase.sample_gap(t + h, speed) - phase.sample_gap(t - h, speed)) / (2 * h)
        assert rate == pytest.approx(-speed, rel=1e-3)
    start = (phase.sample_gap(h, speed) - phase.sample_gap(0.0, speed)) / h
    assert start == pytest.approx(0.0, abs=1e-5)


def test_retreat_opens_monotonically_from_rest_to_rest() -> None:
    phase = make_gap(gap_end=0.008)
    gap = np.array([phase.sample_gap(t, 0.010) for t in np.linspace(0.0, 0.5, 501)])
    assert gap[0] == 0.0
    assert (np.diff(gap) >= 0.0).all()
    assert gap[-1] == pytest.approx(0.008)
    assert gap[1] < 1e-8


def test_smooth_step_has_no_velocity_or_acceleration_at_its_ends() -> None:
    h = 1e-4
    assert (smooth_step(0.0), smooth_step(0.5), smooth_step(1.0)) == (0.0, 0.5, 1.0)
    for a, b in ((0.0, h), (1.0 - h, 1.0)):
        assert smooth_step(b) - smooth_step(a) < 20 * h**3


# -- a whole plan -------------------------------------------------------------------------------------------


def test_phases_are_those_of_the_plan_in_order(plan: Plan, reference: Reference) -> None:
    planned = [(a, p, x.name) for a, action in enumerate(plan.actions) for p, x in enumerate(action.phases)]
    assert [(p.action_index, p.phase_index, p.name) for p in reference.phases] == planned
    assert {action.name for action in plan.actions} == {"hold", "move_object", "place", "lift"}
    durations = [x.duration for action in plan.actions for x in action.phases]
    assert [p.duration for p in reference.phases] == durations
    assert reference.duration == pytest.approx(plan.duration)


def test_object_path_chains_from_start_to_goal(plan: Plan, reference: Reference) -> None:
    X = plan.X_WO_start
    for phase in reference.phases:
        begin, V0, _ = phase.object_path.sample(0.0)
        end, V1, _ = phase.object_path.sample(phase.duration)
        np.testing.assert_allclose(begin, X, atol=1e-9)
        np.testing.assert_allclose([V0, V1], 0.0, atol=1e-12)
        X = end
    np.testing.assert_allclose(X, plan.X_WO_goal, atol=1e-9)


def test_object_moves_no_faster_than_asked(problem: Problem, plan: Plan, reference: Reference) -> None:
    limit = np.radians(problem.control.speed_deg_s)
    for phase in reference.phases:
        for t in np.linspace(0.0, phase.duration, 60):
            assert np.linalg.norm(phase.object_path.sample(t)[1][3:]) <= limit + 1e-12
    slow = Timing(object_speed=np.radians(4.0))
    slower = pipeline.time_plan(problem, plan, slow)
    assert slower.duration > reference.duration


def test_load_shares_are_continuous_and_belong_to_holding_fingers(reference: Reference) -> None:
    light = reference.touchdown.light_load
    previous: Phase | None = None
    for phase in reference.phases:
        for share in (phase.load_start, phase.load_end):
            assert ((share >= 0.0) & (share <= 1.0)).all()
            assert all(share[i] >= light for i in phase.holding)
        if previous is not None:
            for i in set(phase.holding) & set(previous.holding):
                assert phase.load_start[i] == previous.load_end[i]
            # Who begins to hold begins with a light load, who stops has come down to it.
            for i in set(phase.holding) - set(previous.holding):
                assert phase.load_start[i] == light
            for i in set(previous.holding) - set(phase.holding):
                assert previous.load_end[i] == light
        previous = phase


def test_landing_ends_on_touch_and_holding_follows_the_demands(plan: Plan, reference: Reference) -> None:
    for phase in reference.phases:
        touch = plan.actions[phase.action_index].phases[phase.phase_index].touch
        assert phase.ends_on_touch == (phase.name == "approach")
        assert phase.holding == tuple(i for i, demand in enumerate(touch) if demand == "must")
        may = [i for i, demand in enumerate(touch) if demand == MAY]
        assert may == ([phase.finger] if phase.name in ("approach", "retreat") else [])


def test_travel_ends_where_the_approach_begins(problem: Problem, reference: Reference) -> None:
    fingers = pipeline.build_scene(problem).fingers
    approach = next(p for p in reference.phases if p.name == "approach")
    travel = next(p for p in reference.phases if p.name == "travel")
    finger = approach.finger
    assert finger is not None
    assert travel.finger == finger
    assert travel.postures is not None
    assert approach.X_OF is not None
    assert approach.normal_O is not None
    np.testing.assert_allclose(travel.postures[0], fingers[finger].q_home, atol=1e-12)
    X_WF = fingers[finger].pose_at(travel.postures[-1])
    aim = approach.object_path.motion.X_WO_start @ approach.X_OF
    hover = (
        aim[:3, 3] + approach.gap_start * approach.object_path.motion.X_WO_start[:3, :3] @ approach.normal_O
    )
    np.testing.assert_allclose(X_WF[:3, 3], hover, atol=2e-5)
    back = [p for p in reference.phases if p.name == "travel"][1]
    assert back.finger is not None
    assert back.postures is not None
    np.testing.assert_allclose(back.postures[-1], fingers[back.finger].q_home, atol=1e-12)


def test_a_plan_that_says_too_little_makes_no_reference(plan: Plan) -> None:
    k = next(k for k, action in enumerate(plan.actions) if action.name == "place")
    place = plan.actions[k]
    untimed = tuple(replace(phase, duration=None) for phase in place.phases)
    for action, what in (
        (replace(place, ways=()), "has not been timed"),
        (replace(place, phases=untimed), "has not been timed"),
        (replace(place, phases=place.phases[:2]), "has 2 phases; 3 are accepted"),
    ):
        with pytest.raises(ValueError, match=what):
            build_reference(replace(plan, actions=(*plan.actions[:k], action)))


def test_start_carries_the_contacts_of_the_plan(plan: Plan, reference: Reference) -> None:
    for begin, contact in zip(reference.start, plan.start_contacts, strict=True):
        assert (begin is None) == (contact is None)
        if begin is not None and contact is not None:
            np.testing.assert_array_equal(begin[0], contact.X_OF)
            np.testing.assert_array_equal(begin[1], contact.q)
    assert reference.normal_force == plan.normal_force
