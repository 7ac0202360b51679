"""Goal contacts that cannot be: the status, the first violated condition, and a cure that belongs to it."""

from __future__ import annotations

from typing import Any

import pytest

from dexplan import pipeline
from dexplan.planning.tasks.goal_refusals import suggest_cure
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.problems.read import load_problem

PAIR = [[-38.0, 0.0], [102.0, 0.0], "free"]
RING = [[0.0, 0.0], [120.0, 0.0], [240.0, 0.0]]
SHELF = {"obstacles": [{"kind": "box", "pos_m": [0.0, 0.0, 0.108], "size_m": [0.06, 0.06, 0.004]}]}


def adjust(contacts: list[Any], start: list[Any] = PAIR, *, keep: bool = False) -> dict[str, Any]:
    goal = {"kind": "grasp_adjustment", "contacts_deg": contacts, "keep_object": keep}
    return {"start.contacts_deg": start, "goal": goal}


def dextrous(contacts: list[Any], **goal: Any) -> dict[str, Any]:
    return {
        "start.contacts_deg": PAIR,
        "goal": {"kind": "dextrous_manipulation", "contacts_deg": contacts, **goal},
    }


CASES: dict[str, tuple[dict[str, Any], str, str, str]] = {
    "out of reach, the object stays": (
        adjust([[80.0, 0.0], [220.0, 0.0], "free"], keep=True),
        "goal_contacts_unreachable", "finger_1 and finger_2 cannot reach", "goal.keep_object = false",
    ),
    "out of reach at the goal": (
        dextrous([[60.0, 0.0], [200.0, 0.0], "free"], rotation={"axis": [0, 0, 1], "angle_deg": 24.0}),
        "goal_contacts_unreachable", "with the object at its goal", "choose another attitude",
    ),
    "two tips in one place": (
        adjust([[0.0, 0.0], [8.0, 0.0], [185.0, 0.0]]),
        "goal_grasp_inadmissible", "the tips of finger_1 and finger_2 would come within", "move the two contacts apart",
    ),
    "no force closure": (
        adjust([[0.0, 0.0], [90.0, 0.0], "free"]),
        "goal_grasp_inadmissible", "not force closed", "raise the friction",
    ),
    "not allowed there": (
        {**adjust([[15.0, 20.0], [155.0, -20.0], "free"]),
         "object.allowed_regions": [{"axis": [0.0, 0.0, -1.0], "half_angle_deg": 95.0}]},
        "goal_not_allowed", "the goal contact of finger_1 lies outside object.allowed_regions", "widen a region",
    ),
    "down into a shelf": (
        {**dextrous([*PAIR[:2], [215.0, 0.0]], translation_m=[0.0, 0.0, -0.016]), **SHELF},
        "goal_grasp_inadmissible", "object/surface and obstacle_1 come within", "move or shrink what is in the way",
    ),
    "down into a shelf without goal contacts": (
        {"start.contacts_deg": PAIR, "goal": {"translation_m": [0.0, 0.0, -0.016]}, **SHELF},
        "goal_unreachable", "object/surface and obstacle_1 would come within", "move or shrink what is in the way",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_reason_is_true_and_has_its_cure(case: str) -> None:
    assignments, status, reason, cure = CASES[case]
    plan = pipeline.plan(load_problem("hold_two", assignments))
    assert plan.status == status, plan.reason
    assert reason in plan.reason
    assert cure in plan.reason.split(";", 1)[1]
    assert plan.actions == ()


def test_a_ring_upside_down_is_reached_by_turning_the_object_over() -> None:
    """Fingers 2 and 3 exchanged: against the clockwise order on the object as it is, with it on an object turned over."""
    plan = pipeline.plan(load_problem("hold_two", adjust([RING[0], RING[2], RING[1]], RING)))
    assert plan.is_solved, plan.reason
    assert plan.X_WO_goal[2, 2] < -0.5
    refused = pipeline.plan(load_problem("hold_two", adjust([RING[0], RING[2], RING[1]], RING, keep=True)))
    assert refused.status == "goal_contacts_unreachable"


@pytest.mark.parametrize(
    ("refusal", "word"),
    [
        (Refusal(RefusalKind.NEAR_STANDING, ("finger_1/tip", "obstacle_1"), 0.0012), "shrink"),
        (Refusal(RefusalKind.NEAR_FINGER, ("finger_1/tip", "finger_2/tip")), "apart"),
        (
            Refusal(RefusalKind.NEAR_ITSELF, ("finger_2/link_2", "finger_2/link_4"), -0.0006),
            "of this finger towards where it stands",
        ),
        (Refusal(RefusalKind.JOINT_LIMIT, ("finger_1",), 0.03), "towards where the fingers stand"),
        (Refusal(RefusalKind.OUT_OF_REACH, ("finger_3",)), "towards where the fingers stand"),
        (Refusal(RefusalKind.LOAD), "friction"),
    ],
)
def test_cures_belong_to_refusals(refusal: Refusal, word: str) -> None:
    """What a refusal follows from decides, however many others were made of it."""
    on_way = Refusal(RefusalKind.ON_WAY, because=(refusal,))
    whole = Refusal(RefusalKind.CANNOT_TAKE_GOAL, ("finger_1",), because=(on_way,))
    for one in (refusal, on_way, whole):
        assert word in suggest_cure(one).text
        assert not suggest_cure(one).is_checked
