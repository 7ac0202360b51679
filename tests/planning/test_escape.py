"""Grasps from which no finger finds room: the pair turns the object first to where one does, and the plan stands a check."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest
from recheck import Recheck
from scipy.spatial.transform import Rotation

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.oracle import Landfall, Purpose
from dexplan.planning.contacts.orbit_landfalls import find_landings_on
from dexplan.planning.gait.escape import (
    ALIKE,
    COUNT,
    FURTHEST,
    MOST_PLACES_COUNTED,
    Escape,
    count_room,
    find_escapes,
)
from dexplan.planning.gait.routes import build_routes, list_swings
from dexplan.planning.search.cost import Improvement
from dexplan.planning.tasks import object_manipulation as planner
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.spatial import Array
from dexplan.witness.attitudes import Question, draw_questions

BUDGET = 2000
GAITS: tuple[Literal["substitution", "rewind"], ...] = ("substitution", "rewind")
STUCK, ROOMY, TIGHT = (0, 17), 1, 2
"""Of the questions of seed 1: two without any room, one with plenty, and one with little."""


Pair = tuple[Held, Held]


@dataclass(frozen=True, eq=False)
class Case:
    """A question, its start on the first leg of the straight route, and what is said of it."""

    question: Question
    table: ContactTable
    pair: Pair
    room: int
    escapes: list[Escape]


@pytest.fixture(scope="module")
def cases(hand: HandModel) -> dict[int, Case]:
    """Return the questions that the tests are about, by number."""
    found, questions = {}, list(draw_questions(hand, 18, 1))
    for number in (*STUCK, ROOMY, TIGHT):
        table, pair = begin(hand, questions[number])
        escapes = find_escapes(table, pair) if number in STUCK else []
        found[number] = Case(questions[number], table, pair, count_room(table, pair), escapes)
    return found


def stand(hand: HandModel, question: Question, leg: Leg) -> tuple[ContactTable, Pair]:
    """Return the table of a leg with the question's start contacts on it."""
    table = ContactTable(hand, leg)
    held = [table.start_along(f, n) for f, n in enumerate(question.start) if n is not None]
    first, second = held
    assert first is not None
    assert second is not None
    return table, (first, second)


def begin(hand: HandModel, question: Question) -> tuple[ContactTable, Pair]:
    """Return the start on the first leg of the straight route."""
    return stand(hand, question, build_routes(question.goal)[0][0])


def find_landings(table: ContactTable, pair: Pair) -> int:
    """Return at how many places the search itself would let a free finger land beside the pair, right where it is."""
    held = {h.finger for h in pair}
    free = set(range(len(table.hand.fingers))) - held
    asked = [Landfall(f, keep, pair, 0, Purpose.STAND_IN) for f in sorted(free) for keep in pair]
    return sum(len(found) for found in find_landings_on(table, asked))


@pytest.mark.parametrize("number", STUCK)
def test_escapes_lead_to_where_a_finger_can_land(
    hand: HandModel, cases: dict[int, Case], number: int
) -> None:
    case = cases[number]
    table, question = case.table, case.question
    assert case.room == 0
    assert find_landings(table, case.pair) == 0
    assert 0 < len(case.escapes) <= COUNT
    carried = 0
    for escape in case.escapes:
        assert np.linalg.norm(escape.axis_W) == pytest.approx(1.0)
        assert 0.0 < escape.angle <= FURTHEST + 1e-9
        # The pair takes the object there, as far as its fingers are concerned; obstacles are the search's business.
        turn = Leg(table.leg.X_WO_start, escape.axis_W, escape.angle)
        on_way, going = stand(hand, question, turn)
        if min(h.left for h in going) < turn.stations or carried == 2:
            continue
        carried += 1
        X_WO = turn.X_WO_end
        after = ContactTable(hand, Leg(X_WO, table.leg.axis_W, table.leg.angle))
        arrived = []
        for h in going:
            X_OF = on_way.placement(h, 0).X_OF
            contact = after.start_at(h.finger, X_WO @ X_OF, on_way.state(h.carried(turn.stations)).q)
            assert contact is not None
            arrived.append(contact)
        first, second = arrived
        assert count_room(after, (first, second)) == escape.room > 0
        assert find_landings(after, (first, second)) > 0
    assert carried > 0


def test_escapes_are_different_ways_the_roomiest_and_nearest_first(cases: dict[int, Case]) -> None:
    for number in STUCK:
        escapes = cases[number].escapes
        scores = [
            min(e.room, MOST_PLACES_COUNTED) / MOST_PLACES_COUNTED - 0.5 * e.angle / FURTHEST for e in escapes
        ]
        assert scores == sorted(scores, reverse=True)
        for k, one in enumerate(escapes):
            assert all(one.axis_W @ two.axis_W < ALIKE for two in escapes[:k])


def angle_about(plan: Plan, axis: Array) -> float:
    """Return the turn about ``axis`` [rad] counted along the plan's moves, through whole turns."""
    quats = []
    for action in plan.actions:
        if action.name == "move_object":
            for share in np.linspace(0.0, 1.0, 20):
                turn = Rotation.from_rotvec(share * action.motion.angle * action.motion.axis_W)
                back = plan.X_WO_start[:3, :3].T
                R = turn.as_matrix() @ action.X_WO_start[:3, :3] @ back
                quats.append(Rotation.from_matrix(R).as_quat(canonical=True))
    quat = np.array(quats)
    return float(np.unwrap(2.0 * np.arctan2(quat[:, :3] @ axis, quat[:, 3]))[-1])


def test_attitude_from_a_stuck_start(hand: HandModel, cases: dict[int, Case]) -> None:
    case = cases[STUCK[1]]
    plan = plan_rotation(hand, case.question.goal, case.question.start, BUDGET, GAITS)
    assert plan.is_solved, plan.reason
    assert plan.statistics["nodes"] < 100
    # What moves first is the pair, about an axis to where there is room.
    first = next(a for a in plan.actions if a.name == "move_object")
    assert any(np.allclose(first.motion.axis_W, e.axis_W) for e in case.escapes)
    assert first.grasping == tuple(sorted(h.finger for h in case.pair))
    assert np.allclose(plan.actions[-1].X_WO_end, plan.X_WO_goal, atol=1e-9)
    assert Recheck(hand, plan).faults == []


def test_turn_about_a_named_axis_from_a_stuck_start(hand: HandModel, cases: dict[int, Case]) -> None:
    """Planned too: escape, the turn asked for, and what was turned first undone; the turn counts as what was asked for."""
    question, up = cases[STUCK[0]].question, np.array([0.0, 0.0, 1.0])
    goal = RotationGoal(question.goal.X_WO_start, up, 0.5 * np.pi, np.array([0.004, -0.003, 0.003]))
    plan = plan_rotation(hand, goal, question.start, BUDGET, GAITS)
    assert plan.is_solved, plan.reason
    assert plan.turned_angle == goal.angle
    assert np.allclose(plan.actions[-1].X_WO_end, goal.X_WO_goal, atol=1e-9)
    assert angle_about(plan, up) == pytest.approx(goal.angle, abs=1e-9)
    moves = [a for a in plan.actions if a.name == "move_object" and a.motion.angle]
    about_up = [abs(a.motion.axis_W @ up) > 1.0 - 1e-9 for a in moves]
    assert (about_up[0], about_up[-2 if not moves[-1].motion.angle else -1]) == (False, False)
    assert sum(a.motion.angle for a, is_up in zip(moves, about_up, strict=True) if is_up) == pytest.approx(
        0.5 * np.pi
    )
    assert Recheck(hand, plan).faults == []


def propose(hand: HandModel, question: Question) -> Iterator[tuple[Leg, ...]]:
    """Yield the routes that the planner would try after the first."""
    planning = planner._Planning(hand, question.goal, question.start, BUDGET, GAITS, Improvement())
    assert planning._begin_all() is None
    yield from planning._propose(planning.searches[0].tables[0])


def test_who_has_room_goes_straight(
    hand: HandModel, cases: dict[int, Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With plenty of room nobody even looks for an escape; with little, escapes come last; with none, first."""
    tight, stuck, roomy = cases[TIGHT], cases[STUCK[0]], cases[ROOMY]
    assert stuck.room == 0 < tight.room < MOST_PLACES_COUNTED <= roomy.room
    asked: list[int] = []

    def tell(table: ContactTable, held: Pair) -> list[Escape]:
        asked.append(count_room(table, held))
        return stuck.escapes

    monkeypatch.setattr(planner, "find_escapes", tell)
    straight = count_straight(hand, tight.question)
    routes = list(propose(hand, tight.question))
    is_escape = [any(np.array_equal(r[0].axis_W, e.axis_W) for e in stuck.escapes) for r in routes]
    assert not any(is_escape[:straight])
    assert all(is_escape[straight:])
    assert len(routes) > straight
    routes = list(propose(hand, stuck.question))
    # One way by every escape, the straight ones, then all others by the escapes.
    axes = [r[0].axis_W for r in routes]
    count = len(stuck.escapes)
    assert all(np.array_equal(a, e.axis_W) for a, e in zip(axes[:count], stuck.escapes, strict=True))
    assert len(routes) > count + count_straight(hand, stuck.question)
    assert len(list(propose(hand, roomy.question))) == count_straight(hand, roomy.question)
    assert asked == [tight.room, 0]


def count_straight(hand: HandModel, question: Question) -> int:
    """Return how many routes of the goal's own there are but the first."""
    return len(build_routes(question.goal, list_swings(hand.p_WF_home))) - 1
