"""The sphere: what fingertips and balls are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.surfaces.polar_axes import CHART_COUNT, POLE_AXES, from_chart_axes, to_chart_axes
from dexplan.contact.surfaces.surface import AbstractSurface, ChartGeometry, as_chart_points
from dexplan.spatial import Array


@final
@dataclass(frozen=True)
class Sphere(AbstractSurface):
    """Sphere of ``radius`` rho [m] about the origin; u latitude, v longitude [rad] [MLS 1994, §5.6].

    ``K = I / rho``, ``M = diag(rho, rho cos u)``, ``T = [0, -tan(u) / rho]``: a chart ends at its poles u = +-pi/2, where
    the longitude is undefined and T is unbounded.  Chart 0 has its poles on z, chart 1 on x, chart 2 on y.
    """

    radius: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"sphere radius is {self.radius} m; a positive length is accepted")

    @property
    def chart_count(self) -> int:
        """Three: poles on z, x, y."""
        return CHART_COUNT

    def geometry(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> ChartGeometry:
        """Return the geometry at latitude u and longitude v: x to the north, y to the east."""
        u, v, chart = as_chart_points(u, v, chart, CHART_COUNT)
        su, cu, sv, cv = np.sin(u), np.cos(u), np.sin(v), np.cos(v)
        # Rows: normal, north, east.  Filled in place: this is the inner loop of integration.
        E = np.empty((*u.shape, 3, 3))
        E[..., 0, 0], E[..., 0, 1], E[..., 0, 2] = cu * cv, cu * sv, su
        E[..., 1, 0], E[..., 1, 1], E[..., 1, 2] = -su * cv, -su * sv, cu
        E[..., 2, 0], E[..., 2, 1], E[..., 2, 2] = -sv, cv, 0.0
        E = from_chart_axes(E, chart[..., None])
        lengths, T = np.empty((*u.shape, 2)), np.zeros((*u.shape, 2))
        lengths[..., 0], lengths[..., 1] = self.radius, self.radius * cu
        T[..., 1] = -np.tan(u) / self.radius
        K = np.zeros((*u.shape, 2, 2))
        K[..., 0, 0] = K[..., 1, 1] = 1.0 / self.radius
        normal = E[..., 0, :]
        return ChartGeometry(self.radius * normal, E[..., 1, :], E[..., 2, :], normal, lengths, K, T)

    def coordinates(self, p_O: ArrayLike, chart: ArrayLike = 0) -> tuple[Array, Array]:
        """Return latitude and longitude (...) [rad] of points (..., 3)."""
        n = self.radial(p_O) / self.radius
        n = to_chart_axes(n, as_chart_points(0.0, 0.0, chart, CHART_COUNT).chart)
        return np.arctan2(n[..., 2], np.hypot(n[..., 0], n[..., 1])), np.arctan2(n[..., 1], n[..., 0])

    def chart_margins(self, p_O: ArrayLike) -> Array:
        """Return the cosines of the three latitudes (..., 3) of points (..., 3)."""
        n = self.radial(p_O) / self.radius
        return np.sqrt(np.clip(1.0 - n[..., POLE_AXES] ** 2, 0.0, None))

    def radial(self, direction: ArrayLike) -> Array:
        """Return the points (..., 3) [m] in these directions; raises ValueError for a zero one."""
        direction = np.asarray(direction, dtype=np.float64)
        length = np.linalg.norm(direction, axis=-1, keepdims=True)
        if np.any(length == 0.0):
            raise ValueError("direction is zero; a vector that points somewhere is accepted")
        on_surface: Array = self.radius * direction / length
        return on_surface

    def project(self, p_O: ArrayLike) -> Array:
        """Return the nearest points (..., 3) [m]; raises ValueError for the centre, which is as near to all."""
        return self.radial(p_O)
