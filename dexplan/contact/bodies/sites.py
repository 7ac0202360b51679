"""Places on a body where a finger may land: even samples of the surface, away from sharp edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody, Flat
from dexplan.icosphere import build_icosphere
from dexplan.spatial import Array, build_frame, lock_arrays

EDGE_BAND = 4e-3
"""Contacts keep this far from sharp edges [m]: a fixed contact wanders less than a tenth of that over its face."""
_FINER = 0.35
"""Spacing of the candidates on curved parts, as a share of the spacing asked for: the fewer, the less even the sites."""
_FINEST = 6
"""Level of the grid of directions at most: 40,962 of them."""


@dataclass(frozen=True, eq=False)
class Sites:
    """Points (S, 3) [m] of a body's surface and the **outward** normals (S, 3) there, in the body's axes."""

    points: Array
    normals: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def __len__(self) -> int:
        return len(self.points)


def build_sites(body: ConvexBody, spacing: float, edge_band: float = 0.0) -> Sites:
    """Return sites at least ``spacing`` [m] apart, none within ``edge_band`` [m] of a sharp edge.

    Plane parts carry a hexagonal grid about their middle, which is itself a site; curved parts are filled point by point,
    always in the same order.  A tip of any radius may touch in a band beside an edge, but a contact there leaves the face as soon
    as the tip rolls or the object is not quite where it should be.

    Raises ValueError for a spacing that is not positive or a negative band.
    """
    if not (np.isfinite(spacing) and spacing > 0.0):
        raise ValueError(f"sites every {spacing} m; a positive spacing is accepted")
    if not edge_band >= 0.0:
        raise ValueError(f"an edge band of {edge_band} m; 0 or more is accepted")
    # What a grid leaves open beside borders and edges, finer ones fill.
    grids = [_cover_flat(body, flat, step) for step in (spacing, _FINER * spacing) for flat in body.flats]
    candidates = np.concatenate([*grids, _cover_curved(body, spacing)])
    candidates = candidates[body.measure_edge_distance(candidates) >= edge_band - 1e-12]
    points = candidates[_thin(candidates, spacing)]
    return Sites(points, body.normal_at(points))


def _cover_flat(body: ConvexBody, flat: Flat, spacing: float) -> Array:
    """Return a hexagonal grid (N, 3) on a plane part, from the middle outward."""
    count = int(np.ceil(flat.radius / (spacing * np.sqrt(0.75))))
    i, j = np.meshgrid(np.arange(-2 * count, 2 * count + 1), np.arange(-count, count + 1), indexing="ij")
    x, y = spacing * (i + 0.5 * j).ravel(), spacing * np.sqrt(0.75) * j.ravel()
    order = np.lexsort((np.round(np.arctan2(y, x), 9), np.round(np.hypot(x, y), 12)))
    axes = build_frame(flat.normal)
    points = flat.center + x[order, None] * axes[:, 0] + y[order, None] * axes[:, 1]
    # What lies beyond the border of the plane part is nearest to something else.
    found = body.project(points + 1e-3 * body.bound * flat.normal)
    is_own = np.linalg.norm(found.point - points, axis=1) < 1e-9 * body.bound + 1e-12
    return np.asarray(points[is_own])


def _cover_curved(body: ConvexBody, spacing: float) -> Array:
    """Return a dense cover (N, 3) of what is not plane."""
    level = 0
    while level < _FINEST and build_icosphere(level).spacing * body.bound > _FINER * spacing:
        level += 1
    points = body.radial(build_icosphere(level).vertices)
    normals = body.normal_at(points)
    is_plane = np.zeros(len(points), dtype=bool)
    for flat in body.flats:
        is_plane |= (normals @ flat.normal > 1.0 - 1e-12) & (
            np.abs((points - flat.center) @ flat.normal) < 1e-9 * body.bound
        )
    return np.asarray(points[~is_plane])


def _thin(points: Array, spacing: float) -> NDArray[np.intp]:
    """Return the rows of points (N, 3) that are kept, in order, where none may be nearer than ``spacing`` to an earlier one."""
    tree, keep = cKDTree(points), np.ones(len(points), dtype=bool)
    # A hair less than the spacing: neighbours of a grid are exactly so far apart.
    for k in range(len(points)):
        if keep[k]:
            near = tree.query_ball_point(points[k], (1.0 - 1e-9) * spacing)
            keep[[n for n in near if n > k]] = False
    return np.flatnonzero(keep)
