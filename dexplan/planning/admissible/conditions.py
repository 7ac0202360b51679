"""What a grasp has to meet, by name: so that who refuses one can say what would help without reading sentences."""

from __future__ import annotations

import re
from enum import StrEnum

import numpy as np

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max, describe_separation
from dexplan.scene.description import STANDING, Nearness


class Condition(StrEnum):
    """A condition on grasps; its text is what may help where it is not met."""

    STANDING = "move or shrink what is in the way"
    FINGERS = "stand the fingers farther apart (hand.base_azimuths_deg), or use smaller tips"
    WAITING = "let this finger hold from the start on, or use a smaller object"
    POSTURE = "choose contacts nearer to the fingers, or use a smaller object"
    ORDER = "choose contacts in the order of the fingers' bases"
    ALLOWED = "widen object.allowed_regions"
    JOINTS = "widen hand.joint_ranges_deg"
    FRICTION = "raise the friction, or lower friction.safety"
    WEIGHT = "use a lighter object"

    def explain(self, hand: HandModel) -> str:
        """Return in words what holds where no pair of contacts meets this condition and all others."""
        if self is Condition.FRICTION:
            limits = hand.limits
            beta = compute_pair_angle_max(hand.friction.scaled(limits.cone_share)) - limits.closure_margin
            return f"no two fingers reach contacts {describe_separation(beta, hand.friction.sliding)}"
        if self is Condition.JOINTS:
            kept = np.degrees(hand.limits.joint_margin)
            return f"the joint ranges, {kept:.3g} deg kept from their ends, leave no two fingers contacts that hold"
        if self is Condition.ALLOWED:
            return "object.allowed_regions leave no two fingers contacts that hold"
        if self is Condition.WEIGHT:
            return "no two fingers can carry its weight"
        return "no two fingers hold it"


def classify_nearness(nearest: Nearness) -> Condition:
    """Return the condition that bodies do not meet which are too near to one another."""
    if STANDING in nearest.owners:
        return Condition.STANDING
    fingers = {owner for owner in nearest.owners if owner >= 0}
    return Condition.FINGERS if len(fingers) > 1 else Condition.POSTURE


def explain_locked_joint(hand: HandModel, finger: int) -> str:
    """Return which joint of a finger has no room between its limits for holding anything, in words; "" where all have."""
    description, margin = hand.fingers[finger], hand.limits.joint_margin
    ranges = description.chain.upper - description.chain.lower
    if ranges.min() > 2.0 * margin + 1e-9:
        return ""
    name = description.joint_names[int(ranges.argmin())].replace("/", ".")
    return (
        f"{name} has a range of {np.degrees(ranges.min()):.1f} deg, and a finger that holds keeps {np.degrees(margin):.3g} deg "
        "to either end"
    )


def without_numbers(refusal: str) -> str:
    """Return a refusal without what differs from state to state, so that like refusals can be counted."""
    return re.sub(r" within -?[0-9.]+ mm", " too near", refusal)
