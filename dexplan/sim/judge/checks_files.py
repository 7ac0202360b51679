"""Do problem, plan, model and record belong together?  Each contradiction is one sentence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks_case import Case, CheckResult, judge
from dexplan.sim.judge.goals import as_direction, compute_goal_pose, find_marks
from dexplan.sim.judge.groups import OWN_COLUMNS
from dexplan.spatial import Array

SAME_POSITION, SAME_ANGLE = 1e-6, 1e-5
"""Stated twice, a position [m] and an angle [rad] differ by less: a model text carries nine digits, a plan twelve."""
FORMATS = (1, 2)
"""The formats of plan.json that are judged; what is read of them stands at the same place in both."""
TOLD = 6
"""So many contradictions are spelled out; the others are counted."""


def check_files_agree(case: Case) -> CheckResult:
    """Count what problem, plan, model and record say against each other."""
    found = [*case.contradictions, *find_contradictions(case)]
    told = found[:TOLD] + ([f"and {len(found) - TOLD} more"] if len(found) > TOLD else [])
    return judge("files_agree", len(found), case.limit("files_agree"), "count", note="; ".join(told))


def find_contradictions(case: Case) -> Iterator[str]:
    """Yield one sentence per contradiction between the values themselves, wherever they were read from."""
    plan = case.plan
    if plan.get("format", FORMATS[-1]) not in FORMATS:
        yield f"the plan has format {plan['format']}, and {' and '.join(map(str, FORMATS))} are judged"
    if plan["status"] != "solved":
        yield f"the plan's status is {plan['status']}, which leaves nothing to run"
    if not plan["actions"]:
        yield "the plan has no actions"
    own = [name for name in OWN_COLUMNS if name in case.columns]
    if case.controller is not None and own:
        yield f"the record names {case.controller} and holds {', '.join(own)}, which only dexplan's own controller writes"
    fingers = case.replay.world.fingers
    if tuple(plan["fingers"]) != fingers:
        yield f"the plan moves {', '.join(plan['fingers'])}, the model has {', '.join(fingers)}"
        return
    yield from _find_in_goal(case)
    yield from _find_in_chain(case)
    yield from _find_in_contacts(case)


def _find_in_goal(case: Case) -> Iterator[str]:
    """The plan's start is the model's, and its goal is what the problem asks for."""
    plan, asked = case.plan, case.problem["goal"]
    goal = plan["goal"]
    if not _is_same_pose(plan["start"]["object_pose"], case.replay.world.home_pose):
        yield "the plan starts with the object elsewhere than the model"
    if goal["kind"] != asked["kind"]:
        yield f"the plan is a {goal['kind']}, the problem asks for a {asked['kind']}"
    if (asked["kind"] != "grasp_adjustment" or asked.get("keep_object")) and not _is_same_pose(
        goal["object_pose"], compute_goal_pose(case)
    ):
        yield "the plan's goal pose is not the problem's"
    marks = find_marks(case)
    for k, mark in enumerate(marks, start=1):
        if mark is None:
            yield f"the plan holds nowhere at waypoint {k} of {len(marks) + 1}"
    rotation, turned = asked.get("rotation"), goal.get("turned_angle_deg")
    if rotation and turned is not None:
        angle = float(rotation["angle_deg"])
        # An axis and its opposite name the same turn by opposite angles.
        side = np.sign(np.dot(rotation["axis"], goal["axis_W"])) if goal.get("axis_W") else 1.0
        if not abs(side * turned - angle) <= np.degrees(SAME_ANGLE):
            yield f"the plan turns by {turned:g} deg, the problem asks for {angle:g}"


def _find_in_chain(case: Case) -> Iterator[str]:
    """Each action begins where the one before it ended."""
    before, where = case.plan["start"]["object_pose"], "the start"
    for k, action in enumerate(case.plan["actions"]):
        if not _is_same_pose(action["object_pose_start"], before):
            yield f"action {k + 1} of the plan does not begin where {where} left the object"
        before, where = action["object_pose_end"], f"action {k + 1}"
    if case.plan["actions"] and not _is_same_pose(case.plan["goal"]["object_pose"], before):
        yield "the plan does not end at its own goal"


def _find_in_contacts(case: Case) -> Iterator[str]:
    """Planned contacts begin where the problem says and end where it says.

    By direction alone: the true object may be of another size than the planner believed.
    """
    plan, problem = case.plan, case.problem
    start, end = plan["start"]["contacts"], plan["actions"][-1]["contacts_end"] if plan["actions"] else None
    asked = problem.get("start", {}).get("contacts_deg", "auto")
    if not isinstance(asked, str):
        yield from _compare(case, "starts", asked, start)
    wanted = problem["goal"].get("contacts_deg")
    if wanted and plan["goal"].get("contacts"):
        yield from _compare(case, "has a goal", wanted, plan["goal"]["contacts"])
    if wanted and end is not None:
        # Where a roll ends is known as well as it is judged.
        yield from _compare(case, "ends", wanted, end, np.radians(case.limit("contact_error_final_deg")))


def _compare(
    case: Case, verb: str, asked: Any, planned: Mapping[str, Any], most: float = SAME_ANGLE
) -> Iterator[str]:
    """Yield where the ``planned`` contacts are not the ones ``asked`` for in a problem, off by ``most`` [rad]."""
    for k, finger in enumerate(case.replay.world.fingers):
        contact = planned.get(finger)
        wanted = asked[k] if k < len(asked) else "free"
        if (wanted == "free") != (contact is None):
            yield f"the plan {verb} with {finger} {'free' if contact is None else 'touching'}, which the problem does not"
        elif contact is not None and not isinstance(wanted, str):
            # Around a ball the normal says where; on another body it is the point, seen from the origin.
            said = "point_O" if case.problem["object"].get("shape") and "point_O" in contact else "normal_O"
            where, direction = np.asarray(contact[said]), as_direction(wanted)
            across = np.linalg.norm(np.cross(where, direction))
            if not np.arctan2(across, where @ direction) <= most:
                yield f"the plan {verb} with {finger} elsewhere than the problem says"


def _is_same_pose(a: Any, b: Any) -> bool:
    """Return whether two poses (7,) are one."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if not (np.isfinite(a).all() and np.isfinite(b).all() and a[3:].any() and b[3:].any()):
        return False
    return bool(np.linalg.norm(a[:3] - b[:3]) <= SAME_POSITION and _angle(a, b) <= SAME_ANGLE)


def _angle(a: Array, b: Array) -> float:
    """Return the angle [rad] between the attitudes of two poses."""
    first, second = (Rotation.from_quat(pose[3:], scalar_first=True) for pose in (a, b))
    return float((first * second.inv()).magnitude())
