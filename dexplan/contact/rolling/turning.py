"""Turns about axes and tangents to the unit sphere, batched where paths need it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dexplan.spatial import Array, hat


def build_turn(axis: ArrayLike, angle: ArrayLike) -> Array:
    """Return rotations (..., 3, 3) about unit axes (..., 3) by angles (...) [rad] (Rodrigues' formula)."""
    W, angle = hat(np.asarray(axis, dtype=np.float64)), np.asarray(angle, dtype=np.float64)[..., None, None]
    # 1 - cos without cancellation.
    return np.eye(3) + np.sin(angle) * W + 2.0 * np.sin(0.5 * angle) ** 2 * (W @ W)


def make_tangent(n: Array, direction: ArrayLike) -> Array:
    """Return the unit tangent (3,) at n that is nearest to ``direction`` (3,); raises ValueError for one along n."""
    d = np.asarray(direction, dtype=np.float64)
    tangent = d - (n @ d) * n
    size = np.linalg.norm(tangent)
    if size <= 1e-9 * np.linalg.norm(d):
        raise ValueError(
            "the heading is along the normal; a direction with a part along the surface is accepted"
        )
    tangent = tangent / size
    tangent = tangent - (n @ tangent) * n  # once more, for directions that are nearly along n
    return tangent / np.linalg.norm(tangent)


def any_tangent(n: Array) -> Array:
    """Return some unit tangent (3,) at the unit vector n."""
    return make_tangent(n, np.eye(3)[np.argmin(np.abs(n))])


def split_turn(R: Array) -> tuple[Array, Array]:
    """Return unit axes (..., 3) and angles (...) [rad] of rotations by clearly less than half a turn."""
    twice = np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )
    size = np.linalg.norm(twice, axis=-1)
    angle = np.arctan2(size, np.trace(R, axis1=-2, axis2=-1) - 1.0)
    axis = twice / np.where(size > 0.0, size, 1.0)[..., None]
    return np.where(size[..., None] > 0.0, axis, [0.0, 0.0, 1.0]), angle
