"""Regions of directions: algebra, areas and distances against the closed forms of caps, and the paper's independent cones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.grasp.closed_forms.pair import build_independent_cones as build_cones_in_closed_form
from dexplan.grasp.closed_forms.pair import check_sphere_pair
from dexplan.icosphere import build_icosphere
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.regions.spherical import (
    SphericalRegion,
    build_cap,
    build_closure,
    build_independent_cones,
)
from dexplan.spatial import Array, build_frame, rotate_about

SOME = spread_directions(4000)
FEW = settings(max_examples=12, deadline=None, derandomize=True)
angles = st.floats(0.1, 1.4)
axes = st.tuples(st.floats(0.0, 6.28), st.floats(-1.5, 1.5)).map(
    lambda a: np.array([np.cos(a[0]) * np.cos(a[1]), np.sin(a[0]) * np.cos(a[1]), np.sin(a[1])])
)
caps = st.tuples(axes, angles).map(lambda a: build_cap(*a))


def angle(a: Array, b: Array) -> Array:
    """Return the angle between unit vectors, by another formula than the code's."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))


@pytest.mark.parametrize("level", range(6))
def test_icosphere_covers_the_sphere(level: int) -> None:
    grid = build_icosphere(level)
    assert len(grid.vertices) == 10 * 4**level + 2
    assert len(grid.triangles) == 20 * 4**level
    assert np.allclose(np.linalg.norm(grid.vertices, axis=1), 1.0)
    assert grid.areas.sum() == pytest.approx(4.0 * np.pi)
    assert np.allclose(grid.vertices[grid.antipodes], -grid.vertices)
    if grid.coarser is not None:
        assert np.array_equal(grid.vertices[: len(grid.coarser.vertices)], grid.coarser.vertices)
        # What is linear in the parents' plane stays so: a coordinate is reproduced up to the sagitta.
        z = grid.extend(grid.coarser.vertices[:, 2])
        assert np.abs(z - grid.vertices[:, 2]).max() < 0.2 * grid.coarser.spacing**2


def test_no_level_below_the_icosahedron() -> None:
    with pytest.raises(ValueError, match=r"level is -1; 0 \(the icosahedron\) or more"):
        build_icosphere(-1)


@given(a=caps, b=caps, c=caps)
@FEW
def test_algebra_of_sets(a: SphericalRegion, b: SphericalRegion, c: SphericalRegion) -> None:
    """The laws hold on the grid and at exact queries, with the bit of every direction."""
    for one, two in (
        (~(a & b), ~a | ~b),
        (~(a | b), ~a & ~b),
        (a & (b | c), (a & b) | (a & c)),
        (a | (b & c), (a | b) & (a | c)),
        (a - b, a & ~b),
        (~~a, a),
        ((a - b) | (a & b), a),
    ):
        assert np.array_equal(one.level.values >= 0.0, two.mask) or not np.any(
            np.abs(one.level.values[one.mask != two.mask]) > 0.0
        )
        assert np.array_equal(one.contains(SOME), two.contains(SOME))
    assert np.array_equal((a & b).contains(SOME), a.contains(SOME) & b.contains(SOME))
    assert np.array_equal((a | b).contains(SOME), a.contains(SOME) | b.contains(SOME))
    assert (a - a).area < 1e-9
    assert a.area + (~a).area == pytest.approx(4.0 * np.pi, abs=1e-9)
    assert (a | b).area + (a & b).area == pytest.approx(a.area + b.area, abs=0.02)


@given(axis=axes, half=angles)
@FEW
def test_cap_in_closed_form(axis: Array, half: float) -> None:
    cap = build_cap(axis, half)
    assert cap.area == pytest.approx(2.0 * np.pi * (1.0 - np.cos(half)), abs=2e-3)
    off = angle(SOME, axis)
    assert np.array_equal(cap.contains(SOME), off <= half)
    assert np.allclose(cap.compute_margin(SOME), half - off, atol=1e-7)
    wrong = (cap.estimate_margin(SOME) >= 0.0) != (off <= half)
    assert np.all(np.abs(off - half)[wrong] < np.radians(0.05))
    for x in SOME[::400]:
        nearest = cap.find_nearest(x)
        assert nearest is not None
        assert nearest[1] == pytest.approx(max(0.0, float(angle(x, axis)) - half), abs=np.radians(0.01))
        assert float(angle(nearest[0], x)) == pytest.approx(nearest[1], abs=1e-6)


@given(axis=axes, half=angles, k=st.integers(0, 3999), m=st.integers(0, 3999))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_first_point_along_a_great_circle(axis: Array, half: float, k: int, m: int) -> None:
    """Against the crossing of a circle of latitude and a great circle: cos(t) x.a + sin(t) h.a = cos(half)."""
    x, y = SOME[k], SOME[m]
    h = y - (x @ y) * x
    if np.linalg.norm(h) < 1e-3:
        return
    h /= np.linalg.norm(h)
    found = build_cap(axis, half).find_along(x, y)
    size, phase = np.hypot(x @ axis, h @ axis), np.arctan2(h @ axis, x @ axis)
    if np.arccos(np.clip(x @ axis, -1.0, 1.0)) <= half:
        assert found is not None
        assert found[1] == 0.0
    elif size < np.cos(half):
        assert found is None
    elif 2.0 * np.arccos(np.cos(half) / size) > np.radians(0.6):  # a shorter chord may be stepped over
        assert found is not None
        entry = np.mod(phase - np.arccos(np.cos(half) / size), 2.0 * np.pi)
        assert found[1] == pytest.approx(entry, abs=np.radians(0.01))
        assert np.allclose(found[0], np.cos(found[1]) * x + np.sin(found[1]) * h, atol=1e-9)


def test_a_short_way_may_end_before_the_region() -> None:
    cap = build_cap([1.0, 0.0, 0.0], 0.3)
    x, y = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert cap.find_along(x, y, limit=1.0) is None
    found = cap.find_along(x, y, limit=1.3)
    assert found is not None
    assert found[1] == pytest.approx(0.5 * np.pi - 0.3, abs=1e-3)
    with pytest.raises(ValueError, match="parallel or opposite; directions that fix a great circle"):
        cap.find_along(x, -x)


@given(axis=axes, half=st.floats(0.1, 0.8), mu=st.floats(0.1, 0.8))
@FEW
def test_closure_of_a_cap_is_a_wider_cap_opposite(axis: Array, half: float, mu: float) -> None:
    """FC of a cap of half angle a is the opposite cap of half angle a + 2 theta."""
    theta = float(np.arctan(mu))
    closure, wide = build_closure(build_cap(axis, half), theta), build_cap(-axis, half + 2.0 * theta)
    off = np.abs(angle(SOME, -axis) - half - 2.0 * theta)
    wrong = closure.contains(SOME) != wide.contains(SOME)
    assert np.all(off[wrong] < np.radians(0.02))
    assert np.all(off[(closure.estimate_margin(SOME) >= 0.0) != wide.contains(SOME)] < np.radians(0.15))
    assert closure.area == pytest.approx(wide.area, abs=0.01)


@given(axis=axes, mu=st.floats(0.05, 1.5), seed=st.integers(0, 99))
@FEW
def test_any_two_contacts_in_independent_cones_hold(axis: Array, mu: float, seed: int) -> None:
    """[paper §3, result 1]: inside both, every pair is closed; with a wider cone some pair is not."""
    theta, rng = float(np.arctan(mu)), np.random.default_rng(seed)
    one, two = build_independent_cones(axis, theta)
    closed_form = build_cones_in_closed_form(axis, mu)
    assert closed_form.half_angle == pytest.approx(theta)
    assert np.array_equal(one.contains(SOME), angle(SOME, closed_form.axis) <= theta)
    assert not (one & two).mask.any() or theta > 0.25 * np.pi
    a, b = SOME[one.contains(SOME)], SOME[two.contains(SOME)]
    for _ in range(20):
        x, y = a[rng.integers(len(a))], b[rng.integers(len(b))]
        assert check_sphere_pair(x, y, mu).margin > -1e-9
    # The widest lean of both to the same side is the border; any wider cone has a pair beyond it.
    frame = build_frame(axis)
    lean = [rotate_about(frame[:, 0], s * 1.02 * theta) @ (s * axis) for s in (1.0, -1.0)]
    assert check_sphere_pair(lean[0], lean[1], mu).margin < 0.0


def test_whole_and_empty_regions() -> None:
    cap = build_cap([0.0, 0.0, 1.0], 0.5)
    whole, empty = cap | ~cap, cap & build_cap([0.0, 0.0, -1.0], 0.5)
    assert whole.area == pytest.approx(4.0 * np.pi)
    assert empty.is_empty
    assert empty.area == 0.0
    assert empty.find_nearest([1.0, 0.0, 0.0]) is None
    assert empty.find_along([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]) is None
    nearest = whole.find_nearest([1.0, 0.0, 0.0])
    assert nearest is not None
    assert nearest[1] == 0.0
    assert build_closure(empty, 1.5).is_empty
    assert build_closure(whole, 0.1).contains(SOME).all()


def test_regions_of_different_poses_do_not_mix() -> None:
    R = rotate_about(np.array([0.0, 0.0, 1.0]), 0.3)
    one, two = build_cap([1.0, 0.0, 0.0], 0.5), build_cap([1.0, 0.0, 0.0], 0.5, R)
    with pytest.raises(ValueError, match="different object poses; two of the same pose are accepted"):
        _ = one & two
    # Told in its own axes, a cap is the same whatever the grid's.
    assert np.array_equal(one.contains(SOME), two.contains(SOME))
    assert np.array_equal(one.turned(R).contains(SOME @ R), one.contains(SOME))
    with pytest.raises(ValueError, match="a direction is zero"):
        one.contains([0.0, 0.0, 0.0])
