"""What problem files can ask for, and no plan is made of yet: said in one sentence, never left out of a plan in silence."""

from __future__ import annotations

from dexplan.errors import ProblemError
from dexplan.problems.problem import Problem

_BALLS_ALONE = "for an object that is a ball alone as yet"


def refuse_unplanned(problem: Problem) -> None:
    """Raise ProblemError where ``problem`` asks for what the planner does not do."""
    goal = problem.goal
    if problem.object.shape is None:
        return
    if goal.contacts_deg is not None:
        accepted = "accepted: a goal of the object, by rotation, orientation_wxyz or translation_m"
        raise ProblemError(problem.name, "goal.contacts_deg", f"planned {_BALLS_ALONE}", accepted)
