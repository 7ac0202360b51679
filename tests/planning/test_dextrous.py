"""Dextrous manipulation on a small goal in the paper's three orders, and travel that is handed over to motions of the object."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.control.reference import build_reference
from dexplan.planning.actions.overlap import count_overlaps, overlap_travel
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.phases import MUST_NOT
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.problems.read import load_problem
from dexplan.spatial import direction_from_angles

ORDERS = ("object_first", "grasp_first", "simultaneous")
CONTACTS = [(-38.0, 0.0), (102.0, 0.0), (205.0, 10.0)]
GOAL: dict[str, object] = {
    "kind": "dextrous_manipulation",
    "rotation": {"axis": [0.1, 0.0, 1.0], "angle_deg": 24.0},
    "contacts_deg": [list(c) for c in CONTACTS],
}


def small(order: str, **changes: object) -> Problem:
    return load_problem(
        "hold_two",
        {
            "start.contacts_deg": [[-38.0, 0.0], [102.0, 0.0], "free"],
            "goal": {**GOAL, "order": order, **changes},
        },
    )


@lru_cache
def plan_of(order: str) -> Plan:
    return pipeline.plan(small(order))


@pytest.mark.parametrize("order", ORDERS)
def test_object_and_contacts_reach_their_goals(order: str) -> None:
    plan = plan_of(order)
    assert plan.is_solved, plan.reason
    np.testing.assert_allclose(plan.actions[-1].X_WO_end, plan.X_WO_goal, atol=1e-12)
    assert np.degrees(sum(a.motion.angle for a in plan.actions)) == pytest.approx(24.0)
    for contact, (azimuth, elevation) in zip(plan.actions[-1].contacts_end, CONTACTS, strict=True):
        assert contact is not None
        np.testing.assert_allclose(contact.normal_O, direction_from_angles(azimuth, elevation), atol=1e-6)


def test_orders_come_in_their_order() -> None:
    first, second = ([a.name for a in plan_of(order).actions] for order in ORDERS[:2])
    assert first == ["hold", "move_object", "place", "hold"]
    assert second == ["hold", "place", "move_object", "hold"]


def test_simultaneous_is_quicker_and_overlaps() -> None:
    plan = plan_of("simultaneous")
    times = [plan_of(order).duration for order in ORDERS]
    assert times[2] < min(times[:2]) - 0.2
    counted = count_overlaps(plan.actions)
    assert counted["relocations_overlapping"] >= 0.3 * counted["relocations"]
    move = next(a for a in plan.actions if a.name == "move_object")
    assert [way.finger for way in move.ways] == [2]
    assert move.phases[0].touch[2] == MUST_NOT
    assert "travels" in move.why


def test_the_finger_arrives_with_the_object(hand: HandModel) -> None:
    """While the object moves the finger's share of its way follows the object's, from home to the hover over its contact."""
    plan = plan_of("simultaneous")
    reference = build_reference(plan)
    k = next(i for i, p in enumerate(reference.phases) if p.name == "move")
    move, approach = reference.phases[k], reference.phases[k + 1]
    assert move.postures is not None
    assert move.travelled(0.0) == 0.0
    assert move.travelled(move.duration) == pytest.approx(1.0)
    np.testing.assert_allclose(move.postures[0], hand.fingers[2].q_home)
    assert approach.X_OF is not None
    assert approach.normal_O is not None
    X_OF = approach.X_OF.copy()
    X_OF[:3, 3] += approach.gap_start * approach.normal_O
    end = move.object_path.sample(move.duration)[0]
    np.testing.assert_allclose(hand.fingers[2].pose_at(move.postures[-1]), end @ X_OF, atol=1e-6)


def test_travel_that_comes_too_near_is_not_handed_over(hand: HandModel) -> None:
    careful = replace(hand, limits=replace(hand.limits, clearance=0.05))
    plan = overlap_travel(careful, plan_of("object_first"))
    assert plan.statistics["relocations_overlapping"] == 0
    ways = [[[way.finger for way in a.ways] for a in p.actions] for p in (plan, plan_of("object_first"))]
    assert ways[0] == ways[1]


def test_plans_survive_saving(tmp_path: Path) -> None:
    plan = plan_of("simultaneous")
    path = tmp_path / "plan.json"
    plan.save(path)
    assert Plan.load(path).as_dict() == plan.as_dict()


def test_goal_contacts_beyond_reach_at_the_goal() -> None:
    plan = pipeline.plan(small("object_first", contacts_deg=[[60.0, 0.0], [200.0, 0.0], "free"]))
    assert plan.status == "goal_contacts_unreachable"
    assert "with the object at its goal" in plan.reason


def test_figure_5_asks_for_what_the_paper_shows() -> None:
    """Three radii, every goal contact at least 40 degrees from its start, a goal attitude at least 60 degrees away."""
    problem = load_problem("fig5_dextrous")
    assert sorted(problem.hand.tip_radii_m) == [0.014, 0.018, 0.022]
    assert isinstance(problem.start.contacts_deg, tuple)
    assert problem.goal.contacts_deg is not None
    pairs = zip(
        compute_contact_directions(problem.start.contacts_deg),
        compute_contact_directions(problem.goal.contacts_deg),
        strict=True,
    )
    for start, goal in pairs:
        assert start is not None
        assert goal is not None
        assert np.degrees(np.arccos(start @ goal)) >= 40.0
    assert problem.goal.orientation_wxyz is not None
    quat = np.array(problem.goal.orientation_wxyz)
    assert np.degrees(2.0 * np.arccos(abs(quat[0]) / np.linalg.norm(quat))) >= 60.0
