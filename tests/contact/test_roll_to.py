"""The rolling planner: shortest of its ways, within limits, truthful when there is none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dexplan.contact.rolling.candidates import RollLimits
from dexplan.contact.rolling.manoeuvre import RollingTriangle, compute_spin
from dexplan.contact.rolling.roll_to import RollPlan, roll_to
from dexplan.contact.rolling.turning import build_turn, make_tangent
from dexplan.contact.surfaces.shapes import Sphere
from dexplan.spatial import Array

TIP, BALL = Sphere(0.018), Sphere(0.035)
LIMITS = RollLimits(np.radians(80.0), np.radians(75.0), samples=60)
STRAIGHT_DEG = 80.0 * 18.0 / 35.0
"""How far a straight roll from the pole goes on the ball: 41.1 degrees."""

lightly = settings(deadline=None, derandomize=True, max_examples=40)


def _start(seed: int, off: float = 0.0) -> tuple[Array, Array]:
    """A random touching pose with the contact ``off`` [rad] from the tip's pole, and the contact's normal on the ball."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    azimuth = rng.uniform(0, 2 * np.pi)
    contact_F = np.array([np.sin(off) * np.cos(azimuth), np.sin(off) * np.sin(azimuth), np.cos(off)])
    align, _ = Rotation.align_vectors(-n[None], contact_F[None])
    X = np.eye(4)
    X[:3, :3] = (Rotation.from_rotvec(rng.uniform(0, 2 * np.pi) * n) * align).as_matrix()
    X[:3, 3] = (TIP.radius + BALL.radius) * n
    return X, n


def _goal(n: Array, seed: int, away: float) -> Array:
    return build_turn(np.cross(n, make_tangent(n, np.random.default_rng(seed + 1).normal(size=3))), away) @ n


def _require_valid(plan: RollPlan, X: Array, goal: Array, limits: RollLimits = LIMITS) -> None:
    """Recheck a plan from its samples alone: start, end, polar limit, contact, no sliding, no spin."""
    assert plan.is_found, plan.reason
    assert np.allclose(plan.paths[0].X_OF[0], X, atol=1e-9)
    assert np.allclose(plan.paths[-1].n_O[-1], goal, atol=1e-9)
    for path in plan.paths:
        R = path.X_OF[:, :3, :3]
        assert path.polar_angle.max() <= limits.tip_polar_limit + 1e-9
        assert np.allclose(np.einsum("kij,kj->ki", R, path.n_F), -path.n_O, atol=1e-9)
        w = Rotation.from_matrix(R[1:] @ np.swapaxes(R[:-1], -1, -2)).as_rotvec()
        assert np.allclose(np.sum(w * (path.n_O[1:] + path.n_O[:-1]), axis=1), 0.0, atol=1e-9)
        rate = (1.0 / TIP.radius + 1.0 / BALL.radius) * np.diff(path.length)
        assert np.allclose(np.linalg.norm(w, axis=1), rate, atol=1e-9)
    for before, after in zip(plan.paths[:-1], plan.paths[1:], strict=True):
        # A lift puts the tip back on the same place of ball and tip.
        assert np.allclose(before.n_O[-1], after.n_O[0], atol=1e-9)
        assert np.allclose(before.n_F[-1], [0.0, 0.0, 1.0], atol=1e-9)


@given(st.integers(0, 2**31), st.floats(0.0, 1.35), st.floats(0.0, 2.0))
@lightly
def test_plans_are_valid_and_no_longer_than_straight_when_that_is_allowed(
    seed: int, off: float, away: float
) -> None:
    X, n = _start(seed, off)
    goal = _goal(n, seed, away)
    plan = roll_to(X, goal, TIP, BALL, LIMITS)
    if plan.status == "out_of_reach":
        assert away > np.radians(120.0)
        return
    _require_valid(plan, X, goal)
    assert plan.total_length >= BALL.radius * away - 1e-9
    if plan.kind == "straight":
        assert plan.total_length == pytest.approx(BALL.radius * away, abs=1e-12)
    elif off < 1e-9 and plan.kind != "stay":
        assert away > np.radians(STRAIGHT_DEG)


@given(st.integers(0, 2**31), st.floats(0.0, 1.35), st.floats(0.0, 0.9), st.booleans())
@lightly
def test_the_pole_is_on_the_contact_at_the_end(
    seed: int, off: float, away: float, is_spin_cancelled: bool
) -> None:
    X, n = _start(seed, off)
    goal = _goal(n, seed, away)
    plan = roll_to(X, goal, TIP, BALL, LIMITS, end="pole_without_spin" if is_spin_cancelled else "pole")
    _require_valid(plan, X, goal)
    assert plan.paths[-1].polar_angle[-1] < 1e-7
    if is_spin_cancelled and off == 0.0:
        assert compute_spin(plan.path) == pytest.approx(0.0, abs=1e-8)


def test_a_near_goal_is_rolled_straight() -> None:
    X, n = _start(0)
    goal = _goal(n, 0, np.radians(20.0))
    plan = roll_to(X, goal, TIP, BALL, LIMITS)
    assert (plan.status, plan.kind, plan.tried) == ("found", "straight", 1)
    assert np.degrees(plan.path.polar_angle[-1]) == pytest.approx(20.0 * 35.0 / 18.0, abs=1e-6)


@pytest.mark.parametrize(
    ("tip_deg", "is_straight"), [(39.0, True), (41.0, False), (-119.0, True), (-121.0, False)]
)
def test_a_straight_roll_ends_at_the_polar_limit(tip_deg: float, is_straight: bool) -> None:
    """From 40 degrees off the pole 40 more may be rolled away from it, and 120 the other way, across the pole."""
    X, n = _start(12, np.radians(40.0))
    pole = X[:3, 2]
    # On the tip the contact runs away from the pole as it runs away from the pole's image on the ball.
    away = -make_tangent(n, pole)
    goal = build_turn(np.cross(n, away), np.radians(tip_deg) * TIP.radius / BALL.radius) @ n
    plan = roll_to(X, goal, TIP, BALL, LIMITS)
    _require_valid(plan, X, goal)
    assert (plan.kind == "straight") is is_straight
    if is_straight:
        assert np.degrees(plan.path.polar_angle[-1]) == pytest.approx(79.0, abs=1e-6)


def test_beyond_the_straight_roll_comes_a_bend_then_triangles() -> None:
    X, n = _start(1)
    kinds = {}
    for away in (41.0, 42.0, 60.0, 90.0):
        goal = _goal(n, 1, np.radians(away))
        plan = roll_to(X, goal, TIP, BALL, LIMITS)
        _require_valid(plan, X, goal)
        kinds[away] = plan.kind
    assert kinds[41.0] == "straight"
    assert kinds[42.0] == "bend"
    assert kinds[60.0].startswith("triangles")
    assert kinds[90.0].startswith("triangles")


def test_the_papers_manoeuvre_is_found_where_the_pole_has_to_end_on_the_contact() -> None:
    """Limits of a hemisphere: A-B-C-D with legs of 90 degrees, repeated and mirrored to a distant target."""
    limits = RollLimits(0.5 * np.pi, np.radians(60.0))
    once = RollingTriangle(TIP.radius, BALL.radius, 0.5 * np.pi, np.radians(60.0)).displacement
    X, n = _start(2)
    goal = _goal(n, 2, 4.0 * once)
    plan = roll_to(X, goal, TIP, BALL, limits, end="pole_without_spin")
    _require_valid(plan, X, goal, limits)
    assert plan.kind in ("triangles LRLR", "triangles RLRL")
    assert plan.total_length == pytest.approx(4.0 * TIP.radius * (np.pi + np.radians(60.0)), abs=1e-9)
    assert compute_spin(plan.path) == pytest.approx(0.0, abs=1e-9)


def test_a_veto_on_one_hand_is_answered_with_the_other_or_with_lifts() -> None:
    X, n = _start(3)
    goal = _goal(n, 3, np.radians(25.0))
    side = np.cross(n, goal) / np.linalg.norm(np.cross(n, goal))
    first = roll_to(X, goal, TIP, BALL, LIMITS, end="pole")
    mean = float((first.paths[0].n_O @ side).mean())

    def is_on_one_side(X_OF: Array) -> NDArray[np.bool_]:
        return np.sign(-mean) * (X_OF[:, :3, 3] @ side) > -1e-4

    once = RollingTriangle(
        TIP.radius, BALL.radius, LIMITS.tip_polar_limit, LIMITS.tip_rotation_limit
    ).displacement
    near = _goal(n, 3, 0.9 * once)
    one = roll_to(X, near, TIP, BALL, LIMITS, end="pole", is_admissible=is_on_one_side)
    _require_valid(one, X, near)
    assert is_on_one_side(one.path.X_OF).all()
    # Mirrored pairs go to both sides: without spin only lifts remain.
    refused = roll_to(X, goal, TIP, BALL, LIMITS, end="pole_without_spin", is_admissible=is_on_one_side)
    assert refused.status == "not_admissible"
    assert "none is admissible all along" in refused.reason
    lifting = RollLimits(LIMITS.tip_polar_limit, LIMITS.tip_rotation_limit, max_lifts=4)
    plan = roll_to(X, goal, TIP, BALL, lifting, end="pole_without_spin", is_admissible=is_on_one_side)
    _require_valid(plan, X, goal)
    assert "lifts" in plan.kind
    with pytest.raises(ValueError, match="a way without lifts has one"):
        _ = plan.path
    ahead = build_turn(side, np.radians(25.0))
    assert np.allclose(plan.paths[-1].X_OF[-1, :3, :3], ahead @ X[:3, :3], atol=1e-9)


def test_a_goal_on_the_other_side_is_reached() -> None:
    X, n = _start(4)
    plan = roll_to(X, -n, TIP, BALL, RollLimits(0.5 * np.pi, np.radians(75.0), max_cycles=20))
    _require_valid(plan, X, -n, RollLimits(0.5 * np.pi, 1.0))


def test_staying_is_a_way() -> None:
    X, n = _start(5)
    plan = roll_to(X, n, TIP, BALL, LIMITS, end="pole_without_spin")
    assert (plan.status, plan.kind) == ("found", "stay")
    assert plan.total_length < 1e-12


def test_truthful_when_there_is_no_way() -> None:
    X, n = _start(6)
    goal = _goal(n, 6, np.radians(90.0))
    none = roll_to(X, goal, TIP, BALL, RollLimits(np.radians(80.0), np.radians(75.0), max_cycles=0))
    assert none.status == "out_of_reach"
    assert "the goal is 90 degrees away" in none.reason
    assert "more cycles, wider limits or a nearer goal would help" in none.reason
    with pytest.raises(ValueError, match="0 paths"):
        _ = none.path
    tipped, m = _start(6, np.radians(85.0))
    beyond = roll_to(tipped, m, TIP, BALL, LIMITS)
    assert beyond.status == "start_beyond_limit"
    assert beyond.reason == "the contact starts 85.0 degrees off the tip's pole; at most 80.0 is accepted"
    stuck = roll_to(X, goal, TIP, BALL, LIMITS, is_admissible=lambda x: np.zeros(len(x), dtype=bool))
    assert stuck.status == "start_not_admissible"
    same = X.copy()
    same[:3, 3] = 0.07 * n
    equal = roll_to(same, goal, Sphere(0.035), BALL, LIMITS, end="pole")
    assert equal.status == "out_of_reach"
    assert "not as large as the ball" in equal.reason


def test_a_goal_just_out_of_reach_is_in_reach_with_one_more_cycle() -> None:
    once = RollingTriangle(
        TIP.radius, BALL.radius, LIMITS.tip_polar_limit, LIMITS.tip_rotation_limit
    ).displacement
    X, n = _start(7)
    goal = _goal(n, 7, 3.01 * once)
    for cycles, status in ((3, "out_of_reach"), (4, "found")):
        limits = RollLimits(LIMITS.tip_polar_limit, LIMITS.tip_rotation_limit, max_cycles=cycles)
        assert roll_to(X, goal, TIP, BALL, limits, end="pole").status == status


def test_spin_is_cancelled_by_pairs_only() -> None:
    """Three cycles make one mirrored pair: the reach that is reported says so."""
    once = RollingTriangle(
        TIP.radius, BALL.radius, LIMITS.tip_polar_limit, LIMITS.tip_rotation_limit
    ).displacement
    X, n = _start(7)
    goal = _goal(n, 7, 2.5 * once)
    limits = RollLimits(LIMITS.tip_polar_limit, LIMITS.tip_rotation_limit, max_cycles=3)
    plan = roll_to(X, goal, TIP, BALL, limits, end="pole_without_spin")
    assert plan.status == "out_of_reach"
    assert f"at most about {np.degrees(2.0 * once):.3g} can be rolled" in plan.reason


def test_a_tip_larger_than_the_ball_gets_ahead_too() -> None:
    X, n = _start(10)
    X[:3, 3] = 0.055 * n
    goal = _goal(n, 10, 0.3)
    plan = roll_to(X, goal, Sphere(0.035), Sphere(0.020), LIMITS, end="pole")
    assert plan.is_found, plan.reason
    assert np.allclose(plan.path.n_O[-1], goal, atol=1e-9)
    assert plan.path.polar_angle[-1] < 1e-7


def test_mistakes_are_named() -> None:
    X, n = _start(8)
    with pytest.raises(ValueError, match=r"'upright'.*'pole_without_spin' are accepted"):
        roll_to(X, n, TIP, BALL, LIMITS, end="upright")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="from 1 and from 2 on"):
        RollLimits(1.0, 1.0, samples=1)
    with pytest.raises(ValueError, match="shape"):
        roll_to(
            X,
            _goal(n, 8, 0.1),
            TIP,
            BALL,
            LIMITS,
            is_admissible=lambda x: np.ones(1, dtype=bool),
        )
    with pytest.raises(ValueError, match="at most pi/2"):
        RollLimits(2.0, 1.0)
    with pytest.raises(ValueError, match="less than pi"):
        RollLimits(1.0, 4.0)
    with pytest.raises(ValueError, match="0 or more"):
        RollLimits(1.0, 1.0, max_cycles=-1)
