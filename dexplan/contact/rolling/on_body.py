"""Pure rolling of a spherical tip on any smooth convex body, along the curve over which a ray from the body's origin sweeps."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.rolling.path import RollingPath
from dexplan.spatial import Array

FINER = 16
"""Steps of the integration from one sample to the next: of a sixteenth of a degree they are off by 1e-7 in half a radian."""


def roll_on_body(
    body: ConvexBody, tip_radius: float, X_OF_start: Array, directions: Array, tolerance: float = 1e-6
) -> RollingPath:
    """Return how a tip rolls over the points in which the rays along ``directions`` (K, 3), in object axes, leave the body.

    The tip turns without spin about the normal and without sliding: with its centre c = p + r n going along the curve,
    ``w = n x dc / r``, integrated by the midpoint rule [Montana 1988, eq. 1 with w_z = 0].

    Args:
        body: smooth along the curve.
        tip_radius: r [m].
        X_OF_start: pose (4, 4) of the tip touching where the first ray leaves.
        directions: from the body's origin, evenly spaced along the way.
        tolerance: how far [m] the tip's centre may be from where it touches.

    Raises ValueError where the tip does not touch there.
    """
    finer = np.linspace(0.0, len(directions) - 1.0, FINER * (len(directions) - 1) + 1)
    rows = np.stack(
        [np.interp(finer, np.arange(len(directions)), directions[:, k]) for k in range(3)], axis=1
    )
    points = body.radial(rows)
    normals = body.normal_at(points)
    centers = points + tip_radius * normals
    off = float(np.linalg.norm(centers[0] - X_OF_start[:3, 3]))
    if off > tolerance:
        raise ValueError(
            f"the tip is {1e3 * off:.3g} mm off the point where it is to begin; one that touches there is accepted"
        )
    middle = normals[1:] + normals[:-1]
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    steps = Rotation.from_rotvec(np.cross(middle, np.diff(centers, axis=0)) / tip_radius)
    turned, R = [Rotation.from_matrix(X_OF_start[:3, :3])], Rotation.from_matrix(X_OF_start[:3, :3])
    for k in range(len(steps)):
        R = steps[k] * R
        if (k + 1) % FINER == 0:
            turned.append(R)
    X_OF = np.tile(np.eye(4), (len(directions), 1, 1))
    X_OF[:, :3, :3], X_OF[:, :3, 3] = Rotation.concatenate(turned).as_matrix(), centers[::FINER]
    n_O, last = normals[::FINER], len(directions) - 1
    n_F = -np.einsum("kji,kj->ki", X_OF[:, :3, :3], n_O)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])[::FINER]
    return RollingPath(n_O, n_F, X_OF, points[::FINER], tip_radius * n_F, length, np.array([0, last]))
