"""Random goal contacts that the planner was not shown: grasps adjusted and objects taken along, planned and carried out."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal, get_args

import numpy as np

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.grasp.closure import check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.regions.sampling import sample_attitude
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.problem import GoalSection, Problem, compute_contact_directions
from dexplan.sim.judge.validate import ValidationReport
from dexplan.spatial import Array, as_pose7, build_frame

Task = Literal["grasp_adjustment", "keep_object", "object_first", "grasp_first", "simultaneous"]
"""A grasp adjustment, one after which the object is where it was, or a dextrous manipulation in one of its orders."""
TASKS: tuple[Task, ...] = get_args(Task)

AWAY = float(np.radians(40.0))
"""Every goal contact is at least so far from where its finger starts [rad]."""
TURN = float(np.radians(60.0))
"""The goal attitude is at least so far from where the object starts [rad]."""
TRIES = 2000
"""Attitudes drawn before a seed is given up."""
PLACES = 200
"""Directions drawn for every finger in every attitude."""
UNFAIR = (Status.GOAL_CONTACTS_UNREACHABLE, Status.GOAL_GRASP_INADMISSIBLE, Status.GOAL_NOT_ALLOWED)
"""Statuses that say that the goal grasp cannot be, however one might try to come to it."""


@dataclass(frozen=True, eq=False)
class Question:
    """Bring the fingers to goal contacts, given as outward normals (3,) in object axes, with the object at ``R_WO`` (3, 3).

    In an adjustment nobody is told about ``R_WO``: it is an attitude at which every finger reaches its contact; where the object
    is kept it is that of its start.
    """

    number: int
    problem: Problem
    contacts: tuple[Array, ...]
    R_WO: Array

    __repr__ = brief_repr

    def as_problem(self, task: Task) -> Problem:
        """Return the question as a problem."""
        contacts = tuple(as_azimuth_elevation(n) for n in self.contacts)
        if task == "grasp_adjustment" or task == "keep_object":
            goal = GoalSection(
                kind="grasp_adjustment", contacts_deg=contacts, keep_object=task == "keep_object"
            )
        else:
            X_WO = np.eye(4)
            X_WO[:3, :3] = self.R_WO
            goal = GoalSection(
                kind="dextrous_manipulation",
                order=task,
                contacts_deg=contacts,
                orientation_wxyz=tuple(as_pose7(X_WO)[3:].tolist()),
            )
        return replace(self.problem, name=f"{self.problem.name}_{self.number}", goal=goal)


@dataclass(frozen=True, eq=False)
class Attempt:
    """A question as a problem, its plan, and the processor time that planning took [s]."""

    question: Question
    problem: Problem
    plan: Plan
    planning_s: float

    __repr__ = brief_repr

    @property
    def is_fair(self) -> bool:
        """Whether the goal grasp can be at all, as far as loads, clearances and the goal's pose are concerned."""
        return self.plan.status not in UNFAIR


def draw_questions(problem: Problem, count: int, seed: int = 0, is_kept: bool = False) -> Iterator[Question]:
    """Yield ``count`` questions with the start of ``problem``, its tips' radii in another order from one to the next.

    Each has a seed of its own, ``seed`` and on.  An attitude is drawn, and for every finger a place that it can reach with the
    object there; kept are places that are force closed, whose tips do not overlap, and that are far from where they start.
    Loads, clearances, the fingers' order and the way there are not looked at.  ``is_kept``: the attitude is that of the start.
    """
    hands: dict[tuple[float, ...], HandModel] = {}
    for number in range(seed, seed + count):
        rng = np.random.default_rng(number)
        radii = tuple(rng.permutation(problem.hand.tip_radii_m).tolist())
        posed = replace(problem, hand=replace(problem.hand, tip_radii_m=radii))
        if radii not in hands:
            hands[radii] = pipeline.build_hand(posed, pipeline.build_scene(posed))
        yield _draw(posed, hands[radii], number, rng, is_kept)


def attempt(question: Question, task: Task) -> Attempt:
    """Plan a question."""
    posed = question.as_problem(task)
    begun = time.process_time()
    plan = pipeline.plan(posed)
    return Attempt(question, posed, plan, time.process_time() - begun)


def carry_out(done: Attempt) -> ValidationReport:
    """Run an attempt's plan in the simulator; return the validator's judgement."""
    return pipeline.validate(done.problem, done.plan, pipeline.rollout(done.problem, done.plan))


def as_azimuth_elevation(normal: Array) -> tuple[float, float]:
    """Return the azimuth and elevation [deg] of a direction (3,)."""
    x, y, z = normal
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))))


def _draw(
    problem: Problem, hand: HandModel, number: int, rng: np.random.Generator, is_kept: bool
) -> Question:
    assert not isinstance(problem.start.contacts_deg, str)
    start = compute_contact_directions(problem.start.contacts_deg)
    X_WO, home, fingers = hand.object.X_WO_home.copy(), hand.object.X_WO_home, range(len(hand.fingers))
    for _ in range(TRIES):
        R = home[:3, :3] if is_kept else sample_attitude(rng)
        if not is_kept and np.trace(R.T @ home[:3, :3]) > 1.0 + 2.0 * np.cos(TURN):
            continue
        X_WO[:3, :3] = R
        reach = [_reach(hand, X_WO, f, rng, start[f]) for f in fingers]
        if not all(len(places) for places in reach):
            continue
        chosen = tuple(places[rng.integers(len(places))] for places in reach)
        if _are_apart(hand, chosen) and _are_closed(hand, chosen):
            return Question(number, problem, chosen, R)
    raise ValueError(
        f"no goal contacts in {TRIES} attitudes; a hand and friction that allow some are accepted"
    )


def _reach(hand: HandModel, X_WO: Array, finger: int, rng: np.random.Generator, start: Array | None) -> Array:
    """Return random directions (N, 3) in object axes that a finger reaches, far from where it starts."""
    normals = rng.normal(size=(PLACES, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    if start is not None:
        normals = normals[normals @ start < np.cos(AWAY)]
    landed = build_landings(hand, X_WO, finger, normals)
    return normals[[placement is not None for placement in landed]]


def _are_apart(hand: HandModel, normals: tuple[Array, ...]) -> bool:
    surface, radii = hand.object.surface, [f.tip_radius for f in hand.fingers]
    centers = [surface.radial(n) + r * n for n, r in zip(normals, radii, strict=True)]
    return all(
        np.linalg.norm(centers[i] - centers[j]) - radii[i] - radii[j] >= hand.limits.clearance
        for i, j in combinations(range(len(normals)), 2)
    )


def _are_closed(hand: HandModel, normals: tuple[Array, ...]) -> bool:
    radial = hand.object.surface.radial
    contacts = (Contact(f, radial(n), build_frame(-n), hand.friction) for f, n in enumerate(normals))
    return check_force_closure(Grasp(tuple(contacts))).is_closed
