"""A plan's parts in words: which finger, from where to where, what holds meanwhile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dexplan.plans.actions import Action, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Contacts, GoalContact
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import angles_from_direction


def describe_goal_contacts(fingers: Sequence[str], contacts: Sequence[GoalContact | None]) -> str:
    """Return in words where the fingers of these names have to touch in the end."""
    words = []
    for name, contact in zip(fingers, contacts, strict=True):
        if contact is None:
            words.append(f"{name} free")
            continue
        az, el = angles_from_direction(contact.normal_O)
        words.append(f"{name} at azimuth {az:.1f}, elevation {el:.1f} deg")
    return f"goal contacts (on the object): {'; '.join(words)}"


def explain_action(fingers: Sequence[str], action: Action, before: Contacts) -> str:
    """Return one action as a sentence, its reason last; ``before`` are the contacts before it."""
    holders = " and ".join(fingers[i] for i in action.grasping)
    match action:
        case MoveObject():
            text = f"{describe_motion(action.motion)}, held by {holders}"
        case Roll():
            rolling = " and ".join(_describe_roll(fingers, roll) for roll in action.rolls)
            text = f"roll {rolling} while {holders} hold"
        case Relocate():
            where = _describe_place(action, before)
            text = f"{action.name} {fingers[action.finger]}{where} while {holders} hold"
        case Hold():
            text = f"hold with {holders}"
    return f"{text}: {action.why}"


def describe_motion(motion: ObjectMotion) -> str:
    """Return in words how the object turns and is shifted."""
    axis = "(" + ", ".join(f"{x:.2f}" for x in motion.axis_W) + ")"
    shift = 1e3 * motion.shift_W
    turn = f"turn the object by {np.degrees(motion.angle):.1f} deg about {axis}"
    if np.linalg.norm(shift) < 0.05:
        return turn
    way = "(" + ", ".join(f"{x:.1f}" for x in shift + 0.0) + ") mm"
    return f"{turn} and shift it by {way}" if motion.angle else f"shift the object by {way}"


def _describe_place(action: Relocate, before: Contacts) -> str:
    """Return where the relocated finger touches, or touched."""
    placement = action.contacts_end[action.finger] or before[action.finger]
    if placement is None:
        return ""
    az, el = angles_from_direction(action.X_WO_end[:3, :3] @ placement.normal_O)
    return f" at azimuth {az:.1f}, elevation {el:.1f} deg (world)"


def _describe_roll(fingers: Sequence[str], roll: TipRoll) -> str:
    way = np.degrees(np.arccos(np.clip(roll.normal_O[0] @ roll.normal_O[-1], -1.0, 1.0)))
    return f"{fingers[roll.finger]} over {way:.1f} deg of the object"
