"""Surfaces against finite differences of their own points and normals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.contact.surfaces.shapes import Cylinder, Ellipsoid, Plane, Sphere
from dexplan.contact.surfaces.surface import AbstractSurface

SPHERE = Sphere(0.035)
SURFACES = [
    SPHERE,
    Plane(),
    Cylinder(0.02),
    Ellipsoid((0.03, 0.02, 0.025)),
    Ellipsoid((0.03, 0.03, 0.012)),
    Ellipsoid((0.01, 0.03, 0.02)),
]
U, V, H = 0.4, -1.1, 1e-6

charted = given(
    st.sampled_from(SURFACES),
    st.floats(-1.2, 1.2),
    st.floats(-3.1, 3.1),
    st.integers(0, 2),
)
lightly = settings(deadline=None, derandomize=True, max_examples=100)


def _differences(surface: AbstractSurface, u: float, v: float, chart: int) -> dict[str, np.ndarray]:
    """Central differences (3, 2) of point, normal and x along u and v, fourth order in the step."""
    out: dict[str, list[np.ndarray]] = {"point": [], "normal": [], "x": []}
    h = 1e-3
    for a, b in ((h, 0.0), (0.0, h)):
        ring = [surface.geometry(u + k * a, v + k * b, chart) for k in (-2, -1, 1, 2)]
        for name, columns in out.items():
            f = [getattr(g, name) for g in ring]
            columns.append((f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h))
    return {name: np.stack(columns, axis=1) for name, columns in out.items()}


@charted
@lightly
def test_metric_curvature_and_torsion_are_derivatives(
    surface: AbstractSurface, u: float, v: float, chart: int
) -> None:
    chart %= surface.chart_count
    M = surface.metric(u, v, chart)
    x, y = surface.tangents(u, v, chart)
    slopes = _differences(surface, u, v, chart)
    size = np.abs(M).max()
    assert np.allclose(slopes["point"], np.stack([x, y], axis=1) @ M, atol=1e-8 * size)
    E, K, T = np.stack([x, y]), surface.curvature(u, v, chart), surface.torsion(u, v, chart)
    # Per unit of chart, so that nothing is divided by a short metric.
    assert np.allclose(E @ slopes["normal"], K @ M, atol=1e-7)
    assert np.allclose(y @ slopes["x"], T @ M, atol=1e-7)


@charted
@lightly
def test_charts_are_orthogonal_and_frames_proper(
    surface: AbstractSurface, u: float, v: float, chart: int
) -> None:
    chart %= surface.chart_count
    R = surface.frame(u, v, chart)
    assert np.allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    n = surface.normal(u, v, chart)
    assert np.array_equal(R[:, 2], -n)
    # Outward: a step along n leads off the surface and projects back.
    p = surface.point(u, v, chart)
    assert np.allclose(surface.project(p + 0.004 * n), p, atol=1e-12)
    assert np.allclose(surface.curvature(u, v, chart), surface.curvature(u, v, chart).T, atol=1e-9)


@charted
@lightly
def test_coordinates_invert_point_in_every_chart(
    surface: AbstractSurface, u: float, v: float, chart: int
) -> None:
    chart %= surface.chart_count
    p = surface.point(u, v, chart)
    back = surface.coordinates(p, chart)
    assert np.allclose(back, (u, v), atol=1e-12)
    for other in range(surface.chart_count):
        assert np.allclose(surface.point(*surface.coordinates(p, other), other), p, atol=1e-14)


@pytest.mark.parametrize("surface", SURFACES, ids=repr)
def test_the_chosen_chart_is_far_from_its_border_everywhere(surface: AbstractSurface) -> None:
    """The poles of every chart included: nothing is ever NaN or unbounded in the chart that suits the point."""
    p = surface.project(
        np.concatenate([0.05 * np.random.default_rng(0).normal(size=(500, 3)), 0.05 * np.eye(3)]) + 1e-300
    )
    if isinstance(surface, Cylinder):
        p = p[:-1]  # the last lies on the axis
    charts = surface.choose_chart(p)
    u, v = surface.coordinates(p, charts)
    at = surface.geometry(u, v, charts)
    assert surface.margin(u, v, charts).min() >= np.sqrt(2.0 / 3.0) - 1e-12
    assert np.allclose(at.point, p, atol=1e-15)
    for part in (at.lengths, at.curvature, at.torsion, at.x, at.y, at.normal):
        assert np.isfinite(part).all()
    assert np.abs(at.torsion).max() < 2.0 / 0.01


@pytest.mark.parametrize("surface", SURFACES, ids=repr)
def test_on_a_pole_nothing_is_nan(surface: AbstractSurface) -> None:
    for u in (0.5 * np.pi, -0.5 * np.pi):
        for chart in range(surface.chart_count):
            at = surface.geometry(u, 0.3, chart)
            assert np.isfinite(at.point).all()
            assert np.isfinite(at.normal).all()
            assert np.isfinite(np.stack(surface.coordinates(at.point, chart))).all()


def test_sphere_closed_forms() -> None:
    assert np.allclose(SPHERE.curvature(U, V), np.eye(2) / 0.035, atol=1e-9)
    assert np.allclose(SPHERE.metric(U, V), np.diag([0.035, 0.035 * np.cos(U)]), atol=1e-9)
    assert np.allclose(SPHERE.torsion(U, V), [[0.0, -np.tan(U) / 0.035]], atol=1e-9)


def test_an_ellipsoid_with_equal_axes_is_a_sphere() -> None:
    u, v, chart = np.linspace(-1.4, 1.4, 9), np.linspace(-3.0, 3.0, 9), np.arange(9) % 3
    ours, theirs = Ellipsoid((0.035, 0.035, 0.035)).geometry(u, v, chart), SPHERE.geometry(u, v, chart)
    for name in ("point", "x", "y", "normal", "lengths", "curvature", "torsion"):
        assert np.allclose(getattr(ours, name), getattr(theirs, name), atol=1e-9), name


def test_ellipsoid_feet_are_nearest() -> None:
    """Against a fine net of the surface, inside and outside, on planes of symmetry too."""
    surface = Ellipsoid((0.03, 0.02, 0.01))
    net = surface.radial(np.random.default_rng(1).normal(size=(40000, 3)))
    queries = 0.02 * np.random.default_rng(2).normal(size=(40, 3))
    queries = np.concatenate([queries, queries * [1, 1, 0], queries * [0.1, 0, 0], np.zeros((1, 3))])
    distance = np.linalg.norm(surface.project(queries) - queries, axis=1)
    by_net = np.array([np.linalg.norm(net - q, axis=1).min() for q in queries])
    assert np.all(distance <= by_net + 1e-12)
    assert np.all(distance >= by_net - 5e-4)


def test_arrays_keep_their_shape() -> None:
    u, v = np.meshgrid(np.linspace(-1.4, 1.4, 7), np.linspace(-3.0, 3.0, 7))
    assert np.allclose(SPHERE.coordinates(2.0 * SPHERE.point(u, v)), (u, v))
    for surface in SURFACES:
        assert surface.frame(u, v).shape == (7, 7, 3, 3)
        assert surface.torsion(u, v).shape == (7, 7, 1, 2)
        assert surface.metric(u, v).shape == (7, 7, 2, 2)
        assert surface.curvature(u, 0.0).shape == (7, 7, 2, 2)


def test_radial_is_along_the_ray() -> None:
    assert np.allclose(SPHERE.radial([0.0, 3.0, 4.0]), [0.0, 0.021, 0.028])
    assert np.allclose(Cylinder(0.02).radial([0.0, 3.0, 4.0]), [0.0, 0.02, 0.08 / 3.0])
    assert np.allclose(Ellipsoid((0.01, 0.02, 0.03)).radial([0.0, -5.0, 0.0]), [0.0, -0.02, 0.0])
    with pytest.raises(ValueError, match="direction is zero"):
        SPHERE.radial([0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"project\(point\) is accepted"):
        Plane().radial([0.0, 0.0, 1.0])


def test_what_is_no_surface_is_refused() -> None:
    with pytest.raises(ValueError, match="positive length"):
        Sphere(-1.0)
    with pytest.raises(ValueError, match="positive length"):
        Cylinder(0.0)
    with pytest.raises(ValueError, match="three positive lengths"):
        Ellipsoid((0.1, 0.2, np.nan))
    with pytest.raises(ValueError, match="charts 0 to 2 are accepted"):
        SPHERE.point(0.0, 0.0, 3)
