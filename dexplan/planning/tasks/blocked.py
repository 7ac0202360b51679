"""What is in the way before anything moves: of the hand whatever it does, of the object where it is, of fingers that wait."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from dexplan.errors import spell_apart
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_tip_pose
from dexplan.planning.admissible.aligned import build_touching
from dexplan.planning.admissible.conditions import Condition, find_unmet, refuse_locked_joint, refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.lone_clearance import list_others
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.pair_survey import find_nearest_at_home
from dexplan.plans.contacts import Placement
from dexplan.plans.goal import RotationGoal
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.scene.description import STANDING, Nearness
from dexplan.spatial import Array

StartContact = Array | Placement
"""A direction (3,) in W from the object's origin, on a ball the outward normal; a tip pose X_OF (4, 4) in the object frame; or
the placement with which a finger came there."""


def find_obstruction(hand: HandModel, waiting: tuple[int, ...] | None = None) -> No | None:
    """Return what is in the way of any plan, and the cure; None where nothing is.

    ``waiting``: the fingers that are free at the start, None where the planner chooses.  A finger that holds is not at home, so
    that what is in the way there matters only for fingers that have to be.
    """
    for overlap in hand.probe.find_overlaps():
        cure = Cure(_suggest_cure_of_overlap(overlap))
        refusal = Refusal(RefusalKind.OVERLAP, overlap.bodies, -overlap.distance, cure=cure)
        return No(Status.BLOCKED, f"{refusal}; {cure}", refusal)
    everyone, X_WO = tuple(range(len(hand.fingers))), hand.object.X_WO_home
    nearest = hand.probe.find_nearest(hand.q_home, X_WO, (), everyone)
    if nearest.distance < hand.limits.clearance:
        return _block(hand, nearest, "where the object is at the start", Condition.STANDING)
    at_home = {f: find_nearest_at_home(hand, X_WO, f) for f in everyone}
    blocked = [f for f in everyone if at_home[f].distance < hand.limits.clearance]
    if waiting is None:
        # Two fingers hold and the others wait: is there a choice of two that leaves nobody blocked waiting?
        if any(set(blocked) <= set(pair) for pair in combinations(everyone, 2)):
            return None
        waiting = tuple(blocked)
    for finger in waiting:
        if finger in blocked:
            where = f"while {hand.fingers[finger].name} is at home, where a free finger waits"
            is_standing = STANDING in at_home[finger].owners
            return _block(
                hand, at_home[finger], where, Condition.STANDING if is_standing else Condition.WAITING
            )
    return None


def _block(hand: HandModel, nearest: Nearness, where: str, cure: Condition) -> No:
    left, kept = spell_apart(1e3 * nearest.distance, 1e3 * hand.limits.clearance)
    words = f"{nearest.names} come within {left} mm {where}, and {kept} mm have to be left"
    refusal = replace(refuse_nearness(nearest, hand.limits.clearance), cure=Cure(cure.value), words=words)
    return No(Status.BLOCKED, f"{words}; {cure}", refusal)


def _suggest_cure_of_overlap(overlap: Nearness) -> str:
    if STANDING in overlap.owners:
        return "move or shrink the obstacle"
    if len(set(overlap.owners)) > 1:
        return "stand the fingers farther apart (hand.base_azimuths_deg)"
    return "use a smaller tip (hand.tip_radii_m), or widen hand.joint_ranges_deg"


def refuse_contact(
    hand: HandModel, finger: int, X_WO: Array, direction: Array, X_WF: Array | None = None
) -> Refusal | None:
    """Return why a finger cannot touch the object at ``X_WO`` (4, 4), wherever the others are; None where it alone can.

    It touches where the ray along ``direction`` (3,) in W leaves the body; ``X_WF`` (4, 4) is the tip's whole pose where that
    is given.
    """
    limits, description = hand.limits, hand.fingers[finger]
    chain, workspace = description.chain, hand.workspaces[finger]
    point_O, normal_O = find_start_point(hand, X_WO, direction)
    X = build_touching(hand, finger, X_WO, point_O[None], normal_O[None]) if X_WF is None else X_WF[None]
    if len(workspace.postures):
        solved, reached = solve_tip_pose(workspace, X, counts_spin=X_WF is not None)
    if not len(workspace.postures) or not reached[0]:
        return Refusal(
            RefusalKind.OUT_OF_REACH, (description.name,), words="it lies outside the finger's workspace"
        )
    q = solved[0]
    if chain.has_tip_roll and X_WF is None:
        q[-1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    room = np.minimum(q - chain.lower, chain.upper - q)
    joint = int(room.argmin())
    if room[joint] < limits.joint_margin:
        name = description.joint_names[joint].split("/")[-1]
        left = (
            f"{np.degrees(abs(room[joint])):.1f} deg {'from' if room[joint] >= 0.0 else 'beyond'} its limit"
        )
        words = f"{name} would be {left}, and {np.degrees(limits.joint_margin):.3g} deg are kept"
        return Refusal(
            RefusalKind.JOINT_LIMIT, (description.name,), float(room[joint]), limits.joint_margin, words=words
        )
    if float(estimate_dexterity(chain, q[None])[0]) < limits.dexterity:
        words = "its posture would be nearly singular"
        return Refusal(RefusalKind.SINGULAR, (description.name,), words=words)
    posture = hand.q_home.copy()
    posture[finger] = q
    nearest = hand.probe.find_nearest(posture, X_WO, (finger,), list_others(hand, finger))
    if nearest.distance < limits.clearance:
        gaps = spell_apart(1e3 * nearest.distance, 1e3 * limits.clearance)
        words = f"{nearest.names} would come within {gaps[0]} mm, and {gaps[1]} mm have to be left"
        return replace(refuse_nearness(nearest, limits.clearance), words=words)
    return None


def refuse_start_contact(hand: HandModel, X_WO: Array, finger: int, given: StartContact) -> No:
    """Return the answer to a start contact which its finger cannot hold, whatever the others do."""
    pose = given.X_OF if isinstance(given, Placement) else given
    X_WF = X_WO @ pose if pose.shape == (4, 4) else None
    refusal = refuse_contact(hand, finger, X_WO, find_start_direction(X_WO, given), X_WF)
    name = hand.fingers[finger].name
    if refusal is None:
        # Whatever the others do, one state alone is held: it is the way on from there that its joints do not give.
        words = "its joints would come too near to their limits"
        refusal = Refusal(RefusalKind.JOINT_LIMIT, (name,), words=words)
        condition = None
    else:
        condition = find_unmet(refusal)
    if condition is Condition.JOINTS:
        refusal = refuse_locked_joint(hand, finger) or refusal
    cure = 'move the contact towards the finger, or set start.contacts_deg = "auto"'
    if condition in (Condition.STANDING, Condition.JOINTS):
        cure = f"{condition}, or {cure}"
    status = Status.BLOCKED if condition is Condition.STANDING else Status.START_UNREACHABLE
    reason = f"{name} cannot hold its start contact: {refusal}; {cure}"
    return No(status, reason, replace(refusal, cure=Cure(cure)))


def find_start_point(hand: HandModel, X_WO: Array, direction: Array) -> tuple[Array, Array]:
    """Return where the ray from the object's origin along ``direction`` (3,) in W leaves the body (3,) [m], and the outward
    normal (3,) there, both in O.
    """
    body = hand.object.body
    point = body.radial(X_WO[:3, :3].T @ direction)
    return point, body.normal_at(point)


def find_start_direction(X_WO: Array, given: StartContact) -> Array:
    """Return the direction (3,) in W of a start contact from the object's origin: on a ball its outward normal."""
    pose = given.X_OF if isinstance(given, Placement) else given
    arm = X_WO[:3, :3] @ pose[:3, 3] if pose.shape == (4, 4) else pose
    return np.asarray(arm / np.linalg.norm(arm))


def may_hold_at(hand: HandModel, goal: RotationGoal, start: tuple[StartContact | None, ...] | None) -> bool:
    """Return whether two of the start contacts are within reach of their fingers at the goal, as far as each alone goes."""
    X_WO, reached = goal.X_WO_goal, 0
    turn = X_WO[:3, :3] @ goal.X_WO_start[:3, :3].T
    for finger, given in enumerate(start or ()):
        if given is not None:
            direction = turn @ find_start_direction(goal.X_WO_start, given)
            reached += refuse_contact(hand, finger, X_WO, direction) is None
    return reached > 1


def refuse_region(name: str) -> No:
    """Return the answer to a start contact of the finger ``name`` where contacts are not allowed."""
    words = f"the start contact of {name} lies outside object.allowed_regions"
    cure = Cure('move it inside, or set start.contacts_deg = "auto"')
    refusal = Refusal(RefusalKind.NOT_ALLOWED, (name,), cure=cure, words=words)
    return No(Status.START_NOT_ALLOWED, f"{words}; {cure}", refusal)
