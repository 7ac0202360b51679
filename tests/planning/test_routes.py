"""Attitudes, shifts and starts of any pose: the way is made of legs, and every plan stands a second opinion."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recheck import Recheck
from scipy.spatial.transform import Rotation

from dexplan import pipeline
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.gait.routes import build_routes
from dexplan.planning.regions.sampling import sample_attitude, sample_start
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.problem import Rotation as Turn
from dexplan.spatial import Array, rotate_about

SWINGS = (np.array([1.0, 0.0, 0.0]), np.array([np.cos(2.0), np.sin(2.0), 0.0]))


@settings(derandomize=True, max_examples=40, deadline=None, database=None)
@given(st.integers(0, 10_000), st.booleans())
def test_every_route_leads_to_the_goal(seed: int, is_shifted: bool) -> None:
    rng = np.random.default_rng(seed)
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    shift = 0.01 * rng.normal(size=3) * is_shifted
    goal = RotationGoal.from_attitude(X, sample_attitude(rng), shift)
    routes = build_routes(goal, SWINGS)
    assert len(routes) == (16 if is_shifted else 8)
    for route in routes:
        assert np.allclose(route[0].X_WO_start, X)
        for leg, after in pairwise(route):
            assert np.allclose(leg.X_WO_end, after.X_WO_start)
        assert np.allclose(route[-1].X_WO_end, goal.X_WO_goal, atol=1e-9)
    # The straight way comes first and is the shortest.
    assert sum(abs(leg.angle) for leg in routes[0]) <= np.pi + 1e-9


def test_turns_about_a_named_axis_have_no_other_way() -> None:
    goal = RotationGoal(np.eye(4), np.array([0.0, 0.0, 1.0]), 7.0)
    assert [[leg.angle for leg in route] for route in build_routes(goal, SWINGS)] == [[7.0]]


def ends_at_goal(plan: Plan) -> bool:
    """Return whether the last action ends at the plan's goal."""
    return bool(np.allclose(plan.actions[-1].X_WO_end, plan.X_WO_goal, atol=1e-9))


@pytest.mark.parametrize("seed", [0, 7])
def test_random_attitude_from_a_random_start(hand: HandModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    start = sample_start(hand, rng)
    goal = RotationGoal.from_attitude(hand.object.X_WO_home, sample_attitude(rng))
    plan = plan_rotation(hand, goal, start, 4000)
    assert plan.is_solved, plan.reason
    assert plan.turned_angle is None
    assert ends_at_goal(plan)
    assert Recheck(hand, plan).faults == []


def test_shift_alone_and_with_a_turn(problem: Problem, hand: HandModel) -> None:
    for angle in (0.0, 60.0):
        goal = replace(
            problem.goal,
            rotation=Turn((0.0, 0.0, 1.0), angle),
            translation_m=(0.004, -0.003, 0.006),
        )
        plan = pipeline.plan(replace(problem, goal=goal))
        assert plan.is_solved, plan.reason
        assert ends_at_goal(plan)
        assert np.allclose(plan.X_WO_goal[:3, 3] - plan.X_WO_start[:3, 3], [0.004, -0.003, 0.006])
        assert Recheck(hand, plan).faults == []


def lean(hand: HandModel, X_WO: Array, X_OF: Array, angle: float) -> Array:
    """Return a contact pose whose tip leans by ``angle`` [rad] off the normal and is spun a little, at the same contact."""
    X = X_OF.copy()
    X[:3, :3] = rotate_about(X_OF[:3, 0], angle) @ X_OF[:3, :3] @ rotate_about([0.0, 0.0, 1.0], 0.4)
    return X


def test_start_contacts_may_be_whole_poses(hand: HandModel, full_turn: Plan) -> None:
    """A tip that leans, as after rolling, is carried along as it stands."""
    X_WO = hand.object.X_WO_home
    start = tuple(
        None if c is None else lean(hand, X_WO, c.X_OF, np.radians(15.0)) for c in full_turn.start_contacts
    )
    goal = RotationGoal(X_WO, np.array([0.1, 0.0, 1.0]), np.radians(150.0))
    plan = plan_rotation(hand, goal, start, 4000)
    assert plan.is_solved, plan.reason
    for given_pose, contact in zip(start, plan.start_contacts, strict=True):
        if given_pose is not None:
            assert contact is not None
            assert np.allclose(contact.X_OF, given_pose, atol=1e-6)
    assert sum(a.name == "place" for a in plan.actions) >= 1
    assert Recheck(hand, plan).faults == []


def test_tip_may_not_lean_beyond_its_limit(hand: HandModel, full_turn: Plan) -> None:
    narrow = replace(hand, tip_polar_limit=np.radians(10.0))
    X_WO = hand.object.X_WO_home
    start = tuple(
        None if c is None else lean(hand, X_WO, c.X_OF, np.radians(15.0)) for c in full_turn.start_contacts
    )
    goal = RotationGoal(X_WO, np.array([0.0, 0.0, 1.0]), 0.5)
    assert plan_rotation(narrow, goal, start, 100).status == "start_unreachable"


def test_plan_goes_on_where_another_ended(hand: HandModel, full_turn: Plan) -> None:
    """The grasp at the end of one plan is the start of the next."""
    last = full_turn.actions[-1]
    start = tuple(None if c is None else c.X_OF for c in last.contacts_end)
    R = rotate_about(np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0]), 1.8)
    goal = RotationGoal.from_attitude(last.X_WO_end, R)
    plan = plan_rotation(hand, goal, start, 4000)
    assert plan.is_solved, plan.reason
    assert Recheck(hand, plan).faults == []
    assert np.allclose(plan.X_WO_goal[:3, :3], R)
