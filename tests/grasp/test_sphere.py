"""The sphere's closed forms against their numbers, the general test, and an interior-point solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_grasps import R, directions, on_sphere, ring
from scipy.optimize import linprog

from dexplan.contact.friction import HardFinger, SoftFinger
from dexplan.grasp.closed_forms.agreement import PAIR_BAND, compare, sample_pairs
from dexplan.grasp.closed_forms.pair import (
    IndependentCones,
    build_independent_cones,
    check_independent_sufficient,
    check_sphere_pair,
    check_sphere_triple_sufficient,
    required_pair_preload,
    sphere_pair_angle_min,
)
from dexplan.grasp.closed_forms.triple import check_hard_triple, compute_triple_margin
from dexplan.grasp.closure import check_antipodal, check_force_closure, compute_load_margin
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.spatial import GRAVITY, build_frame

TABLE = [
    (0.3, 16.69924, 1.915653, 146.60151, 0.287348),
    (0.5, 26.56505, 1.788854, 126.86990, 0.447214),
    (0.8, 38.65981, 1.561738, 102.68038, 0.624695),
]
FRICTIONS = [row[0] for row in TABLE]
properties = settings(max_examples=60, deadline=None, derandomize=True)
SEEDS = st.integers(0, 10_000)
WEIGHT = np.array([0, 0, 0.05 * GRAVITY, 0, 0, 0])


def random_directions(seed: int, count: int) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(count, 3))
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def within(axis: np.ndarray, half_angle: float, shares: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Directions at these shares of the half angle about an axis, turned around it by ``ways``."""
    lean = shares * half_angle
    local = np.stack([np.sin(lean) * np.cos(ways), np.sin(lean) * np.sin(ways), np.cos(lean)], axis=1)
    return local @ build_frame(axis).T


def find_min_normal(grasp: Grasp, wrench: np.ndarray, utilisation: float = 1.0) -> float:
    """Least mean normal force [N] of a symmetric pair under a load: where its load margin passes 1 - utilisation."""
    low, high = 1e-3, 100.0
    for _ in range(60):
        middle = np.sqrt(low * high)
        is_enough = compute_load_margin(grasp, wrench, middle).margin >= 1.0 - utilisation
        low, high = (low, middle) if is_enough else (middle, high)
    return float(high)


@pytest.mark.parametrize(("mu", "theta_deg", "d_min", "phi_min_deg", "h_max"), TABLE)
def test_closure_table(mu: float, theta_deg: float, d_min: float, phi_min_deg: float, h_max: float) -> None:
    phi = sphere_pair_angle_min(mu)
    assert np.degrees(phi) == pytest.approx(phi_min_deg, abs=1e-5)
    assert 2.0 * np.sin(phi / 2.0) == pytest.approx(d_min, abs=1e-6)
    assert np.degrees(build_independent_cones([0, 0, 1], mu).half_angle) == pytest.approx(theta_deg, abs=1e-5)
    flat = check_sphere_triple_sufficient(directions((0, 120, 240)), mu)
    assert flat.is_closed
    assert flat.margin == pytest.approx(min(h_max, 0.5), abs=1e-6)


@properties
@given(
    SEEDS,
    st.sampled_from(FRICTIONS),
    st.floats(0, 1),
    st.floats(0, 1),
    st.floats(0, 6.28),
    st.floats(0, 6.28),
)
def test_any_pair_of_the_independent_region_is_closed(
    seed: int, mu: float, share_1: float, share_2: float, way_1: float, way_2: float
) -> None:
    cones = build_independent_cones(random_directions(seed, 1)[0], mu)
    sides = np.array([[1.0], [-1.0]])
    d = sides * within(
        cones.axis, 0.999 * cones.half_angle, np.array([share_1, share_2]), np.array([way_1, way_2])
    )
    found = check_independent_sufficient(cones, d[0], d[1])
    assert found.is_closed
    assert found.is_settled
    assert found.margin == pytest.approx(cones.half_angle * (1.0 - 0.999 * max(share_1, share_2)), abs=1e-9)
    assert check_independent_sufficient(cones, d[1], d[0]).margin == pytest.approx(found.margin, abs=1e-12)
    # both may stray by the margin, each changing the central angle by no more
    assert check_sphere_pair(d[0], d[1], mu).margin >= 2.0 * found.margin - 1e-9
    assert check_force_closure(on_sphere(d, SoftFinger(mu, 0.002))).is_closed


@pytest.mark.parametrize("mu", FRICTIONS)
def test_independent_region_is_the_largest(mu: float) -> None:
    """On its rim a pair is just on the border, and any wider cones hold a pair that is open."""
    largest = build_independent_cones([0.3, -0.5, 0.8], mu)
    d = largest.worst_pair()
    assert check_sphere_pair(d[0], d[1], mu).margin == pytest.approx(0.0, abs=1e-12)
    for factor, closed in ((0.99, True), (1.01, False)):
        cones = IndependentCones(largest.axis, factor * largest.half_angle)
        d = cones.worst_pair()
        assert check_independent_sufficient(cones, d[0], d[1]).margin == pytest.approx(0.0, abs=1e-12)
        assert check_sphere_pair(d[0], d[1], mu).is_closed is closed
        assert check_force_closure(on_sphere(d, SoftFinger(mu, 0.002))).is_closed is closed
        # no pair of these cones is worse
        rng = np.random.default_rng(0)
        worst = check_sphere_pair(d[0], d[1], mu).margin
        for _ in range(200):
            pair = within(cones.axis, cones.half_angle, np.sqrt(rng.uniform(size=2)), rng.uniform(0, 6.3, 2))
            assert check_sphere_pair(pair[0], -pair[1], mu).margin >= worst - 1e-12


def test_independent_region_is_not_necessary() -> None:
    cones = build_independent_cones([0, 0, 1], 0.5)
    d = directions((0, 180))
    found = check_independent_sufficient(cones, d[0], d[1])
    assert not found.is_closed
    assert not found.is_settled
    assert check_sphere_pair(d[0], d[1], 0.5).is_closed


@pytest.mark.parametrize(("mu", "phi_min_deg"), [(row[0], row[3]) for row in TABLE])
@pytest.mark.parametrize("offset_deg", [-0.75, -0.01, 0.01, 0.75])
def test_pair_general_antipodal_and_closed_form_agree(
    mu: float, phi_min_deg: float, offset_deg: float
) -> None:
    grasp = ring((20.0, 20.0 + phi_min_deg + offset_deg), SoftFinger(mu, 0.002))
    a, b = grasp.contacts
    closed = check_sphere_pair(a.n_O, b.n_O, mu)
    chord = check_antipodal(a.p_OC, a.n_O, b.p_OC, b.n_O, mu)
    general = check_force_closure(grasp)
    assert closed.is_closed == chord.is_closed == general.is_closed == (offset_deg > 0.0)
    assert chord.strength == closed.strength == "exact"
    assert np.degrees(closed.margin) == pytest.approx(offset_deg, abs=1e-5)
    # the chord leans by half of what the pair lacks
    assert chord.margin == pytest.approx(closed.margin / 2.0)
    # beta is the lean of the chord; the squeeze along it is the only internal force
    beta = 0.5 * (np.pi - np.radians(phi_min_deg + offset_deg))
    assert general.margin == pytest.approx(1.0 - np.tan(beta) / mu, abs=1e-7)


def test_pairs_agree_with_the_general_test() -> None:
    found = compare(sample_pairs(200, np.random.default_rng(1)), PAIR_BAND)
    assert found.disagreements == ()
    assert found.pyramid_faults == ()
    assert found.beyond == 0
    assert 50 < found.closed < 110
    assert found.in_band < 3


@properties
@given(SEEDS, st.floats(0.1, 2.0), st.floats(1e-6, 0.3))
def test_pair_margin_is_continuous_and_monotone(seed: int, mu: float, size: float) -> None:
    d = random_directions(seed, 2)
    margin = check_sphere_pair(d[0], d[1], mu).margin
    moved = within(d[0], size, np.ones(1), np.ones(1))[0]
    assert abs(check_sphere_pair(moved, d[1], mu).margin - margin) <= size + 1e-12
    more = check_sphere_pair(d[0], d[1], np.tan(min(np.arctan(mu) + size, 1.5))).margin
    assert more - margin == pytest.approx(2.0 * (min(np.arctan(mu) + size, 1.5) - np.arctan(mu)), abs=1e-12)


@pytest.mark.parametrize("mu", FRICTIONS)
@pytest.mark.parametrize(("side", "expected"), [(-0.01, True), (0.01, False)])
def test_triple_closes_below_its_height_limit(mu: float, side: float, expected: bool) -> None:
    """On a circle of latitude h < r sin(theta) is necessary as well."""
    elevation = float(np.degrees(np.arcsin(np.sin(np.arctan(mu)) + side)))
    d = directions((0, 120, 240), elevation)
    assert check_force_closure(on_sphere(d, HardFinger(mu))).is_closed is expected
    assert check_hard_triple(d, d, mu).is_closed is expected
    assert check_sphere_triple_sufficient(d, mu).is_closed is expected


def test_triple_condition_is_only_sufficient() -> None:
    d = directions((0, 60, 150))
    found = check_sphere_triple_sufficient(d, 0.5)
    assert (found.is_closed, found.is_settled, found.strength) == (False, False, "sufficient")
    assert check_hard_triple(d, d, 0.5).is_closed


def test_sufficient_implies_closed_on_random_triples() -> None:
    d = np.random.default_rng(3).normal(size=(800, 3, 3))
    d /= np.linalg.norm(d, axis=2, keepdims=True)
    for mu in FRICTIONS:
        margins = compute_triple_margin(d, d, mu)
        shown = np.array([check_sphere_triple_sufficient(points, mu).is_closed for points in d])
        assert shown.sum() > 25
        assert (margins[shown] > 0.0).all()
        # and it misses many
        assert (margins[~shown] > 0.0).sum() > 25


def test_three_fingers_carry_a_ball() -> None:
    grasp = ring((0, 120, 240), HardFinger(0.5))
    assert find_min_normal(grasp, WEIGHT) == pytest.approx(0.327, abs=1e-6)
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
        b_eq=WEIGHT,
        bounds=(None, None),
    )
    assert answer.x[-1] == pytest.approx(0.35394, abs=1e-5)
    assert answer.x[-1] == pytest.approx(0.327 / np.cos(np.pi / 8))


def test_antipodal_pair_carries_a_ball() -> None:
    assert find_min_normal(ring((0, 180), SoftFinger(0.5, 0.002)), WEIGHT) == pytest.approx(0.4905, abs=1e-6)
    assert required_pair_preload(0.5, 0.002, 0.05, R, np.pi) == pytest.approx(0.4905)


@pytest.mark.parametrize(("phi_deg", "utilisation"), [(160.0, 1.0), (150.0, 1.0), (150.0, 0.8), (140.0, 1.0)])
def test_load_of_a_pair_is_the_optimum(phi_deg: float, utilisation: float) -> None:
    mu, mu_t, radius = 0.55 / 1.3, 0.0025 / 1.3, 0.035
    grasp = ring((0.0, phi_deg), SoftFinger(mu, mu_t), radius=radius)
    # the ball's centre is the origin of the wrench: weight acts there, beside the chord
    least = find_min_normal(grasp, np.array([0, 0, 0.06 * GRAVITY, 0, 0, 0]), utilisation)
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
    with pytest.raises(ValueError, match="collinear or coincide"):
        check_sphere_triple_sufficient(directions((0, 0, 90)), 0.5)
    with pytest.raises(ValueError, match="a vector \\(3,\\) that points somewhere"):
        build_independent_cones([0, 0, 0], 0.5)
    with pytest.raises(ValueError, match="between 0 and pi/2"):
        build_independent_cones([0, 0, 1], -0.5)
