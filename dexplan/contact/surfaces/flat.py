"""Surfaces that unroll into a sheet of paper: plane and cylinder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.surfaces.surface import AbstractSurface, ChartGeometry, as_chart_points
from dexplan.spatial import Array


@final
@dataclass(frozen=True)
class Plane(AbstractSurface):
    """The plane z = 0 with its outward normal along +z; u = y to the north, v = x to the east, as on a map [m].

    ``M = I``, ``K = 0``, ``T = 0``; one chart without a border.
    """

    @property
    def chart_count(self) -> int:
        """One."""
        return 1

    def geometry(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> ChartGeometry:
        """Return the geometry at the point (v, u, 0)."""
        u, v, chart = as_chart_points(u, v, chart, self.chart_count)
        axes = [np.broadcast_to(e, (*u.shape, 3)) for e in np.eye(3)]
        point = np.stack([v, u, np.zeros_like(u)], axis=-1)
        return ChartGeometry(
            point,
            axes[1],
            axes[0],
            axes[2],
            np.ones((*u.shape, 2)),
            np.zeros((*u.shape, 2, 2)),
            np.zeros((*u.shape, 2)),
        )

    def coordinates(self, p_O: ArrayLike, chart: ArrayLike = 0) -> tuple[Array, Array]:
        """Return (y, x) (...) [m] of points (..., 3)."""
        p = np.asarray(p_O, dtype=np.float64)
        u, v, _ = as_chart_points(p[..., 1], p[..., 0], chart, self.chart_count)
        return u, v

    def chart_margins(self, p_O: ArrayLike) -> Array:
        """Return ones (..., 1)."""
        return np.ones((*np.shape(p_O)[:-1], 1))

    def radial(self, direction: ArrayLike) -> Array:
        """Raise ValueError: no point of a plane is its centre."""
        raise ValueError("a plane has no centre for rays to start from; project(point) is accepted")

    def project(self, p_O: ArrayLike) -> Array:
        """Return the nearest points (..., 3) [m]."""
        return np.asarray(p_O, dtype=np.float64) * [1.0, 1.0, 0.0]


@final
@dataclass(frozen=True)
class Cylinder(AbstractSurface):
    """Endless cylinder of ``radius`` rho [m] about the z axis; u [m] along the axis, v [rad] around it.

    ``M = diag(1, rho)``, ``K = diag(0, 1 / rho)``, ``T = 0``; one chart without a border (v may go round).
    """

    radius: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"cylinder radius is {self.radius} m; a positive length is accepted")

    @property
    def chart_count(self) -> int:
        """One."""
        return 1

    def geometry(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> ChartGeometry:
        """Return the geometry at height u and angle v."""
        u, v, chart = as_chart_points(u, v, chart, self.chart_count)
        zero = np.zeros_like(u)
        normal = np.stack([np.cos(v), np.sin(v), zero], axis=-1)
        y = np.stack([-np.sin(v), np.cos(v), zero], axis=-1)
        x = np.broadcast_to([0.0, 0.0, 1.0], (*u.shape, 3))
        lengths = np.broadcast_to([1.0, self.radius], (*u.shape, 2))
        K = np.broadcast_to(np.diag([0.0, 1.0 / self.radius]), (*u.shape, 2, 2))
        return ChartGeometry(
            self.radius * normal + u[..., None] * x, x, y, normal, lengths, K, np.zeros((*u.shape, 2))
        )

    def coordinates(self, p_O: ArrayLike, chart: ArrayLike = 0) -> tuple[Array, Array]:
        """Return height [m] and angle [rad] (...) of points (..., 3)."""
        p = np.asarray(p_O, dtype=np.float64)
        u, v, _ = as_chart_points(p[..., 2], np.arctan2(p[..., 1], p[..., 0]), chart, self.chart_count)
        return u, v

    def chart_margins(self, p_O: ArrayLike) -> Array:
        """Return ones (..., 1)."""
        return np.ones((*np.shape(p_O)[:-1], 1))

    def radial(self, direction: ArrayLike) -> Array:
        """Return where rays from the origin (..., 3) leave the cylinder [m]; raises ValueError for rays along the axis."""
        direction = np.asarray(direction, dtype=np.float64)
        return direction * self._stretch(direction)

    def project(self, p_O: ArrayLike) -> Array:
        """Return the nearest points (..., 3) [m]; raises ValueError on the axis, where all around is as near."""
        p = np.asarray(p_O, dtype=np.float64)
        scale = self._stretch(p)
        on_surface: Array = p * np.concatenate([scale, scale, np.ones_like(scale)], axis=-1)
        return on_surface

    def _stretch(self, p: Array) -> Array:
        off = np.hypot(p[..., 0], p[..., 1])[..., None]
        if np.any(off == 0.0):
            raise ValueError("a point lies on the cylinder's axis; points beside the axis are accepted")
        return self.radius / off
