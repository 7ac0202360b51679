"""Tips that touch the object with their poles along the normal: the contacts that the planner lands on [paper §3]."""

from __future__ import annotations

from dexplan.kinematics.workspace import compute_aligned_pose
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array


def build_touching(hand: HandModel, finger: int, X_WO: Array, points_O: Array, normals_O: Array) -> Array:
    """Return tip poses (N, 4, 4) in W that touch the object at ``X_WO`` (4, 4), poles along the normals; any body.

    ``points_O`` (N, 3) [m] on its surface with the outward ``normals_O`` (N, 3), object axes.
    """
    X = compute_aligned_pose(X_WO[:3, 3], normals_O @ X_WO[:3, :3].T, hand.fingers[finger].tip_radius)
    X[:, :3, 3] += points_O @ X_WO[:3, :3].T
    return X


def build_aligned(hand: HandModel, finger: int, center: Array, normals: Array) -> Array:
    """Return tip poses (N, 4, 4) that touch a ball at ``center`` (3,) along ``normals`` (N, 3), poles along the normals."""
    X = compute_aligned_pose(center, normals, 0.0)
    X[:, :3, 3] += hand.object.surface.radial(normals) + hand.fingers[finger].tip_radius * normals
    return X
