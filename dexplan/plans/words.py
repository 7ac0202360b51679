"""A plan in words: which finger, why, from where to where, what holds meanwhile, what is left."""

from __future__ import annotations

import numpy as np

from dexplan.plans.plan import Action, Placement, Plan
from dexplan.plans.roll import Roll
from dexplan.spatial import angles_from_direction


def explain_plan(plan: Plan) -> str:
    """Return the plan as text, its status first, then two lines per action."""
    lines = [f"status: {plan.status}" + (f" ({plan.reason})" if plan.reason else "")]
    lines += _describe_goal(plan)
    if plan.speed is not None:
        lines.append(f"speed: {plan.speed}")
    before = plan.start_contacts
    for k, action in enumerate(plan.actions):
        lines.append(f"{k + 1:3d}. {_describe_action(plan, action, before)}")
        if action.margins:
            margins = ", ".join(f"{key} {value:.3g}" for key, value in action.margins.items())
            lines.append(f"     margins: {margins}")
        before = action.contacts_end
    return "\n".join(lines)


def _describe_goal(plan: Plan) -> list[str]:
    """Return one line that says where the fingers have to touch in the end; none where the goal does not."""
    if plan.goal_contacts is None:
        return []
    words = []
    for name, contact in zip(plan.fingers, plan.goal_contacts, strict=True):
        if contact is None:
            words.append(f"{name} free")
            continue
        az, el = angles_from_direction(contact.normal_O)
        words.append(f"{name} at azimuth {az:.1f}, elevation {el:.1f} deg")
    return [f"goal contacts (on the object): {'; '.join(words)}"]


def _describe_action(plan: Plan, a: Action, before: tuple[Placement | None, ...]) -> str:
    """Return one action as a sentence; ``before`` are the contacts before it."""
    holders = " and ".join(plan.fingers[i] for i in a.grasping)
    if a.kind == "move_object":
        text = f"{_describe_motion(a)}, held by {holders}"
    elif a.kind == "roll":
        text = f"roll {' and '.join(_describe_roll(plan, r) for r in a.rolls)} while {holders} hold"
    elif a.finger is not None:
        placement = a.contacts_end[a.finger] or before[a.finger]
        where = ""
        if placement is not None:
            az, el = angles_from_direction(a.X_WO_end[:3, :3] @ placement.normal_O)
            where = f" at azimuth {az:.1f}, elevation {el:.1f} deg (world)"
        text = f"{a.kind} {plan.fingers[a.finger]}{where} while {holders} hold"
    else:
        text = f"hold with {holders}"
    return f"{text}: {a.why}"


def _describe_motion(a: Action) -> str:
    axis = "(" + ", ".join(f"{x:.2f}" for x in a.axis_W) + ")"
    shift = 1e3 * (a.X_WO_end[:3, 3] - a.X_WO_start[:3, 3])
    turn = f"turn the object by {np.degrees(a.angle):.1f} deg about {axis}"
    if np.linalg.norm(shift) < 0.05:
        return turn
    way = "(" + ", ".join(f"{x:.1f}" for x in shift + 0.0) + ") mm"
    return f"{turn} and shift it by {way}" if a.angle else f"shift the object by {way}"


def _describe_roll(plan: Plan, roll: Roll) -> str:
    way = np.degrees(np.arccos(np.clip(roll.normal_O[0] @ roll.normal_O[-1], -1.0, 1.0)))
    return f"{plan.fingers[roll.finger]} over {way:.1f} deg of the object"
