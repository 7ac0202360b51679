"""Fingerprints of plans: does a change of the code leave every plan as it is, bit for bit?

The questions: the built-in problems, random attitudes from random starts, random goal grasps, and goals that are refused.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from dexplan import pipeline
from dexplan.plans.actions import Action, Relocate
from dexplan.plans.contacts import Contacts
from dexplan.plans.plan import Plan
from dexplan.plans.poses import write_pose
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem, list_problems, load_problem
from dexplan.witness import adjustments, attitudes

ATTITUDES, GRASPS = 60, 20
SEED = 7000
"""Random questions are drawn from here on."""

START = {"contacts_deg": [[-38.0, 0.0], [102.0, 0.0], "free"]}
TURN = {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 90.0}}


def _adjust(*contacts: list[float]) -> dict[str, Any]:
    """Return the changes that ask for goal contacts, azimuth and elevation [deg], one per finger."""
    return {"start": START, "goal": {"kind": "grasp_adjustment", "contacts_deg": list(contacts)}}


REFUSED: dict[str, dict[str, Any]] = {
    "too slippery": {"goal": TURN, "friction": {"sliding": 0.08, "torsional_m": 0.0002}},
    "slippery from a start": {"start": START, "goal": TURN, "friction": {"sliding": 0.3, "torsional_m": 0.001}},
    "too heavy": {"goal": TURN, "object": {"mass_kg": 3.0}},
    "heavy from a start": {"start": START, "goal": TURN, "object": {"mass_kg": 1.0}},
    "too large": {"goal": TURN, "object": {"radius_m": 0.11}},
    "too light": {"goal": TURN, "object": {"mass_kg": 0.0008}},
    "start too near": {"start": {"contacts_deg": [[-38.0, 0.0], [60.0, 0.0], "free"]}, "goal": TURN},
    "start out of reach": {"start": {"contacts_deg": [[180.0, 0.0], [0.0, 0.0], "free"]}, "goal": TURN},
    "start on the wrong side": {"start": {"contacts_deg": [[102.0, 0.0], [-38.0, 0.0], "free"]}, "goal": TURN},
    "start above": {"start": {"contacts_deg": [[0.0, 90.0], [0.0, -90.0], "free"]}, "goal": TURN},
    "shift too far": {"start": START, "goal": {"translation_m": [0.2, 0.0, 0.0]}},
    "shift too high": {"goal": {"translation_m": [0.0, 0.0, 0.3]}},
    "shift into the floor": {"goal": {"translation_m": [0.0, 0.0, -0.15]}},
    "box in the object": {"goal": TURN, "obstacles": [{"kind": "box", "pos_m": [0.0, 0.0, 0.16], "size_m": [0.01] * 3}]},
    "box at a base": {"goal": TURN, "obstacles": [{"kind": "box", "pos_m": [0.18, 0.0, 0.21], "size_m": [0.01] * 3}]},
    "same base": {"goal": TURN, "hand": {"base_azimuths_deg": [0.0, 0.0, 180.0]}},
    "few nodes": {"start": START, "goal": {"rotation": {"axis": [0, 0, 1], "angle_deg": 720.0}}, "gait": {"node_budget": 3}},
    "goal contacts below": _adjust([0.0, -80.0], [120.0, -80.0], [240.0, -80.0]),
    "goal contacts not closed": _adjust([0.0, 0.0], [70.0, 0.0], [140.0, 0.0]),
    "goal contacts swapped": _adjust([180.0, 0.0], [-60.0, -40.0], [60.0, -40.0]),
}  # fmt: skip
"""Goals that are refused, each for another reason, as changes of a problem file."""


@dataclass(frozen=True, eq=False)
class PlanQuestion:
    """A question whose plan is fingerprinted; ``kind`` says where it comes from, ``number`` which of them it is."""

    key: str
    kind: str
    number: int = 0


def list_questions() -> Iterator[PlanQuestion]:
    """Yield all questions."""
    for name in list_problems():
        yield PlanQuestion(name, "builtin")
    for number in range(ATTITUDES):
        yield PlanQuestion(f"attitude {number}", "attitude", number)
    for number in range(GRASPS):
        yield PlanQuestion(f"goal grasp {number}", "grasp", number)
    for name in REFUSED:
        yield PlanQuestion(f"refused: {name}", "refused")


def pose(question: PlanQuestion) -> Problem:
    """Return the problem that a question asks."""
    if question.kind == "builtin":
        return load_problem(question.key)
    if question.kind == "refused":
        name = question.key.removeprefix("refused: ")
        return build_problem({"format": 1, "name": name.replace(" ", "_"), **REFUSED[name]})
    if question.kind == "attitude":
        problem = load_problem("any_attitude")
        hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
        drawn = next(attitudes.draw_questions(hand, 1, SEED + question.number))
        return drawn.as_problem(problem)
    drawn_grasp = next(adjustments.draw_questions(load_problem("fig5_dextrous"), 1, SEED + question.number))
    return drawn_grasp.as_problem("grasp_adjustment")


def fingerprint(question: PlanQuestion) -> dict[str, Any]:
    """Return the row of a question: status, actions by kind, and a hash of all of the plan but the counts of its search."""
    plan = pipeline.plan(pose(question))
    return {
        "key": question.key,
        "status": str(plan.status),
        "kinds": count_kinds(plan),
        "hash": compute_hash(plan),
    }


def count_kinds(plan: Plan) -> dict[str, int]:
    """Return how many actions of each kind a plan has."""
    return dict(sorted(Counter(action.name for action in plan.actions).items()))


def compute_hash(plan: Plan) -> str:
    """Return the SHA-256 of what is compared, the search's statistics left out: every bit of every number counts."""
    return hashlib.sha256(json.dumps(as_compared(plan), sort_keys=True).encode()).hexdigest()


def as_compared(plan: Plan) -> dict[str, Any]:
    """Return what of a plan is compared, as data that does not change when the format of ``plan.json`` does.

    It is what a plan file of format 1 held: actions, contacts, detours, margins and the speed that is reached.  Arcs and
    durations follow from these; they are looked at by the tests of the plan and of the reference.
    """
    names = plan.fingers
    whole = plan.as_dict()
    goal = whole["goal"]
    return {
        "format": 1,
        **{name: whole[name] for name in ("status", "reason", "fingers", "speed")},
        **{f"normal_{name}_N": whole[f"normal_{name}_N"] for name in ("force", "floor", "ceiling")},
        "start": {**whole["start"], "contacts": _compare_contacts(names, plan.start_contacts)},
        "goal": goal,
        "actions": [
            _compare_action(names, action, written)
            for action, written in zip(plan.actions, whole["actions"], strict=True)
        ],
    }


def _compare_action(names: tuple[str, ...], action: Action, written: dict[str, Any]) -> dict[str, Any]:
    """Return what of an action is compared; ``written`` is the action in the plan file."""
    same = ("index", "kind", "grasping", "limiting_finger", "limit", "why", "rotation", "margins")
    finger = action.finger if isinstance(action, Relocate) else next((w.finger for w in action.ways), None)
    detour = next((way for way in action.ways if way.is_detour), None)
    return {
        **{name: written[name] for name in same},
        "finger": None if finger is None else names[finger],
        "object_pose_start": write_pose(action.X_WO_start),
        "object_pose_end": write_pose(action.X_WO_end),
        "contacts_end": _compare_contacts(names, action.contacts_end),
        "rolls": written.get("rolls", []),
        **({} if detour is None else {"way": detour.postures.tolist()}),
        "phases": [{"name": p["name"], "touch": p["touch"]} for p in written["phases"]],
    }


def _compare_contacts(names: tuple[str, ...], contacts: Contacts) -> dict[str, Any]:
    return {
        name: None
        if c is None
        else {
            "point_O": c.point_O.tolist(),
            "normal_O": c.normal_O.tolist(),
            "X_OF": c.X_OF.tolist(),
            "q": c.q.tolist(),
        }
        for name, c in zip(names, contacts, strict=True)
    }
