"""Contacts in two opposite cones only: one pair of force-closure regions is enough to turn on [paper §2.2]."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.grasp.closed_forms.pair import check_sphere_pair
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem


def turn(angle_deg: float, **changes: object) -> Problem:
    return load_problem("one_pair", {"goal.rotation.angle_deg": angle_deg, **changes})


def find_outside(problem: Problem, plan: Plan) -> list[float]:
    """Return by how much [deg] every contact of the plan misses the nearest allowed cone, where it does."""
    missed = []
    for action in plan.actions:
        for contact in action.contacts_end:
            if contact is not None:
                off = [
                    float(np.degrees(np.arccos(np.clip(contact.normal_O @ np.array(cone.axis), -1.0, 1.0))))
                    - cone.half_angle_deg
                    for cone in problem.object.allowed_regions
                ]
                missed += [min(off)] if min(off) > 1e-9 else []
    return missed


@pytest.fixture(scope="module")
def problem() -> Problem:
    return turn(200.0)


@pytest.fixture(scope="module")
def plan(problem: Problem) -> Plan:
    return pipeline.plan(problem)


def test_ball_turns_on_one_pair_of_regions(problem: Problem, plan: Plan) -> None:
    assert plan.is_solved, plan.reason
    assert sum(action.name == "place" for action in plan.actions) >= 2
    assert find_outside(problem, plan) == []


def test_without_the_regions_other_contacts_are_used(problem: Problem) -> None:
    """The regions are what keeps the contacts inside: the same turn without them strays."""
    free = pipeline.plan(turn(200.0, **{"object.allowed_regions": []}))
    assert free.is_solved
    assert find_outside(problem, free)


def test_any_point_of_one_cone_holds_with_any_of_the_other(problem: Problem) -> None:
    """[paper §3, result 1] for the cones of the problem and the believed friction."""
    rng = np.random.default_rng(0)
    half, mu = np.radians(problem.object.allowed_regions[0].half_angle_deg), problem.friction.believed_sliding
    turns, leans = rng.uniform(0.0, 2.0 * np.pi, (2, 200)), half * np.sqrt(rng.uniform(0.9, 1.0, (2, 200)))
    x = np.stack([np.cos(leans), np.sin(leans) * np.cos(turns), np.sin(leans) * np.sin(turns)], axis=-1)
    assert all(check_sphere_pair(a, -b, mu).is_closed for a, b in zip(*x, strict=True))


def test_start_outside_is_refused_by_name() -> None:
    plan = pipeline.plan(turn(90.0, **{"start.contacts_deg": [[-38.0, 0.0], [102.0, 0.0], "free"]}))
    assert plan.status == "start_not_allowed"
    assert "finger_1 lies outside object.allowed_regions" in plan.reason


def test_regions_that_no_pair_can_use_are_an_honest_no() -> None:
    """Both cones on one side of the ball hold nothing."""
    cones = [
        {"axis": [1.0, 0.0, 0.0], "half_angle_deg": 20.0},
        {"axis": [1.0, 0.3, 0.0], "half_angle_deg": 20.0},
    ]
    plan = pipeline.plan(turn(90.0, **{"object.allowed_regions": cones}))
    assert plan.status == "no_force_closure_pair"
