"""Random shifts of the object, with and without turns: planned, and refusals held against brute force."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from dexplan import pipeline
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.regions.sampling import sample_start
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.problem import GoalSection, Problem, Rotation, StartSection, compute_contact_directions
from dexplan.sim.judge.validate import ValidationReport
from dexplan.spatial import Array, rotate_about
from dexplan.witness.adjustments import as_azimuth_elevation
from dexplan.witness.brute_force import Journey, find_hold

Kind = Literal["shift", "shift and turn"]
FURTHEST = 0.040
"""Shifts are drawn from a cube that reaches this far along every axis [m]."""
TURN_DEG = 90.0
"""Turns are drawn up to this far either way."""
STEP, TURN_STEP = 0.0025, float(np.radians(4.0))
"""Spacing of the poses through which brute force takes the object [m, rad]."""


@dataclass(frozen=True, eq=False)
class Question:
    """A problem with a random goal, and a start that is given, random, or left to the planner."""

    number: int
    kind: Kind
    problem: Problem


@dataclass(frozen=True, eq=False)
class Attempt:
    """A question, its plan, and the processor time that planning took [s]."""

    question: Question
    plan: Plan
    planning_s: float


def draw_questions(
    problem: Problem, kind: Kind, count: int, seed: int, furthest: float = FURTHEST
) -> Iterator[Question]:
    """Yield ``count`` questions, each with a seed of its own, ``seed`` and on; shifts reach ``furthest`` [m] along every axis.

    Starts take turns: that of ``problem``, contacts drawn by reach and force closure alone, and "auto".
    """
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    for number in range(seed, seed + count):
        rng = np.random.default_rng(number)
        shift = tuple(float(x) for x in rng.uniform(-furthest, furthest, 3))
        axis, angle = rng.normal(size=3), float(rng.uniform(-TURN_DEG, TURN_DEG))
        turn = Rotation(tuple(axis / np.linalg.norm(axis)), angle if kind == "shift and turn" else 0.0)
        drawn = sample_start(hand, rng)
        start = problem.start
        if number % 3 == 1:
            contacts = tuple("free" if n is None else as_azimuth_elevation(n) for n in drawn)
            start = StartSection(contacts_deg=contacts)  # type: ignore[arg-type]
        elif number % 3 == 2:
            start = StartSection("auto")
        name = f"{problem.name}_{kind.replace(' ', '_')}_{number}"
        goal = GoalSection(rotation=turn, translation_m=shift)  # type: ignore[arg-type]
        yield Question(number, kind, replace(problem, name=name, start=start, goal=goal))


def attempt(question: Question) -> Attempt:
    """Plan a question."""
    begun = time.process_time()
    plan = pipeline.plan(question.problem)
    return Attempt(question, plan, time.process_time() - begun)


def carry_out(done: Attempt) -> ValidationReport:
    """Run an attempt's plan in the simulator; return the validator's judgement."""
    problem = done.question.problem
    return pipeline.validate(problem, done.plan, pipeline.rollout(problem, done.plan))


@dataclass(frozen=True)
class Verdict:
    """What brute force says of a refusal: whether it agrees, and what it found or looked at."""

    agrees: bool
    why: str


def judge_refusal(done: Attempt) -> Verdict:
    """Return whether brute force agrees with a plan's refusal."""
    problem, plan = done.question.problem, done.plan
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    contacts = problem.start.contacts_deg
    start = None if isinstance(contacts, str) else compute_contact_directions(contacts)
    judge = Admissibility(hand)
    if start is not None and not Journey(hand, plan.X_WO_start[None], start).begins:
        return Verdict(plan.status.is_about_start or plan.status is Status.BLOCKED, "the start does not hold")
    if plan.status.is_about_start or plan.status is Status.BLOCKED:
        return Verdict(False, "the start holds")
    held = find_hold(hand, plan.X_WO_goal, judge)
    if held is None:
        return Verdict(True, "nothing holds at the goal")
    named = ", ".join(f"finger {f + 1} at {np.round(1e3 * p, 1).tolist()} mm" for f, p in held)
    if plan.status in (Status.GOAL_UNREACHABLE, Status.NO_FORCE_CLOSURE_PAIR):
        return Verdict(False, f"at the goal hold {named}")
    looked_at = []
    for poses in list_ways(problem, plan.X_WO_start):
        journey = Journey(hand, poses, start)
        found, is_all = journey.run()
        if found:
            return Verdict(False, f"there is a gait ({journey.looked_at} grasps looked at)")
        looked_at.append(f"{journey.looked_at}{'' if is_all else ' and not all'}")
    return Verdict(True, f"no gait on the straight ways ({', '.join(looked_at)} grasps looked at)")


def list_ways(problem: Problem, X_WO_start: Array) -> list[Array]:
    """Return the poses (K, 4, 4) along which brute force takes the object: the turn first, and the shift first."""
    assert problem.goal.rotation is not None
    axis, angle = np.array(problem.goal.rotation.axis), np.radians(problem.goal.rotation.angle_deg)
    shift = np.array(problem.goal.translation_m)
    turns = np.linspace(0.0, angle, 1 + int(np.ceil(abs(angle) / TURN_STEP)))
    shares = np.linspace(0.0, 1.0, 1 + int(np.ceil(np.linalg.norm(shift) / STEP)))
    ways = []
    for order in ("turn first", "shift first")[: 2 if len(turns) > 1 else 1]:
        both = [(turn, 0.0) for turn in turns] + [(angle, share) for share in shares[1:]]
        if order == "shift first":
            both = [(0.0, share) for share in shares] + [(turn, 1.0) for turn in turns[1:]]
        poses = np.tile(X_WO_start, (len(both), 1, 1))
        for pose, (turn, share) in zip(poses, both, strict=True):
            pose[:3, :3] = rotate_about(axis, turn) @ pose[:3, :3]
            pose[:3, 3] += share * shift
        ways.append(poses)
    return ways


def record(done: Attempt, verdict: Verdict | None = None) -> dict[str, Any]:
    """Return an attempt as one line of a file."""
    goal, start = done.question.problem.goal, done.question.problem.start.contacts_deg
    assert goal.rotation is not None
    row = {
        "number": done.question.number,
        "kind": done.question.kind,
        "start": start,
        "shift_mm": [1e3 * x for x in goal.translation_m],
        "axis": goal.rotation.axis,
        "angle_deg": goal.rotation.angle_deg,
        "status": done.plan.status,
        "reason": done.plan.reason,
        "planning_s": round(done.planning_s, 3),
        "nodes": done.plan.statistics.get("nodes"),
    }
    if verdict is not None:
        row |= {"agrees": verdict.agrees, "brute_force": verdict.why}
    return row
