"""Rolling: great circles, holonomy, order of integration, paths that a controller can follow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from dexplan.contact.kinematics.coordinates import (
    ContactCoordinates,
    build_coordinates,
    compute_relative_pose,
)
from dexplan.contact.kinematics.integration import ORDER, integrate_legs, integrate_motion
from dexplan.contact.rolling.curves import (
    RollingPath,
    join_paths,
    roll_along,
    roll_over,
    roll_turning,
    solve_two_finger_goals,
)
from dexplan.contact.rolling.turning import build_turn, make_tangent
from dexplan.contact.surfaces.shapes import Cylinder, Ellipsoid, Plane, Sphere
from dexplan.contact.surfaces.surface import AbstractSurface
from dexplan.spatial import Array

R_TIP, R_BALL = 0.012, 0.040
lightly = settings(deadline=None, derandomize=True, max_examples=40)


def _pose(n: Array, R_OF: Array, reach: float = R_TIP + R_BALL) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R_OF, reach * n
    return X


def _random_start(seed: int) -> tuple[Array, Array, np.random.Generator]:
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    return _pose(n, Rotation.random(rng=rng).as_matrix()), n, rng


def _flatness(normals: Array) -> float:
    """Smallest singular value of unit vectors (K, 3): zero if and only if they lie on one great circle."""
    return float(np.linalg.svd(normals)[1][-1] / np.sqrt(len(normals)))


def _sphere_contact(X: Array) -> ContactCoordinates:
    n = X[:3, 3] / np.linalg.norm(X[:3, 3])
    return build_coordinates(Sphere(R_TIP), Sphere(R_BALL), X[:3, :3], -X[:3, :3].T @ n, n)


def test_sixty_degrees_on_the_tip() -> None:
    """r 12, R 40 mm, 60 degrees of arc: 12.5664 mm, 18 degrees on the ball, the tip turns by 78 degrees."""
    X, n, rng = _random_start(0)
    axis = np.cross(n, make_tangent(n, rng.normal(size=3)))
    path = roll_along(R_TIP, R_BALL, X, [build_turn(axis, np.radians(18.0)) @ n])
    assert path.total_length == pytest.approx(0.012 * np.pi / 3.0, abs=1e-15)
    assert np.degrees(np.arccos(path.n_F[0] @ path.n_F[-1])) == pytest.approx(60.0, abs=1e-9)
    turn = Rotation.from_matrix(path.X_OF[-1, :3, :3] @ path.X_OF[0, :3, :3].T)
    assert np.degrees(turn.magnitude()) == pytest.approx(78.0, abs=1e-9)


@given(st.integers(0, 2**31), st.integers(1, 4))
@lightly
def test_a_path_touches_and_rolls(seed: int, legs: int) -> None:
    """The contact is where it says on both bodies, and no material point slides: p_OC moves as p_FC does."""
    X, _, rng = _random_start(seed)
    path = roll_along(R_TIP, R_BALL, X, rng.normal(size=(legs, 3)), 400)
    R = path.X_OF[:, :3, :3]
    assert np.allclose(np.einsum("kij,kj->ki", R, path.n_F), -path.n_O, atol=1e-12)
    assert np.allclose(np.einsum("kij,kj->ki", R, path.p_F) + path.X_OF[:, :3, 3], path.p_O, atol=1e-12)
    assert np.allclose(path.X_OF[0], X, atol=1e-12)
    ds = np.diff(path.length)
    for points in (path.p_O, path.p_F):
        chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
        assert np.allclose(chord, ds, atol=1e-6)
    # Velocity of the tip's material point at the contact, by differences of the pose between neighbours.
    middle = 0.5 * (path.p_F[1:] + path.p_F[:-1])
    moved = np.einsum("kij,kj->ki", np.diff(R, axis=0), middle) + np.diff(path.X_OF[:, :3, 3], axis=0)
    step = np.diff(path.length)[:, None] / R_TIP
    assert np.all(np.abs(moved) <= 0.2 * R_TIP * step**2)
    # No spin: the turn between neighbours has no part along the mean normal.
    w = Rotation.from_matrix(R[1:] @ np.swapaxes(R[:-1], -1, -2)).as_rotvec()
    assert np.allclose(np.sum(w * (path.n_O[1:] + path.n_O[:-1]), axis=1), 0.0, atol=1e-12)
    assert len(path.corners) == legs + 1
    assert path.corners[-1] == len(path) - 1


def test_theory_2_great_circle_on_the_ball_gives_one_on_the_tip() -> None:
    X, n, rng = _random_start(1)
    axis = np.cross(n, make_tangent(n, rng.normal(size=3)))

    def motion(_: float, X_OC: Array, X_OF: Array) -> Array:
        # Rolling without spin so that the contact follows the great circle about ``axis`` on the ball.
        return np.concatenate([np.zeros(3), axis])

    at = integrate_motion(Sphere(R_TIP), Sphere(R_BALL), _sphere_contact(X), motion, 4.0, 60)
    assert _flatness(Sphere(R_BALL).normal(at.u_o, at.v_o, at.chart_o)) < 1e-9
    assert _flatness(Sphere(R_TIP).normal(at.u_f, at.v_f, at.chart_f)) < 1e-9
    # As the closed form does.
    s = 4.0 * R_TIP * R_BALL / (R_TIP + R_BALL)
    path = roll_turning(R_TIP, R_BALL, X, np.cross(axis, n), [0.0], [s])
    end = compute_relative_pose(Sphere(R_TIP), Sphere(R_BALL), at)[-1]
    assert np.allclose(path.X_OF[-1], end, atol=1e-9)


def test_theory_2_great_circle_on_the_tip_gives_one_on_the_ball() -> None:
    X, n, rng = _random_start(2)
    axis_F = X[:3, :3].T @ np.cross(n, make_tangent(n, rng.normal(size=3)))

    def motion(_: float, X_OC: Array, X_OF: Array) -> Array:
        # The turn is fixed in the tip: the contact follows the great circle about ``axis_F`` on it.
        return np.concatenate([np.zeros(3), X_OF[:3, :3] @ axis_F])

    at = integrate_motion(Sphere(R_TIP), Sphere(R_BALL), _sphere_contact(X), motion, 4.0, 60)
    assert _flatness(Sphere(R_TIP).normal(at.u_f, at.v_f, at.chart_f)) < 1e-9
    assert _flatness(Sphere(R_BALL).normal(at.u_o, at.v_o, at.chart_o)) < 1e-9


@pytest.mark.parametrize("is_on_tip", [False, True])
def test_theory_2_no_great_circle_on_one_gives_none_on_the_other(is_on_tip: bool) -> None:
    """A small circle 50 degrees about a pole on one; the other's is bent by the same geodesic curvature."""
    pole, opening = np.array([0.0, 0.0, 1.0]), np.radians(50.0)
    n = build_turn([1.0, 0.0, 0.0], opening) @ pole
    R_start = np.diag([1.0, -1.0, -1.0])
    X = _pose(n, R_start)
    if is_on_tip:
        X[:3, :3] = np.diag([-1.0, -1.0, 1.0])
    r = R_TIP if is_on_tip else R_BALL

    def motion(_: float, X_OC: Array, X_OF: Array) -> Array:
        normal = -X_OC[:3, 2]
        round_about = X_OF[:3, :3] @ pole if is_on_tip else pole
        s = np.cross(round_about, normal)  # runs round at sin(opening)
        return np.concatenate([np.zeros(3), np.cross(normal, s)])

    at = integrate_motion(Sphere(R_TIP), Sphere(R_BALL), _sphere_contact(X), motion, 5.0, 80)
    on_tip = Sphere(R_TIP).normal(at.u_f, at.v_f, at.chart_f)
    on_ball = Sphere(R_BALL).normal(at.u_o, at.v_o, at.chart_o)
    first, second = (on_tip, on_ball) if is_on_tip else (on_ball, on_tip)
    assert np.ptp(first @ pole) < 1e-9  # the small circle that was asked for
    assert _flatness(first) > 0.01
    assert _flatness(second) > 0.01
    # Geodesic curvature of a small circle at angle a on radius r: cot(a) / r; rolling without spin keeps it.
    curvature = abs(1.0 / np.tan(np.arccos(first[0] @ pole))) / r
    other = R_BALL if is_on_tip else R_TIP
    normal = np.linalg.svd(second - second.mean(axis=0))[2][-1]
    assert np.ptp(second @ normal) < 1e-9
    assert abs(1.0 / np.tan(np.arccos(second[0] @ normal))) / other == pytest.approx(curvature, rel=1e-8)


@pytest.mark.parametrize(
    ("side", "angle_deg", "axis"),
    [
        (0.5 * np.pi, 120.0, np.array([1.0, 1.0, -1.0]) / np.sqrt(3.0)),
        (np.pi, 0.0, None),
        (1.0, 53.15269, None),
    ],
)
def test_a_unit_sphere_rolled_round_a_square(side: float, angle_deg: float, axis: Array | None) -> None:
    """First along +x, then left: +y, -x, -y.  By integration of the contact equations."""
    tip, plane = Sphere(1.0), Plane()
    start = build_coordinates(tip, plane, np.eye(3), np.array([0.0, 0.0, -1.0]), np.zeros(3))
    path = roll_over(tip, plane, start, [1.0, 0.0, 0.0], [0.0] + 3 * [0.5 * np.pi], 4 * [side], 40)
    assert np.allclose(
        path.p_O[path.corners] / side, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], atol=1e-9
    )
    turn = Rotation.from_matrix(path.X_OF[-1, :3, :3])
    assert np.degrees(turn.magnitude()) == pytest.approx(angle_deg, abs=5e-6)
    if axis is not None:
        assert np.allclose(turn.as_rotvec() / turn.magnitude(), axis, atol=1e-9)
    # The closed form: four rotations about horizontal axes.
    quarter = [
        Rotation.from_rotvec(side * np.cross([0, 0, 1], d))
        for d in ([1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0])
    ]
    closed = quarter[3] * quarter[2] * quarter[1] * quarter[0]
    assert np.allclose(closed.as_matrix(), path.X_OF[-1, :3, :3], atol=1e-9)
    assert np.degrees(closed.magnitude()) == pytest.approx(angle_deg, abs=5e-6)


@given(st.integers(0, 2**31))
@settings(deadline=None, derandomize=True, max_examples=6)
def test_closed_form_legs_agree_with_integration(seed: int) -> None:
    X, n, rng = _random_start(seed)
    heading, turns = make_tangent(n, rng.normal(size=3)), rng.uniform(-3.0, 3.0, 3)
    lengths = rng.uniform(0.2, 2.0, 3) * R_TIP
    path = roll_turning(R_TIP, R_BALL, X, heading, turns.tolist(), lengths.tolist())
    general = roll_over(
        Sphere(R_TIP), Sphere(R_BALL), _sphere_contact(X), heading, turns.tolist(), lengths.tolist(), 25
    )
    assert np.allclose(path.X_OF[-1], general.X_OF[-1], atol=1e-9)
    assert np.allclose(path.n_F[path.corners], general.n_F[general.corners], atol=1e-9)
    assert np.allclose(path.length[path.corners], general.length[general.corners], atol=1e-14)


def _stir(t: float, X_OC: Array, X_OF: Array) -> Array:
    """Rolling, spinning and sliding at once, steady in O but for a slow swing; its part along the normal is taken out."""
    v = np.array([0.004, 0.003 * np.cos(t), -0.002])
    n = X_OC[..., :3, 2]
    w = np.broadcast_to([0.9, -0.5, 0.4 * np.sin(t) + 0.3], n.shape)
    return np.concatenate([v - np.sum(v * n, axis=-1, keepdims=True) * n, w], axis=-1)


def test_sliding_rolling_and_spinning_follow_the_rigid_motion() -> None:
    """Against an adaptive integration of the pose alone: for spheres the contact is on the line of centres."""
    X, _, _ = _random_start(4)

    def pose_rate(t: float, y: Array) -> Array:
        R_OF, p = y[:9].reshape(3, 3), y[9:]
        n = p / np.linalg.norm(p)
        X_OC = np.eye(4)
        X_OC[:3, 2] = -n
        V = _stir(t, X_OC, np.eye(4))
        W = np.cross(np.broadcast_to(V[3:], (3, 3)), R_OF.T).T
        return np.concatenate([W.ravel(), V[:3] + np.cross(V[3:], p - R_BALL * n)])

    y = solve_ivp(
        pose_rate, (0.0, 3.0), np.concatenate([X[:3, :3].ravel(), X[:3, 3]]), "DOP853", rtol=1e-12, atol=1e-14
    ).y[:, -1]
    at = integrate_motion(Sphere(R_TIP), Sphere(R_BALL), _sphere_contact(X), _stir, 3.0, 60)
    end = compute_relative_pose(Sphere(R_TIP), Sphere(R_BALL), at)[-1]
    assert np.allclose(end[:3, :3], y[:9].reshape(3, 3), atol=1e-9)
    assert np.allclose(end[:3, 3], y[9:], atol=1e-10)


@pytest.mark.parametrize(
    ("tip", "body"),
    [
        (Sphere(0.012), Ellipsoid((0.04, 0.03, 0.035))),
        (Ellipsoid((0.02, 0.015, 0.018)), Cylinder(0.03)),
        (Ellipsoid((0.02, 0.015, 0.018)), Plane()),
    ],
    ids=["sphere-ellipsoid", "ellipsoid-cylinder", "ellipsoid-plane"],
)
def test_order_of_integration(tip: AbstractSurface, body: AbstractSurface) -> None:
    """Two contacts at once; the error falls by 2^6 with the step, within a fifth of the exponent."""
    start = ContactCoordinates(
        np.array([0.3, -0.2]),
        np.array([0.2, 1.0]),
        np.array([0.01, -0.02]),
        np.array([0.3, 0.01]),
        np.array([0.7, -1.0]),
    )

    def end(steps: int) -> Array:
        return compute_relative_pose(tip, body, integrate_motion(tip, body, start, _stir, 1.6, steps))[-1]

    exact = end(64)
    errors = [np.abs(end(steps) - exact).max() for steps in (4, 8, 16)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > ORDER - 1.2), (errors, orders)
    assert errors[-1] < 1e-6


def test_an_ellipsoid_rolls_over_the_poles_of_its_charts() -> None:
    """Over a pole of the ball's chart and of the tip's and back: psi stays consistent, nothing is NaN, the way back undoes it."""
    tip, body = Ellipsoid((0.02, 0.015, 0.018)), Ellipsoid((0.04, 0.03, 0.035))
    start = ContactCoordinates(*np.array([0.9, 0.2, 0.0, 0.0, 0.5]))
    at, rolled = integrate_legs(tip, body, start, [0.0, 0.0, 1.0], [0.0, np.pi], [0.065, 0.065], 60)
    assert len(set(at.chart_o.tolist())) > 1
    assert len(set(at.chart_f.tolist())) > 1
    X = compute_relative_pose(tip, body, at)
    assert np.isfinite(X).all()
    step = rolled[1] / 0.006  # no principal radius of either is smaller
    assert np.abs(np.diff(X[:, :3, :3], axis=0)).max() < 2.0 * step  # no jump where charts change
    assert np.allclose(X[-1], X[0], atol=1e-7)


def test_a_batch_of_contacts_rolls_as_each_alone() -> None:
    tip, ball = Sphere(R_TIP), Sphere(R_BALL)
    X = np.stack([_random_start(s)[0] for s in range(3)])
    n = X[:, :3, 3] / (R_TIP + R_BALL)
    start = build_coordinates(tip, ball, X[:, :3, :3], -np.einsum("kji,kj->ki", X[:, :3, :3], n), n)
    headings = np.stack([make_tangent(a, [0.3, 0.2, 0.9]) for a in n])
    lengths = np.array([[0.01, 0.015, 0.02], [0.012, 0.01, 0.0]])
    at, rolled = integrate_legs(tip, ball, start, headings, [0.0, 1.0], lengths, 15)
    end = compute_relative_pose(tip, ball, at)[-1]
    for k in range(3):
        path = roll_turning(R_TIP, R_BALL, X[k], headings[k], [0.0, 1.0], lengths[:, k].tolist())
        assert np.allclose(end[k], path.X_OF[-1], atol=1e-8)
    assert np.allclose(rolled[-1], lengths.sum(axis=0))


def test_poses_between_samples() -> None:
    """Exact on spheres however coarse the samples; second order elsewhere."""
    X, _, rng = _random_start(6)
    waypoints = rng.normal(size=(3, 3))
    fine, coarse = roll_along(R_TIP, R_BALL, X, waypoints, 2001), roll_along(R_TIP, R_BALL, X, waypoints, 60)
    assert np.allclose(coarse.pose_at(fine.length), fine.X_OF, atol=1e-11)
    assert np.allclose(coarse.pose_at([-1.0, 9.0]), fine.X_OF[[0, -1]], atol=1e-12)
    assert coarse.pose_at(0.01).shape == (4, 4)
    tip, body = Sphere(R_TIP), Ellipsoid((0.04, 0.03, 0.035))
    start = ContactCoordinates(*np.array([0.1, 0.2, 0.3, 0.4, 0.5]))
    paths = [roll_over(tip, body, start, [0.0, 0.4, 0.9], [0.0], [0.03], k) for k in (40, 20, 10)]
    errors = [np.abs(p.pose_at(paths[0].length) - paths[0].X_OF).max() for p in paths[1:]]
    assert errors[0] < 0.3 * errors[1]
    assert errors[0] < 1e-2


def test_a_path_is_its_start_and_its_waypoints() -> None:
    X, n, rng = _random_start(11)
    path = roll_turning(
        R_TIP, R_BALL, X, make_tangent(n, rng.normal(size=3)), [0.0, 1.0, -2.0], [0.03, 0.01, 0.02]
    )
    again = roll_along(R_TIP, R_BALL, path.X_OF[0], path.waypoints)
    assert np.allclose(again.X_OF, path.X_OF, atol=1e-12)
    assert np.allclose(again.length, path.length, atol=1e-12)
    back = path.reversed
    assert np.allclose(roll_along(R_TIP, R_BALL, back.X_OF[0], back.waypoints).X_OF[-1], X, atol=1e-12)
    assert back.corners.tolist() == (len(path) - 1 - path.corners[::-1]).tolist()
    assert back.length[0] == 0.0
    assert np.all(np.diff(back.length) > 0.0)


def test_paths_join_where_they_meet() -> None:
    X, _, rng = _random_start(7)
    a, b = rng.normal(size=(2, 3))
    whole = roll_along(R_TIP, R_BALL, X, [a, b])
    first = roll_along(R_TIP, R_BALL, X, [a])
    second = roll_along(R_TIP, R_BALL, first.X_OF[-1], [b])
    joined = join_paths([first, second])
    assert np.allclose(joined.X_OF[-1], whole.X_OF[-1], atol=1e-12)
    assert joined.total_length == pytest.approx(whole.total_length)
    assert np.allclose(joined.X_OF[joined.corners], whole.X_OF[whole.corners], atol=1e-12)
    assert not joined.X_OF.flags.writeable
    with pytest.raises(ValueError, match="without a lift between"):
        join_paths([first, first])


@given(st.integers(0, 2**31), st.floats(1.8, np.pi))
@lightly
def test_two_contacts_reach_a_grasp_the_shortest_way(seed: int, angle_min: float) -> None:
    """Each moves (phi_min - phi) / 2 along their great circle; no other pair of goals within those ways is apart enough."""
    rng = np.random.default_rng(seed)
    a, b = (x / np.linalg.norm(x) for x in rng.normal(size=(2, 3)))
    goals = solve_two_finger_goals(a, b, angle_min)
    phi = np.arccos(a @ b)
    if phi >= angle_min:
        assert np.allclose(goals, (a, b))
        return
    assert np.arctan2(np.linalg.norm(np.cross(*goals)), goals[0] @ goals[1]) == pytest.approx(
        angle_min, abs=1e-12
    )
    for n, goal in zip((a, b), goals, strict=True):
        assert np.arccos(np.clip(n @ goal, -1, 1)) == pytest.approx(0.5 * (angle_min - phi), abs=1e-7)
        assert abs(goal @ np.cross(a, b)) < 1e-12
    # Random moves of the same lengths get no farther apart.
    other = [
        build_turn(np.cross(n, make_tangent(n, rng.normal(size=3))), 0.5 * (angle_min - phi)) @ n
        for n in (a, b)
    ]
    assert np.arccos(np.clip(other[0] @ other[1], -1, 1)) <= angle_min + 1e-9


def test_figure_1() -> None:
    """mu 0.5: contacts 100 degrees apart move 13.43495 degrees each to phi_min = 126.86990."""
    a, b = np.array([1.0, 0.0, 0.0]), np.array([np.cos(np.radians(100.0)), np.sin(np.radians(100.0)), 0.0])
    g, _ = solve_two_finger_goals(a, b, np.pi - 2.0 * np.arctan(0.5))
    assert np.degrees(np.arctan2(g[1], g[0])) == pytest.approx(-13.43495, abs=5e-6)


def test_what_cannot_be_rolled_is_refused() -> None:
    X, n, _ = _random_start(8)
    off = X.copy()
    off[:3, 3] *= 1.05
    with pytest.raises(ValueError, match=r"54.6 mm from the ball's; 52.0 mm touches, 1 % off is accepted"):
        roll_along(R_TIP, R_BALL, off, [n])
    with pytest.raises(ValueError, match="one more between them is accepted"):
        roll_along(R_TIP, R_BALL, X, [-n])
    with pytest.raises(ValueError, match="part along the surface is accepted"):
        roll_turning(R_TIP, R_BALL, X, n, [0.0], [0.01])
    with pytest.raises(ValueError, match="not negative"):
        roll_turning(R_TIP, R_BALL, X, make_tangent(n, [1, 2, 3]), [0.0], [-0.01])
    with pytest.raises(ValueError, match="no direction; finite vectors"):
        roll_along(R_TIP, R_BALL, X, [[np.nan, 0.0, 1.0]])
    with pytest.raises(ValueError, match="a path without a leg"):
        roll_turning(R_TIP, R_BALL, X, make_tangent(n, [1, 2, 3]), [], [])
    with pytest.raises(ValueError, match="same place"):
        solve_two_finger_goals(n, n, 2.0)
    with pytest.raises(ValueError, match="at most pi"):
        solve_two_finger_goals(n, -n, 4.0)
    tip, body = Sphere(0.01), Ellipsoid((0.02, 0.03, 0.04))
    start = ContactCoordinates(*np.zeros(5))
    with pytest.raises(ValueError, match="more steps are accepted"):
        roll_over(tip, body, start, [0, 0, 1], [0.0], [0.05], 1)
    with pytest.raises(ValueError, match="one or more are accepted"):
        roll_over(tip, body, start, [0, 0, 1], [0.0], [0.05], 0)
    with pytest.raises(ValueError, match="touch along a line"):
        roll_over(Plane(), Plane(), start, [0, 1, 0], [0.0], [0.05], 5)


def test_a_path_of_no_length_stays() -> None:
    X, n, _ = _random_start(9)
    path = roll_along(R_TIP, R_BALL, X, [n])
    assert isinstance(path, RollingPath)
    assert path.total_length < 1e-15
    assert np.allclose(path.X_OF, X, atol=1e-12)
    assert np.allclose(path.pose_at(0.0), X, atol=1e-12)
