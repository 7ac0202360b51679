"""Simultaneous motion: a free finger travels while the others move the object [paper §1 (c)].

A relocation has three parts: the finger leaves its contact for a hover, travels, and comes down from a hover.  Only the first and
the last need the object at rest.  Where a lift comes right before a motion of the object, or a placement right after one, the
travel is handed over to the motion: the action MoveObject then has the travelling finger's way.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dexplan.kinematics.arcs import build_travel, compute_hover, refine
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.kinematics.finger import FingerDescription
from dexplan.planning.actions.joining import follow_actions
from dexplan.planning.admissible.carry import follow_object
from dexplan.planning.admissible.hand import HandModel, compute_travel_margin
from dexplan.planning.admissible.order import keeps_order
from dexplan.planning.ways.detour import NOBODY, Surroundings, find_detour
from dexplan.planning.ways.travel import Way, choose_nearer
from dexplan.plans.actions import Action, FingerWay, MoveObject, Relocate
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.phases import TRAVEL
from dexplan.plans.plan import Plan
from dexplan.scene.description import Nearness
from dexplan.spatial import Array

LOOKS = 33
"""A journey is looked at this often at least."""
LIMITS = "the finger's joint limits or the fingers' order"
"""What is in the way where no body is."""
AT_LIMITS = Nearness(-np.inf, LIMITS)


def build_journey(
    finger: FingerDescription, leaves: Array | None, comes: Array | None, motion: ObjectMotion
) -> Array:
    """Return the postures (K, J) of a finger that travels while the object goes through ``motion``.

    It starts at the hover posture ``leaves`` (J,) over where the object is at first and ends at the hover posture ``comes`` over
    where the object ends; None: home.  At progress s of the object it has done ``smooth_step(s)`` of its way.
    """
    centers = motion.X_WO_start[:3, 3], motion.X_WO_end[:3, 3]
    if leaves is not None and comes is not None:
        # Straight on, without the detour by home: the arc stays as far off the object as both hovers are.
        return build_travel(finger, leaves, comes, 0.5 * (centers[0] + centers[1]))
    if leaves is not None:
        return build_travel(finger, finger.q_home, leaves, centers[0])[::-1]
    assert comes is not None
    return build_travel(finger, finger.q_home, comes, centers[1])


def overlap_travel(hand: HandModel, plan: Plan) -> Plan:
    """Return the plan with every travel that may go on during a motion of the object handed over to it.

    A journey is handed over only where it stays clear of the moving object and of the fingers that carry it, and keeps the
    fingers' order.
    """
    actions = list(plan.actions)
    held: list[Contacts] = [plan.start_contacts]
    for action in plan.actions:
        held.append(follow_actions(hand, held[-1], (action,)))
    for k, action in enumerate(plan.actions):
        if not isinstance(action, MoveObject):
            continue
        lift, place = _find_travel(actions, k - 1, False), _find_travel(actions, k + 1, True)
        if lift is not None and place is not None and lift.finger != place.finger:
            place = None
        options = [o for o in ((lift, place), (lift, None), (None, place)) if any(o)]
        for option in options:
            if (way := _find_journey(hand, action, held[k], held[k - 1], option)) is not None:
                _hand_over(hand, actions, k, option, way)
                break
    overlaps = count_overlaps(tuple(actions))
    return replace(plan, actions=tuple(actions), statistics={**plan.statistics, **overlaps})


def count_overlaps(actions: tuple[Action, ...]) -> dict[str, float]:
    """Return how many times a finger was lifted or placed, and how many of these travel while the object moves."""
    changes = [a for a in actions if isinstance(a, Relocate)]
    overlapping = sum(not a.has_travel for a in changes)
    return {"relocations": len(changes), "relocations_overlapping": overlapping}


def _find_travel(actions: list[Action], k: int, is_placing: bool) -> Relocate | None:
    """Return action ``k`` if it places, or lifts, a finger and has its own travel."""
    action = actions[k] if 0 <= k < len(actions) else None
    if not isinstance(action, Relocate) or action.is_placing != is_placing:
        return None
    return action if action.has_travel else None


def _find_journey(
    hand: HandModel,
    action: MoveObject,
    contacts: Contacts,
    before: Contacts,
    option: tuple[Relocate | None, Relocate | None],
) -> Way | None:
    """Return how a finger can travel during ``action``, which begins with ``contacts``; ``before`` those before the lift.

    The way around what is in the arc's way has to be clear with the object at the start, in the middle and at the end of its
    motion; whatever is found is looked at once more as finger and object will really go.  None where nothing is clear.
    """
    if action.rolls:
        return None  # carried on rolling contacts: not looked at
    lift, place = option
    motion = action.motion
    changing = lift or place
    assert changing is not None
    finger = changing.finger
    who, leaves, comes = hand.fingers[finger], None, None
    if lift is not None:
        old = before[finger]
        assert old is not None
        leaves = compute_hover(who, motion.X_WO_start, old.X_OF, old.normal_O, old.q, hand.hover)
    if place is not None:
        new = place.contacts_end[finger]
        assert new is not None
        comes = compute_hover(who, motion.X_WO_end, new.X_OF, new.normal_O, new.q, hand.hover)
    poses = motion.poses()
    poses = motion.poses(max(LOOKS, len(poses)))
    holders = tuple(c for c in contacts if c is not None)
    carried = [follow_object(hand, c, poses)[0] for c in holders]
    if any(len(q) < len(poses) for q in carried):
        return None
    touching = tuple(c.finger for c in holders)
    moments = []
    for k, X_WO in enumerate(poses):
        q = hand.q_home.copy()
        q[list(touching)] = [way[k] for way in carried]
        moments.append(Surroundings(hand, q, X_WO, finger, touching))
    arc = build_journey(who, leaves, comes, motion)
    nearest = _look(moments, holders, arc)
    if nearest.distance >= hand.limits.clearance:
        return Way(arc, nearest)
    found = find_detour((moments[0], moments[len(moments) // 2], moments[-1]), arc[0], arc[-1])
    if found.way is None:
        return None
    around, nearest = nearest.names, _look(moments, holders, found.way)
    return Way(found.way, nearest, around) if nearest.distance >= hand.limits.clearance else None


def _look(moments: list[Surroundings], holders: tuple[Placement, ...], way: Array) -> Nearness:
    """Return what is nearest to what while a finger goes its ``way`` (K, J) through the ``moments`` of a motion.

    The distance is -inf where a joint leaves its limits or the fingers' order changes.
    """
    hand, finger = moments[0].hand, moments[0].finger
    chain = hand.fingers[finger].chain
    if compute_joint_margin(chain, refine(way)).min() < compute_travel_margin(hand, finger):
        return AT_LIMITS
    share = np.linspace(0.0, 1.0, len(moments))
    done = share**3 * (10.0 + share * (6.0 * share - 15.0))
    even = np.linspace(0.0, 1.0, len(way))
    travelled = np.stack([np.interp(done, even, column) for column in way.T], axis=1)
    tips = compute_tip_pose(chain, travelled)[:, :3, 3]
    least = NOBODY
    for moment, posture, tip in zip(moments, travelled, tips, strict=True):
        X_WO = moment.X_WO
        normals = {f: p - X_WO[:3, 3] for f, p in enumerate(hand.p_WF_home)}
        normals.update({c.finger: X_WO[:3, :3] @ c.normal_O for c in holders})
        normals[finger] = tip - X_WO[:3, 3]
        least = choose_nearer(least, moment.find_nearest(posture))
        if least.distance < hand.limits.clearance:
            return least
        if not keeps_order(hand, normals):
            return AT_LIMITS
    return least


def _hand_over(
    hand: HandModel, actions: list[Action], k: int, option: tuple[Relocate | None, Relocate | None], way: Way
) -> None:
    """Take the travel out of a lift before action ``k``, a placement after it, or both; action ``k`` gets it, by ``way``."""
    lift, place = option
    changing = lift or place
    assert changing is not None
    finger, name = changing.finger, hand.fingers[changing.finger].name
    for j, relocation in ((k - 1, lift), (k + 1, place)):
        if relocation is not None:
            kept = tuple(p for p in relocation.phases if p.name != TRAVEL)
            actions[j] = replace(relocation, phases=kept, ways=())
    ends = {
        (True, False): "home",
        (False, True): "over its next contact",
        (True, True): "over its next contact",
    }
    where = ends[lift is not None, place is not None]
    around = f" by a detour that keeps {way.around} apart" if way.around else ""
    why = f"{actions[k].why}; meanwhile {name} travels {where}{around}"
    ways = (FingerWay(finger, way.postures, is_detour=bool(way.around)),)
    actions[k] = replace(actions[k], why=why, ways=ways)
