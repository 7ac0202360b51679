"""Smooth surfaces seen through charts: the geometry that contact kinematics needs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array, lock_arrays

Charts = NDArray[np.intp]
"""Which chart of a surface coordinates belong to: integers, one per point."""


@dataclass(frozen=True, eq=False)
class ChartGeometry:
    r"""A surface at chart coordinates (u, v), to second order, in the axes of the body that owns it.

    ``point`` (..., 3) [m]; ``x``, ``y`` (..., 3) the Gauss frame's unit tangents along growing u and v; ``normal`` (..., 3)
    **outward**; ``lengths`` (..., 2) = (\|p_u\|, \|p_v\|) [m per unit of chart], the diagonal of M; ``curvature`` (..., 2, 2)
    K [1/m]; ``torsion`` (..., 2) T [1/m].
    """

    point: Array
    x: Array
    y: Array
    normal: Array
    lengths: Array
    curvature: Array
    torsion: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def frame(self) -> Array:
        """The Gauss axes as contact frames (..., 3, 3): columns x, y, **inward** normal."""
        return np.stack([self.x, self.y, -self.normal], axis=-1)


class AbstractSurface(ABC):
    """A smooth surface with orthogonal charts (u, v) -> point, in the axes of the body that owns it.

    **Gauss frame.** With tangents p_u, p_v and the outward unit normal n, an orthogonal chart has p_u . p_v =
    0 and gives the axes x = p_u / |p_u|, y = p_v / |p_v| [MLS 1994, §5.6.1].  Three quantities describe the
    surface to second order:

    - metric ``M = diag(|p_u|, |p_v|)``: how far the point moves per unit of chart,
    - curvature ``K = [x, y]^T [n_u / |p_u|, n_v / |p_v|]``: how fast the outward normal turns per metre,
    - torsion ``T = y^T [x_u / |p_u|, x_v / |p_v|]``: how fast x turns about the normal per metre.

    **Handedness.** Every chart is ordered so that x cross y is the *inward* normal (latitude, then longitude).
    :meth:`frame` therefore returns (x, y, -n), which is a proper rotation and at once a contact frame of this
    code (z into the body).  K is positive on convex surfaces because it is taken of the outward normal.

    **Charts.** No chart covers a sphere: its poles are a border, where T is unbounded.  A surface offers
    ``chart_count`` charts that cover it together; all methods take the number ``chart`` of the one that (u, v)
    belong to, and :meth:`choose_chart` names the chart whose border is farthest.

    A subclass is final and implements what is abstract here.  All methods accept scalars or arrays (...) and put
    the shape in front of their own axes.
    """

    @property
    @abstractmethod
    def chart_count(self) -> int:
        """Number of charts."""

    @abstractmethod
    def geometry(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> ChartGeometry:
        """Return everything about the surface at chart coordinates u, v (...)."""

    @abstractmethod
    def coordinates(self, p_O: ArrayLike, chart: ArrayLike = 0) -> tuple[Array, Array]:
        """Return the coordinates u, v (...) of points (..., 3), taken radially onto the surface."""

    @abstractmethod
    def chart_margins(self, p_O: ArrayLike) -> Array:
        """Return, for points (..., 3), how far each chart's border is: (..., chart_count), 1 far away and 0 on it."""

    @abstractmethod
    def radial(self, direction: ArrayLike) -> Array:
        """Return the points (..., 3) [m] where rays from the centre along ``direction`` meet the surface."""

    @abstractmethod
    def project(self, p_O: ArrayLike) -> Array:
        """Return the points (..., 3) [m] of the surface that are nearest to the points (..., 3)."""

    def choose_chart(self, p_O: ArrayLike) -> Charts:
        """Return the chart (...) whose border is farthest from each of the points (..., 3)."""
        best: Charts = np.argmax(self.chart_margins(p_O), axis=-1)
        return best

    def margin(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return how far (...) the border of the points' own chart is: 1 far away, 0 on it."""
        margins = self.chart_margins(self.point(u, v, chart))
        index = np.broadcast_to(np.asarray(chart, dtype=np.intp), margins.shape[:-1])
        return np.take_along_axis(margins, index[..., None], axis=-1)[..., 0]

    def point(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return the points (..., 3) [m] at chart coordinates u, v (...)."""
        return self.geometry(u, v, chart).point

    def tangents(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> tuple[Array, Array]:
        """Return the unit tangents x, y (..., 3) along growing u and growing v."""
        at = self.geometry(u, v, chart)
        return at.x, at.y

    def normal(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return the **outward** unit normals (..., 3)."""
        return self.geometry(u, v, chart).normal

    def metric(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return M (..., 2, 2) [m per unit of chart]."""
        return self.geometry(u, v, chart).lengths[..., None] * np.eye(2)

    def curvature(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return K (..., 2, 2) [1/m] of the outward normal: positive where the surface is convex."""
        return self.geometry(u, v, chart).curvature

    def torsion(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return T (..., 1, 2) [1/m]."""
        return self.geometry(u, v, chart).torsion[..., None, :]

    def frame(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> Array:
        """Return the Gauss axes as contact frames (..., 3, 3): columns x, y, **inward** normal."""
        return self.geometry(u, v, chart).frame


class ChartPoints(NamedTuple):
    """Points of a surface: coordinates u, v and chart, all of one shape (...)."""

    u: Array
    v: Array
    chart: Charts


def as_chart_points(u: ArrayLike, v: ArrayLike, chart: ArrayLike, count: int) -> ChartPoints:
    """Return u, v and chart broadcast to one shape; raises ValueError for a chart that a surface of ``count`` lacks."""
    index = np.asarray(chart, dtype=np.intp)
    if index.size and not 0 <= index.min() <= index.max() < count:
        raise ValueError(f"chart {index.tolist()} does not exist; charts 0 to {count - 1} are accepted")
    u, v = np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)
    if u.shape == v.shape == index.shape:
        return ChartPoints(u, v, index)
    wide = np.broadcast_arrays(u, v, index)
    return ChartPoints(wide[0], wide[1], wide[2])
