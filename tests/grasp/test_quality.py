"""Quality terms against closed forms, a convex hull, an independent search, and what their names promise."""

from __future__ import annotations

from itertools import product

import clarabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_grasps import R, directions, on_sphere, random_grasp, ring, spun, turned, with_friction
from scipy.sparse import csc_matrix
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from dexplan.contact.friction import HardFinger, SoftFinger
from dexplan.grasp.closed_forms.pair import check_sphere_pair
from dexplan.grasp.closure import check_force_closure, compute_load_margin
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.grasp.quality import (
    compute_ferrari_canny,
    compute_pair_cost,
    compute_pair_lack,
    compute_quality,
    compute_singular_value_min,
    compute_support,
)
from dexplan.spatial import GRAVITY, build_frame

SEEDS = st.integers(0, 10_000)
WEIGHT = np.array([0, 0, 0.05 * GRAVITY, 0, 0, 0])


def closed_grasps(count: int) -> list[Grasp]:
    found, seed = [], 0
    while len(found) < count:
        grasp = random_grasp(seed, 2 + seed % 3, hard=False if seed % 3 == 0 else None)
        if check_force_closure(grasp).is_closed:
            found.append(grasp)
        seed += 1
    return found


def shoot_ray(grasp: Grasp, direction: np.ndarray) -> tuple[float, np.ndarray]:
    """How far the wrench set reaches along a direction, by a cone solver, and the outward normal (6,) of its border there."""
    G = compute_grasp_map(grasp)
    G[3:] /= R
    size = G.shape[1]
    rows, offsets, cones = [np.column_stack([G, -direction])], [np.zeros(6)], [clarabel.ZeroConeT(6)]
    for model, part in zip(grasp.models, grasp.slices, strict=True):
        top = np.zeros((1, size + 1))
        top[0, part.start + 2] = 1.0
        cone = np.zeros((model.dimension, size + 1))
        cone[0, part.start + 2] = -1.0
        others = [part.start + j for j in range(model.dimension) if j != 2]
        cone[range(1, model.dimension), others] = -1.0 / model.capacity
        rows += [top, cone]
        offsets += [np.ones(1), np.zeros(model.dimension)]
        cones += [clarabel.NonnegativeConeT(1), clarabel.SecondOrderConeT(model.dimension)]
    quiet = clarabel.DefaultSettings()
    quiet.verbose = False
    cost = np.append(np.zeros(size), -1.0)
    zero = csc_matrix((size + 1, size + 1))
    table = csc_matrix(np.vstack(rows))
    answer = clarabel.DefaultSolver(zero, cost, table, np.concatenate(offsets), cones, quiet).solve()
    # where the cone of normals is wide at a corner, the multiplier is one of them
    return float(answer.x[-1]), -np.array(answer.z[:6])


def search_radius(grasp: Grasp, starts: int) -> float:
    """The radius by an independent search: shoot a ray, turn to the border's normal where it leaves, repeat.

    The distance of the supporting plane there is never more than the ray's length, so that it falls with each shot.
    """
    rng, best = np.random.default_rng(7), np.inf
    for _ in range(starts):
        direction = rng.normal(size=6)
        direction /= np.linalg.norm(direction)
        last = np.inf
        for _ in range(40):
            length, normal = shoot_ray(grasp, direction)
            distance = length * float(normal @ direction) / float(np.linalg.norm(normal))
            direction = normal / np.linalg.norm(normal)
            if last - abs(distance) < 1e-9:
                break
            last = abs(distance)
        best = min(best, last)
    return best


@pytest.mark.parametrize("mu", [0.3, 0.5, 0.8])
def test_ferrari_canny_of_three_equatorial_fingers(mu: float) -> None:
    radius = compute_ferrari_canny(ring((0, 120, 240), HardFinger(mu)), R)
    assert radius == pytest.approx(3.0 * mu / np.sqrt(5.0), abs=1e-7)


@pytest.mark.parametrize("mu", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("mu_t", [0.002, 0.006, 0.008])
def test_ferrari_canny_of_an_antipodal_soft_pair(mu: float, mu_t: float) -> None:
    """Weakest are torsion, with all the squeeze it can take along: 2 m / sqrt(1 + m^2), m = mu_t / R < mu; or a shear of one
    finger by itself: mu sqrt 2 / sqrt(1 + 2 mu^2).
    """
    m = mu_t / R
    expected = min(2.0 * m / np.sqrt(1.0 + m * m), np.sqrt(2.0) * mu / np.sqrt(1.0 + 2.0 * mu * mu))
    radius = compute_ferrari_canny(ring((0, 180), SoftFinger(mu, mu_t)), R)
    assert radius == pytest.approx(expected, abs=1e-7)


def test_ferrari_canny_against_a_search_with_a_cone_solver() -> None:
    for grasp in closed_grasps(4):
        assert compute_ferrari_canny(grasp, R) == pytest.approx(search_radius(grasp, 12), abs=2e-5)


def test_ferrari_canny_lies_between_hulls() -> None:
    """Minkowski sums of inscribed and circumscribed pyramids with four edges, by a convex hull in six dimensions."""
    for d in (directions((0, 120, 240)), directions((0, 100, 230), 8.0)):
        grasp = on_sphere(d, HardFinger(0.6))
        G = compute_grasp_map(grasp)
        G[3:] /= R
        radii = []
        for reach in (1.0, np.sqrt(2.0)):
            angles = np.arange(4) * np.pi / 2
            edges = np.stack([0.6 * reach * np.cos(angles), 0.6 * reach * np.sin(angles), np.ones(4)], axis=1)
            corners = [np.vstack([np.zeros(6), edges @ G[:, part].T]) for part in grasp.slices]
            sums = np.array([sum(choice) for choice in product(*corners)])
            radii.append(float(-ConvexHull(sums, qhull_options="QJ Q12").equations[:, -1].max()))
        assert radii[0] - 1e-6 <= compute_ferrari_canny(grasp, R) <= radii[1] + 1e-6


def test_support_in_the_plane_is_that_of_a_planar_hull() -> None:
    """Equatorial contacts, wrenches (f_x, f_y, tau_z): planar cones with two edges each, exactly."""
    mu, azimuths = 0.5, (0, 110, 235)
    grasp = ring(azimuths, HardFinger(mu))
    corners = []
    for n in directions(azimuths):
        along = np.array([-n[1], n[0], 0.0])
        forces = [np.zeros(3), -n + mu * along, -n - mu * along]
        corners.append([np.array([f[0], f[1], np.cross(n, f)[2]]) for f in forces])
    hull = ConvexHull([sum(choice) for choice in product(*corners)])
    planar = np.zeros((len(hull.equations), 6))
    planar[:, [0, 1, 5]] = hull.equations[:, :3]
    # its facets carry their distance as support, and the least is the weakest planar wrench
    assert np.allclose(compute_support(grasp, planar, R), -hull.equations[:, 3], atol=1e-9)
    assert compute_ferrari_canny(grasp, R) <= -hull.equations[:, 3].max() + 1e-9


def test_no_sampled_direction_is_weaker() -> None:
    rng = np.random.default_rng(2)
    for grasp in closed_grasps(5):
        radius = compute_ferrari_canny(grasp, R)
        d = rng.normal(size=(20_000, 6))
        assert (
            compute_support(grasp, d / np.linalg.norm(d, axis=1, keepdims=True), R) >= radius - 1e-9
        ).all()
        assert compute_ferrari_canny(grasp, R, starts=64, seed=5) == pytest.approx(radius, abs=1e-7)


def test_support_is_what_forces_attain() -> None:
    """At its direction the support is the work of explicit forces, which lie on their cones."""
    rng = np.random.default_rng(4)
    grasp = random_grasp(3, 3)
    G = compute_grasp_map(grasp)
    G[3:] /= R
    for d in rng.normal(size=(20, 6)):
        f = np.zeros(G.shape[1])
        for model, part in zip(grasp.models, grasp.slices, strict=True):
            pull = np.delete(d @ G[:, part], 2) * model.capacity
            best = np.insert(model.capacity * pull / np.linalg.norm(pull), 2, 1.0)
            f[part] = best if d @ G[:, part] @ best > 0.0 else 0.0
            assert float(model.cone_margin(f[part])) == pytest.approx(0.0, abs=1e-12)
        assert float(compute_support(grasp, d, R)) == pytest.approx(float(d @ G @ f))


@settings(max_examples=4, deadline=None, derandomize=True)
@given(st.integers(0, 9), st.floats(0.0, 6.28), st.floats(1.05, 1.5))
def test_quality_knows_no_axes_and_likes_friction(index: int, angle: float, factor: float) -> None:
    grasp = closed_grasps(10)[index]
    rotation = Rotation.random(rng=np.random.default_rng(index)).as_matrix()
    moved = spun(turned(grasp, rotation), angle)
    moved = Grasp(tuple(reversed(moved.contacts)))
    radius, rough = compute_ferrari_canny(grasp, R), with_friction(grasp, factor)
    assert compute_ferrari_canny(moved, R) == pytest.approx(radius, abs=1e-7)
    assert compute_ferrari_canny(rough, R) >= radius - 1e-9
    assert compute_singular_value_min(moved, R) == pytest.approx(compute_singular_value_min(grasp, R))
    assert compute_singular_value_min(rough, R) == pytest.approx(compute_singular_value_min(grasp, R))
    assert compute_pair_cost(moved) == pytest.approx(compute_pair_cost(grasp), abs=1e-12)
    assert compute_pair_lack(rough) <= compute_pair_lack(grasp)


def test_nothing_is_resisted_without_closure() -> None:
    for grasp in (
        ring((0, 40, 80), HardFinger(0.5)),
        ring((0, 180), HardFinger(0.5)),
        ring((0,), HardFinger(0.5)),
    ):
        assert compute_ferrari_canny(grasp, R) == 0.0


def test_singular_values() -> None:
    equatorial = ring((0, 120, 240), HardFinger(0.5))
    assert compute_singular_value_min(equatorial) == pytest.approx(R * np.sqrt(1.5))
    assert compute_singular_value_min(equatorial, R) == pytest.approx(np.sqrt(1.5))
    assert compute_singular_value_min(ring((0, 180), HardFinger(0.5))) == pytest.approx(0.0, abs=1e-12)
    assert compute_singular_value_min(ring((0,), HardFinger(0.5))) == 0.0
    # an antipodal soft pair: G G^T = diag(2, 2, 2, 2, 2 R^2, 2 R^2), spin about the chord without a lever
    assert compute_singular_value_min(ring((0, 180), SoftFinger(0.5, 0.002))) == pytest.approx(
        R * np.sqrt(2.0)
    )


@settings(max_examples=60, deadline=None, derandomize=True)
@given(SEEDS, st.integers(2, 5))
def test_pair_lack_is_the_least_that_any_pair_lacks(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    d = rng.normal(size=(count, 3))
    grasp = on_sphere(d, HardFinger(0.5))
    lacks = [
        max(0.0, -0.5 * check_sphere_pair(d[i], d[j], 0.5).margin) for i in range(count) for j in range(i)
    ]
    lack, cost = compute_pair_lack(grasp), compute_pair_cost(grasp)
    assert lack == pytest.approx(min(lacks), abs=1e-9)
    assert (cost == 0.0) == (lack == 0.0)
    assert lack**2 / len(lacks) * (1 - 1e-9) <= cost <= lack**2 * (1 + 1e-9)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(90.0, 180.0), st.floats(0.01, 3.0))
def test_pair_cost_falls_as_a_pair_opens(first_deg: float, more_deg: float) -> None:
    """A finger on the axis between the two others, which move apart symmetrically until they close."""
    costs = []
    for between in (first_deg, min(first_deg + more_deg, 180.0)):
        d = directions((-0.5 * between, 0.5 * between))
        costs.append(compute_pair_cost(on_sphere(np.vstack([d, [0.0, 0.0, 1.0]]), HardFinger(0.5))))
    assert costs[1] <= costs[0]
    assert (costs[1] < costs[0]) or costs[0] == 0.0


def test_pair_cost_has_a_continuous_slope_where_a_pair_closes() -> None:
    """Central angles through the border: slopes on both sides go to zero together, and between two pairs there is no kink."""

    def cost(between_deg: float, shift_deg: float = 0.0) -> float:
        d = directions((-0.5 * between_deg, 0.5 * between_deg, 180.0 + shift_deg))
        return compute_pair_cost(on_sphere(np.vstack([d[:2], build_frame(d[2])[:, 1]]), HardFinger(0.5)))

    border = float(np.degrees(np.pi - 2 * np.arctan(0.5)))
    slopes = [(cost(border + e) - cost(border - e)) / (2 * e) for e in (0.1, 0.01, 0.001)]
    assert abs(slopes[1]) < 0.2 * abs(slopes[0])
    assert abs(slopes[2]) < 0.2 * abs(slopes[1])

    # two pairs that lack the same: a least would have a kink there
    def two(shift_deg: float) -> float:
        return compute_pair_cost(on_sphere(directions((0.0, 100.0 + shift_deg, 200.0)), HardFinger(0.3)))

    right, left = (two(1e-3) - two(0.0)) / 1e-3, (two(0.0) - two(-1e-3)) / 1e-3
    assert right == pytest.approx(left, abs=1e-6)


def test_quality_gathers_its_terms() -> None:
    grasp = ring((0, 120, 240), HardFinger(0.5))
    found = compute_quality(
        grasp, R, WEIGHT, 2.0, joint_margin=[[0.4, 0.2], [0.3, 0.9]], workspace_margin=0.1
    )
    assert found.closure_margin == check_force_closure(grasp).margin
    assert found.load_margin == compute_load_margin(grasp, WEIGHT, 2.0).margin
    assert found.ferrari_canny == compute_ferrari_canny(grasp, R)
    assert found.singular_value_min == compute_singular_value_min(grasp, R)
    assert found.pair_lack == pytest.approx(np.radians(30.0) - np.arctan(0.5))
    assert (found.joint_margin, found.workspace_margin) == (0.2, 0.1)
    bare = compute_quality(grasp, R, WEIGHT, 2.0)
    assert np.isnan(bare.joint_margin)
    assert np.isnan(bare.workspace_margin)


def test_callers_mistakes_raise_with_what_is_accepted() -> None:
    with pytest.raises(ValueError, match="a positive finite one is accepted"):
        compute_singular_value_min(ring((0, 120, 240), HardFinger(0.5)), 0.0)
    with pytest.raises(ValueError, match="two or more contacts are accepted"):
        compute_pair_lack(ring((0,), HardFinger(0.5)))
