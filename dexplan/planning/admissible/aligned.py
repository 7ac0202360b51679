"""Tips that touch the object with their poles along the normal: the contacts that the planner lands on [paper §3]."""

from __future__ import annotations

from dexplan.kinematics.workspace import compute_aligned_pose
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array


def build_aligned(hand: HandModel, finger: int, center: Array, normals: Array) -> Array:
    """Return tip poses (N, 4, 4) that touch an object at ``center`` (3,) along ``normals`` (N, 3), poles along the normals."""
    X = compute_aligned_pose(center, normals, 0.0)
    X[:, :3, 3] += hand.object.surface.radial(normals) + hand.fingers[finger].tip_radius * normals
    return X
