"""The surfaces at hand, each with closed forms for its chart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.surface import AbstractSurface
from dexplan.spatial import Array


@final
@dataclass(frozen=True)
class Sphere(AbstractSurface):
    """Sphere of ``radius`` [m] about the origin; u latitude, v longitude [rad] [MLS 1994, §5.6].

    ``K = I / rho``, ``M = diag(rho, rho cos u)``, ``T = [0, -tan(u) / rho]``: the chart ends at the poles u =
    +-pi/2, where the longitude is undefined and T is unbounded.
    """

    radius: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"sphere radius is {self.radius} m; a positive length is accepted")

    def point(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the points (..., 3) [m] at latitude u and longitude v."""
        return self.radius * self.normal(u, v)

    def tangents(self, u: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
        """Return the unit vectors (..., 3) to the north and to the east."""
        u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        north = np.stack([-np.sin(u) * np.cos(v), -np.sin(u) * np.sin(v), np.cos(u)], axis=-1)
        east = np.stack([-np.sin(v), np.cos(v), np.zeros_like(v)], axis=-1)
        return north, east

    def normal(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the outward unit normals (..., 3)."""
        u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        return np.stack([np.cos(u) * np.cos(v), np.cos(u) * np.sin(v), np.sin(u)], axis=-1)

    def metric(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return M = diag(rho, rho cos u) (..., 2, 2) [m/rad]."""
        u, _ = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        out = np.zeros((*u.shape, 2, 2))
        out[..., 0, 0], out[..., 1, 1] = self.radius, self.radius * np.cos(u)
        return out

    def curvature(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return K = I / rho (..., 2, 2) [1/m]."""
        u, _ = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        return np.broadcast_to(np.eye(2) / self.radius, (*u.shape, 2, 2)).copy()

    def torsion(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return T = [0, -tan(u) / rho] (..., 1, 2) [1/m]."""
        u, _ = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
        out = np.zeros((*u.shape, 1, 2))
        out[..., 0, 1] = -np.tan(u) / self.radius
        return out

    def chart(self, p_O: ArrayLike) -> tuple[Array, Array]:
        """Return latitude and longitude (...) [rad] of points (..., 3)."""
        n = self.closest(p_O) / self.radius
        return np.arcsin(np.clip(n[..., 2], -1.0, 1.0)), np.arctan2(n[..., 1], n[..., 0])

    def closest(self, direction: ArrayLike) -> Array:
        """Return the points (..., 3) [m] in these directions; raises ValueError for a zero one."""
        direction = np.asarray(direction, dtype=np.float64)
        length = np.linalg.norm(direction, axis=-1, keepdims=True)
        if np.any(length == 0.0):
            raise ValueError("direction is zero; a vector that points somewhere is accepted")
        return self.radius * direction / length
