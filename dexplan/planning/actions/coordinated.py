"""Coordinated object manipulation: the object moves, all contacts stay where they are on it [paper §1; MLS 1994, ch. 5]."""

from __future__ import annotations

from dataclasses import replace

from dexplan.planning.admissible.admissibility import Admissibility, compute_finger_states, worst
from dexplan.planning.admissible.carry import follow_object, judge_carry, spin_tip
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.actions import MoveObject
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.phases import PlannedPhase, demand_touch
from dexplan.plans.refusal import Refusal


def center_spin(hand: HandModel, placement: Placement, motion: ObjectMotion) -> Placement:
    """Return the landing with its spin chosen so that the tip's own joint stays around the middle of its range on the motion.

    ``placement`` stands where the motion begins.
    """
    chain = hand.fingers[placement.finger].chain
    if not chain.has_tip_roll or motion.is_still:
        return placement
    q, _ = follow_object(hand, placement, motion.poses())
    middle = 0.5 * (chain.lower[-1] + chain.upper[-1])
    return spin_tip(hand, placement, float(middle - 0.5 * (q[:, -1].min() + q[:, -1].max())))


def plan_coordinated(
    hand: HandModel,
    admissibility: Admissibility,
    contacts: Contacts,
    motion: ObjectMotion,
    why: str,
) -> tuple[MoveObject | None, Refusal | None]:
    """Return the action that carries the object through ``motion`` with all ``contacts`` fixed, or why that is not possible."""
    poses = motion.poses()
    ways = {}
    for c in contacts:
        if c is None:
            continue
        ways[c.finger], refusal = follow_object(hand, c, poses)
        if refusal:
            return None, refusal
    states = {f: compute_finger_states(hand, f, way) for f, way in ways.items()}
    rows, refusal = judge_carry(hand, admissibility, states, motion, poses)
    if refusal:
        return None, refusal
    action = MoveObject(
        motion=motion,
        grasping=tuple(sorted(ways)),
        contacts_end=tuple(None if c is None else replace(c, q=ways[c.finger][-1]) for c in contacts),
        phases=(PlannedPhase("move", demand_touch(contacts)),),
        why=why,
        margins=worst(rows),
    )
    return action, None
