"""Friction cones: exact, inscribed, scaled."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger

MODELS = [HardFinger(0.5), SoftFinger(0.55, 0.0025)]


def test_wrench_basis_selects_force_and_spin() -> None:
    assert np.array_equal(HardFinger(0.5).wrench_basis(), np.eye(6)[:, :3])
    assert np.array_equal(SoftFinger(0.5, 0.002).wrench_basis() @ [1, 2, 3, 4], [1, 2, 3, 0, 0, 4])


def test_utilisation_is_mujocos_elliptic_cone() -> None:
    model = SoftFinger(0.5, 0.002)
    f = np.array([0.3, 0.4, 2.0, 0.001])
    assert model.utilisation(f) == pytest.approx(np.sqrt(0.25 / 0.5**2 + (0.001 / 0.002) ** 2) / 2.0)
    assert model.cone_margin(f) == pytest.approx(2.0 * (1.0 - model.utilisation(f)))


def test_utilisation_without_pressure() -> None:
    used = HardFinger(0.5).utilisation(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, -1.0]]))
    assert used.tolist() == [0.0, np.inf, np.inf]


@pytest.mark.parametrize("model", MODELS)
def test_pyramid_is_inscribed_with_the_stated_inradius(model: ContactModel) -> None:
    """Vertices by an independent half-space intersection; all of them in the exact cone."""
    A = model.facets()
    others = [j for j in range(model.dimension) if j != 2]
    halfspaces = np.column_stack([A[:, others] * model.capacity, A[:, 2]])  # at f_n = 1, in the unit ball
    vertices = HalfspaceIntersection(halfspaces, np.zeros(len(others))).intersections
    norms = np.linalg.norm(vertices, axis=1)
    assert norms.max() == pytest.approx(1.0, abs=1e-9)
    assert -ConvexHull(vertices).equations[:, -1].max() == pytest.approx(model.facet_inradius, abs=1e-9)
    forces = np.insert(vertices * model.capacity, 2, 1.0, axis=1)
    assert np.all(model.utilisation(forces) <= 1.0 + 1e-9)


def test_soft_polytope_beats_the_required_inradius_with_few_facets() -> None:
    model = SoftFinger(0.55, 0.0025)
    assert model.facets().shape == (76, 4)
    assert model.facet_inradius >= 0.915


def test_octagon_times_interval_is_not_inscribed() -> None:
    model = SoftFinger(0.5, 0.002)
    assert model.utilisation(np.array([0.5, 0.0, 1.0, 0.002])) == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize("edges", [3, 8, 64])
def test_hard_pyramid_with_any_number_of_edges(edges: int) -> None:
    model = HardFinger(0.5)
    across = model.facets(edges) @ np.array([0.5 * np.cos(np.pi / edges), 0.0, 1.0])
    along = model.facets(edges, phase=0.5) @ np.array([0.5, 0.0, 1.0])
    assert across.max() == pytest.approx(0.0, abs=1e-12)
    assert along.max() == pytest.approx(0.0, abs=1e-12)


def test_scaled_is_the_believed_friction() -> None:
    assert SoftFinger(0.5, 0.002).scaled(0.5) == SoftFinger(0.25, 0.001)
    assert HardFinger(0.5).scaled(2.0) == HardFinger(1.0)


def test_nonsense_friction_is_refused_with_the_cure() -> None:
    with pytest.raises(ValueError, match=r"sliding friction is 0\.0; a positive finite number is accepted"):
        HardFinger(0.0)
    with pytest.raises(ValueError, match="torsional friction is nan"):
        SoftFinger(0.5, np.nan)
    with pytest.raises(ValueError, match="4 components; 3 are accepted"):
        HardFinger(0.5).cone_margin(np.ones(4))
    with pytest.raises(ValueError, match="three or more"):
        HardFinger(0.5).facets(2)
