"""Shifts towards a finger: the finger that holds is not at home, so that nothing is in the object's way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.problems.read import build_problem, load_problem

CASES = Path(__file__).resolve().parents[1] / "cases"
PAIR = [[-38.0, 0.0], [102.0, 0.0], "free"]


def shift(x: float, y: float, z: float, start: object = PAIR, **more: object) -> Plan:
    """Plan a shift by (x, y, z) mm."""
    goal = {"translation_m": [1e-3 * x, 1e-3 * y, 1e-3 * z]}
    return pipeline.plan(
        build_problem({"format": 1, "name": "shift", "start": {"contacts_deg": start}, "goal": goal, **more})
    )


@pytest.mark.parametrize("name", ["shift_x30", "rgmc_corner"])
def test_shifts_that_were_refused_are_planned(name: str) -> None:
    problem = load_problem(CASES / f"{name}.toml")
    plan = pipeline.plan(problem)
    assert plan.is_solved, plan.reason
    moved = plan.X_WO_goal[:3, 3] - plan.X_WO_start[:3, 3]
    assert np.allclose(moved, problem.goal.translation_m)
    assert np.allclose(plan.actions[-1].X_WO_end, plan.X_WO_goal)


@pytest.mark.parametrize(
    ("x", "y", "z", "start"),
    [
        (40.0, 0.0, 0.0, PAIR),
        (-18.0, -31.2, 0.0, "auto"),  # towards finger 3
        (-17.0, 29.4, 12.0, [[22.0, 0.0], "free", [-118.0, 0.0]]),
    ],
)
def test_towards_each_finger(x: float, y: float, z: float, start: object) -> None:
    plan = shift(x, y, z, start)
    assert plan.is_solved, plan.reason


def test_no_state_of_the_plan_has_a_free_finger_in_the_way() -> None:
    """Free fingers stay at home: wherever the object is taken, whoever does not hold is clear of it."""
    problem = load_problem(CASES / "shift_x30.toml")
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    plan = pipeline.plan(problem)
    for action in plan.actions:
        held = {c.finger: c for c in action.contacts_end if c is not None}
        q = hand.q_home.copy()
        for f, contact in held.items():
            q[f] = contact.q
        clearance, names = hand.probe.compute_clearance(q, action.X_WO_end, tuple(held))
        assert clearance >= hand.limits.clearance, names


def test_out_of_everybodys_reach_is_said_so() -> None:
    plan = shift(0.0, 300.0, 0.0)
    assert plan.status == "goal_unreachable"
    assert "it lies outside their workspaces" in plan.reason
    assert "shorten goal.translation_m" in plan.reason
