"""Surfaces against finite differences of their own points and normals."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.contact.shapes import Sphere

SPHERE = Sphere(0.035)
U, V, H = 0.4, -1.1, 1e-6


def test_metric_and_tangents_are_derivatives_of_the_point() -> None:
    x, y = SPHERE.tangents(U, V)
    p_u = (SPHERE.point(U + H, V) - SPHERE.point(U - H, V)) / (2 * H)
    p_v = (SPHERE.point(U, V + H) - SPHERE.point(U, V - H)) / (2 * H)
    M = SPHERE.metric(U, V)
    assert np.allclose(p_u, M[0, 0] * x, atol=1e-9)
    assert np.allclose(p_v, M[1, 1] * y, atol=1e-9)


def test_curvature_and_torsion_are_derivatives_of_the_frame() -> None:
    axes = np.stack(SPHERE.tangents(U, V))
    M = np.diag(SPHERE.metric(U, V))
    step = [(H, 0.0), (0.0, H)]
    n = [(SPHERE.normal(U + a, V + b) - SPHERE.normal(U - a, V - b)) / (2 * H) for a, b in step]
    x = [(SPHERE.tangents(U + a, V + b)[0] - SPHERE.tangents(U - a, V - b)[0]) / (2 * H) for a, b in step]
    assert np.allclose(axes @ (np.stack(n, axis=1) / M), SPHERE.curvature(U, V), atol=1e-6)
    assert np.allclose(axes[1] @ (np.stack(x, axis=1) / M), SPHERE.torsion(U, V), atol=1e-6)


def test_sphere_closed_forms() -> None:
    assert np.allclose(SPHERE.curvature(U, V), np.eye(2) / 0.035)
    assert np.allclose(SPHERE.metric(U, V), np.diag([0.035, 0.035 * np.cos(U)]))
    assert np.allclose(SPHERE.torsion(U, V), [[0.0, -np.tan(U) / 0.035]])


def test_frame_is_a_rotation_with_z_into_the_object() -> None:
    R = SPHERE.frame(U, V)
    assert np.allclose(R.T @ R, np.eye(3))
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert np.allclose(R[:, 2], -SPHERE.normal(U, V))


def test_chart_inverts_point_for_arrays() -> None:
    u, v = np.meshgrid(np.linspace(-1.4, 1.4, 7), np.linspace(-3.0, 3.0, 7))
    back = SPHERE.chart(2.0 * SPHERE.point(u, v))
    assert np.allclose(back, (u, v))
    assert SPHERE.frame(u, v).shape == (7, 7, 3, 3)
    assert SPHERE.torsion(u, v).shape == (7, 7, 1, 2)


def test_closest_is_along_the_ray() -> None:
    assert np.allclose(SPHERE.closest([0.0, 3.0, 4.0]), [0.0, 0.021, 0.028])
    with pytest.raises(ValueError, match="direction is zero"):
        SPHERE.closest([0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="positive length"):
        Sphere(-1.0)
