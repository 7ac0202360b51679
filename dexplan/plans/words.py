"""A plan's parts in words: which finger, from where to where, what holds meanwhile."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dexplan.plans.actions import Action, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Contacts, GoalContact
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, angles_from_direction

OFF_RADIAL = 1e-4
"""A normal that passes the object's centre by more [m] does not say where its contact is."""


def describe_goal_contacts(fingers: Sequence[str], contacts: Sequence[GoalContact | None]) -> str:
    """Return in words where the fingers of these names have to touch in the end."""
    words = []
    for name, contact in zip(fingers, contacts, strict=True):
        if contact is None:
            words.append(f"{name} free")
            continue
        words.append(f"{name} at {_spell_place(contact.point_O, contact.normal_O, contact.normal_O)}")
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
    facing = action.X_WO_end[:3, :3] @ placement.normal_O
    return f" at {_spell_place(placement.point_O, placement.normal_O, facing)} (world)"


def _spell_place(point_O: Array, normal_O: Array, facing: Array) -> str:
    """Return where a contact is: by the direction that the surface faces there, which says all on a ball.

    Elsewhere contacts on one face share it, and the point on the object is named, too.
    """
    az, el = angles_from_direction(facing)
    words = f"azimuth {az:.1f}, elevation {el:.1f} deg"
    if np.linalg.norm(np.cross(point_O, normal_O)) < OFF_RADIAL:
        return words
    place = ", ".join(f"{1e3 * x + 0.0:.1f}" for x in point_O)
    return f"({place}) mm of the object, which faces {words} there"


def _describe_roll(fingers: Sequence[str], roll: TipRoll) -> str:
    way = np.degrees(np.arccos(np.clip(roll.normal_O[0] @ roll.normal_O[-1], -1.0, 1.0)))
    return f"{fingers[roll.finger]} over {way:.1f} deg of the object"
