"""What is in the way before anything moves: of the hand whatever it does, of the object where it is, of fingers that wait."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from dexplan.errors import spell_apart
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_tip_pose
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.conditions import Condition, classify_nearness, explain_locked_joint
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.lone_clearance import list_others
from dexplan.planning.tasks.pair_survey import find_nearest_at_home
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Placement
from dexplan.scene.description import STANDING, Nearness
from dexplan.spatial import Array, make_pose

StartContact = Array | Placement
"""An outward normal (3,) in W, a tip pose X_OF (4, 4) in the object frame, or the placement with which a finger came there."""


def explain_obstruction(hand: HandModel, waiting: tuple[int, ...] | None = None) -> str:
    """Return what is in the way of any plan, and the cure; "" where nothing is.

    ``waiting``: the fingers that are free at the start, None where the planner chooses.  A finger that holds is not at home, so
    that what is in the way there matters only for fingers that have to be.
    """
    for overlap in hand.probe.find_overlaps():
        return (
            f"{overlap.names} overlap by {-1e3 * overlap.distance:.1f} mm wherever the fingers are; "
            f"{_suggest_cure_of_overlap(overlap)}"
        )
    everyone, X_WO = tuple(range(len(hand.fingers))), hand.object.X_WO_home
    nearest = hand.probe.find_nearest(hand.q_home, X_WO, (), everyone)
    if nearest.distance < hand.limits.clearance:
        return _spell(hand, nearest, "where the object is at the start", Condition.STANDING)
    at_home = {f: find_nearest_at_home(hand, X_WO, f) for f in everyone}
    blocked = [f for f in everyone if at_home[f].distance < hand.limits.clearance]
    if waiting is None:
        # Two fingers hold and the others wait: is there a choice of two that leaves nobody blocked waiting?
        if any(set(blocked) <= set(pair) for pair in combinations(everyone, 2)):
            return ""
        waiting = tuple(blocked)
    for finger in waiting:
        if finger in blocked:
            kind = classify_nearness(at_home[finger])
            where = f"while {hand.fingers[finger].name} is at home, where a free finger waits"
            return _spell(
                hand, at_home[finger], where, kind if kind is Condition.STANDING else Condition.WAITING
            )
    return ""


def _spell(hand: HandModel, nearest: Nearness, where: str, cure: str) -> str:
    left, kept = spell_apart(1e3 * nearest.distance, 1e3 * hand.limits.clearance)
    return f"{nearest.names} come within {left} mm {where}, and {kept} mm have to be left; {cure}"


def _suggest_cure_of_overlap(overlap: Nearness) -> str:
    if STANDING in overlap.owners:
        return "move or shrink the obstacle"
    if len(set(overlap.owners)) > 1:
        return "stand the fingers farther apart (hand.base_azimuths_deg)"
    return "use a smaller tip (hand.tip_radii_m), or widen hand.joint_ranges_deg"


def explain_contact(
    hand: HandModel, finger: int, center: Array, normal: Array, X_WF: Array | None = None
) -> tuple[Condition | None, str]:
    """Return which condition a finger does not meet that touches along ``normal`` (3,) in W, and how, wherever the others are.

    The object is at ``center`` (3,) [m]; ``X_WF`` (4, 4) is the tip's whole pose where that is given.  None and "it lies outside
    ..." where it is out of reach; None and "" where nothing is wrong with this finger alone.
    """
    limits, description = hand.limits, hand.fingers[finger]
    chain, workspace = description.chain, hand.workspaces[finger]
    X = build_aligned(hand, finger, center, normal[None]) if X_WF is None else X_WF[None]
    if len(workspace.postures):
        solved, reached = solve_tip_pose(workspace, X, counts_spin=X_WF is not None)
    if not len(workspace.postures) or not reached[0]:
        return None, "it lies outside the finger's workspace"
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
        return (
            Condition.JOINTS,
            f"{name} would be {left}, and {np.degrees(limits.joint_margin):.3g} deg are kept",
        )
    if float(estimate_dexterity(chain, q[None])[0]) < limits.dexterity:
        return Condition.POSTURE, "its posture would be nearly singular"
    posture = hand.q_home.copy()
    posture[finger] = q
    nearest = hand.probe.find_nearest(posture, make_pose(p=center), (finger,), list_others(hand, finger))
    if nearest.distance < limits.clearance:
        gaps = spell_apart(1e3 * nearest.distance, 1e3 * limits.clearance)
        why = f"{nearest.names} would come within {gaps[0]} mm, and {gaps[1]} mm have to be left"
        return classify_nearness(nearest), why
    return None, ""


def explain_start_contact(hand: HandModel, X_WO: Array, finger: int, given: StartContact) -> tuple[str, str]:
    """Return the status and the reason that refuse a start contact which its finger cannot hold, whatever the others do."""
    pose = given.X_OF if isinstance(given, Placement) else given
    X_WF = X_WO @ pose if pose.shape == (4, 4) else None
    condition, why = explain_contact(hand, finger, X_WO[:3, 3], find_start_normal(X_WO, given), X_WF)
    if condition is Condition.JOINTS and (locked := explain_locked_joint(hand, finger)):
        why = locked
    why = why or "its joints would come too near to their limits"
    cure = f"{condition}, or " if condition in (Condition.STANDING, Condition.JOINTS) else ""
    return "blocked" if condition is Condition.STANDING else "start_unreachable", (
        f"{hand.fingers[finger].name} cannot hold its start contact: {why}; "
        f'{cure}move the contact towards the finger, or set start.contacts_deg = "auto"'
    )


def find_start_normal(X_WO: Array, given: StartContact) -> Array:
    """Return the outward normal (3,) in W of a start contact."""
    pose = given.X_OF if isinstance(given, Placement) else given
    arm = X_WO[:3, :3] @ pose[:3, 3] if pose.shape == (4, 4) else pose
    return np.asarray(arm / np.linalg.norm(arm))


def may_hold_at(hand: HandModel, goal: RotationGoal, start: tuple[StartContact | None, ...] | None) -> bool:
    """Return whether two of the start contacts are within reach of their fingers at the goal, as far as each alone goes."""
    X_WO, reached = goal.X_WO_goal, 0
    turn = X_WO[:3, :3] @ goal.X_WO_start[:3, :3].T
    for finger, given in enumerate(start or ()):
        if given is not None:
            normal = turn @ find_start_normal(goal.X_WO_start, given)
            reached += not explain_contact(hand, finger, X_WO[:3, 3], normal)[1]
    return reached > 1
