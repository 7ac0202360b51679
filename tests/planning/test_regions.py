"""Who can touch where, and who can hold with whom: exact at queries, and what the paper says of regions."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dexplan.contact.bodies.edged import BoxBody
from dexplan.errors import DexplanError
from dexplan.grasp.closure import check_antipodal
from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin
from dexplan.kinematics.workspace import compute_aligned_pose, spread_directions
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.order import keep_order, keeps_order
from dexplan.planning.regions.regions import Regions, compute_regions
from dexplan.scene.description import ContactCone
from dexplan.spatial import Array, direction_from_angles, make_pose, rotate_about

TILT = rotate_about(np.array([0.6, 0.0, 0.8]), 1.1)


def ask_each(hand: HandModel, finger: int, center: Array, normals: Array) -> NDArray[np.bool_]:
    """Return where a finger touches (N,), by the planner's own inverse kinematics from the nearest sampled posture."""
    description, workspace = hand.fingers[finger], hand.workspaces[finger]
    home = hand.p_WF_home[finger] - center
    near = normals @ (home / np.linalg.norm(home)) > np.cos(np.radians(85.0))
    X_WF = compute_aligned_pose(center, normals[near], 0.035 + description.tip_radius)
    q, reached = workspace.solve(X_WF)
    q[:, -1] = 0.0
    found = np.zeros(len(normals), dtype=bool)
    found[near] = (
        reached
        & (compute_joint_margin(description.chain, q) >= hand.limits.joint_margin)
        & (compute_dexterity(description.chain, q) >= hand.limits.dexterity)
    )
    return found


@pytest.fixture(scope="module")
def center(hand: HandModel) -> Array:
    return np.array(hand.object.X_WO_home[:3, 3])


# -- CWS_i ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("finger", "shift"), [(0, [0.0, 0.0, 0.0]), (1, [0.012, -0.008, 0.01]), (2, [-0.02, 0.015, -0.01])]
)
def test_touching_is_exact_at_queries(
    hand: HandModel, center: Array, finger: int, shift: list[float]
) -> None:
    """4000 directions against the planner's own inverse kinematics; the grid is wrong only at the very border."""
    region = compute_regions(hand, center + shift).contactable[finger]
    normals = spread_directions(4000)
    asked = ask_each(hand, finger, center + shift, normals)
    assert np.array_equal(region.contains(normals), asked)
    assert region.area == pytest.approx(4.0 * np.pi * asked.mean(), abs=0.03)
    wrong = (region.estimate_margin(normals) >= 0.0) != asked
    assert wrong.mean() < 0.002
    for x in normals[wrong]:
        nearest = (~region if asked[np.argmax(normals @ x)] else region).find_nearest(x)
        assert nearest is not None
        assert nearest[1] < np.radians(0.6)


def test_border_along_great_circles(hand: HandModel, center: Array, regions: Regions) -> None:
    """From outside towards inside: the first point that touches, against the planner's inverse kinematics 0.02 deg around it."""
    rng, region = np.random.default_rng(3), regions.contactable[0]
    inside = region.directions[region.mask]
    found = 0
    for _ in range(12):
        x, y = rng.normal(size=3), inside[rng.integers(len(inside))]
        x /= np.linalg.norm(x)
        if region.contains(x):
            continue
        crossing = region.find_along(x, y, limit=float(np.arccos(x @ y)) + 1e-6)
        assert crossing is not None
        h = y - (x @ y) * x
        h /= np.linalg.norm(h)
        t = crossing[1] + np.radians([-0.02, 0.02])
        beside = np.cos(t)[:, None] * x + np.sin(t)[:, None] * h
        assert ask_each(hand, 0, center, beside).tolist() == [False, True]
        found += 1
    assert found > 5


def test_fingers_reach_in_front_of_themselves(hand: HandModel, center: Array, regions: Regions) -> None:
    for i, region in enumerate(regions.contactable):
        own = hand.p_WF_home[i] - center
        assert region.contains(own)
        assert not region.contains(-own)


def test_a_stricter_hand_reaches_less(hand: HandModel, center: Array, regions: Regions) -> None:
    strict = replace(hand, limits=replace(hand.limits, joint_margin=0.2, dexterity=0.3))
    for i, region in enumerate(compute_regions(strict, center).contactable):
        assert region.area < 0.97 * regions.contactable[i].area
        assert not (region - regions.contactable[i]).mask.any()


# -- the pose ----------------------------------------------------------------------------------------------------------------


def test_regions_live_on_the_object(hand: HandModel, center: Array, regions: Regions) -> None:
    """A turned object is touched where it was, told in its own axes."""
    turned = compute_regions(hand, make_pose(TILT, center))
    normals = spread_directions(500)
    for i, j, k in ((0, 1, 2), (1, 2, 0)):
        for here, there in (
            (regions.contactable[i], turned.contactable[i]),
            (regions.closure[i], turned.closure[i]),
            (regions.double(i, j, k), turned.double(i, j, k)),
        ):
            assert there.area == pytest.approx(here.area)
            assert np.array_equal(there.contains(normals @ TILT), here.contains(normals))
            assert np.allclose(there.directions @ TILT.T, here.directions)


def test_palm_and_object_moved_together_change_nothing(
    hand: HandModel, center: Array, regions: Regions
) -> None:
    """By argument, and by a hand whose every chain and sample has been moved."""
    X_WP = make_pose(TILT, [0.1, -0.2, 0.05])
    moved = replace(
        hand,
        fingers=tuple(
            replace(f, chain=w.moved(X_WP).chain) for f, w in zip(hand.fingers, hand.workspaces, strict=True)
        ),
        workspaces=tuple(w.moved(X_WP) for w in hand.workspaces),
    )
    X_WO = X_WP @ make_pose(p=center)
    by_argument, by_hand = compute_regions(hand, X_WO, X_WP=X_WP), compute_regions(moved, X_WO)
    normals = spread_directions(500)
    for i in range(3):
        for region in (by_argument.contactable[i], by_hand.contactable[i]):
            assert np.array_equal(region.contains(normals), regions.contactable[i].contains(normals))
            assert region.area == pytest.approx(regions.contactable[i].area, abs=0.01)
        assert by_hand.closure[i].area == pytest.approx(regions.closure[i].area, abs=0.02)
    # The palm alone moved by a centimetre does change something.
    aside = compute_regions(hand, make_pose(p=center), X_WP=make_pose(p=[0.01, 0.0, 0.0]))
    assert abs(aside.contactable[0].area - regions.contactable[0].area) > 0.05


def test_contacts_only_where_they_are_allowed(hand: HandModel, center: Array, regions: Regions) -> None:
    cones = (ContactCone(np.array([1.0, 0.0, 0.2]), 0.4), ContactCone(np.array([-1.0, 0.0, 0.0]), 0.3))
    X_WO = make_pose(rotate_about(np.array([0.0, 0.0, 1.0]), 0.5), center)
    cut = compute_regions(hand, X_WO, allowed=cones)
    whole = compute_regions(hand, X_WO)
    normals = spread_directions(1500)
    allowed = cones[0].contains(normals) | cones[1].contains(normals)
    for i in range(3):
        assert np.array_equal(
            cut.contactable[i].contains(normals), whole.contactable[i].contains(normals) & allowed
        )
        assert (
            not (cut.closure[i] - whole.closure[i])
            .mask[whole.closure[i].level.values < -np.radians(0.5)]
            .any()
        )
    # Contacts of finger 1 lie in the first cone: what holds with them lies within 2 theta of its opposite.
    reach = np.cos(0.4 + 2.0 * cut.theta)
    assert not cut.closure[0].contains(normals[normals @ -cones[0].axis_O < reach - 1e-3]).any()
    assert cut.closure[0].area < 0.8 * whole.closure[0].area


# -- FC_i and what is made of it ---------------------------------------------------------------------------------------------


def test_closure_regions_are_what_the_pair_condition_says(hand: HandModel, regions: Regions) -> None:
    """x is in FC_i iff some sampled contact of finger i is antipodal to it, away from the samples' spacing."""
    mu = hand.friction.sliding
    for i in range(3):
        touching = regions.directions[regions.contactable[i].mask]
        normals = spread_directions(300)
        margin = regions.closure[i].compute_margin(normals)
        for x, value in zip(normals, margin, strict=True):
            best = max(check_antipodal(x, x, y, y, mu).margin for y in touching[np.argsort(touching @ x)[:6]])
            # The margin of a pair is half of the angle it is beyond the smallest one.
            if abs(value) > np.radians(2.5):
                assert (best > 0.0) == (value > 0.0)
            if 0.0 < value < 2.0 * regions.theta - 0.05:
                assert 2.0 * best == pytest.approx(value, abs=np.radians(2.5))


def test_closure_is_exact_at_its_border(hand: HandModel, center: Array, regions: Regions) -> None:
    """Along great circles: at the border, the nearest contact of a dense sample is 2 theta away from the opposite point."""
    rng, closure = np.random.default_rng(1), regions.closure[1]
    # A quarter of a degree apart; only those about 2 theta from the border's opposite are asked.
    dense = spread_directions(600000)
    outside = closure.directions[~closure.mask]
    checked = 0
    for x in outside[rng.integers(len(outside), size=5)]:
        crossing = closure.find_along(x, rng.normal(size=3))
        if crossing is None:
            continue
        opposite = -crossing[0]
        off = np.arccos(np.clip(dense @ opposite, -1.0, 1.0))
        ring = dense[np.abs(off - 2.0 * regions.theta) < np.radians(0.4)]
        touching = ring[ask_each(hand, 1, center, ring)]
        nearest = np.arccos(np.clip(touching @ opposite, -1.0, 1.0)).min()
        # A sample comes no nearer than the border, and nearly as near.
        assert nearest > 2.0 * regions.theta - np.radians(0.02)
        assert nearest < 2.0 * regions.theta + np.radians(0.3)
        checked += 1
    assert checked > 2


@given(
    theta=st.floats(0.01, 0.75),
    place=st.sampled_from([(0.0, 0.0, 0.0), (0.015, -0.01, 0.0), (-0.02, 0.01, 0.015)]),
)
@settings(max_examples=25, deadline=None, derandomize=True)
def test_two_fingers_hold_together_from_either_ones_point_of_view(
    hand: HandModel, center: Array, theta: float, place: tuple[float, float, float]
) -> None:
    """CWS_j meets FC_i iff CWS_i meets FC_j [paper §2.1], and both miss by the same angle."""
    regions = compute_regions(hand, center + np.array(place), theta=theta)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        # The largest margin of FC_i within CWS_j: how far the two fingers are from, or beyond, holding together.
        best = [
            regions.closure[a].level.values[regions.contactable[b].mask].max() for a, b in ((i, j), (j, i))
        ]
        assert best[0] == pytest.approx(best[1], abs=np.radians(1.0))
        if abs(best[0]) > np.radians(1.0):  # nearer than that the grid does not tell
            assert regions.pair(i, j).is_empty == regions.pair(j, i).is_empty == (best[0] < 0.0)


def test_two_fingers_too_far_apart_hold_nowhere(hand: HandModel, center: Array) -> None:
    """A cap that each finger may use, 120 deg from one another: they hold from 60 deg of 2 theta on, less the caps' width."""
    for theta, is_empty in ((0.30, True), (0.45, False)):
        cones = tuple(ContactCone(direction_from_angles(a, 0.0), 0.12) for a in (0.0, 120.0, 240.0))
        regions = compute_regions(hand, center, theta=theta, allowed=cones)
        gap = np.pi / 3.0 - 0.24
        assert (2.0 * theta < gap) == is_empty
        for i, j in permutations(range(3), 2):
            own = regions.contactable[i].contains(direction_from_angles([0.0, 120.0, 240.0], np.zeros(3)))
            assert own[i]
            # Finger i in its own cap and the others in theirs.
            lonely = compute_regions(hand, center, theta=theta, allowed=(cones[i], cones[j]))
            assert lonely.pair(i, j).is_empty == lonely.pair(j, i).is_empty == is_empty


def test_regions_nest(hand: HandModel, center: Array, regions: Regions) -> None:
    for i, j, k in permutations(range(3)):
        double, pair, reach = regions.double(i, j, k), regions.pair(i, j), regions.contactable[i]
        assert np.array_equal(double.mask, regions.double(i, k, j).mask)
        assert np.array_equal(double.mask, (pair & regions.pair(i, k)).mask)
        assert not (pair.mask & ~reach.mask).any()
        assert double.area <= pair.area <= reach.area
        assert double.name == f"CWS_{i + 1}_{j + 1}{k + 1}"
    assert not any(regions.double(i, (i + 1) % 3, (i + 2) % 3).is_empty for i in range(3))
    # More friction, larger regions.
    low = compute_regions(hand, center, theta=0.2)
    for i in range(3):
        assert np.array_equal(low.contactable[i].mask, regions.contactable[i].mask)
        assert not (low.closure[i].mask & ~regions.closure[i].mask).any()


def test_a_finger_that_reaches_nothing_has_empty_regions(hand: HandModel, center: Array) -> None:
    empty = replace(
        hand.workspaces[2],
        **{n: getattr(hand.workspaces[2], n)[:0] for n in ("postures", "positions", "poles")},
    )
    regions = compute_regions(replace(hand, workspaces=(*hand.workspaces[:2], empty)), center)
    assert regions.contactable[2].is_empty
    assert regions.closure[2].is_empty
    assert regions.pair(0, 2).is_empty
    assert not regions.pair(0, 1).is_empty
    assert not regions.contactable[2].contains(spread_directions(50)).any()
    assert not regions.closure[2].contains(spread_directions(50)).any()


def test_only_balls_so_far(hand: HandModel) -> None:
    box = replace(hand.object, body=BoxBody(0.03, 0.03, 0.03))
    with pytest.raises(DexplanError, match="of kind BoxBody what holds on a ball alone"):
        compute_regions(replace(hand, object=box), hand.object.X_WO_home)


def test_order_is_that_of_the_bases(hand: HandModel) -> None:
    def at(*azimuths_deg: float) -> dict[int, Array]:
        return {f: direction_from_angles(a, 0.0) for f, a in enumerate(azimuths_deg)}

    assert keeps_order(hand, at(0.0, 120.0, 240.0))
    assert keeps_order(hand, at(100.0, 220.0, 340.0))
    assert keeps_order(hand, at(-60.0, 100.0, 200.0))
    assert not keeps_order(hand, at(0.0, 240.0, 120.0))
    assert not keeps_order(hand, at(70.0, 50.0, 240.0))


def test_order_of_many_at_once(hand: HandModel) -> None:
    rng = np.random.default_rng(3)
    many, fixed = rng.normal(size=(200, 3)), rng.normal(size=(2, 3))
    one_by_one = [keeps_order(hand, {0: fixed[0], 1: fixed[1], 2: n}) for n in many]
    assert 0 < sum(one_by_one) < len(many)
    np.testing.assert_array_equal(keep_order(hand, {0: fixed[0], 1: fixed[1], 2: many}), one_by_one)
    assert keep_order(hand, {0: fixed[0], 2: many}).all()
