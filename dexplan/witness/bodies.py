"""Random attitudes from random starts on any convex body: what the planner answers, and what brute force says of a refusal.

Questions are drawn without asking the planner: attitudes uniform over all rotations, start contacts uniform in direction among
those that two fingers reach and with which they hold the object, by the statics of :mod:`.two_contacts`.  A start that the
planner refuses is a refusal like any other.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.contact.bodies.sites import EDGE_BAND, Sites
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.sampling import sample_attitude
from dexplan.plans.plan import Plan
from dexplan.problems.problem import GoalSection, Problem, StartSection
from dexplan.sim.judge.validate import ValidationReport
from dexplan.spatial import VERTICAL, Array, as_pose7, rotate_about
from dexplan.witness.adjustments import as_azimuth_elevation
from dexplan.witness.grasp_grid import SITES, build_grid, spread_sites
from dexplan.witness.pair_judge import PairJudge
from dexplan.witness.pair_search import Outcome, PairSearch, find_axes

DRAWN = 60
"""Directions drawn at a time for start contacts."""
STEP = float(np.radians(7.5))
"""The object's turn from pose to pose, all of which are judged; fingers are put elsewhere at every second, each 15 deg."""
LOOKS = 1500
"""Grasps and ways of fingers that are looked at on one way of the object."""


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
    """What brute force says: whether the goal ``is_reachable`` as far as it looked, what every way of the object came to, and how
    many grasps and fingers' ways were looked at.
    """

    is_reachable: bool
    outcomes: tuple[Outcome, ...]
    looked_at: int

    @property
    def looked_at_all(self) -> bool:
        """Whether there was nothing left to look at."""
        return self.is_reachable or Outcome.UNFINISHED not in self.outcomes

    def __str__(self) -> str:
        if self.is_reachable:
            return f"a gait on way {len(self.outcomes) - 1}, {self.looked_at} grasps and ways looked at"
        ends = ", ".join(f"{n} times: {o.value}" for o, n in Counter(self.outcomes).items())
        return f"no gait on {len(self.outcomes)} ways ({ends}), {self.looked_at} grasps and ways looked at"


def ask_brute_force(question: Question, looks: int = LOOKS, sites: int = SITES) -> Verdict:
    """Return whether brute force finds a gait to the attitude, on any of a few ways of the object."""
    posed = question.as_problem()
    hand = pipeline.build_hand(posed, pipeline.build_scene(posed))
    X_WO, body = hand.object.X_WO_home, hand.object.body
    touching = [(f, X_WO[:3, :3].T @ d) for f, d in enumerate(question.start) if d is not None]
    points = body.radial(np.stack([d for _, d in touching]))
    spread = spread_sites(body, sites)
    places = Sites(np.vstack([spread.points, points]), np.vstack([spread.normals, body.normal_at(points)]))
    first, second = ((f, len(spread) + k) for k, (f, _) in enumerate(touching))
    outcomes, looked_at = list[Outcome](), 0
    for poses in list_ways(X_WO, question.R_WO, hand.p_WF_home):
        search = PairSearch(hand, poses, build_grid(places, find_axes(poses)), (first, second))
        outcomes.append(search.run(looks))
        looked_at += search.judge.looked_at
        if outcomes[-1] is Outcome.FOUND or not search.judge.holds(0, (first, second)):
            break
    return Verdict(outcomes[-1] is Outcome.FOUND, tuple(outcomes), looked_at)


def list_ways(X_WO: Array, R_WO: Array, homes: Array) -> list[Array]:
    """Return the poses (K, 4, 4) of ways from ``X_WO`` (4, 4) to the attitude ``R_WO`` (3, 3).

    The shortest turn and the other way round; a turn about the vertical before and after one about a horizontal axis; about the
    vertical, about the chord of two fingers' tips at ``homes`` (F, 3), and about the vertical again.
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
    for i, j in combinations(range(len(homes)), 2):
        chord = (homes[j] - homes[i]) * [1.0, 1.0, 0.0]
        chord /= np.linalg.norm(chord)
        frame = Rotation.from_matrix(np.stack([chord, np.cross(VERTICAL, chord), VERTICAL], axis=1))
        # R = Rz(a) Rx(b) Rz(c) where x is the chord.
        E = (frame.inv() * whole * frame).as_matrix()
        middle = np.arctan2(np.hypot(E[0, 2], E[1, 2]), E[2, 2])
        if min(middle, np.pi - middle) < 1e-6:
            continue
        last, first = np.arctan2(E[0, 2], -E[1, 2]), np.arctan2(E[2, 0], E[2, 1])
        for half, b in ((0.0, middle), (np.pi, -middle)):
            a, c = (float(np.arctan2(np.sin(x + half), np.cos(x + half))) for x in (last, first))
            turns.append([(VERTICAL, c), (chord, float(b)), (VERTICAL, a)])
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
    X_WO, body = hand.object.X_WO_home, hand.object.body
    for _ in range(400):
        points = body.radial(rng.normal(size=(DRAWN, 3)))
        points = points[body.measure_edge_distance(points) >= EDGE_BAND]
        first, second = sorted(int(f) for f in rng.permutation(len(hand.fingers))[:2])
        grid = build_grid(Sites(points, body.normal_at(points)))
        judge = PairJudge(hand, X_WO[None], grid)
        for a, b in rng.permutation(np.argwhere(judge.tables.at(0)[first, second]))[:4].tolist():
            if judge.holds(0, ((first, a), (second, b))):
                start: list[Array | None] = [None] * len(hand.fingers)
                for f, c in ((first, a), (second, b)):
                    start[f] = X_WO[:3, :3] @ points[c] / np.linalg.norm(points[c])
                return tuple(start)
    raise ValueError(
        "no two fingers were found to hold the object; a hand and an object where some do are accepted"
    )
