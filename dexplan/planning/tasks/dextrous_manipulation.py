"""Dextrous manipulation: a goal for the object *and* for the contacts, in the paper's three orders [paper §1].

(a) object first: gaits take the object to its goal, then the grasp is adjusted; (b) grasp first: the grasp is adjusted as early
as the goal grasp can carry the object from there to its goal; (c) simultaneous: free fingers travel while the others move the
object.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.actions.overlap import overlap_travel
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.search.cost import Improvement
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.dead_ends import refuse_end
from dexplan.planning.tasks.goal_refusals import GoalContacts, refuse_goal_contacts, suggest_cure
from dexplan.planning.tasks.grasp_task import GraspTask
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.passes import PASSES, GraspWay, Pass
from dexplan.planning.tasks.stages import Stages
from dexplan.planning.tasks.starting import Start
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status

KIND = "dextrous_manipulation"
Order = Literal["object_first", "grasp_first", "simultaneous"]
SHARES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)
"""Shares of the object's way after which the grasp is adjusted in the order "grasp first", the earliest that works."""

DETOURS, AXES, MOST = (float(np.radians(15.0)), float(np.radians(30.0))), 12, 6
"""Turns [rad] about so many axes that lead to the goal from beside the straight way there; at most so many are tried."""
TOGETHER = (Pass(1, 2, 3), Pass(2, 2, 3))
"""Where fingers are to travel while the object moves the search needs some of the object's way."""
WORK = 700
"""Work, as :class:`Stages` counts it, after which no further way is tried in one order."""
OVERLAP = 0.3
"""Share of the relocations that should overlap a motion of the object in the order "simultaneous"."""


def plan_dextrous_manipulation(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    contacts: GoalContacts,
    options: SearchOptions,
    order: Order = "object_first",
    compute_duration: Callable[[Plan], float] | None = None,
) -> Plan:
    """Return a plan after which the object is at ``goal`` and every finger at its goal contact.

    ``contacts``: outward normals in object axes, None for a finger that has to be free.  ``compute_duration`` tells how long a
    plan takes [s]; the order "simultaneous" takes the shortest it finds, and counts actions where there is none.
    The options say how long other ways are tried for a plan that costs less, none on which the grasp is adjusted later.  No
    plan is an answer with a status: those of a grasp adjustment, with ``no_dextrous_plan`` instead of ``no_adjustment``.
    """
    if order == "simultaneous":
        # Three searches vie for the shortest time already.
        options = replace(options, improvement=Improvement())
    task = GraspTask(hand, goal.X_WO_start, start, contacts, options)
    stages = Stages(task)
    if task.is_start_refused:
        return task.refuse_start(KIND, goal)
    if no := refuse_goal_contacts(hand, contacts):
        return stages.refuse(KIND, goal, no)
    landed, missing = task.land_goal(goal.X_WO_goal)
    if missing:
        words = f"{' and '.join(missing)} cannot reach the goal contact with the object at its goal"
        shorten = "shorten goal.translation_m, or " if np.any(goal.shift_W) else "or "
        cure = Cure(f"move the contact towards the finger, {shorten}choose another attitude")
        refusal = Refusal(RefusalKind.GOAL_CONTACT_OUT_OF_REACH, missing, cure=cure, words=words)
        no = No(Status.GOAL_CONTACTS_UNREACHABLE, f"{words}; {cure}", refusal)
        return stages.refuse(KIND, goal, no)
    if refused := task.refuse_goal(goal.X_WO_goal, landed):
        cure = suggest_cure(refused)
        reason = f"the goal contacts cannot hold the object at its goal ({refused}); {cure}"
        no = No(Status.GOAL_GRASP_INADMISSIBLE, reason, replace(refused, cure=cure))
        return stages.refuse(KIND, goal, no)
    if order == "simultaneous":
        return _plan_simultaneous(stages, goal, compute_duration or (lambda plan: float(len(plan.actions))))
    return _plan_in_order(stages, goal, (1.0,) if order == "object_first" else SHARES, WORK)


def _plan_in_order(
    stages: Stages,
    goal: RotationGoal,
    shares: tuple[float, ...],
    work: int,
    is_simultaneous: bool = False,
) -> Plan:
    """Return the plan that adjusts the grasp after the first of ``shares`` of the object's way at which that works."""
    whole = goal.motion
    ways = [
        GraspWay(whole.part(0.0, share), whole.part(share, 1.0), goal.is_attitude, is_simultaneous)
        for share in shares
    ]
    detours = (
        _choose_detours(stages.task, goal, is_simultaneous) if len(shares) > 1 and goal.is_attitude else []
    )
    ways += detours[:MOST]
    passes = TOGETHER if is_simultaneous else PASSES
    done = stages.run_all(ways, passes, work, is_early=True)
    if done.number is not None:
        return stages.build_plan(KIND, goal, done)
    done = replace(done, gave_up=done.gave_up or len(detours) > MOST)
    status = Status.BUDGET_EXHAUSTED if done.gave_up else Status.NO_DEXTROUS_PLAN
    return stages.refuse(KIND, goal, refuse_end(stages, status, done, ", or try another goal.order"))


def _choose_detours(task: GraspTask, goal: RotationGoal, is_simultaneous: bool) -> list[GraspWay]:
    """Return motions to poses off the straight way, where the goal contacts are within reach, and on from there to the goal.

    Any way there will do; the grasp is adjusted there, and then carries the object on.
    """
    ways, end = [], goal.X_WO_goal
    for angle in DETOURS:
        for axis in spread_directions(AXES):
            X_WO = ObjectMotion(end, axis, -angle, np.zeros(3)).X_WO_end
            if not task.land_goal(X_WO)[1]:
                there = RotationGoal.from_attitude(goal.X_WO_start, X_WO[:3, :3], goal.shift_W)
                on = ObjectMotion(X_WO, axis, angle, np.zeros(3))
                ways.append(GraspWay(there.motion, on, True, is_simultaneous))
    return ways


def _plan_simultaneous(stages: Stages, goal: RotationGoal, compute_duration: Callable[[Plan], float]) -> Plan:
    """Return the quickest plan in which free fingers travel while the object moves.

    Asked are a search that takes goal contacts on the way, and both other orders; all with their travel handed over.  Plans in
    which enough relocations overlap come first.
    """
    plans = [_plan_in_order(stages, goal, (1.0,), WORK // 3, is_simultaneous=True)]
    plans += [_plan_in_order(stages, goal, shares, WORK // 2) for shares in ((1.0,), SHARES)]
    solved = [overlap_travel(stages.task.hand, plan) for plan in plans if plan.is_solved]
    if not solved:
        # Where one of them gave up there may be a way after all.
        return next((plan for plan in plans if plan.status is Status.BUDGET_EXHAUSTED), plans[0])

    def rank(plan: Plan) -> tuple[bool, float]:
        counted = plan.statistics
        return counted["relocations_overlapping"] < OVERLAP * counted["relocations"], compute_duration(plan)

    return min(solved, key=rank)
