"""Theorem 1 and Theory 3: both outcomes, witnesses that prove themselves, and words that promise no more than the theorems."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from dexplan.grasp.closed_forms.pair import check_sphere_pair
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.regions import Regions, compute_regions
from dexplan.planning.regions.theorems import check_rewind_along, check_theorem_1, check_theory_3
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.scene.description import ContactCone
from dexplan.spatial import Array, direction_from_angles, make_pose, rotate_about

UP = np.array([0.0, 0.0, 1.0])
TILT = rotate_about(np.array([0.6, 0.0, 0.8]), 1.1)


def at(*azimuths_deg: float) -> list[Array]:
    """Return equatorial directions."""
    return [direction_from_angles(a, 0.0) for a in azimuths_deg]


def low_friction(hand: HandModel, angle_deg: float = 4.0) -> Regions:
    """Return the regions at home when friction allows this angle between normal and chord."""
    return compute_regions(hand, hand.object.X_WO_home, theta=float(np.radians(angle_deg)))


def with_short_finger(hand: HandModel, finger: int) -> HandModel:
    """Return the hand with a finger whose first joint has no room left."""
    chain = hand.fingers[finger].chain
    lower, upper = chain.lower.copy(), chain.upper.copy()
    lower[0], upper[0] = -0.05, 0.05
    chain = replace(chain, lower=lower, upper=upper)
    fingers, workspaces = list(hand.fingers), list(hand.workspaces)
    fingers[finger] = replace(fingers[finger], chain=chain)
    workspaces[finger] = replace(workspaces[finger], chain=chain)
    return replace(hand, fingers=tuple(fingers), workspaces=tuple(workspaces))


def turn(hand: HandModel, start_deg: tuple[float, float], angle_deg: float) -> Plan:
    """Return the plan that turns the ball about the vertical, fingers 1 and 2 holding at first."""
    goal = RotationGoal(hand.object.X_WO_home, UP, float(np.radians(angle_deg)))
    return plan_rotation(hand, goal, (*at(*start_deg), None), 2000)


# -- Theorem 1 ---------------------------------------------------------------------------------------------------------------


def test_theorem_1_has_both_outcomes(hand: HandModel, regions: Regions) -> None:
    """Fingers 1 and 2 opposite to one another, the places opposite to them just beyond what finger 3 reaches."""
    x_1, x_2 = at(-30.0, 150.0)
    low = low_friction(hand)
    assert low.pair(0, 1).contains(x_1)
    assert low.pair(1, 0).contains(x_2)
    no = check_theorem_1(low, 0, 1, 2, x_1, x_2)
    assert not no.is_met
    assert no.margin < 0.0
    assert no.witness_O is None
    assert no.reason.startswith(
        "Theorem 1: finger 3 can form a force-closure grasp with neither finger 1 nor finger 2 where they are "
        "(it would have to touch"
    )
    assert no.reason.endswith("so neither can be lifted; roll them first")
    # More friction brings both within the reach of finger 3; so does less of a distance for one of them.
    assert check_theorem_1(regions, 0, 1, 2, x_1, x_2).is_met
    nearer = direction_from_angles(0.0, 0.0)
    assert check_theorem_1(low, 0, 1, 2, nearer, -nearer).is_met


@pytest.mark.parametrize("attitude", [np.eye(3), TILT], ids=["upright", "tilted"])
def test_theorem_1_is_membership_in_a_double_region(hand: HandModel, attitude: Array) -> None:
    """For contacts that hold each other: met iff f_i in CWS_i_jk or f_j in CWS_j_ik, with a witness that closes the grasp."""
    center, rng = hand.object.X_WO_home[:3, 3], np.random.default_rng(2)
    outcomes = set()
    for theta in np.radians([4.0, 9.0, 16.0]):
        regions = compute_regions(hand, make_pose(attitude, center), theta=theta)
        one, two = regions.double(0, 1, 2), regions.double(1, 0, 2)
        pair = regions.pair(0, 1)
        for _ in range(12):
            x_i = pair.directions[rng.choice(np.flatnonzero(pair.mask))]
            lean = 2.0 * theta * rng.uniform(0.0, 0.999)
            frame = np.linalg.qr(np.column_stack([x_i, rng.normal(size=(3, 2))]))[0]
            x_j = -np.cos(lean) * x_i + np.sin(lean) * frame[:, 1]
            if not (pair.contains(x_i) and regions.pair(1, 0).contains(x_j)):
                continue
            answer = check_theorem_1(regions, 0, 1, 2, x_i, x_j)
            assert answer.is_met == (one.contains(x_i) or two.contains(x_j))
            outcomes.add(answer.is_met)
            if answer.is_met:
                assert answer.witness_O is not None
                keeper = x_i if answer.keeper == 0 else x_j
                closed = check_sphere_pair(keeper, answer.witness_O, float(np.tan(theta)))
                assert closed.margin == pytest.approx(answer.margin, abs=1e-6)
                near = regions.contactable[2].compute_margin(answer.witness_O)
                assert near > -np.radians(0.5)
            else:
                assert answer.reason
    assert outcomes == {True, False}


def test_theorem_1_refuses_what_it_is_not_about(regions: Regions) -> None:
    with pytest.raises(ValueError, match="fingers are 0, 1, 1; three different ones are accepted"):
        check_theorem_1(regions, 0, 1, 1, *at(-30.0, 150.0))
    with pytest.raises(ValueError, match=r"120\.0 deg apart and do not hold each other; 134\.1 deg or more"):
        check_theorem_1(regions, 0, 1, 2, *at(0.0, 120.0))
    with pytest.raises(ValueError, match="a contact direction is zero"):
        check_theorem_1(regions, 0, 1, 2, np.zeros(3), at(0.0)[0])


def test_no_gait_where_the_third_finger_holds_with_neither(hand: HandModel) -> None:
    """Theorem 1 fails wherever the ball is: a turn that the pair can make alone is found, one with a gait is not."""
    short = with_short_finger(hand, 2)
    regions = compute_regions(short, short.object.X_WO_home)
    assert regions.contactable[2].is_empty
    answer = check_theorem_1(regions, 0, 1, 2, *at(-38.0, 102.0))
    assert answer.reason.startswith("Theorem 1: finger 3 can form")
    assert "(finger 3 can touch the object nowhere)" in answer.reason
    near, far = turn(short, (-38.0, 102.0), 20.0), turn(short, (-38.0, 102.0), 360.0)
    assert near.is_solved
    assert all(a.name != "place" for a in near.actions)
    assert far.status == "no_gait"


def test_theorem_1_holds_whenever_a_finger_is_placed(hand: HandModel, full_turn: Plan) -> None:
    placed = 0
    before = full_turn.start_contacts
    for action in full_turn.actions:
        if action.name == "place":
            i, j = action.grasping
            (k,) = {0, 1, 2} - {i, j}
            assert k == action.finger
            x: list[Array] = []
            for f in (i, j):
                contact = before[f]
                assert contact is not None
                x.append(contact.normal_O)
            assert check_theorem_1(compute_regions(hand, action.X_WO_start), i, j, k, *x).is_met
            placed += 1
        before = action.contacts_end
    assert placed > 0


# -- Theory 3 ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fingers", [(0, 1, 2), (1, 2, 0), (0, 2, 1)])
@pytest.mark.parametrize("angle_deg", [9.0, 16.0, 22.9])
def test_witnesses_of_theory_3_prove_themselves(
    hand: HandModel, fingers: tuple[int, int, int], angle_deg: float
) -> None:
    i, j, k = fingers
    regions = low_friction(hand, angle_deg)
    answer = check_theory_3(regions, i, j, k)
    assert answer.is_met
    assert answer.reason == ""
    assert answer.x_O is not None
    assert answer.y_O is not None
    assert regions.double(i, j, k).contains(answer.x_O)
    assert regions.double(j, i, k).contains(answer.y_O)
    # dist(x, y) > 2 r cos(theta), and the closed form of a pair says the same.
    assert np.linalg.norm(answer.x_O - answer.y_O) > 2.0 * np.cos(regions.theta)
    closed = check_sphere_pair(answer.x_O, answer.y_O, float(np.tan(regions.theta)))
    assert closed.margin == pytest.approx(answer.margin)
    # No pair of the grid's directions is wider, and each witness has what the free finger needs.
    one, two = regions.double(i, j, k), regions.double(j, i, k)
    widest = np.arccos(np.clip(one.directions[one.mask] @ two.directions[two.mask].T, -1.0, 1.0)).max()
    assert answer.margin >= widest - regions.phi_min - np.radians(0.6)
    for x in (answer.x_O, answer.y_O):
        assert regions.closure[k].contains(x)


def test_theory_3_fails_where_points_are_too_near(hand: HandModel) -> None:
    answer = check_theory_3(low_friction(hand, 2.0), 0, 1, 2)
    assert not answer.is_met
    assert answer.margin < 0.0
    assert "no point of CWS_1_23 is farther than" in answer.reason
    assert "more than 176.0 deg are needed" in answer.reason
    assert answer.reason.endswith("the condition is sufficient only, rewinds may exist all the same")


def test_theory_3_fails_where_a_region_is_empty(hand: HandModel) -> None:
    """Two opposite cones before and behind finger 1: it holds with either of the others, which both need the same cone."""
    cones = (ContactCone(at(0.0)[0], 0.2), ContactCone(at(180.0)[0], 0.2))
    regions = compute_regions(hand, hand.object.X_WO_home, theta=0.4, allowed=cones)
    assert not regions.double(0, 1, 2).is_empty
    answer = check_theory_3(regions, 0, 1, 2)
    assert not answer.is_met
    assert "CWS_2_13 is empty, finger 2 can nowhere hold with both finger 1 and finger 3" in answer.reason
    assert "sufficient only" in answer.reason
    # Substitution needs no more: where fingers 1 and 2 hold, finger 3 can take the place of finger 2.
    assert check_theorem_1(regions, 0, 1, 2, *at(0.0, 180.0)).keeper == 0
    with pytest.raises(ValueError, match="three different ones are accepted"):
        check_theory_3(low_friction(hand), 0, 0, 2)


# -- its conclusion, along a motion ------------------------------------------------------------------------------------------


def turning(hand: HandModel, end_deg: float, step_deg: float = 1.0) -> Array:
    """Return the poses of the ball turning about the vertical from home."""
    angles = np.radians(np.arange(0.0, end_deg + 1e-9, step_deg))
    return np.stack([make_pose(R, hand.object.X_WO_home[:3, 3]) for R in rotate_about(UP, angles)])


def test_rewinds_are_assured_while_contacts_stay_in_double_regions(hand: HandModel) -> None:
    regions_at = partial(compute_regions, hand)
    X_WO, contacts = turning(hand, 60.0), at(-38.0, 102.0)
    answer = check_rewind_along(regions_at, X_WO, 0, 1, 2, *contacts)
    assert answer.is_assured
    assert answer.first is None
    assert answer.margin.shape == (61, 2)
    # What the conclusion says: everywhere on the way finger 3 can hold with either, and both can be placed anew.
    for t in (0, 30, 60):
        regions = regions_at(X_WO[t])
        assert check_theorem_1(regions, 0, 1, 2, *contacts).is_met
        assert check_theory_3(regions, 0, 1, 2).is_met
        for f, region in enumerate((regions.double(0, 1, 2), regions.double(1, 0, 2))):
            assert region.contains(contacts[f])
            assert region.compute_margin(contacts[f]) == pytest.approx(answer.margin[t, f], abs=1e-9)


def test_the_first_sample_outside_is_named(hand: HandModel) -> None:
    regions_at = partial(compute_regions, hand)
    X_WO, contacts = turning(hand, 120.0), at(-38.0, 102.0)
    answer = check_rewind_along(regions_at, X_WO, 0, 1, 2, *contacts)
    assert not answer.is_assured
    first = answer.first
    assert first is not None
    assert (answer.margin[:first] >= 0.0).all()
    assert answer.margin[first].min() < 0.0
    who = int(np.argmin(answer.margin[first]))
    assert (
        f"finger {who + 1} leaves the double force-closure region at sample {first} of 121" in answer.reason
    )
    assert answer.reason.endswith("rewinds may exist all the same")
    # Exactly there: one sample earlier the contact is inside.
    doubles = [(0, 1, 2), (1, 0, 2)][who]
    inside = [bool(regions_at(X_WO[t]).double(*doubles).contains(contacts[who])) for t in (first - 1, first)]
    assert inside == [True, False]


def test_a_motion_that_leaves_home_is_asked_where_it_is(hand: HandModel) -> None:
    """Contacts given sample by sample, the ball carried aside until a region is left."""
    count = 5
    X_WO = np.repeat(hand.object.X_WO_home[None], count, axis=0)
    X_WO[:, 1, 3] += np.linspace(0.0, 0.06, count)
    contacts = [np.repeat(x[None], count, axis=0) for x in at(-40.0, 130.0)]
    answer = check_rewind_along(partial(compute_regions, hand), X_WO, 0, 1, 2, *contacts)
    assert answer.margin[0].min() > 0.0
    for t in range(count):
        regions = compute_regions(hand, X_WO[t])
        for f, region in enumerate((regions.double(0, 1, 2), regions.double(1, 0, 2))):
            assert region.compute_margin(contacts[f][t]) == pytest.approx(answer.margin[t, f], abs=1e-9)
    assert not answer.is_assured
    assert answer.first is not None


def test_a_motion_without_witnesses_is_not_assured(hand: HandModel) -> None:
    regions_at = partial(compute_regions, hand, theta=float(np.radians(2.0)))
    answer = check_rewind_along(regions_at, turning(hand, 4.0), 0, 1, 2, *at(-30.0, 150.0))
    assert not answer.is_assured
    assert answer.first == 0
    assert "Theory 3: no point of CWS_1_23" in answer.reason
