"""A grid on the sphere with values on its vertices: level sets, their borders and areas, distances to borders.

The grid is an icosahedron whose triangles are halved again and again.  It is nearly even, the opposite of every vertex is a
vertex, and each level keeps the vertices of the one before, so that values can be refined where they matter.  Borders of level
sets are found by linear interpolation along edges: their error falls with the square of the spacing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from dexplan.brief import brief_repr
from dexplan.spatial import Array, read_only

Indices = NDArray[np.intp]

_KINK = float(np.radians(15.0))
"""Distances are interpolated where neighbours see parts of a border that are nearer to each other than this."""


@dataclass(frozen=True, eq=False)
class Icosphere:
    """Vertices (V, 3) and triangles (T, 3) of one level; ``coarser`` is the level before, None for the icosahedron.

    Vertices are numbered as on the level before; the new ones follow and ``parents`` (V - V_before, 2) are the ends of the edges
    that they halve.
    """

    vertices: Array
    triangles: Indices
    parents: Indices
    coarser: Icosphere | None = field(default=None, repr=False)

    __repr__ = brief_repr

    @cached_property
    def spacing(self) -> float:
        """Longest edge [rad]."""
        ends = self.vertices[self.triangles]
        return float(2.0 * np.arcsin(0.5 * np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).max()))

    @cached_property
    def antipodes(self) -> Indices:
        """Index (V,) of the vertex opposite to each vertex."""
        return np.asarray(self._tree.query(-self.vertices)[1], dtype=np.intp)

    @cached_property
    def areas(self) -> Array:
        """Solid angles (T,) of the triangles [sr]; they sum to 4 pi [van Oosterom & Strackee 1983]."""
        a, b, c = self.vertices[self.triangles].swapaxes(0, 1)
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = np.einsum("ij,ij->i", a, b) + np.einsum("ij,ij->i", b, c) + np.einsum("ij,ij->i", c, a)
        return read_only(2.0 * np.arctan2(np.abs(volume), 1.0 + dots))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.vertices)

    @cached_property
    def _incident(self) -> Indices:
        """Triangles (V, 6) around each vertex; the twelve vertices with five have one twice."""
        order = np.argsort(self.triangles.ravel(), kind="stable")
        owner, triangle = self.triangles.ravel()[order], order // 3
        first = np.searchsorted(owner, np.arange(len(self.vertices)))
        count = np.bincount(owner)
        return np.asarray(triangle[first[:, None] + np.arange(6) % count[:, None]], dtype=np.intp)

    @cached_property
    def _weights(self) -> Array:
        """Matrices (T, 3, 3) that turn a direction into barycentric weights of a triangle's corners."""
        return read_only(np.linalg.inv(self.vertices[self.triangles].swapaxes(1, 2)))

    def find_nearest(self, directions: Array) -> Indices:
        """Return the index (N,) of the vertex nearest to each of the unit vectors (N, 3)."""
        return np.asarray(self._tree.query(directions)[1], dtype=np.intp)

    def interpolate(self, values: Array, directions: Array) -> Array:
        """Return the values (N,) between the vertices' ``values`` (V,), linear in each triangle, at unit vectors (N, 3)."""
        around = self._incident[self.find_nearest(directions)]
        weights = np.einsum("nkij,nj->nki", self._weights[around], directions)
        best = weights.min(axis=2).argmax(axis=1)
        rows = np.arange(len(directions))
        weight = np.maximum(weights[rows, best], 0.0)
        corners = values[self.triangles[around[rows, best]]]
        return np.asarray((corners * weight).sum(axis=1) / weight.sum(axis=1))

    def extend(self, values: Array) -> Array:
        """Return values (V, ...) from those of the coarser level: the new vertices get the mean of their edge's ends."""
        return np.concatenate([values, values[self.parents].mean(axis=1)])

    @cached_property
    def _corners(self) -> tuple[Indices, Indices, Indices]:
        a, b, c = np.ascontiguousarray(self.triangles.T)
        return a, b, c

    def find_crossed(self, values: Array, near: float) -> NDArray[np.bool_]:
        """Return the vertices (V,) of triangles whose ``values`` (V,) come to within ``near`` of zero or pass it."""
        f, g, h = (values[k] for k in self._corners)
        low, high = np.minimum(np.minimum(f, g), h), np.maximum(np.maximum(f, g), h)
        found = np.zeros(len(values), dtype=bool)
        found[self.triangles[(low < near) & (high > -near)]] = True
        return found

    def compute_area(self, values: Array) -> float:
        """Return the solid angle [sr] where ``values`` (V,), linear in each triangle, are not negative."""
        f = values[self.triangles]
        positive = f >= 0.0
        count = positive.sum(axis=1)
        share = (count == 3).astype(np.float64)
        for mixed, inside in ((count == 1, True), (count == 2, False)):
            rows = np.flatnonzero(mixed)
            alone = np.argmax(positive[rows] == inside, axis=1)
            a, b, c = (f[rows, (alone + k) % 3] for k in range(3))
            corner = a * a / ((a - b) * (a - c))
            share[rows] = corner if inside else 1.0 - corner
        return float(share @ self.areas)

    def find_border(self, values: Array) -> Array:
        """Return the border (S, 2, 3) of ``values`` (V,) >= 0: a short arc, ends as unit vectors, through each mixed triangle."""
        one, two, three = (values[k] >= 0.0 for k in self._corners)
        rows = np.flatnonzero((one != two) | (two != three))
        f = values[self.triangles[rows]]
        positive = f >= 0.0
        # The corner whose sign the other two do not share; the border crosses the two edges that leave it.
        alone = np.argmax(positive == (positive.sum(axis=1) == 1)[:, None], axis=1)
        corners = [self.vertices[self.triangles[rows, (alone + k) % 3]] for k in range(3)]
        a, b, c = (f[np.arange(len(rows)), (alone + k) % 3] for k in range(3))
        ends = [
            corners[0] + (a / (a - other))[:, None] * (corners[k] - corners[0])
            for k, other in ((1, b), (2, c))
        ]
        arcs = np.stack(ends, axis=1)
        return np.asarray(arcs / np.linalg.norm(arcs, axis=2, keepdims=True))


@lru_cache(maxsize=8)
def build_icosphere(level: int) -> Icosphere:
    """Return the icosphere of ``level``: 10 * 4^level + 2 vertices; edges up to 9 deg at level 3, 2.4 deg at level 5.

    Raises ValueError for a negative level.
    """
    if level < 0:
        raise ValueError(f"level is {level}; 0 (the icosahedron) or more is accepted")
    if level == 0:
        golden = 0.5 * (1.0 + np.sqrt(5.0))
        signs = np.array([(a, b) for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
        flat = np.column_stack([np.zeros(4), signs[:, 0], golden * signs[:, 1]])
        vertices = np.concatenate([np.roll(flat, k, axis=1) for k in range(3)])
        vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
        triangles = ConvexHull(vertices).simplices.astype(np.intp)
        return Icosphere(read_only(vertices), triangles, np.zeros((0, 2), dtype=np.intp))
    before = build_icosphere(level - 1)
    corners = before.triangles
    edges = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    parents, edge = np.unique(edges, axis=0, return_inverse=True)
    middle = before.vertices[parents].sum(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    m = edge.reshape(-1, 3) + len(before.vertices)  # middles of the edges 01, 12, 20
    children = [np.stack([corners[:, k], m[:, k], m[:, k - 1]], axis=1) for k in range(3)]
    triangles = np.concatenate([*children, m])
    vertices = np.concatenate([before.vertices, middle])
    return Icosphere(read_only(vertices), triangles, parents, before)


@dataclass(frozen=True, eq=False)
class Arcs:
    """Short great-circle arcs (S, 2, 3), and how near they come to given directions."""

    ends: Array

    __repr__ = brief_repr

    @cached_property
    def _basis(self) -> tuple[Array, Array, Array]:
        """Unit vectors (S, 3) at an arc's start and a quarter turn further along it, and its length (S,) [rad]."""
        a, b = self.ends[:, 0], self.ends[:, 1]
        along = b - np.einsum("ij,ij->i", a, b)[:, None] * a
        sine = np.linalg.norm(along, axis=1)
        return a, along / np.maximum(sine, 1e-12)[:, None], np.arcsin(np.minimum(sine, 1.0))

    @cached_property
    def _middles(self) -> NDArray[np.float32]:
        middle = self.ends.sum(axis=1)
        return np.asarray((middle / np.linalg.norm(middle, axis=1, keepdims=True)).T, dtype=np.float32)

    def project(self, directions: Array, arcs: Indices) -> tuple[Array, Array]:
        """Return the nearest points (..., 3) of the arcs with indices (...) to ``directions`` (..., 3), and their distances."""
        start, along, length = (part[arcs] for part in self._basis)
        turn = np.arctan2((directions * along).sum(axis=-1), (directions * start).sum(axis=-1))
        # Behind the start or beyond the end the nearer end counts; opposite to the arc that is decided by its middle.
        turn = np.where(turn < 0.5 * length - np.pi, turn + 2.0 * np.pi, turn)
        turn = np.clip(turn, 0.0, length)[..., None]
        points = np.cos(turn) * start + np.sin(turn) * along
        return points, measure_angle(points, directions)

    def find_nearest(self, directions: Array) -> tuple[Array, Array, Indices]:
        """Return the nearest points (N, 3) to unit vectors (N, 3), their distances (N,) [rad], and the arcs they lie on (N,)."""
        # All products, in pieces that fit a cache and are too small for the matrix product to wake a thread per core: faster
        # than a tree, which borders around a point defeat.
        nearest = np.empty(len(directions), dtype=np.intp)
        d, middles = directions.astype(np.float32), self._middles
        size = max(8, 60000 // middles.shape[1])
        for first in range(0, len(directions), size):
            nearest[first : first + size] = (d[first : first + size] @ middles).argmax(axis=1)
        points, distance = self.project(directions, nearest)
        return points, distance, nearest


def measure_angle(a: Array, b: Array) -> Array:
    """Return the angles (...) [rad] between unit vectors (..., 3), exact for small ones as well."""
    chord = np.linalg.norm(a - b, axis=-1)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def compute_distance_field(grid: Icosphere, values: Array, arcs: Arcs | None) -> Array:
    """Return the angle (V,) [rad] from every vertex to the region where ``values`` (V,) >= 0, with the border ``arcs``.

    Zero inside the region; 2 pi where it is empty: farther than any point.
    """
    inside = values >= 0.0
    if arcs is None or grid.coarser is None:
        return np.where(inside, 0.0, 2.0 * np.pi)
    count = len(grid.coarser.vertices)
    distance, nearest = np.zeros(count), np.zeros(count, dtype=np.intp)
    # Inside too where a border may cross the next edge.
    wanted = np.flatnonzero(~inside[:count] | grid.coarser.find_crossed(values[:count], 0.0))
    _, distance[wanted], nearest[wanted] = arcs.find_nearest(grid.coarser.vertices[wanted])
    out = grid.extend(distance)
    # Between vertices that look at the same part of the border, neither near it nor near its opposite, the mean of both is as
    # good as exact.  Elsewhere, at kinks above all, a new vertex takes the nearer of what its two parents look at.
    a, b = grid.parents.T
    apart = measure_angle(arcs.ends[nearest[a], 0], arcs.ends[nearest[b], 0]) > _KINK
    focal = np.sin(out[count:]) < np.sin(_KINK)
    rows = np.flatnonzero((apart | focal) & ~inside[count:]) + count
    seen = nearest[grid.parents[rows - count]]
    out[rows] = arcs.project(grid.vertices[rows, None], seen)[1].min(axis=1)
    return np.where(inside, 0.0, out)
