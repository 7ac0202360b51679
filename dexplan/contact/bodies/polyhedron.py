"""A convex polyhedron, as the hull of points: a mesh, a prism, anything with flat faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import SHARP, ConvexBody, Flat, Projection, Solid, as_points
from dexplan.spatial import Array, lock_arrays, read_only

_CHUNK = 200_000
"""Pairs of a point and a triangle that are looked at together: bounds the memory of a projection."""
_COPLANAR = 1e-6
"""Triangles whose corners are nearer to a plane than this, in units of the body's size, are one face: MuJoCo keeps meshes in
single precision.
"""
_PARALLEL = 1e-5
"""Planes of an angle whose squared sine is less have no edge between them."""


@dataclass(frozen=True, eq=False)
class PolyhedronBody(ConvexBody):
    """The convex hull of ``vertices`` (V, 3) [m], with the origin inside.

    Points inside the hull are dropped; :attr:`hull` says what is left.  Raises ValueError for fewer than four points, points in
    one plane, coordinates that are not finite, and an origin that is not inside.
    """

    vertices: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", np.asarray(self.vertices, dtype=np.float64))
        lock_arrays(self)
        shape = self.vertices.shape
        if len(shape) != 2 or shape[1] != 3 or shape[0] < 4:
            raise ValueError(f"vertices of shape {shape}; (V, 3) with four or more is accepted")
        if not np.isfinite(self.vertices).all():
            raise ValueError("a vertex is not finite; finite coordinates [m] are accepted")
        try:
            offsets = self._qhull.equations[:, 3]
        except QhullError:
            raise ValueError(
                "the vertices lie in one plane; points that enclose a volume are accepted"
            ) from None
        if offsets.max() >= 0.0:
            raise ValueError("the origin is not inside the hull; vertices about the origin are accepted")

    @cached_property
    def _qhull(self) -> ConvexHull:
        return ConvexHull(self.vertices)

    @cached_property
    def hull(self) -> Array:
        """The vertices (H, 3) [m] that are corners of the hull."""
        return read_only(self.vertices[np.sort(self._qhull.vertices)])

    @cached_property
    def triangles(self) -> Array:
        """The surface as triangles (T, 3, 3) [m], corners counterclockwise seen from outside."""
        corners = self.vertices[self._qhull.simplices]
        turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        is_inward = np.sum(turned * self._qhull.equations[:, :3], axis=1) < 0.0
        corners[is_inward] = corners[is_inward][:, [0, 2, 1]]
        return read_only(corners)

    @cached_property
    def planes(self) -> Array:
        """The faces' planes (F, 4): outward unit normal and offset b [m], n . x <= b inside; coplanar triangles are one face."""
        return self._faces[0]

    @cached_property
    def _faces(self) -> tuple[Array, NDArray[np.intp]]:
        """Planes (F, 4) and, for each triangle (T,), the number of its face."""
        equations = self._qhull.equations * [1.0, 1.0, 1.0, -1.0]
        corners = self.triangles
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        leader = np.full(len(equations), -1)
        # The largest triangle of a face has the best plane; slivers have almost none of their own.
        for k in np.argsort(-area, kind="stable"):
            if leader[k] < 0:
                off = np.abs(corners @ equations[k, :3] - equations[k, 3]).max(axis=1)
                same = (off < _COPLANAR * self.bound) & (equations[:, :3] @ equations[k, :3] > 0.0)
                leader[same & (leader < 0)] = k
        leaders, first, of_triangle = np.unique(leader, return_index=True, return_inverse=True)
        # Faces are numbered as their triangles come.
        order = np.argsort(first)
        return read_only(equations[leaders[order]]), np.argsort(order)[of_triangle.reshape(-1)]

    @cached_property
    def bound(self) -> float:
        """As :attr:`ConvexBody.bound`."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    @cached_property
    def edges(self) -> Array:
        """The edges (E, 2, 3) [m] at which the surface bends by :data:`SHARP` or more; a mesh of a round body has none."""
        planes, of_triangle = self._faces
        normals = planes[of_triangle, :3]
        found = []
        for triangle, (corners, others) in enumerate(
            zip(self._qhull.simplices, self._qhull.neighbors, strict=True)
        ):
            for k, other in enumerate(others):
                if other > triangle and normals[triangle] @ normals[other] <= np.cos(SHARP):
                    found.append(self.vertices[np.delete(corners, k)])
        return read_only(np.array(found).reshape(-1, 2, 3))

    @property
    def symmetry(self) -> None:
        """None."""
        return None

    @cached_property
    def flats(self) -> tuple[Flat, ...]:
        """The faces, about the middle of their corners or, where that is nearer to an edge, of the largest circle in them."""
        planes, of_triangle = self._faces
        flats = []
        for f, plane in enumerate(planes):
            corners = np.unique(self.triangles[of_triangle == f].reshape(-1, 3), axis=0)
            center, deepest = corners.mean(axis=0), self._find_deepest(f, corners)
            depths = self._measure_depths(f, np.stack([center, deepest]))
            center = deepest if depths[1] > depths[0] * (1.0 + 1e-9) else center
            radius = float(np.linalg.norm(corners - center, axis=1).max())
            flats.append(Flat(center, plane[:3], radius))
        return tuple(flats)

    @cached_property
    def solid(self) -> Solid:
        """As :attr:`ConvexBody.solid`: tetrahedra from the origin to the triangles."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        volumes = np.einsum("ti,ti->t", a, np.cross(b, c)) / 6.0
        volume = float(volumes.sum())
        total = a + b + c
        com = np.einsum("t,ti->i", volumes, total) / (4.0 * volume)
        # Second moments of a tetrahedron with one corner in the origin: V / 20 (sum of x x^T of corners + of their sum).
        second = np.einsum("t,tki,tkj->ij", volumes, self.triangles, self.triangles)
        second = (second + np.einsum("t,ti,tj->ij", volumes, total, total)) / 20.0
        second -= volume * np.outer(com, com)
        return Solid(volume, com, np.trace(second) * np.eye(3) - second)

    def project(self, P: ArrayLike) -> Projection:
        """As :meth:`ConvexBody.project`: inside, the nearest plane's; outside, the nearest triangle's."""
        points = as_points(P)
        flat = points.reshape(-1, 3)
        signed = flat @ self.planes[:, :3].T - self.planes[:, 3]
        face = signed.argmax(axis=1)
        distance = signed[np.arange(len(flat)), face]
        normal = self.planes[face, :3].copy()
        point = flat - distance[:, None] * normal
        outside = np.flatnonzero(distance > 0.0)
        # Above the inside of its face the plane's point is the nearest; elsewhere an edge or a corner of some triangle may be.
        beyond = outside[(point[outside] @ self.planes[:, :3].T - self.planes[:, 3]).max(axis=1) > 1e-14]
        step = max(1, _CHUNK // len(self.triangles))
        for first in range(0, len(beyond), step):
            rows = beyond[first : first + step]
            point[rows] = _find_nearest_on_triangles(flat[rows], self.triangles)
            away = flat[rows] - point[rows]
            distance[rows] = np.linalg.norm(away, axis=1)
            normal[rows] = away / distance[rows, None]
        shape = points.shape
        return Projection(point.reshape(shape), normal.reshape(shape), distance.reshape(shape[:-1]))

    def _measure_depths(self, f: int, points: Array) -> Array:
        """Return how far (N,) [m] points (N, 3) of face ``f`` are from its border, in its plane."""
        normals, offsets = self.planes[:, :3], self.planes[:, 3]
        # In the plane of its face a point is so far from the line in which another face's plane cuts it.
        sines = np.sqrt(np.maximum(1.0 - (normals @ normals[f]) ** 2, 0.0))
        others = sines > _PARALLEL**0.5
        return np.asarray(((offsets - points @ normals.T)[:, others] / sines[others]).min(axis=1))

    def _find_deepest(self, f: int, corners: Array) -> Array:
        """Return the point (3,) of face ``f`` with these ``corners`` (K, 3) that is farthest from its border: of a triangle the
        incentre, else the linear program of the Chebyshev centre.
        """
        if len(corners) == 3:
            opposite = np.linalg.norm(corners[[1, 2, 0]] - corners[[2, 0, 1]], axis=1)
            return np.asarray(opposite @ corners / opposite.sum())
        normals, offsets = self.planes[:, :3], self.planes[:, 3]
        shares = np.sqrt(np.maximum(1.0 - (normals @ normals[f]) ** 2, 0.0))
        others = shares > _PARALLEL**0.5
        found = linprog(
            [0.0, 0.0, 0.0, -1.0],
            A_ub=np.column_stack([normals, shares])[others],
            b_ub=offsets[others],
            A_eq=[[*normals[f], 0.0]],
            b_eq=offsets[[f]],
            bounds=[(None, None)] * 3 + [(0.0, None)],
        )
        point = np.asarray(found.x[:3], dtype=np.float64)
        return np.asarray(point - (point @ normals[f] - offsets[f]) * normals[f])

    def support(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.support`."""
        return np.asarray(self.hull[np.argmax(as_points(direction) @ self.hull.T, axis=-1)])

    def radial(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.radial`."""
        d = as_points(direction)
        # The ray leaves through the plane that it meets first.
        inverse = np.max(d @ self.planes[:, :3].T / self.planes[:, 3], axis=-1, keepdims=True)
        return np.asarray(d / inverse)

    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """As :meth:`ConvexBody.measure_edge_distance`: to the nearest of :attr:`edges`; infinite where there are none."""
        points = as_points(point)
        flat = points.reshape(-1, 3)
        first, along = self.edges[:, 0], self.edges[:, 1] - self.edges[:, 0]
        length = np.einsum("ei,ei->e", along, along)
        distance = np.full(len(flat), np.inf)
        step = max(1, _CHUNK // max(1, len(first)))
        for k in range(0, len(flat) if len(first) else 0, step):
            away = flat[k : k + step, None] - first
            share = np.clip(np.einsum("nei,ei->ne", away, along) / length, 0.0, 1.0)
            distance[k : k + step] = np.linalg.norm(away - share[..., None] * along, axis=2).min(axis=1)
        return distance.reshape(points.shape[:-1])


def _find_nearest_on_triangles(P: Array, triangles: Array) -> Array:
    """Return the nearest points (N, 3) of triangles (T, 3, 3) to ``P`` (N, 3): inside a triangle or on one of its edges."""
    a = triangles[:, 0]
    u, v = triangles[:, 1] - a, triangles[:, 2] - a
    away = P[:, None] - a
    uu, uv, vv = (np.einsum("ti,ti->t", x, y) for x, y in ((u, u), (u, v), (v, v)))
    pu, pv = np.einsum("nti,ti->nt", away, u), np.einsum("nti,ti->nt", away, v)
    det = uu * vv - uv**2
    s, t = (vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det
    candidates = [a + s[..., None] * u + t[..., None] * v]
    is_within = [(s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)]
    for start, edge in ((a, u), (a, v), (triangles[:, 1], triangles[:, 2] - triangles[:, 1])):
        along = np.einsum("nti,ti->nt", P[:, None] - start, edge) / np.einsum("ti,ti->t", edge, edge)
        candidates.append(start + np.clip(along, 0.0, 1.0)[..., None] * edge)
        is_within.append(np.ones_like(s, dtype=bool))
    points = np.concatenate(candidates, axis=1)
    gap = np.sum((P[:, None] - points) ** 2, axis=2)
    gap[~np.concatenate(is_within, axis=1)] = np.inf
    return np.asarray(points[np.arange(len(P)), gap.argmin(axis=1)])
