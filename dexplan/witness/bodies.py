"""Random attitudes from random starts on any convex body: what the planner answers, and what brute force says of a refusal.

Questions are drawn without asking the planner: attitudes uniform over all rotations, start contacts uniform in direction among
those that two fingers reach, whose chord lies inside both cones, and that hold the object as far as one state can tell.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.contact.bodies.sites import EDGE_BAND, Sites
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.sampling import sample_attitude
from dexplan.plans.actions import count_placements
from dexplan.plans.plan import Plan
from dexplan.problems.problem import GoalSection, Problem, StartSection
from dexplan.sim.judge.validate import ValidationReport
from dexplan.spatial import VERTICAL, Array, as_pose7, rotate_about
from dexplan.witness.adjustments import as_azimuth_elevation
from dexplan.witness.brute_force import Journey, Touch, find_hold

DRAWN = 60
"""Directions drawn at a time for start contacts."""
STEP = float(np.radians(7.5))
"""The object's turn from pose to pose, all of which are judged; fingers are put elsewhere at every second, each 15 deg."""
STATES = 3000
"""Grasps that are looked at on one way."""


@dataclass(frozen=True, eq=False)
class Question:
    """Take the object from two contacts to an attitude ``R_WO`` (3, 3); ``number`` is the seed that it was drawn from.

    ``start``: per finger the direction (3,) from the object's origin to its contact, in W, None for a free finger.
    """

    number: int
    problem: Problem
    start: tuple[Array | None, ...]
    R_WO: Array

    __repr__ = brief_repr

    @property
    def key(self) -> str:
        """The name of the question among those about its problem."""
        return f"{self.problem.name}_{self.number}"

    @property
    def turn(self) -> Rotation:
        """The shortest turn from the start to the attitude asked for; objects start with their axes those of the world."""
        return Rotation.from_matrix(self.R_WO)

    def as_problem(self) -> Problem:
        """Return the question as a problem."""
        contacts = tuple("free" if d is None else as_azimuth_elevation(d) for d in self.start)
        X_WO = np.eye(4)
        X_WO[:3, :3] = self.R_WO
        return replace(
            self.problem,
            name=self.key,
            start=StartSection(contacts_deg=contacts),  # type: ignore[arg-type]
            goal=GoalSection(orientation_wxyz=tuple(as_pose7(X_WO)[3:].tolist())),
        )


@dataclass(frozen=True, eq=False)
class Attempt:
    """A question, its plan, and the processor time that planning took [s]."""

    question: Question
    plan: Plan
    planning_s: float

    __repr__ = brief_repr


def draw_questions(problem: Problem, count: int, seed: int = 0) -> Iterator[Question]:
    """Yield ``count`` questions about the object and hand of ``problem``, each from a seed of its own, ``seed`` and on."""
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    for number in range(seed, seed + count):
        rng = np.random.default_rng(number)
        yield Question(number, problem, _draw_start(hand, rng), sample_attitude(rng))


def attempt(question: Question) -> Attempt:
    """Plan a question."""
    posed = question.as_problem()
    scene = pipeline.build_scene(posed)
    pipeline.build_hand(posed, scene)
    begun = time.process_time()
    plan = pipeline.plan(posed)
    return Attempt(question, plan, time.process_time() - begun)


def carry_out(done: Attempt) -> ValidationReport:
    """Run an attempt's plan in the simulator; return the validator's judgement."""
    posed = done.question.as_problem()
    return pipeline.validate(posed, done.plan, pipeline.rollout(posed, done.plan))


@dataclass(frozen=True)
class Verdict:
    """What brute force says: whether the goal ``is_reachable`` as far as it looked, whether it ``looked_at_all``, and why."""

    is_reachable: bool
    looked_at_all: bool
    why: str


def ask_brute_force(question: Question, states: int = STATES) -> Verdict:
    """Return whether brute force finds a way to the attitude, on any of a few ways of the object."""
    posed = question.as_problem()
    hand = pipeline.build_hand(posed, pipeline.build_scene(posed))
    ways = list_ways(hand.object.X_WO_home, question.R_WO)
    if find_hold(hand, ways[0][-1], Admissibility(hand), most=2) is None:
        return Verdict(False, True, "no two fingers hold it at the goal")
    looked_at, is_all = 0, True
    for number, poses in enumerate(ways):
        journey = Journey(hand, poses, question.start, every=2)
        found, ended = journey.run(states)
        looked_at, is_all = looked_at + journey.looked_at, is_all and ended
        if found:
            return Verdict(True, True, f"a gait on way {number}, {looked_at} grasps looked at")
    return Verdict(False, is_all, f"no gait on {len(ways)} ways, {looked_at} grasps looked at")


def list_ways(X_WO: Array, R_WO: Array) -> list[Array]:
    """Return the poses (K, 4, 4) of ways from ``X_WO`` (4, 4) to the attitude ``R_WO`` (3, 3).

    The shortest turn and the other way round; a turn about the vertical before and after one about a horizontal axis.
    """
    whole = Rotation.from_matrix(R_WO @ X_WO[:3, :3].T)
    v, angle = whole.as_rotvec(), float(whole.magnitude())
    axis = v / angle if angle > 1e-9 else VERTICAL
    # R = swing * twist: the twist about the vertical leaves what turns the vertical to where it goes.
    up = whole.apply(VERTICAL)
    across = np.cross(VERTICAL, up)
    size = np.linalg.norm(across)
    level = across / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    lean = float(np.arctan2(size, up[2]))
    twist = float((Rotation.from_rotvec(-lean * level) * whole).as_rotvec()[2])
    turned = rotate_about(VERTICAL, -twist) @ level
    turns: list[list[tuple[Array, float]]] = [
        [(axis, angle)],
        [(axis, angle - 2.0 * np.pi)],
        [(VERTICAL, twist), (level, lean)],
        [(turned, lean), (VERTICAL, twist)],
    ]
    return [_list_poses(X_WO, legs) for legs in turns]


def _list_poses(X_WO: Array, legs: list[tuple[Array, float]]) -> Array:
    poses = [X_WO]
    for axis, angle in legs:
        before = poses[-1]
        count = int(np.ceil(abs(angle) / STEP))
        for k in range(1, count + 1):
            pose = before.copy()
            pose[:3, :3] = rotate_about(axis, angle * k / count) @ before[:3, :3]
            poses.append(pose)
    return np.stack(poses)


def _draw_start(hand: HandModel, rng: np.random.Generator) -> tuple[Array | None, ...]:
    """Return start contacts that hold the object at home."""
    X_WO, body, judge = hand.object.X_WO_home, hand.object.body, Admissibility(hand)
    for _ in range(400):
        directions = rng.normal(size=(DRAWN, 3))
        points = body.radial(directions)
        points = points[body.measure_edge_distance(points) >= EDGE_BAND]
        touch = Touch(hand, X_WO, Sites(points, body.normal_at(points)))
        first, second = (int(f) for f in rng.permutation(len(hand.fingers))[:2])
        spare = touch.measure_spare(np.arange(len(points))[:, None], np.arange(len(points))[None])
        pairs = np.argwhere(touch.ok[first][:, None] & touch.ok[second][None] & (spare > 0.0))
        for a, b in rng.permutation(pairs)[:4].tolist():
            if touch.holds(judge, ((first, a), (second, b))):
                start: list[Array | None] = [None] * len(hand.fingers)
                for f, d in ((first, a), (second, b)):
                    start[f] = X_WO[:3, :3] @ points[d] / np.linalg.norm(points[d])
                return tuple(start)
    raise ValueError(
        "no two fingers were found to hold the object; a hand and an object where some do are accepted"
    )


def record(done: Attempt, verdict: Verdict | None, report: ValidationReport | None) -> dict[str, Any]:
    """Return an attempt, and what brute force and the world say of it, as one line of a file."""
    plan, question = done.plan, done.question
    row: dict[str, Any] = {
        "key": question.key,
        "shape": question.problem.name,
        "seed": question.number,
        "turn_deg": round(float(np.degrees(question.turn.magnitude())), 1),
        "status": str(plan.status),
        "reason": plan.reason,
        "planning_s": round(done.planning_s, 3),
        "nodes": plan.statistics.get("nodes"),
        "placements": count_placements(plan.actions),
        "agrees": plan.is_solved,
    }
    if verdict is not None:
        # A refusal before the budget ended says that there is none; what brute force did not find either may be so.
        row["agrees"] = not verdict.is_reachable
        row |= {"brute_force": verdict.why, "looked_at_all": verdict.looked_at_all}
    if report is not None:
        row["run"] = {
            c.name: [c.value, c.limit, c.unit] for c in report.checks if c.status == "fail"
        } or "PASS"
    return row
