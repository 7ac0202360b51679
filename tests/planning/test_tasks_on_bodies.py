"""Tasks on bodies other than balls: what the problem allows is all that the plan uses, and what it asks for is done."""

from __future__ import annotations

from typing import Any

import numpy as np

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem

EGG = {"kind": "ellipsoid", "semi_axes_m": [0.03, 0.03, 0.04]}
CUBE = {"kind": "box", "half_sizes_m": [0.03, 0.03, 0.03]}
TURN = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 30.0}}


def ask(shape: dict[str, Any], **sections: dict[str, Any]) -> Problem:
    """Return a problem with an object of ``shape`` and the given sections."""
    data = {"object": {"shape": shape, "mass_kg": 0.1}, "hand": {"tip_radii_m": [0.012] * 3}, **sections}
    return build_problem({"format": 1, "name": "body", **data})


def turn(shape: dict[str, Any], primitives: list[str], angle: float, **sections: dict[str, Any]) -> Plan:
    goal = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": angle}}
    return pipeline.plan(ask(shape, goal=goal, gait={"primitives": primitives}, **sections))


def test_three_fixed_contacts_carry_an_egg() -> None:
    start = {"contacts_deg": [[0.0, 5.0], [120.0, 5.0], [240.0, 5.0]]}
    plan = turn(EGG, [], 30.0, start=start)
    assert plan.is_solved, plan.reason
    assert [a.name for a in plan.actions] == ["hold", "move_object", "hold"]
    assert plan.actions[1].grasping == (0, 1, 2)
    np.testing.assert_allclose(plan.actions[-1].X_WO_end, plan.X_WO_goal, atol=1e-12)


def test_the_pair_that_is_chosen_takes_a_cube_there_without_regrasp() -> None:
    """The least strained pair comes to a singular posture after 15 degrees."""
    plan = turn(CUBE, [], 60.0)
    assert plan.is_solved, plan.reason
    assert [a.name for a in plan.actions] == ["hold", "move_object", "hold"]


def test_beyond_the_limit_of_fixed_contacts_is_a_truthful_no() -> None:
    plan = turn(CUBE, [], 150.0, start={"contacts_deg": [[0.0, 0.0], [180.0, 0.0], "free"]})
    assert plan.status is Status.LIMIT_REACHED
    assert 'allow "substitution" or "rewind" in gait.primitives' in plan.reason
    assert plan.actions[1].limiting_finger is not None


def test_rewinds_alone_turn_an_egg_with_one_pair() -> None:
    plan = turn(EGG, ["rewind"], 160.0)
    assert plan.is_solved, plan.reason
    moves = [k for k, a in enumerate(plan.actions) if a.name == "move_object"]
    pairs = {plan.actions[k].grasping for k in moves}
    assert len(moves) >= 2
    assert len(pairs) == 1
    assert len(next(iter(pairs))) == 2
    between = [a for a in plan.actions[moves[0] + 1 : moves[-1]] if a.name in ("place", "lift")]
    assert between
    assert all(a.why.startswith("finger rewind: ") for a in between)


def test_a_turn_that_one_pair_can_make_needs_no_rewind() -> None:
    plan = turn(EGG, ["rewind"], 20.0)
    assert [a.name for a in plan.actions] == ["hold", "move_object", "hold"], plan.reason
