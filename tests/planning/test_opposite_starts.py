"""Starts from exactly opposite contacts, and their neighbours: hardly any room beside them, so they roll first."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.gait.escape import count_room
from dexplan.planning.gait.routes import build_routes
from dexplan.planning.rolling.roll_gait import RollToPair
from dexplan.planning.tasks.pair_roll import PairRolls
from dexplan.planning.tasks.rolling_start import plan_object_manipulation
from dexplan.plans.contacts import Placement
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, direction_from_angles

UP = np.array([0.0, 0.0, 1.0])
NODES = 60


def build(**changes: object) -> HandModel:
    problem = load_problem("fig4_substitution", {key.replace("__", "."): v for key, v in changes.items()})
    return pipeline.build_hand(problem, pipeline.build_scene(problem))


@pytest.fixture(scope="module")
def hands() -> dict[float, HandModel]:
    """Return hands around a ball that leaves a ring of 0.02 deg beside opposite contacts, and around one that leaves none."""
    return {0.035: build(), 0.030: build(object__radius_m=0.030, object__mass_kg=0.040)}


def ask(hand: HandModel, contacts: tuple[tuple[float, float] | None, ...], angle: float) -> Plan:
    """Return the plan from contacts at (azimuth, elevation) [deg] for a turn about the vertical [deg]."""
    goal = RotationGoal(hand.object.X_WO_home, UP, float(np.radians(angle)))
    start = tuple(None if c is None else direction_from_angles(*c) for c in contacts)
    return plan_object_manipulation(hand, goal, start, NODES)


@pytest.mark.parametrize(
    ("radius", "azimuths", "elevation", "angle"),
    [
        (0.035, (0.0, 180.0), 0.0, 90.0),
        (0.035, (0.0, -180.0), 0.0, -90.0),
        (0.035, (10.0, 190.0), 0.0, 360.0),
        (0.035, (-370.0, 530.0), 0.0, 90.0),
        (0.035, (-20.0, 160.0), 20.0, 90.0),
        (0.030, (-30.0, 150.0), 0.0, 90.0),
        (0.030, (-15.0, 165.0), -15.0, -90.0),
    ],
)
def test_opposite_contacts_are_a_start_like_any_other(
    hands: dict[float, HandModel],
    radius: float,
    azimuths: tuple[float, float],
    elevation: float,
    angle: float,
) -> None:
    a, b = azimuths
    plan = ask(hands[radius], ((a, elevation), (b, -elevation), None), angle)
    assert plan.is_solved, plan.reason
    for contact, azimuth, lift in zip(
        plan.start_contacts[:2], azimuths, (elevation, -elevation), strict=True
    ):
        assert contact is not None
        assert contact.normal_O == pytest.approx(direction_from_angles(azimuth, lift), abs=1e-9)
    assert plan.actions[-1].X_WO_end == pytest.approx(plan.X_WO_goal, abs=1e-9)


@pytest.mark.parametrize("off", [0.0, 0.01, -0.01, 0.1, -0.1])
def test_the_answer_does_not_hang_on_a_hundredth_of_a_degree(
    hands: dict[float, HandModel], off: float
) -> None:
    assert ask(hands[0.035], ((0.0, 0.0), (180.0 + off, 0.0), None), 90.0).is_solved


def settle(
    hand: HandModel, first: float, angle: float
) -> tuple[RotationGoal, tuple[Placement | None, ...], ContactTable]:
    goal = RotationGoal(hand.object.X_WO_home, UP, float(np.radians(angle)))
    table = ContactTable(hand, build_routes(goal)[0][0])
    held = [table.start_along(f, direction_from_angles(first + 180.0 * f, 0.0)) for f in (0, 1)]
    assert all(held)
    return goal, (*(table.placement(h, 0) for h in held if h), None), table


@pytest.mark.parametrize("first", [-40.0, -25.0, -10.0, 5.0])
def test_rolled_pairs_hold_all_the_way_and_leave_room(hands: dict[float, HandModel], first: float) -> None:
    hand = hands[0.030]
    goal, contacts, table = settle(hand, first, 90.0)
    normals: list[Array] = [c.normal_O for c in contacts if c is not None]
    assert normals[0] @ normals[1] == pytest.approx(-1.0, abs=1e-12)
    judge = Admissibility(hand)
    option = next(PairRolls(hand, goal, contacts, judge).options())
    ends = [c for c in option.contacts if c is not None]
    assert len(ends) == 2
    held = tuple(table.start_at(c.finger, goal.X_WO_start @ c.X_OF, c.q) for c in ends)
    assert held[0] is not None
    assert held[1] is not None
    # None beside the opposite pair, some after it has rolled; and the pair still holds.
    before = tuple(table.start_along(f, direction_from_angles(first + 180.0 * f, 0.0)) for f in (0, 1))
    assert count_room(table, before) == 0  # type: ignore[arg-type]
    assert count_room(table, (held[0], held[1])) > 0
    assert table.has_pair((held[0], held[1]))
    for roll in option.rolls:
        start = contacts[roll.finger]
        assert start is not None
        assert roll.X_OF[0] == pytest.approx(start.X_OF, abs=1e-9)
    q = hand.q_home.copy()
    for c in ends:
        q[c.finger] = c.q
    assert judge.compute_margins(q, goal.X_WO_start, (0, 1)).is_admissible


def test_the_third_of_three_may_be_lifted_from_exactly_opposite_contacts(
    hands: dict[float, HandModel],
) -> None:
    hand = hands[0.035]
    plan = ask(hand, ((0.0, 0.0), (180.0, 0.0), (-100.0, 20.0)), 90.0)
    assert plan.is_solved, plan.reason
    option = next(RollToPair(hand, plan.X_WO_start, plan.start_contacts, Admissibility(hand)).options())
    assert (option.pair, option.rolls) == ((0, 1), ())


def test_what_rolling_cannot_help_is_said(hands: dict[float, HandModel]) -> None:
    """With hardly any friction nothing can be rolled out of opposite places."""
    hand = build(friction__sliding=0.10, friction__torsional_m=0.0005)
    plan = ask(hand, ((0.0, 0.0), (180.0, 0.0), None), 90.0)
    assert plan.status in ("no_gait", "start_inadmissible")
    if plan.status == "no_gait":
        assert "rolling" in plan.reason


def test_a_roll_of_a_pair_says_so(hands: dict[float, HandModel]) -> None:
    plan = ask(hands[0.030], ((-30.0, 0.0), (150.0, 0.0), None), 90.0)
    roll = plan.actions[1]
    assert (roll.name, roll.grasping, roll.motion.angle) == ("roll", (0, 1), 0.0)
    assert "no gait was found from the start contacts" in roll.why
    assert "roll" in plan.explain()
