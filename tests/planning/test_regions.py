"""Who can touch where, who can hold with whom, and the paper's Theorem 1."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from dexplan.contact.friction import SoftFinger
from dexplan.grasp.sphere import check_sphere_pair
from dexplan.planning.goal import RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.plan import Plan
from dexplan.planning.planner import plan_rotation
from dexplan.planning.regions import Regions, check_theorem_1, compute_regions, keeps_order
from dexplan.spatial import Array, direction_from_angles

UP = np.array([0.0, 0.0, 1.0])


def with_friction(hand: HandModel, sliding: float) -> HandModel:
    """Return the hand with this believed friction."""
    return replace(hand, friction=SoftFinger(sliding, hand.friction.torsional))


def with_short_finger(hand: HandModel, finger: int) -> HandModel:
    """Return the hand with a finger whose first joint has no room left."""
    chain = hand.fingers[finger].chain
    lower, upper = chain.lower.copy(), chain.upper.copy()
    lower[0], upper[0] = -0.05, 0.05
    fingers = list(hand.fingers)
    fingers[finger] = replace(fingers[finger], chain=replace(chain, lower=lower, upper=upper))
    return replace(hand, fingers=tuple(fingers))


def turn(hand: HandModel, start_deg: tuple[float, float], angle_deg: float) -> Plan:
    """Return the plan that turns the ball about the vertical, fingers 1 and 2 holding at first."""
    goal = RotationGoal(hand.object.X_WO_home, UP, float(np.radians(angle_deg)))
    start = (*(direction_from_angles(a, 0.0) for a in start_deg), None)
    return plan_rotation(hand, goal, start, 2000)


@pytest.mark.parametrize("sliding", [0.05, 0.2, 0.42])
def test_two_fingers_hold_together_from_either_ones_point_of_view(hand: HandModel, sliding: float) -> None:
    """CWS_j meets FC_i iff CWS_i meets FC_j [paper §2.1]."""
    regions = compute_regions(with_friction(hand, sliding), hand.object.X_WO_home[:3, 3], count=1500)
    for i, j in permutations(range(3), 2):
        assert regions.pair(i, j).any() == regions.pair(j, i).any()


def test_closure_regions_are_what_the_pair_condition_says(hand: HandModel, regions: Regions) -> None:
    rng = np.random.default_rng(0)
    for i in range(3):
        touching = regions.directions[regions.reach[i]]
        for k in rng.choice(len(regions.directions), 60, replace=False):
            x = regions.directions[k]
            margin = max(
                check_sphere_pair(x, y, hand.friction.sliding).margin
                for y in touching[np.argsort(touching @ x)[:3]]
            )
            if abs(margin) > 1e-9:
                assert regions.closure[i, k] == (margin > 0.0)


def test_regions_nest(regions: Regions) -> None:
    for i, j, k in permutations(range(3)):
        double = regions.double(i, j, k)
        assert np.array_equal(double, regions.double(i, k, j))
        assert np.array_equal(double, regions.pair(i, j) & regions.pair(i, k))
        assert not (regions.pair(i, j) & ~regions.reach[i]).any()
    assert all(regions.double(i, (i + 1) % 3, (i + 2) % 3).any() for i in range(3))


def test_fingers_reach_in_front_of_themselves(hand: HandModel, regions: Regions) -> None:
    center = hand.object.X_WO_home[:3, 3]
    for i, finger in enumerate(hand.fingers):
        own = finger.pose_at(finger.q_home)[:3, 3] - center
        own /= np.linalg.norm(own)
        assert regions.reach[i][np.argmax(regions.directions @ own)]
        assert not regions.reach[i][np.argmax(regions.directions @ -own)]


def test_theorem_1_has_both_outcomes(hand: HandModel, regions: Regions) -> None:
    """Fingers 1 and 2 opposite to one another, the places opposite to them just beyond what finger 3 reaches."""
    x_1, x_2 = direction_from_angles(np.array([-30.0, 150.0]), np.zeros(2))
    low = compute_regions(with_friction(hand, np.tan(np.radians(4.0))), hand.object.X_WO_home[:3, 3])
    assert low.pair(0, 1)[np.argmax(low.directions @ x_1)]
    assert low.pair(1, 0)[np.argmax(low.directions @ x_2)]
    why = check_theorem_1(low, 0, 1, 2, x_1, x_2)
    assert why.startswith(
        "Theorem 1: finger 3 can form a force-closure grasp with neither finger 1 nor finger 2"
    )
    assert "roll them first" in why
    # More friction brings both within the reach of finger 3; so does less of a distance for one of them.
    assert check_theorem_1(regions, 0, 1, 2, x_1, x_2) == ""
    nearer = direction_from_angles(0.0, 0.0)
    assert check_theorem_1(low, 0, 1, 2, nearer, -nearer) == ""


def test_no_gait_where_the_third_finger_holds_with_neither(hand: HandModel) -> None:
    """Theorem 1 fails wherever the ball is: a turn that the pair can make alone is found, one with a gait is not."""
    short = with_short_finger(hand, 2)
    regions = compute_regions(short, hand.object.X_WO_home[:3, 3], count=1500)
    assert not regions.reach[2].any()
    x_1, x_2 = direction_from_angles(np.array([-38.0, 102.0]), np.zeros(2))
    assert check_theorem_1(regions, 0, 1, 2, x_1, x_2).startswith("Theorem 1: finger 3")
    near, far = turn(short, (-38.0, 102.0), 20.0), turn(short, (-38.0, 102.0), 360.0)
    assert near.is_solved
    assert all(a.kind != "place" for a in near.actions)
    assert far.status == "no_gait"


def test_theorem_1_holds_whenever_a_finger_is_placed(full_turn: Plan, regions: Regions) -> None:
    placed = 0
    before = full_turn.start_contacts
    for action in full_turn.actions:
        if action.kind == "place":
            i, j = action.grasping
            (k,) = {0, 1, 2} - {i, j}
            assert k == action.finger
            x: list[Array] = []
            for f in (i, j):
                contact = before[f]
                assert contact is not None
                x.append(action.X_WO_start[:3, :3] @ contact.normal_O)
            assert check_theorem_1(regions, i, j, k, *x) == ""
            placed += 1
        before = action.contacts_end
    assert placed > 0


def test_order_is_that_of_the_bases(hand: HandModel) -> None:
    def at(*azimuths_deg: float) -> dict[int, Array]:
        return {f: direction_from_angles(a, 0.0) for f, a in enumerate(azimuths_deg)}

    assert keeps_order(hand, at(0.0, 120.0, 240.0))
    assert keeps_order(hand, at(100.0, 220.0, 340.0))
    assert keeps_order(hand, at(-60.0, 100.0, 200.0))
    assert not keeps_order(hand, at(0.0, 240.0, 120.0))
    assert not keeps_order(hand, at(70.0, 50.0, 240.0))
