"""An arc bowed in one joint: its ends stay, one joint leaves the arc by a known amount, and the way stands a finer check."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.kinematics.arcs import build_travel, compute_hover, interpolate
from dexplan.kinematics.chain import Chain, compute_dexterity, compute_joint_margin, compute_tip_pose
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.ways.detour import BOWS, Detour, Surroundings, bow_arc, sample_evenly
from dexplan.planning.ways.travel import find_way
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, direction_from_angles

FINGER = 0
BESIDE = {"kind": "box", "pos_m": [0.065, 0.021, 0.1372], "size_m": [0.002, 0.002, 0.002]}
"""A small cube on the left of finger 1's arc, 1 mm from its tip: too near, but not in the way."""
OTHER_SIDE = {**BESIDE, "pos_m": [0.065, -0.021, 0.1372]}
BEHIND = {**BESIDE, "pos_m": [0.086, 0.0, 0.1372]}
"""Just where the stem would go: only a wider bow goes around."""
BELOW = {**BESIDE, "pos_m": [0.065, 0.0, 0.1162]}
"""Where the tip would go, and no bow in one joint goes around it."""


def build_arc(*obstacles: Mapping[str, object]) -> tuple[Surroundings, Array]:
    """Return finger 1 among ``obstacles`` while finger 2 holds, and its arc (K, J) to a place low on the ball."""
    problem = load_problem("fig4_substitution", {"obstacles": list(obstacles)})
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    X_WO, finger = hand.object.X_WO_home, hand.fingers[FINGER]
    low, other = (
        build_landings(hand, X_WO, f, direction_from_angles(np.array([a]), np.array([e])))[0]
        for f, a, e in ((FINGER, 0.0, -36.0), (1, 140.0, 0.0))
    )
    assert low is not None
    assert other is not None
    q = hand.q_home.copy()
    q[1] = other.q
    hover = compute_hover(finger, X_WO, low.X_OF, low.normal_O, low.q, hand.hover)
    return Surroundings(hand, q, X_WO, FINGER, (1,)), build_travel(finger, finger.q_home, hover, X_WO[:3, 3])


def find_bow(arc: Array, way: Array) -> list[tuple[int, float]]:
    """Return the joints and amplitudes [rad] of half-sine bows of the ``arc`` (K, J) that give ``way`` when walked evenly."""
    shape = np.sin(np.linspace(0.0, np.pi, len(arc)))[:, None]
    amplitudes = [sign * size for size in BOWS for sign in (1.0, -1.0)]
    return [
        (j, a)
        for j in range(arc.shape[1])
        for a in amplitudes
        if np.allclose(sample_evenly(arc + a * shape * np.eye(arc.shape[1])[j])[1:-1], way[1:-1], atol=1e-9)
    ]


def check_promises(around: Surroundings, arc: Array, found: Detour) -> Array:
    """Check what any bow promises, between the planned postures too; return its way."""
    way, limits = found.way, around.hand.limits
    assert way is not None
    assert np.array_equal(way[[0, -1]], arc[[0, -1]])
    fine = interpolate(way, np.linspace(0.0, 1.0, 900))
    clearances = [around.compute_clearance(q)[0] for q in fine]
    assert min(clearances) >= limits.clearance - 5e-5
    assert found.clearance == pytest.approx(min(clearances), abs=1e-4)
    chain = get_chain(around)
    assert compute_joint_margin(chain, fine).min() >= limits.joint_margin - 1e-6
    assert compute_dexterity(chain, fine).min() >= limits.dexterity - 1e-3
    assert all(around.keeps_order(X[:3, 3]) for X in compute_tip_pose(chain, fine))
    return way


def get_chain(around: Surroundings) -> Chain:
    return around.hand.fingers[around.finger].chain


def with_limits(around: Surroundings, lower: Array, upper: Array) -> Surroundings:
    """Return the surroundings with other joint limits (J,) of the moving finger."""
    hand, i = around.hand, around.finger
    finger = replace(hand.fingers[i], chain=replace(get_chain(around), lower=lower, upper=upper))
    fingers = (*hand.fingers[:i], finger, *hand.fingers[i + 1 :])
    return replace(around, hand=replace(hand, fingers=fingers))


@pytest.fixture(scope="module")
def beside() -> tuple[Surroundings, Array]:
    return build_arc(BESIDE)


@pytest.mark.parametrize("obstacle", [BESIDE, OTHER_SIDE, BEHIND])
def test_one_joint_leaves_the_arc_by_one_of_the_amplitudes(obstacle: Mapping[str, object]) -> None:
    around, arc = build_arc(obstacle)
    limit = around.hand.limits.clearance
    assert around.compute_way_clearance(arc)[0] < limit
    found = bow_arc(around, arc)
    assert found is not None
    way = check_promises(around, arc, found)
    ((joint, amplitude),) = find_bow(arc, way)
    assert joint < around.hand.fingers[FINGER].chain.n_joints - 1  # a tip's own roll makes no room
    # No smaller bow of that joint would do: the way is no wider than it has to be.
    shape = np.sin(np.linspace(0.0, np.pi, len(arc)))[:, None]
    for size in BOWS[: BOWS.index(abs(amplitude))]:
        smaller = arc + np.sign(amplitude) * size * shape * np.eye(arc.shape[1])[joint]
        evenly = interpolate(sample_evenly(smaller), np.linspace(0.0, 1.0, 300))
        assert around.compute_way_clearance(evenly)[0] < limit
    # A travel that meets this obstacle takes it, and names what was in the arc's way.
    taken = find_way(around, arc)
    assert np.array_equal(taken.postures, way)
    assert "obstacle_1" in taken.around


def test_the_bow_goes_away_from_what_is_too_near(beside: tuple[Surroundings, Array]) -> None:
    """A cube on one side and on the other: bowed to opposite sides, as the mirror image of each other."""
    middles = []
    for around, arc in (beside, build_arc(OTHER_SIDE)):
        found = bow_arc(around, arc)
        assert found is not None
        assert found.way is not None
        tips = compute_tip_pose(get_chain(around), found.way)[:, :3, 3]
        middles.append(tips[len(tips) // 2])
    assert middles[0][1] < -0.005
    assert middles[1] == pytest.approx(middles[0] * [1.0, -1.0, 1.0], abs=1e-6)


def test_a_bow_stays_inside_the_joint_limits(beside: tuple[Surroundings, Array]) -> None:
    """With the joint that would bow stopped half way: another bow within the limits, or none, never one beyond them."""
    around, arc = beside
    free = bow_arc(around, arc)
    assert free is not None
    assert free.way is not None
    ((joint, amplitude),) = find_bow(arc, free.way)
    chain, margin = get_chain(around), around.hand.limits.joint_margin
    lower, upper = chain.lower.copy(), chain.upper.copy()
    lower[joint] = max(lower[joint], arc[:, joint].min() - margin - 0.5 * abs(amplitude))
    upper[joint] = min(upper[joint], arc[:, joint].max() + margin + 0.5 * abs(amplitude))
    narrow = with_limits(around, lower, upper)
    assert compute_joint_margin(get_chain(narrow), free.way).min() < margin
    found = bow_arc(narrow, arc)
    if found is not None:
        way = check_promises(narrow, arc, found)
        assert (joint, amplitude) not in find_bow(arc, way)
    # With no more room than the arc itself needs there is no bow at all.
    tight = with_limits(around, arc.min(axis=0) - margin - 0.05, arc.max(axis=0) + margin + 0.05)
    assert bow_arc(tight, arc) is None


def test_no_bow_where_none_helps_or_an_end_is_not_clear(beside: tuple[Surroundings, Array]) -> None:
    around, arc = build_arc(BELOW)
    assert bow_arc(around, arc) is None
    # The end of this way is where the cube is too near.
    around, arc = beside
    clearances = [around.compute_clearance(q)[0] for q in arc]
    short = arc[: int(np.argmin(clearances)) + 1]
    assert bow_arc(around, short) is None
    assert bow_arc(around, short[::-1]) is None


def test_the_same_arc_has_the_same_bow(beside: tuple[Surroundings, Array]) -> None:
    around, arc = beside
    before = arc.copy()
    one, two = bow_arc(around, arc), bow_arc(around, arc)
    assert one is not None
    assert two is not None
    assert one.way is not None
    assert two.way is not None
    assert np.array_equal(one.way, two.way)
    assert np.array_equal(arc, before)
