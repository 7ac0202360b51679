"""Fingers whose contacts roll: the same engine and protocol, and what their rank and their torques make of a gait."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest

from dexplan.contact.friction import SoftFinger
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.oracle import Landfall, Progress
from dexplan.planning.contacts.rolling_contacts import RollingContacts
from dexplan.planning.contacts.rolling_stations import SLIP_CAP, RollingGrip
from dexplan.planning.contacts.track import Track
from dexplan.planning.tasks.rolling_fingers import RollingPlan, build_rolling_contacts, plan_rolling
from dexplan.plans.actions import MoveObject, Relocate, count_placements
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import RefusalKind
from dexplan.plans.status import Status
from dexplan.scene.library import TRIFINGER_BALL, load_scene_with
from dexplan.spatial import VERTICAL, direction_from_angles
from dexplan.witness.rolling_hand import LIMITS, build_question

FIRST = Progress(0, 0)


def _ask(turn_deg: float) -> tuple[RollingContacts, RollingGrip]:
    home = load_scene_with(TRIFINGER_BALL).object.X_WO_home
    motion = ObjectMotion(home, VERTICAL, float(np.radians(turn_deg)), np.zeros(3))
    return build_question(load_scene_with(TRIFINGER_BALL), (motion,))


@pytest.fixture(scope="module")
def short() -> tuple[RollingContacts, RollingGrip]:
    return _ask(40.0)


@pytest.fixture(scope="module")
def found() -> RollingPlan:
    contacts, start = _ask(118.0)
    return plan_rolling(contacts, start, 60)


def test_the_ball_turns_by_118_degrees_with_three_placements_at_most(found: RollingPlan) -> None:
    plan = found.plan
    assert plan.status is Status.SOLVED
    assert count_placements(plan.actions) <= 3
    assert plan.statistics["nodes"] <= 60
    carries = [action for action in plan.actions if isinstance(action, MoveObject)]
    assert sum(action.motion.angle for action in carries) == pytest.approx(np.radians(118.0))
    assert (found.slips <= SLIP_CAP * len(carries)).all()
    # What a tip may slide in a carry cannot be had twice by interrupting it.
    assert not any(isinstance(a, MoveObject) and isinstance(b, MoveObject) for a, b in pairwise(plan.actions))
    for action in plan.actions:
        # Shares of the believed cone and of the torque limits, at every station.
        assert action.margins.get("load", 1.0) >= 1.0 - LIMITS.cone_share - 1e-9
        assert action.margins.get("torque_share", 0.0) <= LIMITS.torque_share + 1e-9


def test_move_on_three_and_hold_on_two_comes_out(found: RollingPlan) -> None:
    """No rule says it; nor that two that hold alone have to be 150 degrees apart."""
    plan, gaps = found.plan, []
    for before, action in pairwise((None, *plan.actions)):
        contacts = plan.start_contacts if before is None else before.contacts_end
        touching = [c for c in contacts if c is not None]
        if isinstance(action, MoveObject):
            assert len(touching) == 3
            assert {roll.finger for roll in action.rolls} == {c.finger for c in touching}
        if isinstance(action, Relocate) and not action.is_placing:
            left = [c for c in action.contacts_end if c is not None]
            assert len(left) == 2
            gaps.append(np.degrees(np.arccos(left[0].normal_O @ left[1].normal_O)))
    assert gaps
    assert min(gaps) > 145.0


def test_the_drift_of_contacts_is_in_the_plan(found: RollingPlan) -> None:
    """A carried contact ends elsewhere on the ball than it began, and the next action finds it there."""
    moved = []
    plan: Plan = found.plan
    before = plan.start_contacts
    for action in plan.actions:
        for roll in action.rolls:
            landed, end = before[roll.finger], action.contacts_end[roll.finger]
            assert landed is not None
            assert end is not None
            assert np.allclose(roll.X_OF[0], landed.X_OF)
            assert np.allclose(roll.X_OF[-1], end.X_OF)
            drift = np.degrees(np.arccos(landed.normal_O @ end.normal_O))
            moved.append(drift / np.degrees(abs(action.motion.angle)))
        before = action.contacts_end
    # On a ball the contact keeps behind by r / (R + r) of the turn, about.
    assert np.median(moved) == pytest.approx(10.0 / 42.5, rel=0.15)


def test_two_contacts_that_pivot_hold_the_ball_and_do_not_move_it(
    short: tuple[RollingContacts, RollingGrip],
) -> None:
    contacts, start = short
    pair = contacts.change(start, 0, None)
    assert contacts.judge(pair, FIRST).is_admissible
    reach = contacts.go(pair, FIRST)
    assert reach.stops == 0
    assert [refusal.kind for refusal in reach.refusals] == [RefusalKind.LEFT_TO_TORSION]
    assert contacts.go(start, FIRST).stops > 0


def test_landings_hold_with_what_holds_already_and_are_carried_once(
    short: tuple[RollingContacts, RollingGrip],
) -> None:
    contacts, start = short
    pair = contacts.change(start, 0, None)
    asked = [Landfall(0, None, pair, 0)]
    first = contacts.land(0, asked)[0]
    count = len(contacts.touches.touches)
    again = contacts.land(0, asked)[0]
    assert again == first
    assert len(contacts.touches.touches) == count
    assert first
    for landing in first:
        touch = contacts.touches.touches[landing.held]
        assert touch.finger == 0
        assert touch.until == landing.promise
        partners = [contacts.place(t, FIRST) for t in pair if t is not None]
        own = contacts.place(landing.held, FIRST)
        assert min(own.normal_O @ partner.normal_O for partner in partners) < -0.7
    assert contacts.list_touching(contacts.change(pair, 0, first[0].held)) == (0, 1, 2)


def test_a_heavier_ball_is_refused_with_its_reason() -> None:
    home = load_scene_with(TRIFINGER_BALL).object.X_WO_home
    motion = ObjectMotion(home, VERTICAL, 0.2, np.zeros(3))
    contacts, start = build_question(load_scene_with(TRIFINGER_BALL), (motion,))
    contacts.hold.hand = contacts.touches.hand = _weighing(contacts.hand, 0.5)
    found = plan_rolling(contacts, start, 10).plan
    assert found.status is Status.START_INADMISSIBLE
    assert found.refusal is not None
    assert found.refusal.kind is RefusalKind.LOAD


def _weighing(hand: HandModel, mass: float) -> HandModel:
    return HandModel(**{**vars(hand), "object": hand.object.weighing(mass)})


@pytest.mark.parametrize("rolls", [True, False])
def test_fingers_of_six_joints_are_asked_in_the_same_words(hand: HandModel, rolls: bool) -> None:
    """They differ in the rule of the carry alone; where the tip does not roll both rules agree, and two may carry."""
    nominal = SoftFinger(0.55, 2.5e-3)
    motion = ObjectMotion(hand.object.X_WO_home, VERTICAL, float(np.radians(12.0)), np.zeros(3))
    contacts = build_rolling_contacts(hand, nominal, Track((motion,)), rolls=rolls)
    known = contacts.touches
    grip = (
        known.land_at(0, direction_from_angles(-12.0, 0.0)),
        known.land_at(1, direction_from_angles(150.0, 0.0)),
        None,
    )
    assert contacts.judge(grip, FIRST).is_admissible
    assert contacts.go(grip, FIRST).stops == known.last
    assert contacts.judge_carry(grip, FIRST, known.last).refusal is None
    slips = contacts.stations.measure_slips(grip, FIRST, known.last)
    assert (slips < 1e-6).all()
    for number in (t for t in grip if t is not None):
        states = [known.touches[number].at(k) for k in range(len(known.stations))]
        for a, b in combinations((states[0], states[-1]), 2):
            assert np.allclose(a.p_O, b.p_O, atol=2e-5)
            assert np.allclose(a.X_OF, b.X_OF, atol=1e-3)
