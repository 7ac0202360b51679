"""Grasp adjustment: goal contacts are reached, every state on the way is admissible, and refusals say what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from recheck import Recheck

from dexplan import pipeline
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regrasp.moves import reverse_roll
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.grasp_adjustment import plan_grasp_adjustment
from dexplan.plans.actions import Action
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, direction_from_angles

BUDGET = 3000
Places = list[tuple[float, float] | None]
PAIR: Places = [(-38.0, 0.0), (102.0, 0.0), None]
RING: Places = [(0.0, 0.0), (120.0, 0.0), (240.0, 0.0)]


class RecheckRolls(Recheck):
    """Looks at rolls too: every sample of the way is admissible while all fingers hold."""

    def _check_roll(self, name: str, action: Action) -> None:
        count = action.rolls[0].count
        for k in range(count):
            for roll in action.rolls:
                held = self._contacts[roll.finger]
                assert held is not None
                self._carry(
                    name,
                    type(held)(held.finger, held.point_O, held.normal_O, roll.X_OF[k], held.q),
                    self._X_WO,
                )
            self._check_state(name, self._X_WO, self._holding)
        for roll in action.rolls:
            self._contacts[roll.finger] = action.contacts_end[roll.finger]
            placed = action.contacts_end[roll.finger]
            assert placed is not None
            self._expect(name, np.allclose(placed.X_OF, roll.X_OF[-1], atol=1e-9), "rolls to another place")


def directions(places: Places) -> tuple[Array | None, ...]:
    return tuple(None if p is None else direction_from_angles(*p) for p in places)


def adjust(hand: HandModel, start: Places, goal: Places, *, keep_object: bool = False) -> Plan:
    return plan_grasp_adjustment(
        hand,
        hand.object.X_WO_home,
        directions(start),
        directions(goal),
        SearchOptions(BUDGET),
        keep_object=keep_object,
    )


def check_reached(hand: HandModel, plan: Plan, goal: Places) -> None:
    """The plan is sound to a second opinion and ends with every finger at its goal contact."""
    assert plan.is_solved, plan.reason
    assert plan.goal_kind == "grasp_adjustment"
    assert RecheckRolls(hand, plan).faults == []
    for contact, wanted in zip(plan.actions[-1].contacts_end, directions(goal), strict=True):
        assert (contact is None) == (wanted is None)
        if contact is not None and wanted is not None:
            assert np.degrees(np.arccos(np.clip(contact.normal_O @ wanted, -1.0, 1.0))) < 1e-3


def kinds(plan: Plan) -> list[str]:
    return [a.name for a in plan.actions]


class TestSearch:
    def test_a_free_finger_is_put_down(self, hand: HandModel) -> None:
        goal: Places = [*PAIR[:2], (215.0, 10.0)]
        plan = adjust(hand, PAIR, goal)
        check_reached(hand, plan, goal)
        assert kinds(plan) == ["hold", "place", "hold"]

    def test_fingers_that_hold_are_exchanged(self, hand: HandModel) -> None:
        """Finger 1 goes and finger 3 comes; finger 2 is relocated, which takes a finger that stands in for it."""
        goal: Places = [None, (80.0, 0.0), (222.0, 0.0)]
        plan = adjust(hand, PAIR, goal)
        check_reached(hand, plan, goal)
        np.testing.assert_array_equal(plan.X_WO_goal, plan.X_WO_start)
        assert all(a.margins["load"] > 0.0 for a in plan.actions if a.name in ("place", "lift"))

    def test_near_goals_are_rolled_to(self, hand: HandModel) -> None:
        goal: Places = [(8.0, 5.0), (125.0, -5.0), (243.0, 0.0)]
        plan = adjust(hand, RING, goal)
        check_reached(hand, plan, goal)
        assert kinds(plan) == ["hold", "roll", "hold"]

    def test_a_goal_grasp_without_a_pair_is_rolled_into(self) -> None:
        """The built-in problem: no two of the goal contacts are 122.4 degrees apart and a bit, so the last move is a roll."""
        problem = load_problem("adjust_grasp")
        plan = pipeline.plan(problem)
        hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
        assert isinstance(problem.goal.contacts_deg, tuple)
        check_reached(hand, plan, [(c[0], c[1]) for c in problem.goal.contacts_deg if isinstance(c, tuple)])
        assert kinds(plan)[-2] == "roll"
        assert "rolled into" in plan.actions[-2].why
        assert "place" in kinds(plan)

    def test_goals_out_of_reach_are_brought_within_reach(self, hand: HandModel) -> None:
        goal: Places = [(75.0, 0.0), (215.0, 0.0), None]
        plan = adjust(hand, PAIR, goal)
        check_reached(hand, plan, goal)
        assert "move_object" in kinds(plan)
        assert not np.allclose(plan.X_WO_goal, plan.X_WO_start)

    def test_nothing_to_do(self, hand: HandModel) -> None:
        plan = adjust(hand, PAIR, PAIR)
        assert kinds(plan) == ["hold", "hold"]

    def test_a_roll_backwards_is_a_roll(self, hand: HandModel) -> None:
        roll = next(
            a for a in adjust(hand, RING, [(8.0, 5.0), (125.0, -5.0), (243.0, 0.0)]).actions if a.rolls
        ).rolls[0]
        back = reverse_roll(roll)
        np.testing.assert_array_equal(back.X_OF[0], roll.X_OF[-1])
        for s in (0.1, 0.5, 0.8):
            np.testing.assert_allclose(back.sample(s)[0], roll.sample(1.0 - s)[0], atol=1e-9)


class TestRefusals:
    def test_contacts_that_cannot_hold(self, hand: HandModel) -> None:
        plan = adjust(hand, PAIR, [(0.0, 0.0), (90.0, 0.0), None])
        assert plan.status == "goal_grasp_inadmissible"
        assert "not force closed" in plan.reason
        assert "raise the friction" in plan.reason
        assert plan.actions == ()

    def test_the_object_has_to_stay_and_the_contacts_are_out_of_reach(self, hand: HandModel) -> None:
        plan = adjust(hand, PAIR, [(80.0, 0.0), (220.0, 0.0), None], keep_object=True)
        assert plan.status == "goal_contacts_unreachable"
        assert "finger_1 and finger_2 cannot reach" in plan.reason
        assert "goal.keep_object = false" in plan.reason

    @pytest.mark.parametrize("start", [[(180.0, 0.0), (320.0, 0.0), None]])
    def test_a_start_out_of_reach(self, hand: HandModel, start: Places) -> None:
        plan = adjust(hand, start, PAIR)
        assert plan.status == "start_unreachable"
        assert plan.goal_kind == "grasp_adjustment"
