"""Which of many pairs of contacts hold alone?  The chord between them inside both friction cones, in one go."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dexplan.spatial import Array


def measure_chord_lean(points: ArrayLike, normals: ArrayLike) -> Array:
    """Return the larger angle (...) [rad] between a pair's chord and its inward normals.

    The pair of soft fingers is force closed where it is below atan mu [Nguyen 1988], see
    :func:`~dexplan.grasp.closure.check_antipodal`.  On a ball both angles are ``90 deg - phi / 2`` for contacts phi apart
    [paper §3, result 2]; on other bodies points and normals count apart.

    Args:
        points: (..., 2, 3) [m], the two contacts.
        normals: (..., 2, 3), unit **outward** normals there.

    Returns:
        The angle; pi where the two points coincide, for no cone contains a chord without length.
    """
    p, n = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    chord = p[..., 1, :] - p[..., 0, :]
    both = np.stack([chord, -chord], axis=-2)
    sine = np.linalg.norm(np.cross(n, both), axis=-1)
    cosine = -np.sum(n * both, axis=-1)
    lean = np.arctan2(sine, cosine)
    lean = np.where(np.linalg.norm(both, axis=-1) > 0.0, lean, np.pi)
    return np.asarray(lean.max(axis=-1))
