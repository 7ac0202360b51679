"""Routes on which the object first turns to where there is room: they lead to the goal, with as many turns as were asked for."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dexplan.planning.contacts.legs import Leg
from dexplan.planning.gait.routes import build_detours
from dexplan.planning.regions.sampling import sample_attitude
from dexplan.plans.goal import RotationGoal
from dexplan.spatial import Array, rotate_about


def draw_pose(rng: np.random.Generator) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    return X


def draw_turn(rng: np.random.Generator) -> tuple[Array, float]:
    """Return an axis and an angle as escapes have them."""
    axis = rng.normal(size=3)
    return axis / np.linalg.norm(axis), float(np.radians(rng.uniform(5.0, 80.0)))


def check_way(route: tuple[Leg, ...], goal: RotationGoal, axis: Array, angle: float) -> None:
    """The legs follow upon one another, the escape first, and end exactly at the goal."""
    assert np.array_equal(route[0].X_WO_start, goal.X_WO_start)
    assert np.array_equal(route[0].axis_W, axis)
    assert route[0].angle == angle
    for leg, after in pairwise(route):
        assert np.array_equal(leg.X_WO_end, after.X_WO_start)
    assert np.abs(route[-1].X_WO_end - goal.X_WO_goal).max() < 1e-12


def count_turn(route: tuple[Leg, ...], axis: Array) -> float:
    """Return the turn about ``axis`` [rad] that is counted along the route: twists, two degrees apart, through whole turns."""
    R_start, samples = route[0].X_WO_start[:3, :3], []
    for leg in route:
        shares = np.linspace(0.0, 1.0, 2 + int(abs(leg.angle) / 0.035))
        turns = rotate_about(leg.axis_W, shares * leg.angle)
        samples.append(turns @ leg.X_WO_start[:3, :3] @ R_start.T)
    quat = Rotation.from_matrix(np.concatenate(samples)).as_quat(canonical=True)
    return float(np.unwrap(2.0 * np.arctan2(quat[:, :3] @ axis, quat[:, 3]))[-1])


@settings(derandomize=True, max_examples=60, deadline=None, database=None)
@given(st.integers(0, 10_000), st.booleans())
def test_detours_to_an_attitude_end_at_it(seed: int, is_shifted: bool) -> None:
    rng = np.random.default_rng(seed)
    shift = 0.01 * rng.normal(size=3) * is_shifted
    goal = RotationGoal.from_attitude(draw_pose(rng), sample_attitude(rng), shift)
    axis, angle = draw_turn(rng)
    ways = build_detours(goal, axis, angle)
    assert len(ways) == (8 if is_shifted else 4)
    for way in ways:
        check_way(way, goal, axis, angle)
    # What is left is gone about first as directly as can be.
    assert sum(abs(leg.angle) for leg in ways[0][1:]) <= np.pi + 1e-9


@settings(derandomize=True, max_examples=30, deadline=None, database=None)
@given(st.integers(0, 10_000), st.floats(-25.0, 25.0), st.booleans())
def test_detours_of_a_turn_make_that_turn_and_undo_the_rest(
    seed: int, turned: float, is_shifted: bool
) -> None:
    """Several turns are several turns, however the first one is undone."""
    rng = np.random.default_rng(seed)
    shift = 0.01 * rng.normal(size=3) * is_shifted
    goal = RotationGoal(draw_pose(rng), rng.normal(size=3), turned, shift)
    axis, angle = draw_turn(rng)
    ways = build_detours(goal, axis, angle)
    assert ways
    for way in ways:
        check_way(way, goal, axis, angle)
        assert np.array_equal(way[1].axis_W, goal.axis_W)
        assert way[1].angle == turned
        assert abs(count_turn(way, goal.axis_W) - turned) < 1e-6
    # Undone by the very turn, back, as seen from where the object has come to.
    back = ways[0][2]
    assert abs(back.angle - angle) < 1e-9
    assert np.allclose(back.axis_W, -(rotate_about(goal.axis_W, turned) @ axis), atol=1e-7)


def test_a_goal_that_is_there_already_is_come_back_to() -> None:
    """Where the escape itself is what was asked for, nothing is left to do but to stay."""
    axis = np.array([0.0, 0.6, 0.8])
    goal = RotationGoal.from_attitude(np.eye(4), rotate_about(axis, 0.5))
    for way in build_detours(goal, axis, 0.5):
        check_way(way, goal, axis, 0.5)
        assert sum(abs(leg.angle) for leg in way[1:]) < 1e-9
    still = RotationGoal(np.eye(4), axis, 0.0, np.array([0.0, 0.0, 0.01]))
    for way in build_detours(still, axis, 0.5):
        check_way(way, still, axis, 0.5)
        assert abs(count_turn(way, axis)) < 1e-9
