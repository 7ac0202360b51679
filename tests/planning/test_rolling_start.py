"""Three fingers hold, two of them might alone, and yet no gait begins: rolling first helps, or lifting does, or nothing.

Starts were drawn at random, and chosen for what :func:`plan_rotation` alone answers to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.contact.rolling.curves import roll_turning
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.tasks import rolling_start
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.planning.tasks.rolling_start import OPTIONS, plan_object_manipulation
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import Relocate
from dexplan.plans.goal import RotationGoal
from dexplan.plans.phases import MUST
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, direction_from_angles

UP = np.array([0.0, 0.0, 1.0])
BUDGET = 320


@dataclass(frozen=True)
class Case:
    """Azimuths and elevations of three contacts [deg], and the turn about the vertical that is asked for [deg]."""

    azimuths: tuple[float, float, float]
    elevations: tuple[float, float, float]
    turn: float

    @property
    def start(self) -> tuple[Array, ...]:
        return tuple(direction_from_angles(a, e) for a, e in zip(self.azimuths, self.elevations, strict=True))


THIRD_ROLLS = Case((-47.0, 151.0, 279.0), (-1.0, -7.0, 27.0), -30.0)
ALL_ROLL = Case((-17.0, 164.0, 246.0), (-27.0, 24.0, 19.0), -30.0)
LIFTING_IS_ENOUGH = Case((-44.0, 105.0, 294.0), (-23.0, -5.0, 18.0), 30.0)
LIFTED_PAIR_ROLLS = Case((58.0, 174.0, 237.0), (-17.0, 7.0, 18.0), 30.0)


@pytest.fixture(scope="module")
def slippery() -> HandModel:
    """Return the hand with less friction than usual, so that pairs hold in few places."""
    changes = {"friction.sliding": 0.45, "friction.torsional_m": 0.0021}
    problem = load_problem("fig4_substitution", changes)
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


def ask(hand: HandModel, case: Case, budget: int = BUDGET) -> tuple[Plan, Plan]:
    """Return the answers of gaits alone, and of gaits with rolling before them."""
    goal = RotationGoal(hand.object.X_WO_home, UP, float(np.radians(case.turn)))
    return (
        plan_rotation(hand, goal, case.start, budget),
        plan_object_manipulation(hand, goal, case.start, budget),
    )


def check_whole(hand: HandModel, plan: Plan, case: Case) -> None:
    """Check that a plan starts as asked, hangs together, holds the object at every action's ends, and reaches the goal."""
    judge = Admissibility(hand)
    for contact, normal in zip(plan.start_contacts, case.start, strict=True):
        assert contact is not None
        assert hand.object.X_WO_home[:3, :3] @ contact.normal_O == pytest.approx(normal, abs=1e-6)
    X_WO, contacts = hand.object.X_WO_home, plan.start_contacts
    for action in plan.actions:
        assert action.X_WO_start == pytest.approx(X_WO, abs=1e-9)
        # Who touches changes by what is lifted, placed or rolled, and by nothing else.
        changed = {
            i
            for i, (a, b) in enumerate(zip(contacts, action.contacts_end, strict=True))
            if (a is None) != (b is None)
            or (a is not None and b is not None and np.abs(a.normal_O - b.normal_O).max() > 1e-6)
        }
        relocated = {action.finger} if isinstance(action, Relocate) else set()
        assert changed == relocated | {r.finger for r in action.rolls}, action.name
        X_WO, contacts = action.X_WO_end, action.contacts_end
        held = {i: c.X_OF for i, c in enumerate(contacts) if c is not None}
        q = hand.q_home.copy()
        for i, X_OF in held.items():
            solved, reached = hand.workspaces[i].solve((X_WO @ X_OF)[None])
            assert reached[0], (action.name, i)
            q[i] = solved[0]
        margins = judge.compute_margins(q, X_WO, tuple(sorted(held)))
        assert margins.load > 0.0, (action.name, margins.refusal)
    assert pytest.approx(plan.X_WO_goal, abs=1e-6) == X_WO


@pytest.mark.parametrize(("case", "rolling"), [(THIRD_ROLLS, 1), (ALL_ROLL, 3)])
def test_rolling_makes_a_grasp_that_a_gait_goes_on_from(
    slippery: HandModel, case: Case, rolling: int
) -> None:
    alone, plan = ask(slippery, case)
    assert alone.status == "no_gait", alone.reason
    assert plan.is_solved, plan.reason
    assert [a.name for a in plan.actions[:3]] == ["hold", "roll", "lift"]
    roll, lift = plan.actions[1:3]
    assert len(roll.rolls) == rolling
    assert all(phase.touch == (MUST, MUST, MUST) for phase in roll.phases)
    # Two of these fingers held alone before already: nothing else may be said.
    assert "no two contacts" not in roll.why
    assert "no gait was found from the start contacts" in roll.why
    assert lift.finger not in lift.grasping
    # Pure rolling: each tip goes as the closed form of its great circle says.
    for way in roll.rolls:
        before = plan.start_contacts[way.finger]
        assert before is not None
        angle = float(np.arccos(np.clip(before.normal_O @ way.normal_O[-1], -1.0, 1.0)))
        assert angle > np.radians(1.0)
        radius, tip = (
            float(np.linalg.norm(before.point_O)),
            slippery.fingers[way.finger].tip_radius,
        )
        path = roll_turning(tip, radius, before.X_OF, way.normal_O[-1], [0.0], [radius * angle], 5)
        assert path.X_OF[-1] == pytest.approx(way.X_OF[-1], abs=1e-8)
    check_whole(slippery, plan, case)


def test_where_lifting_is_enough_nothing_rolls(slippery: HandModel) -> None:
    alone, plan = ask(slippery, LIFTING_IS_ENOUGH)
    assert alone.status == "no_gait", alone.reason
    assert plan.is_solved, plan.reason
    assert [a.name for a in plan.actions[:2]] == ["hold", "lift"]
    assert all(a.rolls for a in plan.actions if a.name == "roll")
    assert "no two contacts" not in plan.explain()
    assert "hold alone, and a gait begins with them" in plan.actions[1].why
    check_whole(slippery, plan, LIFTING_IS_ENOUGH)


def test_a_pair_rolls_where_lifting_the_third_is_not_enough(slippery: HandModel) -> None:
    alone, plan = ask(slippery, LIFTED_PAIR_ROLLS)
    assert alone.status == "no_gait", alone.reason
    assert plan.is_solved, plan.reason
    assert [a.name for a in plan.actions[:3]] == ["hold", "lift", "roll"]
    lift, roll = plan.actions[1:3]
    assert set(roll.grasping) == {0, 1, 2} - {lift.finger}
    check_whole(slippery, plan, LIFTED_PAIR_ROLLS)


def test_where_nothing_helps_the_answer_says_what_was_tried(
    slippery: HandModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What helps above is left out."""
    monkeypatch.setattr(rolling_start, "LIFTS", 0)
    alone, plan = ask(slippery, LIFTED_PAIR_ROLLS)
    assert (alone.status, plan.status) == ("no_gait", "no_gait")
    assert plan.actions == ()
    assert plan.start_contacts[2] is not None
    assert plan.reason.startswith(alone.reason)
    tried = plan.reason[len(alone.reason) :]
    assert tried.startswith("; after rolling (2 ways tried): no_gait: ")
    assert "raise the friction" in tried


def test_a_search_that_was_cut_short_is_not_called_no_gait(
    slippery: HandModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Gaits from the start are exhausted, those after rolling are given too few nodes: with more there is one, as above."""
    seen: list[str] = []

    def plan_briefly(hand: HandModel, goal: RotationGoal, start: Start, budget: int, *means: Any) -> Plan:
        answer = plan_rotation(hand, goal, start, min(budget, 3) if seen else budget, *means)
        seen.append(answer.status)
        return answer

    monkeypatch.setattr(rolling_start, "plan_gait", plan_briefly)
    plan = ask(slippery, LIFTING_IS_ENOUGH)[1]
    assert seen[0] == "no_gait"
    assert "budget_exhausted" in seen[1:]
    assert len(seen) <= 1 + OPTIONS
    assert plan.status == "budget_exhausted"
    assert "raise gait.node_budget" in plan.reason


def test_routes_that_were_not_begun_leave_the_answer_open(slippery: HandModel) -> None:
    _, plan = ask(slippery, LIFTING_IS_ENOUGH)
    lifted = plan.actions[1].finger
    pair = tuple(None if f == lifted else n for f, n in enumerate(LIFTING_IS_ENOUGH.start))
    goal = RotationGoal(slippery.object.X_WO_home, UP, float(np.radians(LIFTING_IS_ENOUGH.turn)))
    assert plan_rotation(slippery, goal, pair, BUDGET).is_solved
    assert plan_rotation(slippery, goal, pair, 1).status == "budget_exhausted"


def test_ways_to_roll_that_were_not_tried_leave_the_answer_open(
    slippery: HandModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where one way to roll is all that may be tried, nothing follows from it for the others."""
    monkeypatch.setattr(rolling_start._RolledStart, "most", 1)
    monkeypatch.setattr(rolling_start, "LIFTS", 0)
    plan = ask(slippery, LIFTED_PAIR_ROLLS)[1]
    assert plan.status == "budget_exhausted"
    assert "after rolling (one way tried): no_gait: " in plan.reason
    assert plan.reason.endswith(
        "the search gave up, for there are more ways to roll; choose another start grasp"
    )


def test_without_a_node_left_rolling_is_not_called_impossible(slippery: HandModel) -> None:
    nodes = int(ask(slippery, LIFTING_IS_ENOUGH)[0].statistics["nodes"])
    plan = ask(slippery, LIFTING_IS_ENOUGH, nodes)[1]
    assert plan.status == "budget_exhausted"
    assert "rolling cannot make one" not in plan.reason
    assert "raise gait.node_budget" in plan.reason
