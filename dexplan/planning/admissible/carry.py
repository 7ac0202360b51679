"""May fingers carry the object through a motion?  Their postures on the way, and the margins they keep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dexplan.kinematics.chain import compute_tip_pose
from dexplan.kinematics.following import follow_tip
from dexplan.planning.admissible.admissibility import (
    Admissibility,
    FingerState,
    Margins,
)
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.contacts import Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array, invert_pose


def follow_object(hand: HandModel, placement: Placement, X_WO: Array) -> tuple[Array, Refusal | None]:
    """Return the postures (L, J) of a finger whose contact is carried through object poses (K, 4, 4), and what stops it.

    Joint limits are not looked at here; ``placement.q`` is the posture at the first pose.
    """
    description = hand.fingers[placement.finger]
    X_WF = X_WO @ placement.X_OF
    q = follow_tip(description.chain, X_WF, placement.q)
    if len(q) < len(X_WF):
        return q, Refusal(RefusalKind.OUT_OF_REACH, (description.name,))
    return q, None


def judge_carry(
    hand: HandModel,
    admissibility: Admissibility,
    states: dict[int, list[FingerState]],
    motion: ObjectMotion,
    poses: Array,
) -> tuple[list[Margins], Refusal | None]:
    """Return the margins at ``poses`` (K, 4, 4) of a motion, fingers in ``states`` (K of each) holding; and the first refusal."""
    axis = np.sign(motion.angle) * motion.axis_W if abs(motion.angle) > 1e-9 else None
    rows: list[Margins] = []
    for k, X_WO in enumerate(poses):
        now = {finger: way[k] for finger, way in states.items()}
        q = hand.q_home.copy()
        for finger, state in now.items():
            q[finger] = state.q
        row = admissibility.compute_margins_of(now, q, X_WO, axis_W=axis, explain=False)
        if not row.is_admissible:
            return rows, row.refusal
        rows.append(row)
    return rows, None


def spin_tip(hand: HandModel, placement: Placement, angle: float) -> Placement:
    """Return the placement with the tip turned about its pole by the last joint's ``angle`` [rad]."""
    chain = hand.fingers[placement.finger].chain
    q = placement.q.copy()
    q[-1] += angle
    before, after = compute_tip_pose(chain, np.stack([placement.q, q]))
    return replace(placement, q=q, X_OF=placement.X_OF @ invert_pose(before) @ after)
