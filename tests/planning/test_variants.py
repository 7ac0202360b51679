"""Other hands, other names, the other way round: a different plan each time, and every one stands a second opinion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from recheck import Recheck

from dexplan import pipeline
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem, Rotation, StartSection


def vary(problem: Problem, name: str) -> Problem:
    """Return the variant ``name`` of the full turn."""
    hand = problem.hand
    if name == "bases moved":
        return replace(problem, hand=replace(hand, base_azimuths_deg=(0.0, 110.0, 235.0)))
    if name == "range halved":
        # The half that the full turn needs least of: a symmetric half would leave the plan as it is.
        return replace(problem, hand=replace(hand, joint_ranges_deg={"finger_1.joint_1": (0.0, 85.9)}))
    if name == "renumbered":
        return replace(
            problem,
            hand=replace(hand, base_azimuths_deg=(120.0, 0.0, 240.0)),
            start=StartSection(((102.0, 0.0), (-38.0, 0.0), "free")),
        )
    if name == "axis reversed":
        return replace(problem, goal=replace(problem.goal, rotation=Rotation((0.0, 0.0, -1.0), 360.0)))
    assert name == "chosen start"
    return replace(problem, start=StartSection("auto"))


VARIANTS = ("bases moved", "range halved", "renumbered", "axis reversed", "chosen start")


def test_full_turn_stands_a_second_opinion(hand: HandModel, full_turn: Plan) -> None:
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


def test_second_opinion_catches_a_tampered_plan(hand: HandModel, full_turn: Plan) -> None:
    def find_faults(**changes: Any) -> str:
        return "; ".join(Recheck(hand, replace(full_turn, **changes)).faults)

    hold, move, place, lift = full_turn.actions[:4]
    assert (hold.name, move.name, place.name, lift.name) == ("hold", "move_object", "place", "lift")
    assert find_faults(actions=(hold, move, place)) == ""

    further = replace(move.motion, angle=move.motion.angle + np.radians(4.0))
    assert "begins elsewhere" in find_faults(actions=(hold, replace(move, motion=further), place))
    assert "begins elsewhere" in find_faults(actions=(hold, place))
    assert "ends with other contacts" in find_faults(actions=(hold, replace(move, contacts_end=(None,) * 3)))
    wrong = replace(place, grasping=(0, 1, 2))
    assert "names other fingers" in find_faults(actions=(hold, move, wrong))

    first, *others = full_turn.start_contacts
    assert first is not None
    X_OF = first.X_OF.copy()
    X_OF[0, 3] += 1e-3
    assert "does not touch" in find_faults(start_contacts=(replace(first, X_OF=X_OF), *others), actions=())
    bent = replace(first, q=first.q + 0.01)
    assert "posture elsewhere" in find_faults(start_contacts=(bent, *others), actions=())
    gone = (None, *others)
    assert "carry the load" in find_faults(start_contacts=gone, actions=(hold,))
