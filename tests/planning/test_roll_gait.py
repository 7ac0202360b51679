"""From three fingers to two by rolling, and the object turned on rolling contacts: as plans, before any physics."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.rolling.roll_gait import RollToPair, build_roll_actions, follow_roll
from dexplan.planning.rolling.rolling_carry import build_carry_roll, plan_rolling_turn
from dexplan.planning.rolling.rolls import build_roll
from dexplan.plans.contacts import Placement
from dexplan.plans.phases import MAY, MUST, MUST_NOT
from dexplan.plans.plan import Plan
from dexplan.plans.tip_roll import TipRoll
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, rotate_about

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def ring(hand: HandModel) -> Plan:
    """Return the plan that holds the ball at 0, 120 and 240 degrees: no two of these are force closed."""
    return pipeline.plan(load_problem("hold_three"))


def touching(plan: Plan) -> list[Placement]:
    return [c for c in plan.start_contacts if c is not None]


def angle(a: Array, b: Array) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def compute_slip(roll: TipRoll, radius: float, tip: float) -> float:
    """Return the largest sliding speed [m per unit progress] of the tip at its contact, by finite differences."""
    s, h = np.linspace(0.02, 0.98, 25), 1e-5
    worst = 0.0
    for value in s:
        before, after = roll.sample(value - h)[0], roll.sample(value + h)[0]
        n = roll.sample(value)[1]
        point = radius * n
        # the material point of the tip that is at the contact now, a moment before and after
        X = roll.sample(value)[0]
        local = X[:3, :3].T @ (point - X[:3, 3])
        moved = (after[:3, :3] @ local + after[:3, 3]) - (before[:3, :3] @ local + before[:3, 3])
        worst = max(worst, float(np.linalg.norm(moved)) / (2.0 * h))
    assert roll.count > 3
    assert np.isclose(np.linalg.norm(roll.X_OF[0, :3, 3]), radius + tip)
    return worst


class TestThreeToTwo:
    def test_three_fingers_become_two(self, hand: HandModel, ring: Plan) -> None:
        search = RollToPair(hand, ring.X_WO_start, ring.start_contacts, Admissibility(hand))
        found = next(search.options())
        a, b = (found.contacts[i] for i in found.pair)
        assert a is not None
        assert b is not None
        # believed closure with the margin the planner keeps
        needed = 180.0 - 2.0 * np.degrees(np.arctan(hand.friction.sliding))
        assert needed + 2.0 < angle(a.normal_O, b.normal_O) < needed + 8.0
        # both rolled by the same angle, along their common great circle
        first, second = found.rolls[:2]
        assert angle(first.normal_O[0], first.normal_O[-1]) == pytest.approx(
            angle(second.normal_O[0], second.normal_O[-1])
        )
        plane = np.cross(first.normal_O[0], second.normal_O[0])
        assert (
            max(abs(n @ plane) for roll in (first, second) for n in roll.normal_O) < 1e-8
        )  # as exact as the start's posture
        assert found.lifted not in found.pair

    def test_tips_roll_and_do_not_slide(self, hand: HandModel, ring: Plan) -> None:
        found = next(RollToPair(hand, ring.X_WO_start, ring.start_contacts, Admissibility(hand)).options())
        for roll in found.rolls:
            assert compute_slip(roll, 0.035, 0.018) < 1e-5

    def test_every_instant_is_admissible_and_the_pair_holds_alone(self, hand: HandModel, ring: Plan) -> None:
        judge = Admissibility(hand)
        for found in islice(RollToPair(hand, ring.X_WO_start, ring.start_contacts, judge).options(), 3):
            assert found.margins["load"] > 0.0
            assert found.margins["clearance_mm"] >= 1e3 * hand.limits.clearance
            q = hand.q_home.copy()
            for i in found.pair:
                placement = found.contacts[i]
                assert placement is not None
                q[i] = placement.q
            assert judge.compute_margins(q, ring.X_WO_start, tuple(sorted(found.pair))).is_admissible

    def test_pair_farthest_apart_comes_first(self, hand: HandModel) -> None:
        """[paper §3]: choose the pair of contacts with the largest straight-line distance."""
        plan = pipeline.plan(load_problem("hold_three", {"start.contacts_deg": [[0, 0], [118, 0], [243, 0]]}))
        found = next(RollToPair(hand, plan.X_WO_start, plan.start_contacts, Admissibility(hand)).options())
        assert set(found.pair) == {1, 2}

    def test_too_little_friction_is_refused_with_the_reason(self, hand: HandModel, ring: Plan) -> None:
        slippery = replace(hand, friction=hand.friction.scaled(0.2))
        search = RollToPair(slippery, ring.X_WO_start, ring.start_contacts, Admissibility(slippery))
        assert next(search.options(), None) is None
        assert "cannot carry the load" in "; ".join(map(str, search.explain()))

    def test_actions_ask_for_the_right_contacts(self, hand: HandModel, ring: Plan) -> None:
        found = next(RollToPair(hand, ring.X_WO_start, ring.start_contacts, Admissibility(hand)).options())
        roll, lift = build_roll_actions(found, hand, ring.X_WO_start, UP)
        assert (roll.name, lift.name) == ("roll", "lift")
        assert all(phase.touch == (MUST, MUST, MUST) for phase in roll.phases)
        assert [phase.touch[found.lifted] for phase in lift.phases] == [MUST, MAY, MUST_NOT]
        assert lift.contacts_end[found.lifted] is None
        assert "roll apart" in roll.why


class TestRolls:
    def test_rolls_stop_at_the_tips_polar_limit(self, hand: HandModel, ring: Plan) -> None:
        start = touching(ring)[0]
        roll = build_roll(hand, start, UP, np.radians(25.0), 26)
        q, refusal = follow_roll(
            replace(hand, tip_polar_limit=np.radians(30.0)), ring.X_WO_start, roll, start.q
        )
        # 30 degrees on the tip are 30 * 18 / 35 on the ball: the last sample before it is kept
        assert len(q) == int(30.0 * 18.0 / 35.0) + 1
        assert "off its tip's pole" in str(refusal)
        assert follow_roll(hand, ring.X_WO_start, roll, start.q)[1] is None

    def test_rolls_stop_at_joint_limits(self, hand: HandModel, ring: Plan) -> None:
        start = touching(ring)[0]
        roll = build_roll(hand, start, UP, np.radians(40.0), 41)
        chain = hand.fingers[0].chain
        lower, upper = chain.lower.copy(), chain.upper.copy()
        lower[4], upper[4] = -0.7 + start.q[4], 0.7 + start.q[4]
        fingers = (
            replace(hand.fingers[0], chain=replace(chain, lower=lower, upper=upper)),
            *hand.fingers[1:],
        )
        q, refusal = follow_roll(replace(hand, fingers=fingers), ring.X_WO_start, roll, start.q)
        assert 2 < len(q) < roll.count
        assert "joint limit while it rolls" in str(refusal)

    def test_spline_passes_through_its_samples(self, hand: HandModel, ring: Plan) -> None:
        roll = build_roll(hand, touching(ring)[1], UP, np.radians(20.0), 21)
        for k in (0, 7, 20):
            X, n = roll.sample(k / 20.0)
            np.testing.assert_allclose(X, roll.X_OF[k], atol=1e-12)
            np.testing.assert_allclose(n, roll.normal_O[k], atol=1e-12)
        assert np.degrees(roll.tip_angle) == pytest.approx(20.0 * (1.0 + 35.0 / 18.0))


class TestRollingCarry:
    @pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
    @pytest.mark.parametrize("elevation", [0.0, 25.0])
    def test_tips_roll_without_pivoting(self, hand: HandModel, share: float, elevation: float) -> None:
        """Whatever the axis and the place of the contact: no sliding, no spin about the normal."""
        n = np.array([np.cos(np.radians(elevation)), 0.0, np.sin(np.radians(elevation))])
        X = np.eye(4)
        X[:3, :3] = rotate_about(np.array([0.0, 1.0, 0.0]), -np.pi / 2 - np.radians(elevation))
        X[:3, 3] = 0.053 * n
        axis = np.array([0.2, 0.3, 0.933])
        axis /= np.linalg.norm(axis)
        roll = build_carry_roll(hand, Placement(0, 0.035 * n, n, X, np.zeros(6)), axis, 0.7, share, 401)
        assert compute_slip(roll, 0.035, 0.018) < 1e-6
        steps = np.swapaxes(roll.X_OF[:-1, :3, :3], 1, 2) @ roll.X_OF[1:, :3, :3]
        turn = 0.5 * np.stack(
            [
                steps[:, 2, 1] - steps[:, 1, 2],
                steps[:, 0, 2] - steps[:, 2, 0],
                steps[:, 1, 0] - steps[:, 0, 1],
            ],
            1,
        )
        turn_O = np.einsum("kij,kj->ki", roll.X_OF[:-1, :3, :3], turn)
        assert np.abs(np.sum(turn_O * roll.normal_O[:-1], axis=1)).max() < 2e-6

    def test_contact_goes_round_by_less_than_the_object(self, hand: HandModel, ring: Plan) -> None:
        """A tip that does not turn: the contact follows R / (R + r) of the object's turn."""
        start = touching(ring)[0]
        roll = build_carry_roll(hand, start, UP, np.radians(30.0), 1.0, 61)
        in_world = rotate_about(UP, np.radians(30.0)) @ roll.normal_O[-1]
        assert angle(start.normal_O, in_world) == pytest.approx(30.0 * 35.0 / 53.0)
        attitude = rotate_about(UP, np.radians(30.0)) @ roll.X_OF[-1, :3, :3]
        np.testing.assert_allclose(attitude, start.X_OF[:3, :3], atol=1e-12)

    def test_rolling_contacts_turn_the_object_further(self, hand: HandModel) -> None:
        contacts = [[-38.0, 0.0], [102.0, 0.0], [212.0, 10.0]]
        plan = pipeline.plan(load_problem("hold_three", {"start.contacts_deg": contacts}))
        judge = Admissibility(hand)
        fixed, half = (
            plan_rolling_turn(hand, judge, plan.X_WO_start, plan.start_contacts, UP, np.radians(170.0), share)
            for share in (0.0, 0.5)
        )
        assert 60.0 < np.degrees(fixed.angle) < np.degrees(half.angle) - 20.0
        assert fixed.limit
        assert half.action is not None
        assert len(half.action.rolls) == 3
        assert half.margins["load"] > 0.0
