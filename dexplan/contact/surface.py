"""Smooth surfaces seen through a chart: the geometry that contact kinematics needs."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from dexplan.spatial import Array


class AbstractSurface(ABC):
    """A smooth closed surface with an orthogonal chart (u, v) -> point, in the axes of the body that owns it.

    **Gauss frame.** With tangents p_u, p_v and the outward unit normal n, an orthogonal chart has p_u . p_v =
    0 and gives the axes x = p_u / |p_u|, y = p_v / |p_v| [MLS 1994, §5.6.1].  Three quantities describe the
    surface to second order:

    - metric ``M = diag(|p_u|, |p_v|)``: how far the point moves per unit of chart,
    - curvature ``K = [x, y]^T [n_u / |p_u|, n_v / |p_v|]``: how fast the outward normal turns per metre,
    - torsion ``T = y^T [x_u / |p_u|, x_v / |p_v|]``: how fast x turns about the normal per metre.

    **Handedness.** The chart fixes x and y, hence x cross y; on the latitude-longitude charts used here that
    is the *inward* normal.  :meth:`frame` therefore returns (x, y, -n), which is a proper rotation and at
    once a contact frame of this code (z into the object).  K is positive on convex surfaces because it is
    taken of the outward normal.

    A subclass is final.  All methods accept scalars or arrays (...) of u, v and put the shape in front of
    their own axes.
    """

    @abstractmethod
    def point(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the points (..., 3) [m] at chart coordinates u, v (...)."""

    @abstractmethod
    def tangents(self, u: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
        """Return the unit tangents x, y (..., 3) along growing u and growing v."""

    @abstractmethod
    def normal(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the **outward** unit normals (..., 3)."""

    @abstractmethod
    def metric(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return M (..., 2, 2) [m per unit of chart]."""

    @abstractmethod
    def curvature(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return K (..., 2, 2) [1/m] of the outward normal: positive where the surface is convex."""

    @abstractmethod
    def torsion(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return T (..., 1, 2) [1/m]."""

    @abstractmethod
    def chart(self, p_O: ArrayLike) -> tuple[Array, Array]:
        """Return the coordinates u, v (...) of points (..., 3), taken radially onto the surface."""

    @abstractmethod
    def closest(self, direction: ArrayLike) -> Array:
        """Return the points (..., 3) [m] where rays from the centre along ``direction`` meet the surface."""

    def frame(self, u: ArrayLike, v: ArrayLike) -> Array:
        """Return the Gauss axes as contact frames (..., 3, 3): columns x, y, **inward** normal."""
        x, y = self.tangents(u, v)
        return np.stack([x, y, -self.normal(u, v)], axis=-1)
