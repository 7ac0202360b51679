"""What a grasp has to meet, by name: so that who refuses one can say what would help without reading sentences."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max, describe_separation
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.scene.description import OBJECT, STANDING, Nearness


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

    def explain(self, hand: HandModel) -> Refusal:
        """Return what holds where no pair of contacts meets this condition and all others."""
        if self is Condition.FRICTION:
            limits = hand.limits
            beta = compute_pair_angle_max(hand.friction.scaled(limits.cone_share)) - limits.closure_margin
            words = f"no two fingers reach contacts {describe_separation(beta, hand.friction.sliding)}"
            return Refusal(RefusalKind.NOT_CLOSED, needed=np.pi - 2.0 * max(beta, 0.0), words=words)
        if self is Condition.JOINTS:
            kept = hand.limits.joint_margin
            words = f"the joint ranges, {np.degrees(kept):.3g} deg kept from their ends, leave no two fingers contacts that hold"
            return Refusal(RefusalKind.JOINT_LIMIT, needed=kept, words=words)
        if self is Condition.ALLOWED:
            words = "object.allowed_regions leave no two fingers contacts that hold"
            return Refusal(RefusalKind.NOT_ALLOWED, words=words)
        if self is Condition.WEIGHT:
            return Refusal(RefusalKind.TOO_HEAVY)
        return Refusal(RefusalKind.LOAD, words="no two fingers hold it")


def refuse_nearness(nearest: Nearness, needed: float) -> Refusal:
    """Return the refusal because two bodies are nearer to one another than ``needed`` [m]."""
    return Refusal(_classify(nearest.owners), nearest.bodies, nearest.distance, needed)


def _classify(owners: tuple[int, ...]) -> RefusalKind:
    if STANDING in owners:
        return RefusalKind.NEAR_STANDING
    if OBJECT in owners:
        return RefusalKind.NEAR_OBJECT
    return RefusalKind.NEAR_FINGER if len(set(owners)) > 1 else RefusalKind.NEAR_ITSELF


UNMET = {
    RefusalKind.JOINT_LIMIT: Condition.JOINTS,
    RefusalKind.LOCKED_JOINT: Condition.JOINTS,
    RefusalKind.SINGULAR: Condition.POSTURE,
    RefusalKind.OUT_OF_REACH: Condition.POSTURE,
    RefusalKind.NEAR_STANDING: Condition.STANDING,
    RefusalKind.NEAR_FINGER: Condition.FINGERS,
    RefusalKind.NEAR_ITSELF: Condition.POSTURE,
    RefusalKind.NEAR_OBJECT: Condition.POSTURE,
    RefusalKind.WAITING: Condition.WAITING,
    RefusalKind.ORDER: Condition.ORDER,
    RefusalKind.NOT_ALLOWED: Condition.ALLOWED,
    RefusalKind.LOAD: Condition.FRICTION,
    RefusalKind.NOT_CLOSED: Condition.FRICTION,
    RefusalKind.TOO_HEAVY: Condition.WEIGHT,
}
"""The condition that is not met, by what a refusal is or comes down to."""


def find_unmet(refusal: Refusal | None) -> Condition | None:
    """Return the condition that a refusal is about; None where it is about none of them, or there is no refusal."""
    if refusal is None:
        return None
    found = [UNMET[kind] for kind in refusal.chain if kind in UNMET]
    # What stands in the way of a finger that waits helps by going, whoever waits.
    return Condition.STANDING if Condition.STANDING in found else found[0] if found else None


def refuse_locked_joint(hand: HandModel, finger: int) -> Refusal | None:
    """Return which joint of a finger has no room between its limits for holding anything; None where all have."""
    description, margin = hand.fingers[finger], hand.limits.joint_margin
    ranges = description.chain.upper - description.chain.lower
    if ranges.min() > 2.0 * margin + 1e-9:
        return None
    name = description.joint_names[int(ranges.argmin())].replace("/", ".")
    words = (
        f"{name} has a range of {np.degrees(ranges.min()):.1f} deg, and a finger that holds keeps {np.degrees(margin):.3g} deg "
        "to either end"
    )
    return Refusal(RefusalKind.LOCKED_JOINT, (name,), float(ranges.min()), 2.0 * margin, words=words)
