"""Postures of a finger whose tip goes through given poses: all at once where there is a closed form, else step by step."""

from __future__ import annotations

import numpy as np

from dexplan.kinematics.chain import Chain, solve_ik, wrap_near
from dexplan.kinematics.spherical_wrist import find_spherical_wrist, solve_near
from dexplan.spatial import Array

JUMP = 0.30
"""Joint steps between samples beyond this mean another branch [rad]."""
BLOCK = 6
"""Samples whose inverse kinematics are solved at once, step by step."""


def follow_tip(chain: Chain, X_WF: Array, q_start: Array) -> Array:
    """Return the postures (L, J) [rad] from ``q_start`` (J,) through tip poses (K, 4, 4), as far as they go on without a jump.

    ``q_start`` is the posture at the first pose.  Joint limits are not looked at.
    """
    q = follow_closed(chain, X_WF, q_start)
    return follow_in_steps(chain, X_WF, q_start) if q is None else q


def follow_closed(chain: Chain, X_WF: Array, q_start: Array) -> Array | None:
    """Return the postures (L, J) from ``q_start`` through tip poses (K, 4, 4), as far as they exist without a jump.

    All at once, on the branch of the closed form that ``q_start`` lies on; None for chains without one.
    """
    wrist = find_spherical_wrist(chain)
    if wrist is None or not wrist.find_branches(q_start[None]):
        return None
    q, exists = solve_near(chain, X_WF, np.tile(q_start, (len(X_WF), 1)))
    q[0] = q_start
    q = np.unwrap(q, axis=0)
    good = exists[1:] & (np.abs(np.diff(q, axis=0)).max(axis=1) <= JUMP)
    return q if good.all() else q[: 1 + int(good.argmin())]


def follow_in_steps(chain: Chain, X_WF: Array, q_start: Array) -> Array:
    """Return the same by Newton steps, for any chain."""
    q = np.empty((len(X_WF), chain.n_joints))
    q[0] = q_start
    for first in range(1, len(X_WF), BLOCK):
        rows = slice(first, min(first + BLOCK, len(X_WF)))
        # A few small steps at once, all from where the finger is: one pass of the batch costs hardly more than one pose.
        solved, reached = solve_ik(
            chain, X_WF[rows], np.repeat(q[first - 1 : first], len(X_WF[rows]), axis=0)
        )
        for k in range(first, rows.stop):
            q[k] = wrap_near(solved[k - first], q[k - 1])
            if not reached[k - first] or np.abs(q[k] - q[k - 1]).max() > JUMP:
                return q[:k]
    return q
