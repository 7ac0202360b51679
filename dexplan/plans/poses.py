"""Poses as they stand in plan.json."""

from __future__ import annotations

import numpy as np

from dexplan.spatial import Array, as_pose, as_pose7


def write_pose(X: Array) -> list[float]:
    """Return a pose as (x, y, z, qw, qx, qy, qz), rounded so that reading and writing it again changes nothing.

    The largest component of the quaternion follows from the others; rounding all four would leave it off unit length.
    """
    pose = np.round(as_pose7(X), 12)
    quat = pose[3:]
    quat *= np.sign(quat[np.flatnonzero(quat)[0]])
    k = int(np.argmax(np.round(np.abs(quat), 6)))
    quat[k] = np.sign(quat[k]) * np.sqrt(1.0 - (np.delete(quat, k) ** 2).sum())
    return [float(x) for x in pose + 0.0]


def read_pose(pose7: list[float]) -> Array:
    """Return the pose (4, 4) that :func:`write_pose` wrote."""
    return as_pose(pose7)
