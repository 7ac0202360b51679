"""Regions of directions as values: set operations, area, exact membership, nearest points.

A region is the set where a signed margin is not negative.  The margin is kept on a grid, which answers for areas, pictures and
emptiness, and as a function, which answers exactly at any direction.  ``a & b`` has the smaller margin, ``a | b`` the larger,
``~a`` the negative one; a point of the border belongs to a region and to its complement alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.brief import brief_repr
from dexplan.icosphere import Arcs, Icosphere, build_icosphere, compute_distance_field, measure_angle
from dexplan.spatial import Array, build_frame, lock_arrays, read_only

Margin = Callable[[Array], Array]
"""Signed margins (N,) [rad] at unit vectors (N, 3), in the axes of a grid."""

FINE = 5
"""Level of the grid that all regions live on: edges of 2.4 deg, borders between them by interpolation."""
BAND = float(np.radians(0.6))
"""The grid's borders are nearer than this to the exact ones: within it distances are settled exactly [rad]."""
STEP = float(np.radians(0.5))
"""Spacing of the samples along a great circle [rad]; a region thinner than this on the circle may be stepped over."""
_FAN = np.radians(np.linspace(-1.6, 1.6, 5))
_RAY = np.linspace(-1.5 * BAND, 1.5 * BAND, 13)


@dataclass(frozen=True, eq=False)
class LevelSet:
    """A margin in the axes of its grid: ``values`` (V,) [rad] on the vertices and ``exact``, the function behind them."""

    grid: Icosphere
    values: Array
    exact: Margin

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @cached_property
    def arcs(self) -> Arcs | None:
        """The border, None where there is none."""
        ends = self.grid.find_border(self.values)
        return Arcs(ends) if len(ends) else None

    @cached_property
    def distances(self) -> Array:
        """Angle (V,) [rad] from every vertex to the set; 2 pi where it is empty."""
        return read_only(compute_distance_field(self.grid, self.values, self.arcs))

    @cached_property
    def area(self) -> float:
        """Solid angle [sr]."""
        return self.grid.compute_area(self.values)

    def measure_distance(self, directions: Array, threshold: float | None = None) -> tuple[Array, Array]:
        """Return the angle (N,) [rad] from unit vectors (N, 3) to the set, and the nearest points of the set (N, 3).

        With a ``threshold`` [rad] only distances within ``BAND`` of it are settled exactly, the others to within ``BAND``: enough
        to compare with it.  Angles are 2 pi and points NaN where the set is empty.
        """
        points, distance = directions.copy(), np.zeros(len(directions))
        if self.arcs is None:
            if not (self.values >= 0.0).all():
                return np.full_like(points, np.nan), np.full(len(points), 2.0 * np.pi)
            return points, distance
        inside = self.grid.interpolate(self.values, directions) >= 0.0
        feet, far, _ = self.arcs.find_nearest(directions)
        points[~inside], distance[~inside] = feet[~inside], far[~inside]
        unsure = far < BAND if threshold is None else inside & (far < BAND)
        if unsure.any():
            really = self.exact(directions[unsure]) >= 0.0
            rows = np.flatnonzero(unsure)
            points[rows] = np.where(really[:, None], directions[rows], feet[rows])
            distance[rows] = np.where(really, 0.0, far[rows])
        close = (
            distance > 0.0 if threshold is None else (distance > 0.0) & (np.abs(distance - threshold) < BAND)
        )
        for row in np.flatnonzero(close):
            points[row], distance[row] = self._polish(directions[row], points[row])
        return points, distance

    def _polish(self, x: Array, foot: Array) -> tuple[Array, float]:
        """Return the nearest point (3,) of the set to x (3,) near the grid's one, and its distance: fans of rays are asked."""
        found = float(measure_angle(x, foot))
        for width in (1.0, 0.2):
            away = foot - (foot @ x) * x
            if np.linalg.norm(away) < 1e-9:
                away = build_frame(x)[:, 0]
            away /= np.linalg.norm(away)
            aside = np.cross(x, away)
            # Rays that pass the foot at up to 1.6 degrees aside, then nearer.
            azimuth = width * _FAN / max(np.sin(found), np.sin(_FAN[-1]))
            headings = np.cos(azimuth)[:, None] * away + np.sin(azimuth)[:, None] * aside
            angles = np.maximum(found + width * _RAY, 0.0)
            rays = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * headings[:, None]
            margin = self.exact(rays.reshape(-1, 3)).reshape(len(_FAN), len(_RAY))
            best, point = np.inf, foot
            for ray in np.flatnonzero((margin >= 0.0).any(axis=1)):
                first = int(np.argmax(margin[ray] >= 0.0))
                angle = float(angles[first])
                if first > 0:
                    low, high = margin[ray, first - 1], margin[ray, first]
                    angle -= float(angles[first] - angles[first - 1]) * high / (high - low)
                if angle < best:
                    best, point = angle, np.cos(angle) * x + np.sin(angle) * headings[ray]
            if np.isinf(best):
                break
            foot, found = point, best
        return foot, found


@dataclass(frozen=True, eq=False)
class SphericalRegion:
    """A set of directions from the centre of an object, in the object's own axes.

    ``R_GO`` (3, 3) turns them into the axes of the grid.  ``name`` says what the region is.
    """

    level: LevelSet
    R_GO: Array
    name: str = ""

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    # -- set algebra -----------------------------------------------------------------------------------------------------

    def __and__(self, other: SphericalRegion) -> SphericalRegion:
        """Return the intersection."""
        return self._join(other, np.minimum, f"{self.name} and {other.name}")

    def __or__(self, other: SphericalRegion) -> SphericalRegion:
        """Return the union."""
        return self._join(other, np.maximum, f"{self.name} or {other.name}")

    def __sub__(self, other: SphericalRegion) -> SphericalRegion:
        """Return what is in this region and not in the other."""
        return self & ~other

    def __invert__(self) -> SphericalRegion:
        """Return the complement."""
        exact = self.level.exact
        level = LevelSet(self.level.grid, read_only(-self.level.values), lambda d: -exact(d))
        return SphericalRegion(level, self.R_GO, f"not {self.name}")

    def _join(
        self, other: SphericalRegion, choose: Callable[[Array, Array], Array], name: str
    ) -> SphericalRegion:
        """Raises ValueError for regions in different axes or on different grids."""
        if self.level.grid is not other.level.grid or not np.array_equal(self.R_GO, other.R_GO):
            raise ValueError(
                f"{self.name} and {other.name} are regions at different object poses; two of the same pose are accepted"
            )
        one, two = self.level, other.level
        values = read_only(choose(one.values, two.values))
        return SphericalRegion(
            LevelSet(one.grid, values, lambda d: choose(one.exact(d), two.exact(d))), self.R_GO, name
        )

    def named(self, name: str) -> SphericalRegion:
        """Return the same region under another name."""
        return replace(self, name=name)

    def turned(self, R_GO: Array) -> SphericalRegion:
        """Return the same directions of the grid's axes, told in object axes that ``R_GO`` (3, 3) turns into them."""
        return replace(self, R_GO=read_only(R_GO))

    # -- measures --------------------------------------------------------------------------------------------------------

    @property
    def directions(self) -> Array:
        """The grid's directions (V, 3) in object axes."""
        return self.level.grid.vertices @ self.R_GO

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which of them lie in the region (V,)."""
        return np.asarray(self.level.values >= 0.0)

    @property
    def border(self) -> Array:
        """The border (S, 2, 3) in object axes as short arcs between unit vectors."""
        return self.level.grid.find_border(self.level.values) @ self.R_GO

    @property
    def area(self) -> float:
        """Solid angle [sr]."""
        return self.level.area

    @property
    def is_empty(self) -> bool:
        """Whether no direction of the grid lies in the region; what is smaller than its triangles counts as empty."""
        return not self.mask.any()

    def compute_margin(self, directions: ArrayLike) -> Array:
        """Return the exact margin (...) [rad] at ``directions`` (..., 3) in object axes: not negative inside."""
        d = _as_units(directions)
        return self.level.exact(d.reshape(-1, 3) @ self.R_GO.T).reshape(d.shape[:-1])

    def contains(self, directions: ArrayLike) -> NDArray[np.bool_]:
        """Return whether ``directions`` (..., 3) in object axes lie in the region (...), exactly."""
        return np.asarray(self.compute_margin(directions) >= 0.0)

    def estimate_margin(self, directions: ArrayLike) -> Array:
        """Return the margin (...) interpolated on the grid: for pictures, a hundred times faster than the exact one."""
        d = _as_units(directions)
        grid = self.level.grid
        return grid.interpolate(self.level.values, d.reshape(-1, 3) @ self.R_GO.T).reshape(d.shape[:-1])

    # -- nearest points --------------------------------------------------------------------------------------------------

    def find_nearest(self, direction: ArrayLike) -> tuple[Array, float] | None:
        """Return the point (3,) of the region nearest to ``direction`` (3,), and its angle [rad]; None where it is empty."""
        x = _as_units(direction) @ self.R_GO.T
        points, distance = self.level.measure_distance(x[None])
        if distance[0] > np.pi:
            return None
        return read_only(points[0] @ self.R_GO), float(distance[0])

    def find_along(
        self, direction: ArrayLike, towards: ArrayLike, limit: float = 2.0 * np.pi
    ) -> tuple[Array, float] | None:
        """Return the first point (3,) of the region on the great circle from ``direction`` towards ``towards``, and its angle.

        The angle [rad] is measured from ``direction``, at most ``limit``; None where the region is not met by then.  Raises
        ValueError where both directions are parallel: they fix no great circle.
        """
        x, y = _as_units(direction) @ self.R_GO.T, _as_units(towards) @ self.R_GO.T
        heading = y - (x @ y) * x
        if np.linalg.norm(heading) < 1e-9:
            raise ValueError(
                "the two directions are parallel or opposite; directions that fix a great circle are accepted"
            )
        heading /= np.linalg.norm(heading)
        level = self.level

        def at(angles: Array) -> Array:
            return np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * heading

        angles = np.linspace(0.0, limit, max(2, int(np.ceil(limit / STEP)) + 1))
        # The grid says where to look; the answer is exact.
        likely = np.flatnonzero(level.grid.interpolate(level.values, at(angles)) >= -2.0 * BAND)
        for chunk in np.array_split(likely, max(1, len(likely) // 24)):
            found = np.flatnonzero(level.exact(at(angles[chunk])) >= 0.0) if len(chunk) else chunk
            if not len(found):
                continue
            first = int(chunk[found[0]])
            if first == 0:
                return read_only(x @ self.R_GO), 0.0
            low, high = float(angles[first - 1]), float(angles[first])
            for _ in range(4):
                trial = np.linspace(low, high, 10)
                inside = level.exact(at(trial)) >= 0.0
                k = max(1, int(np.argmax(inside)))
                low, high = float(trial[k - 1]), float(trial[k])
            return read_only(at(np.array([high]))[0] @ self.R_GO), high
        return None


def _as_units(directions: ArrayLike) -> Array:
    """Return directions (..., 3) with unit length.  Raises ValueError for a zero one."""
    d = np.asarray(directions, dtype=np.float64)
    length = np.linalg.norm(d, axis=-1, keepdims=True)
    if np.any(length == 0.0):
        raise ValueError("a direction is zero; vectors that point somewhere are accepted")
    return d / length


def build_cap(axis: ArrayLike, half_angle: float, R_GO: Array | None = None) -> SphericalRegion:
    """Return the directions within ``half_angle`` [rad] of ``axis`` (3,) in object axes; ``R_GO`` as in the regions to join."""
    R = read_only(np.eye(3) if R_GO is None else R_GO)
    center = _as_units(axis) @ R.T

    def exact(d: Array) -> Array:
        return half_angle - measure_angle(d, center)

    grid = build_icosphere(FINE)
    return SphericalRegion(
        LevelSet(grid, read_only(exact(grid.vertices)), exact), R, f"cap of {np.degrees(half_angle):.1f} deg"
    )


def build_independent_cones(
    axis: ArrayLike, theta: float, R_GO: Array | None = None
) -> tuple[SphericalRegion, SphericalRegion]:
    """Return two opposite cones such that *any* contact in one holds with *any* in the other [paper §3, result 1].

    Half angle ``theta`` = atan mu [rad]: two contacts that lean by theta from the axis each, to the same side, are
    180 deg - 2 theta apart, the smallest angle that is force closed.
    """
    axis = _as_units(axis)
    return build_cap(axis, theta, R_GO), build_cap(-axis, theta, R_GO)


def build_closure(source: SphericalRegion, theta: float, name: str = "") -> SphericalRegion:
    """Return the directions antipodal to some point of ``source``: FC_i of a CWS_i on a sphere [paper §2.1, §3 result 2].

    x is in it when -x lies within 2 ``theta`` [rad] of the source; the margin is what is left of that angle.
    """
    level, grid = source.level, source.level.grid
    values = 2.0 * theta - level.distances[grid.antipodes]

    def exact(d: Array) -> Array:
        return 2.0 * theta - level.measure_distance(-d, 2.0 * theta)[1]

    return SphericalRegion(
        LevelSet(grid, read_only(values), exact), source.R_GO, name or f"FC of {source.name}"
    )
