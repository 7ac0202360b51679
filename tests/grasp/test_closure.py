"""The general closure test: against an interior-point cone solver, its own certificates, and what theory says of margins."""

from __future__ import annotations

from collections.abc import Callable

import clarabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_grasps import R, anywhere, on_sphere, random_grasp, ring, spun, turned, with_friction
from scipy.sparse import csc_matrix
from scipy.spatial.transform import Rotation

from dexplan.contact.friction import HardFinger, SoftFinger
from dexplan.grasp.closed_forms.agreement import PAIR_BAND, compare, sample_chords
from dexplan.grasp.closure import (
    check_antipodal,
    check_force_closure,
    choose_contact_model,
    compute_load_margin,
)
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.spatial import GRAVITY

SEEDS = st.integers(0, 10_000)
WEIGHT = np.array([0, 0, 0.05 * GRAVITY, 0, 0, 0])


def properties(examples: int) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return settings(max_examples=examples, deadline=None, derandomize=True)


def equality(grasp: Grasp) -> tuple[np.ndarray, np.ndarray]:
    """Balance and mean squeeze as rows (7, sum m) on forces divided by capacity, and the capacities."""
    capacity = np.concatenate([np.insert(model.capacity, 2, 1.0) for model in grasp.models])
    rows = np.zeros((7, len(capacity)))
    rows[:6] = compute_grasp_map(grasp) * capacity
    rows[3:6] /= R
    rows[6, [s.start + 2 for s in grasp.slices]] = 1.0
    return rows, capacity


def solve_by_clarabel(grasp: Grasp, wrench: np.ndarray, mean: float) -> float:
    """The margin by an interior-point solver for second-order cones; -inf where it finds no forces."""
    rows, _ = equality(grasp)
    size = rows.shape[1]
    right = np.concatenate([wrench[:3] / mean, wrench[3:] / (R * mean), [len(grasp.contacts)]])
    blocks, offsets, cones = [np.column_stack([rows, np.zeros(7)])], [right], [clarabel.ZeroConeT(7)]
    for model, part in zip(grasp.models, grasp.slices, strict=True):
        cone = np.zeros((model.dimension, size + 1))
        cone[0, part.start + 2], cone[0, -1] = -1.0, 1.0
        others = [part.start + j for j in range(model.dimension) if j != 2]
        cone[range(1, model.dimension), others] = -1.0
        blocks.append(cone)
        offsets.append(np.zeros(model.dimension))
        cones.append(clarabel.SecondOrderConeT(model.dimension))
    quiet = clarabel.DefaultSettings()
    quiet.verbose = False
    cost = np.append(np.zeros(size), -1.0)
    table = csc_matrix(np.vstack(blocks))
    zero = csc_matrix((size + 1, size + 1))
    answer = clarabel.DefaultSolver(zero, cost, table, np.concatenate(offsets), cones, quiet).solve()
    return float(answer.x[-1]) if str(answer.status) == "Solved" else -np.inf


@pytest.mark.parametrize("count", [2, 3, 4, 6])
def test_margin_is_the_optimum(count: int) -> None:
    finite = 0
    for seed in range(25):
        # two hard fingers balance hardly anything
        grasp = random_grasp(seed, count, hard=False if count == 2 else None)
        wrench = 0.2 * np.random.default_rng(seed).normal(size=6) * [1, 1, 1, R, R, R] * (seed % 3)
        best = solve_by_clarabel(grasp, wrench, 2.0)
        if np.isfinite(best):
            finite += 1
            assert compute_load_margin(grasp, wrench, 2.0).margin == pytest.approx(best, abs=5e-7)
    assert finite >= 20


@properties(40)
@given(SEEDS, st.integers(2, 5), st.floats(0.3, 20.0), st.sampled_from(["cone", "polytope"]))
def test_margin_proves_itself(seed: int, count: int, mean: float, method: str) -> None:
    """The forces balance the wrench, have the mean asked for, and leave each exact cone no earlier than the margin says."""
    grasp = random_grasp(seed, count, hard=False if count == 2 else None)
    found = compute_load_margin(grasp, WEIGHT, mean, method)  # type: ignore[arg-type]
    f = found.internal_forces
    assert f is not None
    assert np.allclose(compute_grasp_map(grasp) @ f, WEIGHT, atol=1e-8 * max(1.0, mean))
    assert f[[s.start + 2 for s in grasp.slices]].mean() == pytest.approx(mean)
    attained = min(float(m.cone_margin(f[s])) for m, s in zip(grasp.models, grasp.slices, strict=True)) / mean
    assert attained >= found.margin - 1e-7
    if method == "cone":
        assert attained == pytest.approx(found.margin, abs=1e-9 * (1.0 + abs(attained)))


@properties(40)
@given(SEEDS, st.integers(2, 5), st.booleans())
def test_pyramid_costs_what_its_inradius_says(seed: int, count: int, hard: bool) -> None:
    grasp = random_grasp(seed, count, hard and count > 2)
    kept = min(model.facet_inradius for model in grasp.models)
    exact, pyramid = (compute_load_margin(grasp, WEIGHT, 1.0, method) for method in ("cone", "polytope"))
    below = compute_load_margin(with_friction(grasp, kept), WEIGHT, 1.0)
    assert below.margin - 1e-7 <= pyramid.margin <= exact.margin + 1e-7
    assert (exact.strength, pyramid.strength) == ("exact", "sufficient")


@properties(40)
@given(SEEDS, st.integers(2, 4), st.floats(0.0, 6.28))
def test_margin_depends_neither_on_axes_nor_on_order(seed: int, count: int, angle: float) -> None:
    grasp = random_grasp(seed, count, hard=False if count == 2 else None)
    rng = np.random.default_rng(seed)
    rotation = Rotation.random(rng=rng).as_matrix()
    other = spun(turned(grasp, rotation), angle)
    other = Grasp(tuple(other.contacts[i] for i in rng.permutation(count)))
    wrench = np.concatenate([rotation @ WEIGHT[:3], rotation @ WEIGHT[3:]])
    for load_1, load_2 in ((np.zeros(6), np.zeros(6)), (WEIGHT, wrench)):
        here, there = compute_load_margin(grasp, load_1, 1.0), compute_load_margin(other, load_2, 1.0)
        assert there.margin == pytest.approx(here.margin, abs=5e-8 * (1.0 + abs(here.margin)))


@properties(40)
@given(SEEDS, st.integers(2, 4), st.floats(1.001, 2.0))
def test_margin_grows_with_friction_by_no_more_than_its_share(seed: int, count: int, factor: float) -> None:
    """A load is used / factor afterwards, so nothing gains more than (factor - 1) times what is then used."""
    grasp = random_grasp(seed, count, hard=False if count == 2 else None)
    before, after = check_force_closure(grasp), check_force_closure(with_friction(grasp, factor))
    assert after.margin >= before.margin - 1e-7
    f = after.internal_forces
    assert f is not None
    models = with_friction(grasp, factor).models
    used = max(float(m.load(f[s])) for m, s in zip(models, grasp.slices, strict=True))
    assert after.margin <= before.margin + (factor - 1.0) * used + 1e-7


@properties(60)
@given(SEEDS, st.integers(2, 4), st.sampled_from([1e-2, 1e-3, 1e-4]))
def test_margin_is_continuous(seed: int, count: int, size: float) -> None:
    """Contacts moved a little, normals turned a little, friction changed a little: forces repaired by the pseudo-inverse
    of the new balance bound what the margin can lose, in both directions.
    """
    grasp = random_grasp(seed, count, hard=False)
    rng = np.random.default_rng(seed + 1)
    points = np.array([c.p_OC for c in grasp.contacts]) + size * R * rng.uniform(-1, 1, (count, 3))
    normals = np.array([c.n_O for c in grasp.contacts]) + size * rng.uniform(-1, 1, (count, 3))
    moved = anywhere(points, normals, [m.scaled(1 + size * rng.uniform(-1, 1)) for m in grasp.models])
    found = [check_force_closure(g) for g in (grasp, moved)]
    maps = [equality(g) for g in (grasp, moved)]
    for i, j in ((0, 1), (1, 0)):
        f = found[i].internal_forces
        assert f is not None
        y = f / maps[i][1]
        miss = (maps[j][0] - maps[i][0]) @ y
        repair = float(np.linalg.norm(np.linalg.pinv(maps[j][0]) @ miss))
        assert found[j].margin >= found[i].margin - np.sqrt(2.0) * repair - 1e-7


@properties(30)
@given(SEEDS)
def test_hard_pairs_are_never_closed(seed: int) -> None:
    result = check_force_closure(random_grasp(seed, 2, hard=True))
    assert result.rank == 5
    assert not result.is_closed
    assert result.is_settled


def test_hard_pair_squeezes_but_cannot_resist_spin() -> None:
    grasp = ring((0, 180), HardFinger(0.5))
    result = check_force_closure(grasp)
    assert result.rank == 5
    assert result.margin == pytest.approx(1.0)
    assert not result.is_closed
    spin = compute_load_margin(grasp, np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.0]), 1.0)
    assert spin.margin == -np.inf
    assert not spin.is_closed
    assert spin.internal_forces is None


def test_contact_model_of_a_pair_is_soft_and_of_three_hard() -> None:
    assert choose_contact_model(2, 0.5, 0.002) == SoftFinger(0.5, 0.002)
    assert choose_contact_model(3, 0.5, 0.002) == choose_contact_model(4, 0.5, 0.002) == HardFinger(0.5)
    with pytest.raises(ValueError, match="two or more are accepted"):
        choose_contact_model(1, 0.5, 0.002)
    # the fewest fingers that each model can close
    assert check_force_closure(ring((0, 180), choose_contact_model(2, 0.5, 0.002))).is_closed
    assert check_force_closure(ring((0, 120, 240), choose_contact_model(3, 0.5, 0.002))).is_closed


def test_hard_fingers_are_the_conservative_model_of_three() -> None:
    closed = 0
    for seed in range(60):
        hard = random_grasp(seed, 3, hard=True)
        soft = anywhere(
            np.array([c.p_OC for c in hard.contacts]),
            np.array([c.n_O for c in hard.contacts]),
            [SoftFinger(float(m.capacity[0]), 0.002) for m in hard.models],
        )
        before, after = check_force_closure(hard), check_force_closure(soft)
        assert after.margin >= before.margin - 1e-7
        closed += before.is_closed
        assert after.is_closed or not before.is_closed
    assert 10 < closed < 50


def test_full_rank_is_not_force_closure() -> None:
    result = check_force_closure(ring((0, 40, 80), HardFinger(0.5)))
    assert result.rank == 6
    assert not result.is_closed
    assert result.margin < 0.0


def test_load_margin_of_a_carried_ball() -> None:
    """Three equatorial hard fingers under gravity: each carries a third of the weight by shear."""
    grasp = ring((0, 120, 240), HardFinger(0.5))
    for mean in (0.3, 0.327, 1.0, 5.0):
        found = compute_load_margin(grasp, WEIGHT, mean)
        assert found.margin == pytest.approx(1.0 - WEIGHT[2] / (3 * 0.5 * mean), abs=1e-7)
        assert found.is_closed is (mean > 0.327)
        # the octagon keeps cos(22.5 deg) of friction across a facet, where the load is, and all of it at an edge
        for angle, kept in ((0.0, 0.5 * np.cos(np.pi / 8)), (np.pi / 8, 0.5)):
            pyramid = compute_load_margin(spun(grasp, angle), WEIGHT, mean, "polytope")
            assert pyramid.margin == pytest.approx(1.0 - WEIGHT[2] / (3 * kept * mean), abs=1e-7)
        # two antipodal soft fingers carry half each
        pair = compute_load_margin(ring((0, 180), SoftFinger(0.5, 0.002)), WEIGHT, mean)
        assert pair.margin == pytest.approx(1.0 - WEIGHT[2] / (2 * 0.5 * mean), abs=1e-7)


def test_one_plane_makes_the_antipodal_test_exact() -> None:
    """Chord along x, normals in one plane with it: the general test changes its answer where the chord leaves a cone."""
    rng = np.random.default_rng(5)
    points = np.array([[-R, 0.0, 0.0], [R, 0.0, 0.0]])
    for _ in range(40):
        mu = rng.uniform(0.3, 1.0)
        lean = np.arctan(mu) + np.array([rng.choice([-1e-3, 1e-3]), -rng.uniform(1e-3, 0.2)])
        side = np.array([[-1.0], [1.0]])
        normals = np.stack(
            [side[:, 0] * np.cos(lean), rng.choice([-1, 1], 2) * np.sin(lean), np.zeros(2)], axis=1
        )
        chord = check_antipodal(points[0], normals[0], points[1], normals[1], mu)
        general = check_force_closure(anywhere(points, normals, [SoftFinger(mu, 0.01)] * 2))
        assert chord.strength == "exact"
        assert chord.margin == pytest.approx(np.arctan(mu) - lean.max(), abs=1e-9)
        assert general.is_closed == chord.is_closed


def test_skew_pair_may_hold_though_its_chord_misses_the_cones() -> None:
    """Torsion balances the couple of two forces that both lean towards their normals: the condition is sufficient only."""
    mu, off = 0.5, np.arctan(0.5) + np.radians(0.2)
    points = np.array([[-R, 0.0, 0.0], [R, 0.0, 0.0]])
    normals = np.array([[-np.cos(off), -np.sin(off), 0.0], [np.cos(off), 0.0, -np.sin(off)]])
    grasp = anywhere(points, normals, [SoftFinger(mu, 0.01)] * 2)
    chord = check_antipodal(points[0], normals[0], points[1], normals[1], mu)
    assert np.degrees(chord.margin) == pytest.approx(-0.2)
    assert not chord.is_closed
    assert not chord.is_settled
    found = check_force_closure(grasp)
    assert found.is_closed
    f = found.internal_forces
    assert f is not None
    assert np.allclose(compute_grasp_map(grasp) @ f, 0.0, atol=1e-9)
    assert min(m.cone_margin(f[s]) for m, s in zip(grasp.models, grasp.slices, strict=True)) > 1e-3
    # with less torsion the textbook's "only if" comes back
    thin = anywhere(points, normals, [SoftFinger(mu, 0.001)] * 2)
    assert not check_force_closure(thin).is_closed


def test_antipodal_pairs_anywhere_are_closed() -> None:
    found = compare(sample_chords(120, np.random.default_rng(1)), PAIR_BAND)
    assert found.disagreements == ()
    assert found.pyramid_faults == ()
    assert 30 < found.closed < 90


def test_callers_mistakes_raise_with_what_is_accepted() -> None:
    grasp = on_sphere(np.eye(3), HardFinger(0.5))
    with pytest.raises(ValueError, match="six finite numbers"):
        compute_load_margin(grasp, np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="a positive finite one is accepted"):
        compute_load_margin(grasp, np.zeros(6), 0.0)
    with pytest.raises(ValueError, match="'cone' and 'polytope' are accepted"):
        compute_load_margin(grasp, np.zeros(6), 1.0, "ball")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="coincide"):
        check_antipodal([0, 0, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0], 0.5)
