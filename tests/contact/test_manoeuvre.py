"""Closed forms of the rolling manoeuvres against integration of the contact equations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dexplan.contact.kinematics.coordinates import (
    ContactCoordinates,
    build_coordinates,
    compute_relative_pose,
)
from dexplan.contact.kinematics.integration import integrate_legs
from dexplan.contact.rolling.curves import roll_turning
from dexplan.contact.rolling.manoeuvre import (
    RollingBend,
    RollingTriangle,
    build_longitude_equator,
    compute_spin,
    repeat_triangle,
    solve_apex,
)
from dexplan.contact.rolling.turning import build_turn, make_tangent
from dexplan.contact.surfaces.shapes import Sphere
from dexplan.spatial import Array

triangles = st.builds(
    RollingTriangle,
    tip_radius=st.floats(0.008, 0.025),
    object_radius=st.floats(0.007, 0.06),
    leg=st.floats(0.2, 0.5 * np.pi),
    apex=st.floats(0.1, 2.0).flatmap(lambda a: st.sampled_from([a, -a])),
)
attitudes = st.integers(0, 2**31)
lightly = settings(deadline=None, derandomize=True, max_examples=60)


def _start(triangle: RollingTriangle, seed: int) -> tuple[Array, Array]:
    """A random pose of the tip on the ball, any contact on the tip, and a random direction."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    X = np.eye(4)
    X[:3, :3] = Rotation.random(rng=rng).as_matrix()
    X[:3, 3] = (triangle.tip_radius + triangle.object_radius) * n
    return X, make_tangent(n, rng.normal(size=3))


@given(triangles, attitudes)
@lightly
def test_the_end_is_as_predicted(triangle: RollingTriangle, seed: int) -> None:
    X, direction = _start(triangle, seed)
    path = triangle.roll(X, direction, 40)
    assert np.allclose(path.X_OF[-1], triangle.end_pose(X, direction), atol=1e-12)
    # The contact is back in its place on the tip, and ahead on the ball where it was wanted.
    assert np.allclose(path.n_F[-1], path.n_F[0], atol=1e-12)
    assert np.arccos(np.clip(path.n_O[0] @ path.n_O[-1], -1, 1)) == pytest.approx(
        triangle.displacement, abs=1e-7
    )
    assert compute_spin(path) == pytest.approx(np.angle(np.exp(1j * triangle.spin)), abs=1e-10)
    assert path.total_length == pytest.approx(triangle.total_length)
    assert path.polar_angle.shape == (len(path),)


@given(triangles, attitudes)
@settings(deadline=None, derandomize=True, max_examples=8)
def test_closed_forms_agree_with_integration(triangle: RollingTriangle, seed: int) -> None:
    """Random r, R, lambda, gamma, poses and directions, through Montana's equations and whatever charts are met: 1e-9."""
    X, direction = _start(triangle, seed)
    steps = int(30 * max(1.0, triangle.tip_radius / triangle.object_radius))
    end, contact_F = _integrate(triangle, X, direction, steps)
    assert np.allclose(end, triangle.end_pose(X, direction), atol=1e-9, rtol=0.0)
    n = X[:3, 3] / np.linalg.norm(X[:3, 3])
    assert np.allclose(contact_F, -X[:3, :3].T @ n, atol=1e-9, rtol=0.0)


@pytest.mark.parametrize("gamma_deg", [15.0, 60.0, -75.0, 110.0])
def test_the_papers_manoeuvre_agrees_with_integration(gamma_deg: float) -> None:
    paper = build_longitude_equator(0.012, 0.040, np.radians(gamma_deg))
    X, direction = _start(paper, 7)
    end, _ = _integrate(paper, X, direction, 25)
    assert np.allclose(end, paper.end_pose(X, direction), atol=1e-9, rtol=0.0)


def _integrate(triangle: RollingTriangle, X: Array, direction: Array, steps: int) -> tuple[Array, Array]:
    """The pose at the end, and the contact on the tip there, by the contact equations."""
    n = X[:3, 3] / np.linalg.norm(X[:3, 3])
    heading = build_turn(n, triangle.first_angle) @ direction
    tip, ball = Sphere(triangle.tip_radius), Sphere(triangle.object_radius)
    start = build_coordinates(tip, ball, X[:3, :3], -X[:3, :3].T @ n, n)
    at, _ = integrate_legs(tip, ball, start, heading, triangle.turns, triangle.lengths, steps)
    last = ContactCoordinates.from_array(at.as_array()[-1], at.chart_f[-1], at.chart_o[-1])
    return compute_relative_pose(tip, ball, last), tip.normal(last.u_f, last.v_f, last.chart_f)


def test_numbers_of_the_papers_manoeuvre() -> None:
    """r 12, R 40 mm, gamma 60 degrees: 11.187156 mm (not r gamma = 12.566) and -51.77445 degrees ."""
    paper = build_longitude_equator(0.012, 0.040, np.radians(60.0))
    assert 1e3 * paper.displacement_length == pytest.approx(11.187156, abs=5e-7)
    assert np.degrees(paper.spin) == pytest.approx(-51.77445, abs=5e-6)
    assert np.allclose(paper.lengths, 0.012 * np.array([0.5 * np.pi, np.radians(60.0), 0.5 * np.pi]))
    assert np.allclose(paper.turns, [0.0, 0.5 * np.pi, 0.5 * np.pi])
    # sin(d / 2) = cos(L) sin(b / 2) with right angles.
    L, b = 0.3 * 0.5 * np.pi, 0.3 * np.radians(60.0)
    assert paper.displacement == pytest.approx(2.0 * np.arcsin(np.cos(L) * np.sin(0.5 * b)), abs=1e-12)


@pytest.mark.parametrize(
    ("legs_deg", "ahead_mm", "ahead_deg", "spin_deg"),
    [(60.0, 4.025, 6.590, -19.090), (75.0, 9.353, None, -34.568)],
)
def test_numbers_of_rolling_triangles(
    legs_deg: float, ahead_mm: float, ahead_deg: float | None, spin_deg: float
) -> None:
    """r 18, R 35 mm ."""
    triangle = RollingTriangle(0.018, 0.035, np.radians(legs_deg), np.radians(legs_deg))
    assert 1e3 * triangle.displacement_length == pytest.approx(ahead_mm, abs=6e-4)
    assert np.degrees(triangle.spin) == pytest.approx(spin_deg, abs=6e-4)
    if ahead_deg is not None:
        assert np.degrees(triangle.displacement) == pytest.approx(ahead_deg, abs=6e-4)


def test_a_small_triangle_rolls_far_for_little() -> None:
    """30/30: 0.30 mm for 23.5 mm rolled ."""
    triangle = RollingTriangle(0.018, 0.035, np.radians(30.0), np.radians(30.0))
    assert 1e3 * triangle.displacement_length == pytest.approx(0.30, abs=5e-3)
    assert 1e3 * triangle.total_length == pytest.approx(23.5, abs=0.1)


def test_displacement_is_of_third_order() -> None:
    """Halving a small triangle divides what it gets ahead by eight."""
    ahead = [RollingTriangle(0.018, 0.035, leg, 1.0).displacement for leg in (0.1, 0.05, 0.025)]
    assert np.allclose([ahead[0] / ahead[1], ahead[1] / ahead[2]], 8.0, rtol=0.01)


@pytest.mark.parametrize("legs_deg", [60.0, 75.0])
def test_right_angles_below_ninety_degrees_do_not_close(legs_deg: float) -> None:
    """Arcs r lambda, r gamma, r lambda with right angles leave the tip off its pole by 18 to 31 degrees."""
    leg = 0.018 * np.radians(legs_deg)
    X = np.eye(4)
    X[:3, :3], X[2, 3] = np.diag([1.0, -1.0, -1.0]), 0.053
    path = roll_turning(0.018, 0.035, X, [1.0, 0.0, 0.0], [0.0, 0.5 * np.pi, 0.5 * np.pi], [leg, leg, leg])
    assert path.polar_angle[0] == 0.0
    assert 17.5 < np.degrees(path.polar_angle[-1]) < 31.0


@given(triangles, attitudes)
@lightly
def test_mirrored_cycles_cancel_spin_and_add_displacement(triangle: RollingTriangle, seed: int) -> None:
    X, direction = _start(triangle, seed)
    (path,) = repeat_triangle(triangle, X, direction, 2, "mirror", 40)
    n = path.n_O[0]
    ahead = build_turn(np.cross(n, direction), 2.0 * triangle.displacement)
    assert np.allclose(path.X_OF[-1, :3, :3], ahead @ X[:3, :3], atol=1e-12)
    assert np.allclose(path.n_O[-1], ahead @ n, atol=1e-12)
    assert triangle.mirrored.spin == -triangle.spin


def test_lifts_turn_the_tip_back_on_the_spot() -> None:
    triangle = build_longitude_equator(0.012, 0.040, np.radians(60.0))
    X, direction = _start(triangle, 1)
    paths = repeat_triangle(triangle, X, direction, 5, "lift", 40)
    assert len(paths) == 5
    n, axis = paths[0].n_O[0], np.cross(paths[0].n_O[0], direction)
    for k, path in enumerate(paths):
        # Each cycle starts as the first did, carried along the great circle.
        assert np.allclose(
            path.X_OF[0, :3, :3], build_turn(axis, k * triangle.displacement) @ X[:3, :3], atol=1e-12
        )
        assert np.allclose(path.n_O[-1], build_turn(axis, (k + 1) * triangle.displacement) @ n, atol=1e-12)
    for before, after in pairwise(paths):
        assert np.allclose(before.X_OF[-1, :3, 3], after.X_OF[0, :3, 3], atol=1e-12)
    (spun,) = repeat_triangle(triangle, X, direction, 5, "none", 40)
    spin = compute_spin(spun)
    assert np.exp(1j * spin) == pytest.approx(np.exp(5j * triangle.spin), abs=1e-9)


@given(triangles, attitudes)
@lightly
def test_a_bend_ends_where_it_says(triangle: RollingTriangle, seed: int) -> None:
    X, direction = _start(triangle, seed)
    bend = RollingBend(triangle)
    path = bend.roll(X, direction, 40)
    n = path.n_O[0]
    assert np.allclose(path.n_O[-1], build_turn(np.cross(n, direction), bend.displacement) @ n, atol=1e-9)
    assert path.n_F[-1] @ path.n_F[0] == pytest.approx(np.cos(triangle.leg), abs=1e-12)


@given(triangles)
@lightly
def test_apex_is_found_again(triangle: RollingTriangle) -> None:
    ahead = triangle.displacement
    # Where the ball is larger, the displacement grows with the apex up to 90 degrees at least.
    if triangle.object_radius < 1.05 * triangle.tip_radius or abs(triangle.apex) > 0.5 * np.pi:
        return
    r, R, leg = triangle.tip_radius, triangle.object_radius, triangle.leg
    found = solve_apex(r, R, leg, ahead, abs(triangle.apex))
    assert found == pytest.approx(abs(triangle.apex), abs=1e-6)
    assert RollingTriangle(r, R, leg, found).displacement == pytest.approx(ahead, abs=1e-12)
    assert solve_apex(r, R, leg, 1.01 * ahead, found) is None


def test_equal_radii_get_nowhere() -> None:
    assert RollingTriangle(0.03, 0.03, 1.0, 1.0).displacement == pytest.approx(0.0, abs=1e-15)
    assert RollingTriangle(0.03, 0.02, 1.0, 1.0).displacement > 0.1
    assert solve_apex(0.03, 0.03, 1.0, 0.01, 1.0) is None


def test_what_is_no_triangle_is_refused() -> None:
    with pytest.raises(ValueError, match="at most pi/2"):
        RollingTriangle(0.01, 0.02, 2.0, 1.0)
    with pytest.raises(ValueError, match="other than 0"):
        RollingTriangle(0.01, 0.02, 1.0, 0.0)
    with pytest.raises(ValueError, match="positive lengths"):
        RollingTriangle(0.01, -0.02, 1.0, 0.5)
    with pytest.raises(ValueError, match="one or more"):
        repeat_triangle(RollingTriangle(0.01, 0.02, 1.0, 0.5), np.eye(4), [1, 0, 0], 0)


def test_a_path_has_about_as_many_samples_as_asked_for() -> None:
    paper = build_longitude_equator(0.012, 0.040, np.radians(60.0))
    X, direction = _start(paper, 0)
    assert len(paper.roll(X, direction, 1000)) == pytest.approx(1000, abs=2)
