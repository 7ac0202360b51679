"""The contact equations against rigid motions and closest points, for every pair of shapes."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from dexplan.contact.kinematics.closest_points import find_closest_points
from dexplan.contact.kinematics.coordinates import (
    ContactCoordinates,
    build_psi_rotation,
    change_charts,
    compute_relative_pose,
    leave_borders,
)
from dexplan.contact.kinematics.montana import (
    build_pivoting_twist,
    build_rolling_twist,
    build_sliding_twist,
    compute_contact_twist,
    compute_rates,
    compute_tip_twist,
    compute_twist,
)
from dexplan.contact.surfaces.shapes import Cylinder, Ellipsoid, Plane, Sphere
from dexplan.contact.surfaces.surface import AbstractSurface
from dexplan.spatial import Array, hat, invert_pose

SHAPES: list[AbstractSurface] = [
    Sphere(0.018),
    Plane(),
    Cylinder(0.02),
    Ellipsoid((0.03, 0.02, 0.025)),
]
PAIRS = list(itertools.product(SHAPES, SHAPES))
POINT_PAIRS = [(a, b) for a, b in PAIRS if not {type(a), type(b)} <= {Plane, Cylinder}] + [
    (Cylinder(0.02), Cylinder(0.03))
]
LINE_PAIRS = [(a, b) for a, b in PAIRS if {type(a), type(b)} <= {Plane, Cylinder}]

lightly = settings(deadline=None, derandomize=True, max_examples=40)
pairs = st.sampled_from(POINT_PAIRS)
angles = st.tuples(*[st.floats(-1.0, 1.0)] * 5)
charts = st.tuples(st.integers(0, 2), st.integers(0, 2))
twists = st.tuples(*[st.floats(-1.0, 1.0)] * 5)


def _contact(
    tip: AbstractSurface, body: AbstractSurface, q: tuple[float, ...], k: tuple[int, int]
) -> ContactCoordinates:
    """Contact coordinates from numbers in [-1, 1]: latitudes up to 60 degrees (or 6 cm), any longitude and psi."""
    scale = [0.06 if isinstance(s, (Plane, Cylinder)) else 1.05 for s in (tip, body)]
    # Cylinders must not lie along each other.
    psi = (
        0.25 + 0.55 * (q[4] + 1.0) if isinstance(tip, Cylinder) and isinstance(body, Cylinder) else 3.1 * q[4]
    )
    wide = [0.06 if isinstance(s, Plane) else 3.1 for s in (tip, body)]
    values = np.array([scale[0] * q[0], wide[0] * q[1], scale[1] * q[2], wide[1] * q[3], psi])
    chart_f, chart_o = (np.array(c % s.chart_count) for c, s in zip(k, (tip, body), strict=True))
    return ContactCoordinates.from_array(values, chart_f, chart_o)


def _twist(q: tuple[float, ...]) -> Array:
    """Sliding up to 2 cm/s and turning up to 1 rad/s."""
    return np.array([0.02 * q[0], 0.02 * q[1], 0.0, q[2], q[3], q[4]])


def _move(X_OF: Array, V_OF_F: Array, t: float) -> Array:
    """X_OF after the tip has moved with a constant twist (v, w) in its own frame for a time t."""
    xi = np.zeros((4, 4))
    xi[:3, :3], xi[:3, 3] = hat(V_OF_F[3:]), V_OF_F[:3]
    return X_OF @ expm(t * xi)


def _unwrap(difference: Array) -> Array:
    """Differences of coordinates of which any but the metric ones may jump by a whole turn (never by half of one)."""
    return np.where(
        np.abs(difference) > np.pi,
        difference - 2.0 * np.pi * np.round(difference / (2.0 * np.pi)),
        difference,
    )


@given(pairs, angles, charts, twists)
@lightly
def test_rates_are_those_of_rigid_motion_and_closest_points(
    pair: tuple[AbstractSurface, AbstractSurface],
    q: tuple[float, ...],
    k: tuple[int, int],
    w: tuple[float, ...],
) -> None:
    tip, body = pair
    at = _contact(tip, body, q, k)
    V_C = _twist(w)
    V_F, X = compute_tip_twist(tip, body, at, V_C), compute_relative_pose(tip, body, at)
    h = 1e-3
    poses = np.stack([_move(X, V_F, t * h) for t in (-2, -1, 1, 2)])
    seen, _ = find_closest_points(tip, body, poses, near=at)
    steps = _unwrap(seen.as_array() - at.as_array())
    slope = (steps[0] - 8.0 * steps[1] + 8.0 * steps[2] - steps[3]) / (12.0 * h)
    rates = compute_rates(tip, body, at, V_C)
    assert np.allclose(rates, slope, atol=1e-6 * (1.0 + np.abs(rates).max()))


@given(pairs, angles, charts, twists)
@lightly
def test_twist_and_rates_are_inverse(
    pair: tuple[AbstractSurface, AbstractSurface],
    q: tuple[float, ...],
    k: tuple[int, int],
    w: tuple[float, ...],
) -> None:
    tip, body = pair
    at, V_C = _contact(tip, body, q, k), _twist(w)
    assert np.allclose(compute_twist(tip, body, at, compute_rates(tip, body, at, V_C)), V_C, atol=1e-12)
    assert np.allclose(
        compute_contact_twist(tip, body, at, compute_tip_twist(tip, body, at, V_C)), V_C, atol=1e-14
    )


@given(pairs, angles, charts)
@lightly
def test_pose_and_coordinates_round_trip(
    pair: tuple[AbstractSurface, AbstractSurface], q: tuple[float, ...], k: tuple[int, int]
) -> None:
    """From nothing but the pose; in the chart the coordinates came from, to 1e-12."""
    tip, body = pair
    at = _contact(tip, body, q, k)
    X = compute_relative_pose(tip, body, at)
    found, gap = find_closest_points(tip, body, X)
    assert abs(gap) < 1e-14
    assert np.allclose(compute_relative_pose(tip, body, found), X, atol=1e-12, rtol=0.0)
    back = change_charts(tip, body, found, at.chart_f, at.chart_o)
    assert np.allclose(_unwrap(back.as_array() - at.as_array()), 0.0, atol=1e-12)


@given(pairs, angles, charts, st.floats(-0.004, 0.02))
@lightly
def test_gap_is_seen_along_the_normal(
    pair: tuple[AbstractSurface, AbstractSurface], q: tuple[float, ...], k: tuple[int, int], gap: float
) -> None:
    tip, body = pair
    at = _contact(tip, body, q, k)
    X = compute_relative_pose(tip, body, at)
    X[:3, 3] += gap * body.normal(at.u_o, at.v_o, at.chart_o)
    found, measured = find_closest_points(tip, body, X, near=at)
    assert measured == pytest.approx(gap, abs=1e-12)
    assert np.allclose(_unwrap(found.as_array() - at.as_array()), 0.0, atol=1e-9)


@given(pairs, angles, charts, charts)
@lightly
def test_the_pose_does_not_depend_on_charts(
    pair: tuple[AbstractSurface, AbstractSurface],
    q: tuple[float, ...],
    k: tuple[int, int],
    other: tuple[int, int],
) -> None:
    tip, body = pair
    at = _contact(tip, body, q, k)
    moved = change_charts(
        tip, body, at, np.array(other[0] % tip.chart_count), np.array(other[1] % body.chart_count)
    )
    X = compute_relative_pose(tip, body, at)
    assert np.allclose(compute_relative_pose(tip, body, moved), X, atol=1e-14)
    assert np.allclose(X[:3, :3].T @ X[:3, :3], np.eye(3), atol=1e-14)
    assert np.linalg.det(X[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("pair", POINT_PAIRS, ids=lambda p: f"{type(p[0]).__name__}-{type(p[1]).__name__}")
def test_many_contacts_are_as_many_single_ones(pair: tuple[AbstractSurface, AbstractSurface]) -> None:
    tip, body = pair
    rng = np.random.default_rng(3)
    q, w, k = rng.uniform(-1, 1, (6, 5)), rng.uniform(-1, 1, (6, 5)), rng.integers(0, 3, (6, 2))
    one = [_contact(tip, body, tuple(a), (int(b[0]), int(b[1]))) for a, b in zip(q, k, strict=True)]
    many = ContactCoordinates.from_array(
        np.stack([c.as_array() for c in one]).reshape(2, 3, 5),
        np.stack([c.chart_f for c in one]).reshape(2, 3),
        np.stack([c.chart_o for c in one]).reshape(2, 3),
    )
    V = np.stack([_twist(tuple(a)) for a in w]).reshape(2, 3, 6)
    functions: list[Callable[[ContactCoordinates, Array], Array]] = [
        lambda at, v: compute_rates(tip, body, at, v),
        lambda at, _: compute_relative_pose(tip, body, at),
        lambda at, v: compute_tip_twist(tip, body, at, v),
        lambda at, _: find_closest_points(tip, body, compute_relative_pose(tip, body, at), near=at)[
            0
        ].as_array(),
    ]
    for f in functions:
        singles = np.stack([f(c, v) for c, v in zip(one, V.reshape(6, 6), strict=True)])
        assert np.allclose(f(many, V).reshape(singles.shape), singles, atol=1e-10)


@pytest.mark.parametrize("pair", LINE_PAIRS, ids=lambda p: f"{type(p[0]).__name__}-{type(p[1]).__name__}")
def test_contact_along_a_line_is_refused(pair: tuple[AbstractSurface, AbstractSurface]) -> None:
    at = ContactCoordinates(*np.zeros((5, 1)))
    with pytest.raises(ValueError, match="touch along a line"):
        compute_rates(*pair, at, build_rolling_twist(0.1, 0.2))


def test_rolling_speed_on_spheres() -> None:
    """The contact runs at |w| r R / (r + R) on both surfaces [ORACLES.md]."""
    tip, ball = Sphere(0.012), Sphere(0.040)
    at = ContactCoordinates(*np.array([0.3, 0.2, -0.5, 1.0, 0.7]))
    rates = compute_rates(tip, ball, at, build_rolling_twist(0.6, -0.8))
    s_f = rates[:2] * np.diag(tip.metric(at.u_f, at.v_f))
    s_o = rates[2:4] * np.diag(ball.metric(at.u_o, at.v_o))
    wanted = 0.012 * 0.040 / 0.052
    assert np.linalg.norm(s_f) == pytest.approx(wanted, abs=1e-12)
    assert np.linalg.norm(s_o) == pytest.approx(wanted, abs=1e-12)
    # Both points run the same way in space: s_o = P s_f.
    assert np.allclose(build_psi_rotation(at.psi)[:2, :2] @ s_f, s_o, atol=1e-15)


def test_pivoting_moves_nothing_but_psi_and_sliding_keeps_the_attitude() -> None:
    tip, ball = Ellipsoid((0.03, 0.02, 0.025)), Sphere(0.040)
    at = ContactCoordinates(*np.array([0.3, 0.2, -0.5, 1.0, 0.7]))
    assert np.allclose(
        compute_rates(tip, ball, at, build_pivoting_twist(0.9)), [0, 0, 0, 0, -0.9], atol=1e-15
    )
    sliding = build_sliding_twist(0.01, -0.02)
    rates = compute_rates(tip, ball, at, sliding)
    # Sliding without turning keeps the normal, so neither point moves against the other's normal.
    later = ContactCoordinates.from_array(at.as_array() + 1e-6 * rates, at.chart_f, at.chart_o)
    R = [compute_relative_pose(tip, ball, c)[:3, :3] for c in (at, later)]
    assert np.allclose(R[0], R[1], atol=1e-10)


def test_contacts_on_and_near_a_pole_change_charts() -> None:
    tip, ball = Sphere(0.018), Ellipsoid((0.03, 0.02, 0.025))
    at = ContactCoordinates(np.array([0.5 * np.pi, 1.3, 0.1]), *np.array([[0.2], [-1.4], [0.3], [0.4]]))
    moved = leave_borders(tip, ball, at)
    assert moved.chart_f[2] == 0
    assert np.all(moved.chart_o != 0)
    assert np.allclose(
        compute_relative_pose(tip, ball, moved)[1:], compute_relative_pose(tip, ball, at)[1:], atol=1e-14
    )
    with pytest.raises(ValueError, match=r"leave_borders\(tip, body, at\) is accepted"):
        compute_rates(tip, ball, at, build_pivoting_twist(np.ones(3)))
    assert np.isfinite(compute_rates(tip, ball, moved, build_rolling_twist(np.ones(3), 0.5))).all()


def test_a_twist_off_the_surface_is_refused() -> None:
    at = ContactCoordinates(*np.zeros(5))
    with pytest.raises(ValueError, match="v_z = 0 are accepted"):
        compute_rates(Sphere(0.01), Sphere(0.02), at, [0, 0, 0.001, 0, 0, 0])


def test_mixed_poses_find_their_inverse() -> None:
    """Tip and body swapped: the same contact, the same psi."""
    tip, body = Ellipsoid((0.03, 0.02, 0.025)), Cylinder(0.02)
    at = ContactCoordinates(*np.array([0.3, 0.2, -0.05, 1.0, 0.7]))
    swapped = ContactCoordinates(at.u_o, at.v_o, at.u_f, at.v_f, at.psi)
    X = compute_relative_pose(tip, body, at)
    assert np.allclose(compute_relative_pose(body, tip, swapped), invert_pose(X), atol=1e-15)
