"""The spin with which a tip lands: that which lets the carry ahead go far, where the tip's own joint would end it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_near
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.contacts import Placement
from dexplan.spatial import Array, invert_pose


def center_spins(hand: HandModel, placements: Sequence[Placement], ahead: Sequence[Array]) -> list[Placement]:
    """Return landings of one finger with the tip's own joint around the middle of what the carry ahead asks of it.

    ``ahead``: poses (4, 4) that the object comes to after the one at which the finger lands.  A landing is centred over as many
    of them as its finger reaches; one whose tip has no joint of its own stays as it is.
    """
    if not placements or not len(ahead):
        return list(placements)
    chain, limits = hand.fingers[placements[0].finger].chain, hand.limits
    if not chain.has_tip_roll:
        return list(placements)
    q, X_OF = np.stack([p.q for p in placements]), np.stack([p.X_OF for p in placements])
    low, high = q[:, -1].copy(), q[:, -1].copy()
    room = chain.upper[-1] - chain.lower[-1] - 2.0 * limits.joint_margin
    middle = 0.5 * (chain.upper[-1] + chain.lower[-1])
    there, lasts = q, np.ones(len(q), dtype=bool)
    for X_WO in ahead:
        solved, reached = solve_near(chain, X_WO @ X_OF, there)
        at_rest = solved.copy()
        at_rest[:, -1] = middle
        now_low, now_high = np.minimum(low, solved[:, -1]), np.maximum(high, solved[:, -1])
        lasts = lasts & reached & (compute_joint_margin(chain, at_rest) >= limits.joint_margin)
        lasts &= now_high - now_low <= room
        lasts[lasts] = estimate_dexterity(chain, solved[lasts]) >= limits.dexterity
        if not lasts.any():
            break
        there = np.where(lasts[:, None], solved, there)
        low, high = np.where(lasts, now_low, low), np.where(lasts, now_high, high)
    spun = q.copy()
    spun[:, -1] += middle - 0.5 * (low + high)
    before, after = compute_tip_pose(chain, q), compute_tip_pose(chain, spun)
    turned = X_OF @ invert_pose(before) @ after
    return [replace(p, q=a, X_OF=X) for p, a, X in zip(placements, spun, turned, strict=True)]
