"""What is wrong with goal contacts wherever the object is, and what would help against a refusal."""

from __future__ import annotations

import re
from itertools import combinations

import numpy as np

from dexplan.errors import spell_apart
from dexplan.grasp.closure import check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.plan.status import Status
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max, describe_separation
from dexplan.spatial import Array, build_frame

GoalContacts = tuple[Array | None, ...]
"""Per finger the outward normal (3,) of its goal contact in object axes, None where it has to be free."""
OF_ONE_FINGER = re.compile(r"(\w+)/\w+ and \1/\w+ (come within|too near)")
"""A refusal because a finger meets itself."""


def refuse_goal_contacts(hand: HandModel, goal: GoalContacts) -> tuple[Status, str] | None:
    """Return the status and the reason that refuse the goal contacts wherever the object is; None where nothing does.

    These are questions of the object and the fingertips alone: where contacts are allowed, whether tips overlap, and force
    closure with the believed friction.
    """
    surface, names = hand.object.surface, [f.name for f in hand.fingers]
    wanted = [(f, n) for f, n in enumerate(goal) if n is not None]
    for f, n in wanted:
        if not hand.object.allows(n[None])[0]:
            return Status.GOAL_NOT_ALLOWED, (
                f"the goal contact of {names[f]} lies outside object.allowed_regions; move it inside, or widen a region"
            )
    for (f, n), (g, m) in combinations(wanted, 2):
        tips = [hand.fingers[k].tip_radius for k in (f, g)]
        between = np.linalg.norm(surface.radial(n) + tips[0] * n - surface.radial(m) - tips[1] * m)
        if (gap := between - sum(tips)) < hand.limits.clearance:
            left, kept = spell_apart(1e3 * float(gap), 1e3 * hand.limits.clearance)
            return Status.GOAL_GRASP_INADMISSIBLE, (
                f"the tips of {names[f]} and {names[g]} would come within {left} mm at their goal contacts, and "
                f"{kept} mm have to be left; move the two contacts apart"
            )
    grasp = Grasp(tuple(Contact(f, surface.radial(n), build_frame(-n), hand.friction) for f, n in wanted))
    if not check_force_closure(grasp).is_closed:
        return Status.GOAL_GRASP_INADMISSIBLE, (
            "the goal contacts are not force closed with the believed friction; move two of them nearer to opposite, raise "
            "the friction, or lower friction.safety"
        )
    return None


def suggest_cure(refusal: str) -> str:
    """Return what would help against a refusal of a grasp or of the way to it."""
    if "obstacle" in refusal or "floor" in refusal:
        return "move or shrink what is in the way, or choose goal contacts or a goal pose farther from it"
    if OF_ONE_FINGER.search(refusal):
        return "move the goal contact of this finger towards where it stands"
    if "come within" in refusal or "too near" in refusal:
        return "move the goal contacts of these fingers apart, or towards where the fingers stand"
    if any(word in refusal for word in ("joint", "singular", "workspace", "order", "reach")):
        return "move the goal contacts towards where the fingers stand, and keep the fingers' clockwise order"
    return "move two of the goal contacts nearer to opposite, raise the friction, lower friction.safety, or use a lighter object"


def explain_separation(hand: HandModel) -> str:
    """Return in words how far apart two contacts have to be for their fingers to hold alone with the believed friction."""
    beta = compute_pair_angle_max(hand.friction.scaled(hand.limits.cone_share)) - hand.limits.closure_margin
    return f"two contacts have to be {describe_separation(beta, hand.friction.sliding)}"
