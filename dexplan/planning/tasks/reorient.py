"""How should the object stand so that every finger reaches its goal contact?  Turns that bring it there, the best first."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from dexplan.grasp.grasp import Contact, Grasp
from dexplan.grasp.margin import solve_bounded_margin
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.tasks.grasp_task import GraspTask
from dexplan.plans.contacts import Contacts, GoalContact
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal
from dexplan.spatial import GRAVITY, Array, build_frame, lock_arrays, rotate_about, rotation_vector

AXES = 96
"""Axes about which turns are tried."""
TURN_STEP = float(np.radians(10.0))
"""Angles between the turns that are tried [rad]."""
APART = tuple(np.radians((25.0, 12.0)).tolist())
"""Turns nearer than this to one that was proposed already are left out, at first and then [rad]."""
WAY_WEIGHT = 0.15
"""How much a turn's own angle counts beside the angle between a contact and where its finger is at home."""
REFUSALS = 60
"""After so many turns within reach that do not do those that were found are enough; none is not."""
FEW, CLIMBS = 3, 12
"""Where fewer turns were found than ``FEW``, others are looked for between those of the grid: from so many of them the load's
margin is climbed."""
MEASURED = 200
"""The margin is measured of about so many turns of the grid at most, some ms each."""
CLIMB_STEPS = tuple(np.radians((6.0, 3.0, 1.5)).tolist())
"""Steps of such a climb [rad]."""


@dataclass(frozen=True, eq=False)
class Turn:
    """A turn of the object by ``angle`` [rad] about the unit world axis ``axis_W`` (3,), and how far off a finger then is.

    ``away`` [rad] is the largest angle between a goal contact and the direction in which its finger stands at home.
    """

    axis_W: Array
    angle: float
    away: float

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def cost(self) -> float:
        """What the turn counts: fingers in the middle of their workspaces rather than the shortest way."""
        return self.away + WAY_WEIGHT * self.angle


@dataclass(eq=False)
class Turns:
    """Turns after which every goal contact lies within reach.

    ``fault`` says what was wrong with the first after which the goal grasp does not hold, ``refused`` how many such were asked.
    """

    task: GraspTask
    reachable: list[Turn] = field(init=False)
    fault: Refusal | None = None
    refused: int = 0

    def __post_init__(self) -> None:
        self.reachable = sorted(_find_reachable(self.task), key=lambda turn: turn.cost)

    @property
    def missing(self) -> tuple[str, ...]:
        """The fingers that reach their goal contact in no attitude at all, where there are such."""
        task, names = self.task, []
        for finger, wanted in enumerate(task.goal_contacts):
            if wanted is not None:
                alone = tuple(c if f == finger else None for f, c in enumerate(task.goal_contacts))
                if not any(_find_reachable(task, alone)):
                    names.append(task.hand.fingers[finger].name)
        return tuple(names)

    def choose(self, may_end: Callable[[Array, Contacts], bool] | None = None) -> Iterator[Turn]:
        """Yield turns after which the goal grasp can be held, the best first; first such that differ much, then others.

        ``may_end`` says whether a pose (4, 4) with the goal contacts there is one that is asked for; all are where it is None.
        """
        task, chosen, asked = self.task, list[Array](), set[int]()
        for apart in APART:
            for k, turn in enumerate(self.reachable):
                R = rotate_about(turn.axis_W, turn.angle)
                if k in asked or any(_measure_between(R, other) < apart for other in chosen):
                    continue
                asked.add(k)
                X_WO = ObjectMotion(task.X_WO, turn.axis_W, turn.angle, np.zeros(3)).X_WO_end
                contacts, _ = task.land_goal(X_WO)
                if refusal := task.refuse_goal(X_WO, contacts):
                    self.fault = self.fault or refusal
                    self.refused += 1
                elif may_end is None or may_end(X_WO, contacts):
                    chosen.append(R)
                    yield turn
                    continue
                if chosen and len(asked) - len(chosen) >= REFUSALS:
                    return
        if len(chosen) < FEW:
            for turn in self._climb():
                R = rotate_about(turn.axis_W, turn.angle)
                if any(_measure_between(R, other) < APART[-1] for other in chosen):
                    continue
                X_WO = ObjectMotion(task.X_WO, turn.axis_W, turn.angle, np.zeros(3)).X_WO_end
                contacts, missing = task.land_goal(X_WO)
                if missing or task.refuse_goal(X_WO, contacts):
                    self.refused += 1
                elif may_end is None or may_end(X_WO, contacts):
                    chosen.append(R)
                    yield turn

    def _climb(self) -> Iterator[Turn]:
        """Yield turns between those of the grid in which the goal contacts carry the load best, the best first.

        Contacts that hardly carry the object may do so in a few attitudes only: those in which its weight presses it into them.
        """
        grasp = []
        for wanted in self.task.goal_contacts:
            if wanted is not None:
                friction = self.task.hand.friction.scaled(self.task.hand.limits.cone_share)
                frame = build_frame(-wanted.normal_O)
                grasp.append(Contact(wanted.finger, wanted.point_O, frame, friction))
        margin = partial(_measure_load, self.task, Grasp(tuple(grasp)))
        some = self.reachable[:: 1 + len(self.reachable) // MEASURED]
        begun = [rotate_about(turn.axis_W, turn.angle) for turn in some]
        best = sorted(((margin(R), k) for k, R in enumerate(begun)), key=lambda row: (-row[0], row[1]))
        tops: list[tuple[float, Array]] = []
        for value, k in best:
            if len(tops) >= CLIMBS:
                break
            if all(_measure_between(begun[k], R) >= APART[-1] for _, R in tops):
                tops.append((value, begun[k]))
        ends = [self._climb_from(margin, value, R) for value, R in tops]
        for _, R in sorted(ends, key=lambda end: -end[0]):
            rotvec = rotation_vector(R)
            angle = float(np.linalg.norm(rotvec))
            if angle > 1e-9:
                yield Turn(rotvec / angle, angle, 0.0)

    def _climb_from(self, margin: Callable[[Array], float], value: float, R: Array) -> tuple[float, Array]:
        """Return the largest margin that small turns lead to from ``R`` (3, 3), and where, within reach all the way."""
        for step in CLIMB_STEPS:
            while True:
                # Turns about the vertical leave the load as it is.
                near = np.stack([rotate_about(axis, step) @ R for axis in (*np.eye(3)[:2], *-np.eye(3)[:2])])
                reached = np.isfinite(_measure_away(self.task, near, self.task.goal_contacts))
                values = [margin(other) if ok else -np.inf for other, ok in zip(near, reached, strict=True)]
                if max(values) <= value + 1e-9:
                    break
                value, R = max(values), near[int(np.argmax(values))]
        return value, R


def _measure_load(task: GraspTask, grasp: Grasp, R: Array) -> float:
    """Return the margin with which the goal contacts carry the object turned by ``R`` (3, 3)."""
    hand = task.hand
    up = (R @ task.X_WO[:3, :3]).T @ [0.0, 0.0, hand.object.mass * GRAVITY]
    wrench = np.concatenate([up, np.zeros(3)])
    return solve_bounded_margin(grasp, wrench, hand.limits.normal_floor, hand.limits.normal_ceiling)


def _find_reachable(task: GraspTask, goal: tuple[GoalContact | None, ...] | None = None) -> Iterator[Turn]:
    """Yield the turns that bring all contacts of ``goal`` (by default the task's) within reach."""
    axes = spread_directions(AXES)
    for angle in np.arange(TURN_STEP, np.pi + 1e-9, TURN_STEP):
        turns = np.stack([rotate_about(axis, float(angle)) for axis in axes])
        away = _measure_away(task, turns, task.goal_contacts if goal is None else goal)
        for k in np.flatnonzero(np.isfinite(away)):
            yield Turn(axes[k], float(angle), float(away[k]))


def _measure_away(task: GraspTask, turns: Array, goal: tuple[GoalContact | None, ...]) -> Array:
    """Return how far (N,) [rad] a finger is from home at most after ``turns`` (N, 3, 3) of the object; inf out of reach."""
    hand, R_WO = task.hand, task.X_WO[:3, :3]
    away = np.zeros(len(turns))
    for finger, wanted in enumerate(goal):
        rows = np.flatnonzero(np.isfinite(away))
        if wanted is None or not len(rows):
            continue
        # A finger alone meets the contact only: turning the object is turning the contact on an object that stands still.
        normals_W = turns[rows] @ (R_WO @ wanted.normal_O)
        points_O = turns[rows] @ (R_WO @ wanted.point_O) @ R_WO if task.is_on_sites else None
        landed = build_landings(hand, task.X_WO, finger, normals_W @ R_WO, points_O)
        home = hand.p_WF_home[finger] - task.X_WO[:3, 3]
        angles = np.arccos(np.clip(normals_W @ home / np.linalg.norm(home), -1.0, 1.0))
        reached = np.array([placement is not None for placement in landed])
        away[rows] = np.where(reached, np.maximum(away[rows], angles), np.inf)
    return away


def _measure_between(A: Array, B: Array) -> float:
    """Return the angle [rad] of the rotation between two attitudes (3, 3)."""
    return float(np.arccos(np.clip(0.5 * (np.trace(A.T @ B) - 1.0), -1.0, 1.0)))
