"""What is wrong with goal contacts wherever the object is, and what would help against a refusal."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from dexplan.errors import spell_apart
from dexplan.grasp.closure import check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max, describe_separation
from dexplan.planning.tasks.no import No
from dexplan.plans.contacts import GoalContact
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.spatial import Array, build_frame

GoalContacts = tuple[Array | None, ...]
"""Per finger the direction (3,) of its goal contact from the object's origin in object axes, on a ball the outward normal; None
where it has to be free."""
CURES = {
    RefusalKind.NEAR_STANDING: (
        "move or shrink what is in the way, or choose goal contacts or a goal pose farther from it"
    ),
    RefusalKind.NEAR_FINGER: "move the goal contacts of these fingers apart, or towards where the fingers stand",
    RefusalKind.NEAR_ITSELF: "move the goal contact of this finger towards where it stands",
    RefusalKind.NEAR_OBJECT: "move the goal contact of this finger towards where it stands",
}
"""What helps against a refusal of a grasp or of the way to it, by what it comes down to."""
REACH_CURE = "move the goal contacts towards where the fingers stand, and keep the fingers' clockwise order"
CURES |= dict.fromkeys(
    (
        RefusalKind.JOINT_LIMIT,
        RefusalKind.LOCKED_JOINT,
        RefusalKind.SINGULAR,
        RefusalKind.ORDER,
        RefusalKind.OUT_OF_REACH,
        RefusalKind.GOAL_CONTACT_OUT_OF_REACH,
        RefusalKind.TIP_POLE,
        RefusalKind.TIP_ROTATION,
    ),
    REACH_CURE,
)
LOAD_CURE = "move two of the goal contacts nearer to opposite, raise the friction, lower friction.safety, or use a lighter object"


def locate_goal(hand: HandModel, goal: GoalContacts) -> tuple[GoalContact | None, ...]:
    """Return per finger where on the object its goal contact is: where the ray along its direction leaves the body."""
    body, found = hand.object.body, list[GoalContact | None]()
    for finger, direction in enumerate(goal):
        if direction is None:
            found.append(None)
        elif hand.object.is_isotropic:
            found.append(GoalContact(finger, hand.object.surface.radial(direction), direction))
        else:
            point = body.radial(direction)
            found.append(GoalContact(finger, point, body.normal_at(point)))
    return tuple(found)


def refuse_goal_contacts(hand: HandModel, goal: GoalContacts) -> No | None:
    """Return the answer to goal contacts that cannot be wherever the object is; None where nothing is wrong with them.

    These are questions of the object and the fingertips alone: where contacts are allowed, whether tips overlap, and force
    closure with the believed friction.
    """
    names = [f.name for f in hand.fingers]
    for f, direction in enumerate(goal):
        if direction is not None and not hand.object.allows(direction[None])[0]:
            words = f"the goal contact of {names[f]} lies outside object.allowed_regions"
            cure = Cure("move it inside, or widen a region")
            return _refuse(
                Status.GOAL_NOT_ALLOWED, Refusal(RefusalKind.NOT_ALLOWED, (names[f],), cure=cure, words=words)
            )
    wanted = [one for one in locate_goal(hand, goal) if one is not None]
    for one, other in combinations(wanted, 2):
        f, g = one.finger, other.finger
        tips = [hand.fingers[k].tip_radius for k in (f, g)]
        between = np.linalg.norm(
            one.point_O + tips[0] * one.normal_O - other.point_O - tips[1] * other.normal_O
        )
        if (gap := float(between - sum(tips))) < (needed := hand.limits.clearance):
            left, kept = spell_apart(1e3 * gap, 1e3 * needed)
            words = (
                f"the tips of {names[f]} and {names[g]} would come within {left} mm at their goal contacts, and "
                f"{kept} mm have to be left"
            )
            cure = Cure("move the two contacts apart")
            return _refuse(
                Status.GOAL_GRASP_INADMISSIBLE,
                Refusal(RefusalKind.NEAR_FINGER, (names[f], names[g]), gap, needed, cure, words=words),
            )
    grasp = Grasp(
        tuple(Contact(c.finger, c.point_O, build_frame(-c.normal_O), hand.friction) for c in wanted)
    )
    if not check_force_closure(grasp).is_closed:
        who = tuple(names[c.finger] for c in wanted)
        words = "the goal contacts are not force closed with the believed friction"
        cure = Cure("move two of them nearer to opposite, raise the friction, or lower friction.safety")
        return _refuse(
            Status.GOAL_GRASP_INADMISSIBLE, Refusal(RefusalKind.NOT_CLOSED, who, cure=cure, words=words)
        )
    return None


def _refuse(status: Status, refusal: Refusal) -> No:
    return No(status, f"{refusal}; {refusal.cure}", refusal)


def suggest_cure(refusal: Refusal) -> Cure:
    """Return what would help against a refusal of a grasp or of the way to it; nothing of it was tried."""
    return Cure(CURES.get(refusal.root.kind, LOAD_CURE))


def explain_separation(hand: HandModel) -> str:
    """Return in words how far apart two contacts have to be for their fingers to hold alone with the believed friction."""
    beta = compute_pair_angle_max(hand.friction.scaled(hand.limits.cone_share)) - hand.limits.closure_margin
    return f"two contacts have to be {describe_separation(beta, hand.friction.sliding)}"
