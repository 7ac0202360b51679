"""Hands of two to five fingers of the usual kind, evenly around a ball: the planner counts none of them."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.tasks.by_shape import plan_gait
from dexplan.plans.actions import count_placements
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem
from dexplan.scene.library import load_scene

VERTICAL = np.array([0.0, 0.0, 1.0])


def turn(fingers: int, angle_deg: float) -> Plan:
    """Return a plan for a turn about the vertical, the start free to choose."""
    around = tuple(360.0 * k / fingers for k in range(fingers))
    scene = load_scene(tip_radii=(0.014,) * fingers, base_azimuths_deg=around)
    hand = pipeline.build_hand(load_problem("hold_two"), scene)
    goal = RotationGoal(hand.object.X_WO_home, VERTICAL, float(np.radians(angle_deg)))
    return plan_gait(hand, goal, None, 2000)


@pytest.mark.parametrize("fingers", [2, 3, 4, 5])
def test_any_number_of_fingers_plans_a_turn(fingers: int) -> None:
    plan = turn(fingers, 75.0)
    assert plan.is_solved, plan.reason
    assert len(plan.fingers) == fingers


def test_two_fingers_cannot_gait_and_are_told_why() -> None:
    plan = turn(2, 200.0)
    assert plan.status == "no_gait"
    assert "no finger is free" in plan.reason


@pytest.mark.parametrize("angle_deg", [270.0, 540.0])
def test_four_fingers_put_down_fewer_than_three(angle_deg: float) -> None:
    """Each reaches 50 degrees to either side and more."""
    three, four = (turn(fingers, angle_deg) for fingers in (3, 4))
    assert three.is_solved, three.reason
    assert four.is_solved, four.reason
    assert count_placements(four.actions) < count_placements(three.actions)
