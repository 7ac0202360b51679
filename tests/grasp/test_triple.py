"""Three hard fingers in closed form: against the general test, closed borders, and what theory says of the margin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_grasps import R, anywhere, directions, random_grasp, ring
from scipy.spatial.transform import Rotation

from dexplan.contact.friction import HardFinger
from dexplan.grasp.closed_forms.agreement import TRIPLE_BAND, compare, sample_triples
from dexplan.grasp.closed_forms.triple import check_hard_triple, compute_triple_margin
from dexplan.grasp.closure import check_force_closure
from dexplan.grasp.grasp import compute_grasp_map

SEEDS = st.integers(0, 10_000)
properties = settings(max_examples=50, deadline=None, derandomize=True)


def lumpy(seed: int, count: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals (count, 3, 3) on no surface in particular, normals of any length."""
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(count, 3, 3))
    points = R * d / np.linalg.norm(d, axis=2, keepdims=True) * rng.uniform(0.5, 1.5, (count, 3, 1))
    return points, d + 0.4 * rng.normal(size=d.shape)


def test_agrees_with_the_general_test() -> None:
    found = compare(sample_triples(200, np.random.default_rng(1)), TRIPLE_BAND)
    assert found.disagreements == ()
    assert found.pyramid_faults == ()
    assert 65 < found.closed < 135
    assert found.in_band < 20


@pytest.mark.parametrize("mu", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("height", [0.0, 0.2, 0.5, 0.9])
def test_circle_of_latitude(mu: float, height: float) -> None:
    """Where the triangle is acute the plane's height alone decides: theta must exceed asin(h / r)."""
    elevation = float(np.degrees(np.arcsin(height)))
    d = directions((0, 110, 240), elevation)
    assert check_hard_triple(R * d, d, mu).margin == pytest.approx(
        np.arctan(mu) - np.arcsin(height), abs=1e-9
    )


@pytest.mark.parametrize("half_deg", [0.0, 10.0, 30.0])
@pytest.mark.parametrize("width", [0.5, 1.0, 3.0])
def test_wedge_between_two_fingers_and_a_third_at_its_end(half_deg: float, width: float) -> None:
    """Squeezed towards the third finger the wedge needs no friction; squeezed away from it, the third cannot help and the
    pair has to lean by half the wedge's angle.
    """
    half, theta = np.radians(half_deg), np.arctan(0.8)
    rotation = Rotation.random(rng=np.random.default_rng(0)).as_matrix()
    points = np.array([[0.0, width, 0.0], [0.0, -width, 0.0], [10.0, 0.0, 0.0]])
    for towards, needed in ((1.0, 0.0), (-1.0, half)):
        lean = towards * np.sin(half)
        normals = np.array([[-lean, np.cos(half), 0.0], [-lean, -np.cos(half), 0.0], [1.0, 0.0, 0.0]])
        margin = compute_triple_margin(points @ rotation.T, normals @ rotation.T, 0.8)
        # between parallel faces the third force vanishes at the border, and half of the digits with it
        assert float(margin) == pytest.approx(theta - needed, abs=1e-9 if half > 0.0 else 2e-6)


def test_faces_that_all_look_one_way_are_never_closed() -> None:
    """Pushed from one side only, no friction closes the grasp; the margin then counts from a right angle."""
    points = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
    normals = np.tile([0.0, 0.0, 1.0], (3, 1))
    assert check_hard_triple(points, normals, 5.0).margin == pytest.approx(np.arctan(5.0) - np.pi / 2)


def test_obtuse_triangles_of_the_oracles() -> None:
    for azimuths, closed in (((0, 60, 150), True), ((0, 40, 80), False)):
        d = directions(azimuths)
        result = check_hard_triple(R * d, d, 0.5)
        assert result.is_closed is closed
        assert check_force_closure(ring(azimuths, HardFinger(0.5))).is_closed is closed
    # the pair 150 degrees apart holds by itself and the third finger adds what a hard pair lacks
    d = directions((0, 60, 150))
    assert compute_triple_margin(d, d, 0.5) >= np.arctan(0.5) - np.radians(15.0) - 1e-9


def test_internal_forces_lie_in_the_plane_of_the_points() -> None:
    """The fact that the closed form rests on, found anew as the null space of the grasp map."""
    for seed in range(20):
        grasp = random_grasp(seed, 3, hard=True)
        _, values, rows = np.linalg.svd(compute_grasp_map(grasp))
        assert values[5] > 1e-4
        p = [c.p_OC for c in grasp.contacts]
        normal = np.cross(p[1] - p[0], p[2] - p[0])
        for f in rows[6:]:
            for c, part in zip(grasp.contacts, grasp.slices, strict=True):
                assert normal @ c.R_OC @ f[part] == pytest.approx(0.0, abs=1e-9 * np.linalg.norm(normal))


@properties
@given(SEEDS, st.floats(0.05, 3.0), st.floats(0.01, 0.2))
def test_margin_is_what_friction_has_to_spare(seed: int, mu: float, more: float) -> None:
    """Monotone in mu, at the rate of the friction angle itself, until no friction would do."""
    points, normals = lumpy(seed)
    theta = np.arctan(mu)
    before = float(compute_triple_margin(points, normals, mu)[0])
    after = float(compute_triple_margin(points, normals, np.tan(min(theta + more, 1.5)))[0])
    assert after - before == pytest.approx(min(theta + more, 1.5) - theta, abs=1e-9)


@properties
@given(SEEDS, st.floats(0.1, 2.0), st.sampled_from([0.1, 1e-2, 1e-4]))
def test_margin_follows_turned_normals_no_faster_than_they_turn(seed: int, mu: float, size: float) -> None:
    points, normals = lumpy(seed)
    rng = np.random.default_rng(seed + 1)
    turns = Rotation.from_rotvec(size * rng.normal(size=(3, 3)))
    others = np.stack([turns[i].as_matrix() @ normals[0, i] for i in range(3)])[None]
    change = float(
        compute_triple_margin(points, others, mu)[0] - compute_triple_margin(points, normals, mu)[0]
    )
    assert abs(change) <= turns.magnitude().max() + 1e-9


@properties
@given(SEEDS, st.floats(0.1, 2.0))
def test_margin_is_continuous_in_the_points(seed: int, mu: float) -> None:
    """Each halving of a displacement halves the change, within what rounding leaves, where the triangle is no sliver."""
    points, normals = lumpy(seed)
    sides = np.roll(points, -1, axis=1) - points
    area = np.linalg.norm(np.cross(sides[0, 0], sides[0, 1]))
    shift = np.random.default_rng(seed + 1).uniform(-1.0, 1.0, (1, 3, 3))
    start = float(compute_triple_margin(points, normals, mu)[0])
    for size in (1e-5, 1e-7):
        change = abs(float(compute_triple_margin(points + size * R * shift, normals, mu)[0]) - start)
        # a side and the plane turn by at most (displacement) x (longest side) / area
        turn = 4.0 * size * R * np.linalg.norm(sides, axis=2).max() / area
        assert change <= 4.0 * turn + 1e-8


@properties
@given(SEEDS, st.floats(0.1, 2.0), st.permutations(range(3)))
def test_margin_depends_neither_on_axes_nor_on_order_nor_on_size(
    seed: int, mu: float, order: list[int]
) -> None:
    points, normals = lumpy(seed)
    frictions = mu * np.array([1.0, 1.3, 0.7])
    rotation = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    moved = 7.0 * points @ rotation.T + [0.3, -0.1, 0.2]
    here = compute_triple_margin(points, normals, frictions)
    there = compute_triple_margin(moved[:, order], 0.1 * normals[:, order] @ rotation.T, frictions[order])
    assert np.allclose(here, there, atol=1e-8)


def test_many_at_once_are_one_by_one() -> None:
    points, normals = lumpy(3, 50)
    mu = np.random.default_rng(3).uniform(0.2, 1.0, (50, 3))
    together = compute_triple_margin(
        points.reshape(5, 10, 3, 3), normals.reshape(5, 10, 3, 3), mu.reshape(5, 10, 3)
    )
    apart = [float(compute_triple_margin(p, n, m)) for p, n, m in zip(points, normals, mu, strict=True)]
    assert together.shape == (5, 10)
    assert np.allclose(together.ravel(), apart, atol=1e-12)


def test_unequal_frictions_agree_with_the_general_test() -> None:
    points, normals = lumpy(11, 150)
    mu = np.random.default_rng(11).uniform(0.1, 1.2, (150, 3))
    margins = compute_triple_margin(points, normals, mu)
    for p, n, friction, margin in zip(points, normals, mu, margins, strict=True):
        if abs(margin) > TRIPLE_BAND:
            grasp = anywhere(p, n, [HardFinger(float(m)) for m in friction])
            assert check_force_closure(grasp).is_closed == (margin > 0.0)


def test_collinear_points_are_never_closed() -> None:
    points = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.03, 0.0, 0.0]])
    result = check_hard_triple(points, np.array([[0, 1.0, 0], [0, -1.0, 0], [0, 1.0, 0]]), 0.8)
    assert (result.is_closed, result.margin, result.rank) == (False, -np.inf, 5)
    grasp = anywhere(points, np.array([[0, 1.0, 0], [0, -1.0, 0], [0, 1.0, 0]]), [HardFinger(0.8)] * 3)
    assert check_force_closure(grasp).rank == 5


def test_callers_mistakes_raise_with_what_is_accepted() -> None:
    with pytest.raises(ValueError, match=r"equal shapes \(\.\.\., 3, 3\) are accepted"):
        compute_triple_margin(np.eye(2), np.eye(3), 0.5)
    with pytest.raises(ValueError, match="length zero"):
        compute_triple_margin(np.eye(3), np.zeros((3, 3)), 0.5)
    with pytest.raises(ValueError, match="positive numbers are accepted"):
        compute_triple_margin(np.eye(3), np.eye(3), 0.0)
