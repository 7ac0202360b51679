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
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.spatial import Array, build_frame

GoalContacts = tuple[Array | None, ...]
"""Per finger the outward normal (3,) of its goal contact in object axes, None where it has to be free."""
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


def refuse_goal_contacts(hand: HandModel, goal: GoalContacts) -> No | None:
    """Return the answer to goal contacts that cannot be wherever the object is; None where nothing is wrong with them.

    These are questions of the object and the fingertips alone: where contacts are allowed, whether tips overlap, and force
    closure with the believed friction.
    """
    surface, names = hand.object.surface, [f.name for f in hand.fingers]
    wanted = [(f, n) for f, n in enumerate(goal) if n is not None]
    for f, n in wanted:
        if not hand.object.allows(n[None])[0]:
            words = f"the goal contact of {names[f]} lies outside object.allowed_regions"
            cure = Cure("move it inside, or widen a region")
            return _refuse(
                Status.GOAL_NOT_ALLOWED, Refusal(RefusalKind.NOT_ALLOWED, (names[f],), cure=cure, words=words)
            )
    for (f, n), (g, m) in combinations(wanted, 2):
        tips = [hand.fingers[k].tip_radius for k in (f, g)]
        between = np.linalg.norm(surface.radial(n) + tips[0] * n - surface.radial(m) - tips[1] * m)
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
    grasp = Grasp(tuple(Contact(f, surface.radial(n), build_frame(-n), hand.friction) for f, n in wanted))
    if not check_force_closure(grasp).is_closed:
        who = tuple(names[f] for f, _ in wanted)
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
