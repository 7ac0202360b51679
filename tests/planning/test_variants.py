"""Other hands, other names, the other way round: a different plan each time, and every one stands a second opinion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recheck import Recheck

from dexplan import pipeline
from dexplan.planning.plan import Plan
from dexplan.problems.problem import Problem, Rotation, StartSection


def vary(problem: Problem, name: str) -> Problem:
    """Return the variant ``name`` of the full turn."""
    hand = problem.hand
    free = "free"
    if name == "bases moved":
        return replace(problem, hand=replace(hand, base_azimuths_deg=(0.0, 110.0, 235.0)))
    if name == "range halved":
        # The half that the full turn needs least of: a symmetric half would leave the plan as it is.
        return replace(problem, hand=replace(hand, joint_ranges_deg={"finger_1.joint_1": (0.0, 85.9)}))
    if name == "renumbered":
        return replace(
            problem,
            hand=replace(hand, base_azimuths_deg=(240.0, 0.0, 120.0)),
            start=StartSection((free, (-38.0, 0.0), (102.0, 0.0))),
        )
    if name == "mirrored names":
        return replace(
            problem,
            hand=replace(hand, base_azimuths_deg=(120.0, 0.0, 240.0)),
            start=StartSection(((102.0, 0.0), (-38.0, 0.0), free)),
        )
    if name == "axis reversed":
        return replace(problem, goal=replace(problem.goal, rotation=Rotation((0.0, 0.0, -1.0), 360.0)))
    assert name == "chosen start"
    return replace(problem, start=StartSection("auto"))


VARIANTS = ("bases moved", "range halved", "renumbered", "mirrored names", "axis reversed", "chosen start")


def test_full_turn_stands_a_second_opinion(problem: Problem, full_turn: Plan) -> None:
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    assert full_turn.is_solved
    assert Recheck(hand, full_turn).faults == []


@pytest.mark.parametrize("name", VARIANTS)
def test_variant_gets_a_different_and_valid_plan(problem: Problem, full_turn: Plan, name: str) -> None:
    variant = vary(problem, name)
    plan = pipeline.plan(variant)
    assert plan.is_solved, plan.reason
    assert plan.as_dict()["actions"] != full_turn.as_dict()["actions"]
    hand = pipeline.build_hand(variant, pipeline.build_scene(variant))
    assert Recheck(hand, plan).faults == []


def test_second_opinion_catches_a_tampered_plan(problem: Problem, full_turn: Plan) -> None:
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    actions = list(full_turn.actions)
    k = next(k for k, a in enumerate(actions) if a.kind == "move_object")

    longer = replace(actions[k], angle=actions[k].angle + np.radians(4.0))
    faults = Recheck(hand, replace(full_turn, actions=(*actions[:k], longer, *actions[k + 1 :]))).faults
    assert any("does not end where it says" in fault for fault in faults)

    # Without the lift that follows the first exchange the next turn is made by three.
    lift = next(k for k, a in enumerate(actions) if a.kind == "lift")
    faults = Recheck(hand, replace(full_turn, actions=(*actions[:lift], *actions[lift + 1 :]))).faults
    assert any("ends with other contacts" in fault for fault in faults)

    first = full_turn.start_contacts[0]
    assert first is not None
    moved = replace(first, X_OF=first.X_OF + 1e-3 * np.eye(4)[:, [3, 0, 1, 2]].T)
    start = (moved, *full_turn.start_contacts[1:])
    assert any("does not touch" in f for f in Recheck(hand, replace(full_turn, start_contacts=start)).faults)
