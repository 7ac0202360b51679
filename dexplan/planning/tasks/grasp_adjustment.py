"""Grasp adjustment: given contact points on the object, without regard for the object's pose [paper §1].

"If the goal contact points are initially not within the workspaces of the fingers, first do an object manipulation to bring
them to the workspaces.  Then use finger gaiting and rolling to reach the goal grasp."
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

from dexplan.planning.actions.coordinated import center_spin, plan_coordinated
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.dead_ends import refuse_end
from dexplan.planning.tasks.goal_refusals import GoalContacts, refuse_goal_contacts, suggest_cure
from dexplan.planning.tasks.grasp_task import GraspTask
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.passes import PASSES, GraspWay, Outcome, scale_work
from dexplan.planning.tasks.reorient import Turns
from dexplan.planning.tasks.stages import Stages
from dexplan.planning.tasks.starting import Start
from dexplan.plans.contacts import Contacts
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.spatial import VERTICAL, Array

KIND = "grasp_adjustment"
TURNS = 8
"""Turns of the object that are tried before the goal is given up."""
WORK = 900
"""Work, as :class:`Stages` counts it, after which no further turn is tried."""


def plan_grasp_adjustment(
    hand: HandModel,
    X_WO: Array,
    start: Start,
    goal: GoalContacts,
    options: SearchOptions,
    keep_object: bool = False,
) -> Plan:
    """Return a plan after which every finger touches at its goal contact.

    The object stays at ``X_WO`` (4, 4) if that is possible; else it is turned by one of the turns that help, and, with
    ``keep_object``, brought back by the goal grasp; the options say how long other turns are tried then for a plan that costs
    less.  No plan is an answer with a status: ``goal_contacts_unreachable``, ``goal_grasp_inadmissible``,
    ``no_adjustment`` where everything was tried, ``budget_exhausted`` where the search gave up before, or one of those that
    refuse a start.
    """
    task = GraspTask(hand, X_WO, start, goal, options)
    stages = Stages(task)
    stay = RotationGoal(X_WO, VERTICAL, 0.0)
    if task.is_start_refused:
        return task.refuse_start(KIND, stay)
    if no := refuse_goal_contacts(hand, goal):
        return stages.refuse(KIND, stay, no)
    contacts, missing = task.land_goal(X_WO)
    refusal = None if missing else task.refuse_goal(X_WO, contacts)
    staying: Outcome | None = None
    if not missing and not refusal:
        staying = stages.run(GraspWay(rest_at(X_WO), rest_at(X_WO)))
        if staying.is_found:
            return stages.build_plan(KIND, stay, staying)
    elif keep_object:
        return stages.refuse(KIND, stay, _refuse_to_stay(missing, refusal))
    turns = Turns(task)
    may_end = partial(_can_return, task) if keep_object else None
    most = scale_work(TURNS, options.node_budget)
    chosen = list(islice(turns.choose(may_end), most + 1))
    is_more, chosen = len(chosen) > most, chosen[:most]
    ways = []
    for turn in chosen:
        motion = ObjectMotion(X_WO, turn.axis_W, turn.angle, np.zeros(3))
        there = motion.X_WO_end
        back = ObjectMotion(there, turn.axis_W, -turn.angle, np.zeros(3)) if keep_object else rest_at(there)
        ways.append(GraspWay(motion, back))
    done = stages.run_all(ways, PASSES, WORK)
    if done.number is not None:
        there = ways[done.number].before.X_WO_end
        goal_pose = stay if keep_object else RotationGoal.from_attitude(X_WO, there[:3, :3])
        return stages.build_plan(KIND, goal_pose, done)
    keep = ", or set goal.keep_object = false" if keep_object else ""
    if chosen:
        gave_up = done.gave_up or is_more or (staying is not None and staying.gave_up)
        tried = _describe_tried(done.tried, len(chosen), is_more)
        # What stopped it where the object is says more than what did elsewhere.
        done = replace(staying or done, gave_up=gave_up, ran_out=done.ran_out or is_more)
        status = Status.BUDGET_EXHAUSTED if gave_up else Status.NO_ADJUSTMENT
        return stages.refuse(KIND, stay, refuse_end(stages, status, done, keep, tried))
    if staying is not None:
        nowhere = ": there is no other attitude in which the goal contacts lie within reach and hold" + (
            ", and from which they carry the object back" if keep_object else ""
        )
        status = Status.BUDGET_EXHAUSTED if staying.gave_up else Status.NO_ADJUSTMENT
        return stages.refuse(KIND, stay, refuse_end(stages, status, staying, keep + nowhere))
    return stages.refuse(KIND, stay, _refuse_every_attitude(turns))


def _refuse_to_stay(missing: tuple[str, ...], refusal: Refusal | None) -> No:
    """Return the answer to a goal grasp that cannot be where the object is and has to be there.

    ``missing``: the fingers that do not reach; where all do, ``refusal`` says why the goal contacts do not hold.
    """
    leave = "set goal.keep_object = false"
    if refusal is None:
        who = " and ".join(missing)
        words = f"{who} cannot reach the goal contact with the object where it is, and goal.keep_object wants it there"
        cure = Cure(f"move the contact towards the finger, or {leave}")
        refusal = Refusal(RefusalKind.GOAL_CONTACT_OUT_OF_REACH, missing, cure=cure, words=words)
        return No(Status.GOAL_CONTACTS_UNREACHABLE, f"{words}; {cure}", refusal)
    cure = Cure(f"{suggest_cure(refusal)}, or {leave}")
    reason = f"the goal contacts cannot hold the object where it is ({refusal}), and goal.keep_object wants it there; {cure}"
    return No(Status.GOAL_GRASP_INADMISSIBLE, reason, replace(refusal, cure=cure))


def _refuse_every_attitude(turns: Turns) -> No:
    """Return the answer to a goal grasp that holds in no attitude of the object."""
    if turns.fault:
        cure = suggest_cure(turns.fault)
        reason = (
            f"the goal contacts cannot hold the object in any of {turns.refused} attitudes that bring them within reach "
            f"({turns.fault}); {cure}"
        )
        return No(Status.GOAL_GRASP_INADMISSIBLE, reason, replace(turns.fault, cure=cure))
    if alone := turns.missing:
        words = f"in no attitude of the object can {' and '.join(alone)} reach the goal contact"
        cure = Cure("move the object's home nearer to the hand")
    else:
        words = "every finger reaches its goal contact in some attitude of the object, but in none do all of them at once"
        cure = Cure(
            "keep the fingers' clockwise order and the angles between them, and move the contacts towards where the fingers stand"
        )
    refusal = Refusal(RefusalKind.GOAL_CONTACT_OUT_OF_REACH, alone, cure=cure, words=words)
    return No(Status.GOAL_CONTACTS_UNREACHABLE, f"{words}; {cure}", refusal)


def _can_return(task: GraspTask, X_WO: Array, contacts: Contacts) -> bool:
    """Return whether the goal contacts can carry the object from ``X_WO`` (4, 4) back to where it starts."""
    turn = RotationGoal.from_attitude(X_WO, task.X_WO[:3, :3])
    back = ObjectMotion(X_WO, turn.axis_W, turn.angle, np.zeros(3))
    held = tuple(None if c is None else center_spin(task.hand, c, back) for c in contacts)
    return plan_coordinated(task.hand, task.admissibility, held, back, "")[1] is None


def _describe_tried(tried: int, chosen: int, is_more: bool) -> str:
    """Return in how many attitudes the grasp was to be adjusted, in words."""
    attitudes = "attitude" if chosen == 1 else "attitudes"
    count = f"all {chosen}" if tried == chosen and not is_more and chosen > 1 else f"{tried} of {chosen}"
    which = "the one attitude" if tried == chosen == 1 and not is_more else f"{count} {attitudes}"
    others = "; there are more such attitudes" if is_more else ""
    return f"tried in {which} in which the goal contacts lie within reach{others}"
