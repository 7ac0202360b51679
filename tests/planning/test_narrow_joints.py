"""Joints narrowed to next to nothing, objects out of reach, bases on one another: a plan or a status, never an exception."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.contacts.orbits import measure_roll_room
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem

CASES = Path(__file__).parents[1] / "cases"
HOLD: dict[str, object] = {"goal.rotation.angle_deg": 15.0, "gait.node_budget": 3, "gait.improvement": 0.0}


def plan_with(ranges: dict[str, list[float]], **changes: object) -> Plan:
    return pipeline.plan(
        load_problem("fig4_substitution", {**HOLD, "hand.joint_ranges_deg": ranges, **changes})
    )


def test_a_last_joint_without_room_is_a_start_out_of_reach() -> None:
    plan = pipeline.plan(load_problem(CASES / "joint6_narrow.toml"))
    assert plan.status == "start_unreachable"
    assert "finger_1.joint_6 has a range of 2.0 deg" in plan.reason
    assert "widen hand.joint_ranges_deg" in plan.reason


@pytest.mark.parametrize("joint", [4, 6])
def test_any_joint_may_be_locked(joint: int) -> None:
    plan = plan_with({f"finger_1.joint_{joint}": [-1.0, 1.0]})
    assert plan.status == "start_unreachable"
    assert (
        f"finger_1.joint_{joint} has a range of 2.0 deg, and a finger that holds keeps 5 deg" in plan.reason
    )


@pytest.mark.parametrize("limits", [[0.0, 10.0], [-6.0, 6.0]])
def test_narrow_last_joints_are_planned_or_refused(limits: list[float]) -> None:
    """Exactly twice the margin counts as none: whether one angle is left would be a matter of rounding."""
    plan = plan_with({"finger_1.joint_6": limits})
    assert plan.status in ("solved", "budget_exhausted", "no_gait", "start_unreachable")
    assert (plan.status == "start_unreachable") == (limits[1] - limits[0] <= 10.0)


@pytest.mark.parametrize("key", ["finger_3.joint_5"])
def test_a_free_finger_that_cannot_point_at_the_object_is_no_obstacle(key: str) -> None:
    """It waits wherever its joints allow; the pair that holds turns the object alone."""
    plan = plan_with({key: [30.0, 45.0]}, **{"goal.rotation.angle_deg": 10.0})
    assert plan.is_solved, plan.reason


def test_no_finger_reaches_and_each_says_why() -> None:
    wrists = {f"finger_{f}.joint_{j}": [-1.0, 1.0] for f in (1, 2, 3) for j in (4, 5)}
    plan = plan_with(wrists, **{"start.contacts_deg": "auto"})
    assert plan.status == "start_unreachable"
    assert "finger_1, finger_2 and finger_3 can touch it nowhere" in plan.reason
    assert "finger_2.joint_4 has a range of 2.0 deg" in plan.reason


@pytest.mark.parametrize("start", ["auto", [[-38.0, 0.0], [102.0, 0.0], "free"]])
@pytest.mark.parametrize("radius", [0.005, 0.15, 1.0])
def test_objects_too_large_or_too_small_get_a_status(radius: float, start: object) -> None:
    plan = plan_with({}, **{"object.radius_m": radius, "start.contacts_deg": start})
    assert plan.is_solved or plan.reason
    if radius == 1.0:
        assert plan.status in ("start_unreachable", "no_force_closure_pair", "blocked")


@pytest.mark.parametrize("name", ["ball_r75", "ball_r90"])
def test_large_balls_within_reach_are_turned(name: str) -> None:
    """At the usual home the fingers would meet themselves, or not be at all: they wait a little nearer, or aside."""
    plan = pipeline.plan(load_problem(CASES / f"{name}.toml", {"gait.improvement": 0.0}))
    assert plan.is_solved, plan.reason


def test_fingers_on_one_base_get_a_status() -> None:
    plan = pipeline.plan(load_problem(CASES / "same_base.toml", {"gait.node_budget": 3}))
    assert not plan.is_solved
    assert plan.reason


@pytest.mark.parametrize("degrees", [0.0, 9.0, 10.0, 350.0])
def test_roll_room_of_a_last_joint(degrees: float) -> None:
    chain = pipeline.build_scene(load_problem("fig4_substitution")).fingers[0].chain
    upper = chain.upper.copy()
    upper[-1] = chain.lower[-1] + np.radians(degrees)
    room = measure_roll_room(replace(chain, upper=upper), float(np.radians(5.0)))
    assert room == pytest.approx(np.radians(degrees - 10.0) if degrees > 10.0 else -1.0, abs=1e-9)
