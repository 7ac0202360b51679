"""Random goal attitudes from random start contacts, none of them shown to the planner before: planned, and carried out."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.sampling import sample_attitude, sample_start
from dexplan.planning.tasks.rolling_start import plan_object_manipulation
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.problems.problem import GoalSection, Problem, StartSection
from dexplan.sim.judge.validate import ValidationReport
from dexplan.spatial import Array, as_pose7


@dataclass(frozen=True, eq=False)
class Question:
    """Take the object from the ``start`` contacts (outward normals (3,) in W, None for a free finger) to ``goal``."""

    number: int
    start: tuple[Array | None, ...]
    goal: RotationGoal

    __repr__ = brief_repr

    def as_problem(self, problem: Problem) -> Problem:
        """Return the question as a problem with the hand, object and friction of ``problem``."""
        R_WO = self.goal.X_WO_start[:3, :3]
        contacts = tuple("free" if n is None else _as_azimuth_elevation(R_WO.T @ n) for n in self.start)
        return replace(
            problem,
            name=f"{problem.name}_{self.number}",
            start=StartSection(contacts_deg=contacts),  # type: ignore[arg-type]
            goal=GoalSection(orientation_wxyz=tuple(as_pose7(self.goal.X_WO_goal)[3:].tolist())),
        )


@dataclass(frozen=True, eq=False)
class Attempt:
    """A question, its plan, and the processor time that planning took [s]."""

    question: Question
    plan: Plan
    planning_s: float

    __repr__ = brief_repr

    @property
    def is_fair(self) -> bool:
        """Whether the start is one that the hand can be in and that holds the object: else it is no question to a planner."""
        return not self.plan.status.is_about_start


def draw_questions(hand: HandModel, count: int, seed: int) -> Iterator[Question]:
    """Yield ``count`` questions; starts are drawn by reach and force closure alone."""
    rng, X_WO = np.random.default_rng(seed), hand.object.X_WO_home
    for number in range(count):
        start = sample_start(hand, rng)
        yield Question(number, start, RotationGoal.from_attitude(X_WO, sample_attitude(rng)))


def attempt(problem: Problem, hand: HandModel, question: Question, node_budget: int) -> Attempt:
    """Plan a question with ``problem``'s gaits; the first plan is taken."""
    begun = time.process_time()
    plan = plan_object_manipulation(hand, question.goal, question.start, node_budget, problem.gait.primitives)
    return Attempt(question, plan, time.process_time() - begun)


def carry_out(problem: Problem, done: Attempt) -> ValidationReport:
    """Run an attempt's plan in the simulator; return the validator's judgement."""
    posed = done.question.as_problem(problem)
    plan = pipeline.time_plan(posed, done.plan)
    return pipeline.validate(posed, plan, pipeline.rollout(posed, plan))


def _as_azimuth_elevation(normal: Array) -> tuple[float, float]:
    x, y, z = normal
    return float(np.degrees(np.arctan2(y, x))), float(np.degrees(np.arcsin(np.clip(z, -1.0, 1.0))))
