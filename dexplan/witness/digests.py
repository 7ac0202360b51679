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
from dexplan.plans.plan import Plan
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
    return dict(sorted(Counter(action.kind for action in plan.actions).items()))


def compute_hash(plan: Plan) -> str:
    """Return the SHA-256 of a plan as JSON, the search's statistics left out: every bit of every number counts."""
    data = {name: value for name, value in plan.as_dict().items() if name != "statistics"}
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
