"""Arcs: how a free finger's joints go from one posture to another, and where a tip hovers; from their ends alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from dexplan.kinematics.chain import Chain, compute_joint_margin, compute_tip_pose, wrap_near
from dexplan.kinematics.finger import FingerDescription
from dexplan.kinematics.land import reach_centers
from dexplan.kinematics.spherical_wrist import solve_near
from dexplan.spatial import Array, build_frame


def interpolate(way: Array, share: Array) -> Array:
    """Return the postures at ``share`` (N,) of a way (K, J), as the controller goes through them."""
    return np.asarray(CubicSpline(np.linspace(0.0, 1.0, len(way)), way)(share), dtype=np.float64)


_FREE = 6  # joints that a tip takes to have any pose
SAMPLES = 17
"""Postures along one path."""


BETWEEN = 4
"""Postures looked at for each posture of a way: the controller goes through them along a spline."""


def refine(way: Array) -> Array:
    """Return the postures (N, J) of a way (K, J) as the controller goes through them, ``BETWEEN`` for each that is given."""
    return interpolate(way, np.linspace(0.0, 1.0, BETWEEN * (len(way) - 1) + 1))


def build_travel(finger: FingerDescription, q_start: Array, q_end: Array, center: Array) -> Array:
    """Return postures (K, J) from ``q_start`` to ``q_end`` (J,) [rad] whose tip swings around ``center`` (3,) [m].

    The tip's direction from the centre turns along a great circle while its distance grows or shrinks evenly, so that a tip
    that starts and ends clear of a round object stays clear of it.  The pole turns with it.  Where the last joint is the
    tip's own roll it goes straight from one angle to the other: the shortest turn in space may lie beyond its limit.

    One end should be the finger's home, as in every plan: between two far contacts the arc may leave the workspace, and the
    straight way between postures that takes its place may cut across the object.
    """
    share = np.linspace(0.0, 1.0, SAMPLES)
    straight = q_start + share[:, None] * (q_end - q_start)
    ends = compute_tip_pose(finger.chain, np.stack([q_start, q_end]))
    arms = ends[:, :3, 3] - center
    distances = np.linalg.norm(arms, axis=1)
    directions = arms / distances[:, None]
    X = np.zeros((SAMPLES, 4, 4))
    X[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(ends[:, :3, :3]))(share).as_matrix()
    turn = np.cross(directions[0], directions[1])
    angle = np.arctan2(np.linalg.norm(turn), directions[0] @ directions[1])
    if angle > 1e-9:
        size = np.linalg.norm(turn)
        # Between opposite places every great circle is the shortest.
        axis = turn / size if size > 1e-9 else build_frame(directions[0])[:, 0]
        swung = Rotation.from_rotvec(share[:, None] * angle * axis).apply(directions[0])
    else:
        swung = np.broadcast_to(directions[0], (SAMPLES, 3))
    X[:, :3, 3] = center + (distances[0] + share[:, None] * (distances[1] - distances[0])) * swung
    X[:, 3, 3] = 1.0
    path, reached = _solve(finger.chain, X, straight)
    path = wrap_near(path, straight)
    if finger.chain.has_tip_roll:
        path[:, -1] = straight[:, -1]
    path[0], path[-1] = q_start, q_end
    # Where the arc leaves the workspace or would flip the wrist, the straight line between the postures has to do.
    flips = np.abs(np.diff(path, axis=0)).max() > 0.15 + 3.0 * np.abs(q_end - q_start).max() / (SAMPLES - 1)
    if not reached.all() or flips or compute_joint_margin(finger.chain, path).min() < 0.0:
        return straight
    # Even in what the fastest joint has to do, so that the way can be walked at a steady pace.
    length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path, axis=0)).max(axis=1))])
    even = np.linspace(0.0, length[-1], SAMPLES)
    return (
        np.stack([np.interp(even, length, column) for column in path.T], axis=1) if length[-1] > 0.0 else path
    )


def _solve(chain: Chain, X_WF: Array, q: Array, tolerance: float = 1e-5) -> tuple[Array, NDArray[np.bool_]]:
    """Return postures (N, J) near ``q`` with the tip at poses (N, 4, 4), and which were reached (N,).

    A finger of fewer than six joints takes its tip's centre there, the pole as near as may be.
    """
    if chain.n_joints < _FREE:
        return reach_centers(chain, q, X_WF[:, :3, 3], X_WF[:, :3, 2])
    return solve_near(chain, X_WF, q, tolerance=tolerance)


def compute_hover(
    finger: FingerDescription, X_WO: Array, X_OF: Array, normal_O: Array, q: Array, gap: float
) -> Array:
    """Return the posture (J,) near ``q`` with the tip at its contact pose ``X_OF``, lifted ``gap`` [m] along the normal."""
    X = X_OF.copy()
    X[:3, 3] += gap * normal_O
    solved, _ = _solve(finger.chain, (X_WO @ X)[None], q[None], tolerance=1e-7)
    return wrap_near(solved[0], q)
