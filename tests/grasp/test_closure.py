"""Force closure: the general test against every closed form, and the closed forms against their numbers."""

from __future__ import annotations

import clarabel
import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csc_matrix

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.closure import check_antipodal, check_force_closure, compute_load_margin
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere
from dexplan.grasp.sphere import (
    check_sphere_pair,
    check_sphere_triple_sufficient,
    required_pair_preload,
    sphere_pair_angle_min,
)
from dexplan.spatial import GRAVITY, direction_from_angles

R = 0.03
TABLE = [
    (0.3, 1.915653, 146.60151, 0.287348),
    (0.5, 1.788854, 126.86990, 0.447214),
    (0.8, 1.561738, 102.68038, 0.624695),
]


def ring(
    azimuths: tuple[float, ...], model: ContactModel, elevation: float = 0.0, radius: float = R
) -> Grasp:
    return Grasp(
        tuple(
            contact_on_sphere(i, direction_from_angles(a, elevation), radius, model)
            for i, a in enumerate(azimuths)
        )
    )


def directions(azimuths: tuple[float, ...], elevation: float = 0.0) -> np.ndarray:
    return np.array([direction_from_angles(a, elevation) for a in azimuths])


def solve_min_normal(grasp: Grasp, wrench: np.ndarray, utilisation: float = 1.0) -> float:
    """Least possible largest normal force against the exact cones, by an interior-point cone solver."""
    G = compute_grasp_map(grasp)
    size = G.shape[1]
    G[3:] /= R
    b = np.concatenate([wrench[:3], wrench[3:] / R])
    rows, offsets, cones = [np.column_stack([G, np.zeros(6)])], [b], [clarabel.ZeroConeT(6)]
    for model, part in zip(grasp.models, grasp.slices, strict=True):
        bound = np.zeros((1, size + 1))
        bound[0, part.start + 2], bound[0, -1] = 1.0, -1.0
        rows.append(bound)
        offsets.append(np.zeros(1))
        cones.append(clarabel.NonnegativeConeT(1))
        cone = np.zeros((model.dimension, size + 1))
        cone[0, part.start + 2] = -utilisation
        others = [part.start + j for j in range(model.dimension) if j != 2]
        for k, (column, capacity) in enumerate(zip(others, model.capacity, strict=True)):
            cone[1 + k, column] = -1.0 / capacity
        rows.append(cone)
        offsets.append(np.zeros(model.dimension))
        cones.append(clarabel.SecondOrderConeT(model.dimension))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cost = np.append(np.zeros(size), 1.0)
    zero = csc_matrix((size + 1, size + 1))
    solver = clarabel.DefaultSolver(
        zero, cost, csc_matrix(np.vstack(rows)), np.concatenate(offsets), cones, settings
    )
    return float(solver.solve().x[-1])


@pytest.mark.parametrize(("mu", "d_min", "phi_min_deg", "h_max"), TABLE)
def test_closure_table(mu: float, d_min: float, phi_min_deg: float, h_max: float) -> None:
    phi = sphere_pair_angle_min(mu)
    assert np.degrees(phi) == pytest.approx(phi_min_deg, abs=1e-5)
    assert 2.0 * np.sin(phi / 2.0) == pytest.approx(d_min, abs=1e-6)
    flat = check_sphere_triple_sufficient(directions((0, 120, 240)), mu)
    assert flat.is_closed
    assert flat.margin == pytest.approx(min(h_max, 0.5), abs=1e-6)


@pytest.mark.parametrize(("mu", "phi_min_deg"), [(row[0], row[2]) for row in TABLE])
@pytest.mark.parametrize("offset_deg", [-0.75, -0.01, 0.01, 0.75])
def test_pair_lp_antipodal_and_closed_form_agree(mu: float, phi_min_deg: float, offset_deg: float) -> None:
    grasp = ring((20.0, 20.0 + phi_min_deg + offset_deg), SoftFinger(mu, 0.002), elevation=0.0)
    a, b = grasp.contacts
    closed = check_sphere_pair(a.n_O, b.n_O, mu)
    chord = check_antipodal(a.p_OC, a.n_O, b.p_OC, b.n_O, mu)
    lp = check_force_closure(grasp)
    assert closed.is_closed == chord.is_closed == lp.is_closed == (offset_deg > 0.0)
    assert np.degrees(closed.margin) == pytest.approx(offset_deg, abs=1e-5)
    assert chord.margin == pytest.approx(
        closed.margin / 2.0
    )  # the chord leans by half of what the pair lacks
    # beta is the lean of the chord; the squeeze along it is the only internal force
    beta = 0.5 * (np.pi - np.radians(phi_min_deg + offset_deg))
    assert lp.margin == pytest.approx(1.0 - np.tan(beta) / mu, abs=1e-6)


@pytest.mark.parametrize("mu", [0.3, 0.5, 0.8])
@pytest.mark.parametrize(("side", "expected"), [(-0.01, True), (0.01, False)])
def test_triple_closes_below_its_height_limit(mu: float, side: float, expected: bool) -> None:
    """On a circle of latitude h < r sin(theta) is necessary as well."""
    elevation = float(np.degrees(np.arcsin(np.sin(np.arctan(mu)) + side)))
    grasp = ring((0, 120, 240), HardFinger(mu), elevation)
    assert check_force_closure(grasp).is_closed is expected
    assert check_sphere_triple_sufficient(directions((0, 120, 240), elevation), mu).is_closed is expected


def test_triple_condition_is_only_sufficient() -> None:
    assert not check_sphere_triple_sufficient(directions((0, 60, 150)), 0.5).is_closed
    assert check_force_closure(ring((0, 60, 150), HardFinger(0.5))).is_closed
    assert not check_force_closure(ring((0, 40, 80), HardFinger(0.5))).is_closed


def test_sufficient_implies_closed_on_random_grasps() -> None:
    rng = np.random.default_rng(3)
    seen = 0
    for points in rng.normal(size=(60, 3, 3)):
        if check_sphere_triple_sufficient(points, 0.8).is_closed:
            seen += 1
            grasp = Grasp(tuple(contact_on_sphere(i, p, R, HardFinger(0.8)) for i, p in enumerate(points)))
            assert check_force_closure(grasp).is_closed
    assert seen > 3


def test_full_rank_is_not_force_closure() -> None:
    result = check_force_closure(ring((0, 40, 80), HardFinger(0.5)))
    assert result.rank == 6
    assert not result.is_closed
    assert result.margin < 0.0


def test_hard_pair_squeezes_but_cannot_resist_spin() -> None:
    result = check_force_closure(ring((0, 180), HardFinger(0.5)))
    assert result.rank == 5
    assert result.margin == pytest.approx(1.0)
    assert not result.is_closed


def test_margin_proves_itself() -> None:
    rng = np.random.default_rng(4)
    points = directions((0, 100, 230)) + 0.2 * rng.normal(size=(3, 3))
    grasp = Grasp(tuple(contact_on_sphere(i, p, R, SoftFinger(0.5, 0.002)) for i, p in enumerate(points)))
    result = check_force_closure(grasp)
    assert result.is_closed
    f = result.internal_forces
    assert f is not None
    assert np.allclose(compute_grasp_map(grasp) @ f, 0.0, atol=1e-8)
    margins = [m.cone_margin(f[s]) for m, s in zip(grasp.models, grasp.slices, strict=True)]
    assert min(margins) == pytest.approx(result.margin)


def test_three_fingers_carry_a_ball() -> None:
    grasp = ring((0, 120, 240), HardFinger(0.5))
    weight = np.array([0, 0, 0.05 * GRAVITY, 0, 0, 0])
    assert solve_min_normal(grasp, weight) == pytest.approx(0.327, abs=1e-6)
    # with an inscribed octagon whose edges are off the load
    G = compute_grasp_map(grasp)
    cost = np.append(np.zeros(9), 1.0)
    facets = np.kron(np.eye(3), HardFinger(0.5).facets(edges=8))
    bound = np.zeros((3, 10))
    bound[range(3), [2, 5, 8]], bound[:, -1] = 1.0, -1.0
    A_ub = np.vstack([np.column_stack([facets, np.zeros(len(facets))]), bound])
    answer = linprog(
        cost,
        A_ub=A_ub,
        b_ub=np.zeros(len(A_ub)),
        A_eq=np.column_stack([G, np.zeros(6)]),
        b_eq=weight,
        bounds=(None, None),
    )
    assert answer.x[-1] == pytest.approx(0.35394, abs=1e-5)
    assert answer.x[-1] == pytest.approx(0.327 / np.cos(np.pi / 8))


def test_antipodal_pair_carries_a_ball() -> None:
    grasp = ring((0, 180), SoftFinger(0.5, 0.002))
    weight = np.array([0, 0, 0.05 * GRAVITY, 0, 0, 0])
    assert solve_min_normal(grasp, weight) == pytest.approx(0.4905, abs=1e-6)
    assert required_pair_preload(0.5, 0.002, 0.05, R, np.pi) == pytest.approx(0.4905)


@pytest.mark.parametrize(("phi_deg", "utilisation"), [(160.0, 1.0), (150.0, 1.0), (150.0, 0.8), (140.0, 1.0)])
def test_load_of_a_pair_is_the_optimum(phi_deg: float, utilisation: float) -> None:
    mu, mu_t, radius = 0.55 / 1.3, 0.0025 / 1.3, 0.035
    grasp = ring((0.0, phi_deg), SoftFinger(mu, mu_t), radius=radius)
    # the ball's centre is the origin of the wrench: weight acts there, beside the chord
    least = solve_min_normal(grasp, np.array([0, 0, 0.06 * GRAVITY, 0, 0, 0]), utilisation)
    closed = required_pair_preload(mu, mu_t, 0.06, radius, np.radians(phi_deg), utilisation)
    assert closed == pytest.approx(least, rel=1e-5)


def test_geometric_closure_alone_needs_infinite_squeeze() -> None:
    mu, mu_t = 0.55 / 1.3, 0.0025 / 1.3
    phi_min = sphere_pair_angle_min(mu)
    assert required_pair_preload(mu, mu_t, 0.06, 0.035, phi_min - 1e-9) == np.inf
    at_140 = required_pair_preload(mu, mu_t, 0.06, 0.035, np.radians(140.0))
    at_136 = required_pair_preload(mu, mu_t, 0.06, 0.035, np.radians(136.0))
    assert at_140 < 5.0 < at_136


def test_degenerate_input_is_refused() -> None:
    with pytest.raises(ValueError, match="coincide"):
        check_antipodal([0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0], 0.5)
    with pytest.raises(ValueError, match="collinear or coincide"):
        check_sphere_triple_sufficient(directions((0, 0, 90)), 0.5)


def test_load_margin_of_a_carried_ball() -> None:
    """Three equatorial hard fingers under gravity: all carry a third of the weight, shear mg / 3 each."""
    grasp = ring((0, 120, 240), HardFinger(0.5))
    weight = np.array([0, 0, 0.05 * GRAVITY, 0, 0, 0])
    for mean in (0.3, 0.327, 1.0, 5.0):
        found = compute_load_margin(grasp, weight, mean)
        assert found.margin == pytest.approx(1.0 - 0.05 * GRAVITY / (3 * 0.5 * mean), abs=1e-6)
        assert found.is_closed is (mean > 0.327 + 1e-6)
        assert found.internal_forces is not None
        assert np.allclose(compute_grasp_map(grasp) @ found.internal_forces, weight, atol=1e-8)
        assert found.internal_forces[[2, 5, 8]].mean() == pytest.approx(mean)


def test_load_that_no_force_balances() -> None:
    spin = np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.0])  # about the chord of two hard fingers
    found = compute_load_margin(ring((0, 180), HardFinger(0.5)), spin, 1.0)
    assert found.margin == -np.inf
    assert not found.is_closed
    assert found.internal_forces is None
