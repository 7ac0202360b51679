"""Regions on the object: who can touch where, and who can hold with whom [paper §2.1, §2.2].

On a grid of outward directions: ``CWS_i`` where finger i can touch, ``FC_i`` the points antipodal to some point of ``CWS_i``,
``CWS_i_j = CWS_i and FC_j``, and the double force-closure region ``CWS_i_jk = CWS_i and FC_j and FC_k``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dexplan.contact.friction import SoftFinger
from dexplan.planning.hand import HandModel
from dexplan.scene.chain import compute_dexterity, compute_joint_margin
from dexplan.scene.workspace import compute_aligned_pose, spread_directions
from dexplan.spatial import Array


def compute_pair_angle_max(friction: SoftFinger) -> float:
    """Return the largest angle [rad] between a contact normal and the chord of a pair that friction allows: atan mu.

    On a sphere two contacts at central angle phi make ``90 deg - phi / 2`` with their chord, so this is
    ``phi >= 180 deg - 2 atan mu`` [paper §3, result 2].
    """
    return float(np.arctan(friction.sliding))


ORDER_GAP = float(np.radians(4.0))
"""Neighbouring fingertips keep at least this much azimuth between them: nearer, their order would be a matter of noise."""


def keeps_order(hand: HandModel, normals: dict[int, Array]) -> bool:
    """Return whether fingers touching along ``normals`` (3,) in W stand around the object in the order of their bases.

    The paper's fingers never change their relative (clockwise) positions [paper §4].  Order is taken around the vertical.
    """
    if len(normals) < 3:
        return True
    center = hand.object.X_WO_home[:2, 3]
    bases = {i: hand.fingers[i].chain.offsets[0][:2, 3] - center for i in normals}
    order = sorted(normals, key=lambda i: np.arctan2(bases[i][1], bases[i][0]))
    azimuths = np.array([np.arctan2(normals[i][1], normals[i][0]) for i in order])
    # In order, the steps from finger to finger are all positive and make one turn.
    steps = np.mod(np.roll(azimuths, -1) - azimuths, 2.0 * np.pi)
    return bool(steps.min() >= ORDER_GAP and abs(steps.sum() - 2.0 * np.pi) < 1e-6)


@dataclass(frozen=True, eq=False)
class Regions:
    """Regions of all fingers at one object position, over ``directions`` (N, 3) in W; masks are (F, N).

    ``reach`` is CWS_i with the tip's pole along the normal at some spin, ``closure`` is FC_i.
    """

    directions: Array
    reach: NDArray[np.bool_]
    closure: NDArray[np.bool_]

    def pair(self, i: int, j: int) -> NDArray[np.bool_]:
        """Return CWS_i_j (N,): where finger i can touch and hold with finger j."""
        return self.reach[i] & self.closure[j]

    def double(self, i: int, j: int, k: int) -> NDArray[np.bool_]:
        """Return the double force-closure region CWS_i_jk (N,)."""
        return self.reach[i] & self.closure[j] & self.closure[k]


def compute_regions(hand: HandModel, center: Array, count: int = 4000) -> Regions:
    """Return the regions around an object at ``center`` (3,) [m] on a grid of ``count`` directions."""
    directions = spread_directions(count)
    beta = compute_pair_angle_max(hand.friction)
    reach = np.zeros((len(hand.fingers), count), dtype=bool)
    closure = np.zeros_like(reach)
    for i, (finger, workspace) in enumerate(zip(hand.fingers, hand.workspaces, strict=True)):
        if not len(workspace.postures):
            continue
        radius = float(np.linalg.norm(hand.object.surface.closest(np.array([1.0, 0.0, 0.0]))))
        home = finger.pose_at(finger.q_home)[:3, 3] - center
        near = directions @ (home / np.linalg.norm(home)) > np.cos(np.radians(85.0))
        X = compute_aligned_pose(center, directions[near], radius + finger.tip_radius)
        q, reached = workspace.solve(X)
        if finger.chain.has_tip_roll:
            q[:, -1] = 0.5 * (finger.chain.lower[-1] + finger.chain.upper[-1])
        inside = compute_joint_margin(finger.chain, q) >= hand.limits.joint_margin
        reach[i, near] = reached & inside & (compute_dexterity(finger.chain, q) >= hand.limits.dexterity)
        if reach[i].any():
            # x is in FC_i when -x lies within 2 atan mu of some point of CWS_i.
            distance, _ = cKDTree(directions[reach[i]]).query(-directions)
            closure[i] = distance <= 2.0 * np.sin(beta)
    return Regions(directions, reach, closure)


def check_theorem_1(regions: Regions, i: int, j: int, k: int, x_i: Array, x_j: Array) -> str:
    """Check the paper's Theorem 1 for fingers i, j holding at ``x_i``, ``x_j`` (3,) and a free finger k.

    Necessary for any gait: f_i lies in CWS_i_jk or f_j in CWS_j_ik, that is, finger k can form a force-closure grasp with
    at least one of the holding fingers where it is.  Returns "" where the condition holds, else why no gait is possible.
    """
    near_i = int(np.argmax(regions.directions @ x_i))
    near_j = int(np.argmax(regions.directions @ x_j))
    if regions.closure[k, near_i] or regions.closure[k, near_j]:
        return ""
    return (
        f"Theorem 1: finger {k + 1} can form a force-closure grasp with neither finger {i + 1} nor finger {j + 1} "
        "where they are, so neither can be lifted; roll them first"
    )
