"""Three hard fingers on any surface: force closure in closed form, for many grasps at once.

**In the plane.**  The moment about the line through two of three non-collinear points is due to the third finger alone, so
internal forces of point contacts lie in the plane of the points.  There they are three squeezes along the sides,

    f_1 = a e_12 - c e_31,   f_2 = b e_23 - a e_12,   f_3 = c e_31 - b e_23     (e_ij the unit vector from i to j),

each of which balances by itself, in force and in moment.  A friction cone meets the plane in a sector about the projection
of its axis, with cos(half width) = cos(theta) / cos(tilt of the normal out of the plane).  The rank of G is 6 for any three
non-collinear points.  Hence the grasp is force closed iff some (a, b, c) puts all three forces strictly inside their
sectors: six homogeneous inequalities in three unknowns.  Their solutions form a pointed cone, whose edges lie among the
cross products of two rows; it has an inside iff the sum of its edges is one.

**The margin** is the friction angle to spare: how much all friction angles may shrink before the grasp opens.  Sectors only
grow with friction, so it is found by bisection.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.grasp.closure import ClosureResult
from dexplan.spatial import Array

_PAIRS = np.array(list(combinations(range(6), 2)))
_EDGE = 1e-12  # rows and edges have length 1: what rounding leaves of a zero
_COLLINEAR = 1e-9  # area of the triangle over the square of its longest side
_BITS = 48  # of the bracket
_RIGHT = 0.5 * np.pi


def compute_triple_margin(points: ArrayLike, normals: ArrayLike, mu: ArrayLike) -> Array:
    """Return the friction angle to spare (...) [rad] of three hard fingers; the grasp is force closed iff it is positive.

    The margin is continuous, and grows with mu as atan(mu) does where all three are equal.  Where no friction closes the
    grasp it counts from a right angle: atan(mu) - pi/2 for the largest mu.  It is -inf for collinear points, whose fingers
    cannot resist a torque about their line.  It is exact to 1e-9 rad, and to 1e-6 where a force vanishes at the border,
    as that of a third finger does beside a pair that holds by itself.

    Args:
        points: contact points (..., 3, 3) [m], one per row.
        normals: **outward** normals (..., 3, 3) there, of any length.
        mu: friction coefficient, or one per finger (..., 3).

    Raises ValueError for arrays of another shape, normals of length zero and friction that is not positive.
    """
    p, n, theta = _read(points, normals, mu)
    shape = p.shape[:-2]
    p, n, theta = p.reshape(-1, 3, 3), n.reshape(-1, 3, 3), theta.reshape(-1, 3)
    sides = np.roll(p, -1, axis=1) - p
    normal = np.cross(sides[:, 0], sides[:, 1])
    area, longest = np.linalg.norm(normal, axis=1), np.linalg.norm(sides, axis=2).max(axis=1)
    margin = np.full(len(p), -np.inf)
    proper = np.flatnonzero(area > _COLLINEAR * longest**2)
    if not len(proper):
        return margin.reshape(shape)
    sides, n, theta = sides[proper], n[proper], theta[proper]
    normal = normal[proper] / area[proper, None]
    # In the plane: x along the first side, y so that (x, y, normal) is right-handed.
    x = sides[:, 0] / np.linalg.norm(sides[:, 0], axis=1, keepdims=True)
    basis = np.stack([x, np.cross(normal, x)], axis=1)
    along = sides @ np.swapaxes(basis, 1, 2)
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    inward = -n / np.linalg.norm(n, axis=2, keepdims=True)
    flat = inward @ np.swapaxes(basis, 1, 2)
    tilt = np.arctan2(np.abs(inward @ normal[:, :, None])[..., 0], np.linalg.norm(flat, axis=2))
    heading = np.arctan2(flat[..., 1], flat[..., 0])

    # forces[:, i] (2, 3) maps (a, b, c) to f_i
    forces = np.zeros((len(proper), 3, 2, 3))
    for i in range(3):
        forces[:, i, :, i], forces[:, i, :, i - 1] = along[:, i], -along[:, i - 1]

    low = theta.max(axis=1) - _RIGHT  # all angles grown until the largest is a right one
    high = (theta - tilt).min(axis=1)  # below its tilt a cone misses the plane
    high = np.maximum(high, low)
    # Few grasps are cut into many parts at once, many grasps into halves: numpy's cost per call is what counts.
    parts = 2 if len(proper) > 64 else 64
    shares = np.arange(1, parts) / parts
    for _ in range(_BITS // (parts.bit_length() - 1)):
        tried = low[:, None] + shares * (high - low)[:, None]
        closed = _is_closed(forces, heading, tilt, theta[:, None] - tried[..., None])
        # sectors only shrink from one part to the next, so that the closed ones come first
        part, step = closed.sum(axis=1), (high - low) / parts
        low = low + part * step
        high = low + step
    margin[proper] = low
    return margin.reshape(shape)


def check_hard_triple(points: ArrayLike, normals: ArrayLike, mu: ArrayLike) -> ClosureResult:
    """Check three hard fingers on any surface: :func:`compute_triple_margin` of one grasp, exact in both directions.

    Args:
        points: contact points (3, 3) [m], one per row.
        normals: **outward** normals (3, 3) there.
        mu: friction coefficient, or one per finger (3,).
    """
    margin = float(compute_triple_margin(points, normals, mu))
    rank = 6 if np.isfinite(margin) else 5
    meaning = "friction angle to spare: how much all friction angles may shrink before the grasp opens"
    return ClosureResult(margin > 0.0, margin, "rad", meaning, rank)


class _Triples(NamedTuple):
    """Contact points and outward normals (..., 3, 3), one per row, and friction angles (..., 3) [rad]."""

    points: Array
    normals: Array
    theta: Array


def _read(points: ArrayLike, normals: ArrayLike, mu: ArrayLike) -> _Triples:
    p, n = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    friction = np.asarray(mu, dtype=np.float64)
    if p.shape != n.shape or p.shape[-2:] != (3, 3):
        raise ValueError(f"points {p.shape}, normals {n.shape}; equal shapes (..., 3, 3) are accepted")
    if np.any(np.linalg.norm(n, axis=-1) == 0.0):
        raise ValueError("a normal has length zero; vectors that point somewhere are accepted")
    if not np.all(friction > 0.0):
        raise ValueError(f"friction is {friction.tolist()}; positive numbers are accepted")
    return _Triples(
        p,
        n,
        np.arctan(np.broadcast_to(friction[..., None] if friction.ndim == 0 else friction, p.shape[:-1])),
    )


def _is_closed(forces: Array, heading: Array, tilt: Array, theta: Array) -> NDArray[np.bool_]:
    """Return whether (a, b, c) exist (N, K) with all forces strictly inside their sectors, at K sets of friction angles.

    ``forces`` (N, 3, 2, 3) maps them to forces in the plane; ``heading`` and ``tilt`` (N, 3) [rad] are the direction of
    each sector and what its normal leans out of the plane; ``theta`` (N, K, 3) [rad] are the friction angles.
    """
    # cos(half) = cos(theta) / cos(tilt), in a form that keeps its digits where the half width is small
    width = np.sin(theta - tilt[:, None]) * np.sin(theta + tilt[:, None])
    half = np.arctan2(np.sqrt(np.maximum(width, 0.0)), np.cos(theta))
    left, right = heading[:, None] + half, heading[:, None] - half
    # inward normals of both rims: f inside iff both products are positive
    rims = np.stack(
        [
            np.stack([-np.sin(right), np.cos(right)], axis=-1),
            np.stack([np.sin(left), -np.cos(left)], axis=-1),
        ],
        axis=3,
    )
    rows = (rims @ forces[:, None]).reshape(*theta.shape[:2], 6, 3)
    rows /= np.linalg.norm(rows, axis=-1, keepdims=True)
    edges: Array = np.cross(rows[:, :, _PAIRS[:, 0]], rows[:, :, _PAIRS[:, 1]])
    length: Array = np.linalg.norm(edges, axis=-1, keepdims=True)
    edges = np.where(length > _EDGE, edges / np.maximum(length, _EDGE), 0.0)
    values = edges @ np.swapaxes(rows, -1, -2)
    up, down = (values >= -_EDGE).all(axis=-1), (values <= _EDGE).all(axis=-1)
    inside = np.einsum("nke,nkei->nki", up.astype(np.float64) - down, edges)
    is_inside: NDArray[np.bool_] = ((rows @ inside[..., None])[..., 0] > 10.0 * _EDGE).all(axis=-1)
    return is_inside & (theta > tilt[:, None]).all(axis=-1)
