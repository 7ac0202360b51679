"""Bodies with edges in closed form: box, and cylinder with a sharp or a rounded rim."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.bodies.body import (
    ConvexBody,
    Flat,
    Projection,
    Solid,
    as_points,
    normalize,
    require_positive,
)
from dexplan.spatial import Array, read_only

_Z = read_only(np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class BoxBody(ConvexBody):
    """A box about the origin with the half sizes ``a``, ``b``, ``c`` [m] along x, y, z."""

    a: float
    b: float
    c: float

    def __post_init__(self) -> None:
        require_positive("a box", a=self.a, b=self.b, c=self.c)

    @property
    def half_sizes(self) -> Array:
        """(3,) [m]."""
        return np.array([self.a, self.b, self.c])

    @property
    def bound(self) -> float:
        """As :attr:`ConvexBody.bound`."""
        return float(np.linalg.norm(self.half_sizes))

    @property
    def symmetry(self) -> None:
        """None."""
        return None

    @cached_property
    def flats(self) -> tuple[Flat, ...]:
        """The six faces: +x, -x, +y, -y, +z, -z."""
        h = self.half_sizes
        return tuple(
            Flat(sign * h[k] * np.eye(3)[k], sign * np.eye(3)[k], float(np.linalg.norm(np.delete(h, k))))
            for k in range(3)
            for sign in (1.0, -1.0)
        )

    @cached_property
    def solid(self) -> Solid:
        """As :attr:`ConvexBody.solid`."""
        squares = self.half_sizes**2
        volume = float(8.0 * np.prod(self.half_sizes))
        return Solid(volume, np.zeros(3), volume / 3.0 * np.diag(squares.sum() - squares))

    def project(self, P: ArrayLike) -> Projection:
        """As :meth:`ConvexBody.project`."""
        points = as_points(P)
        return _project_on_box(points, self.half_sizes)

    def support(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.support`."""
        return np.where(as_points(direction) < 0.0, -self.half_sizes, self.half_sizes)

    def radial(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.radial`."""
        d = as_points(direction)
        return np.asarray(d / np.max(np.abs(d) / self.half_sizes, axis=-1, keepdims=True))

    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """As :meth:`ConvexBody.measure_edge_distance`."""
        # One of the three is zero, for the point lies on a face; the next is the nearest edge of that face.
        spare = np.abs(self.half_sizes - np.abs(as_points(point)))
        return np.asarray(np.sort(spare, axis=-1)[..., 1])


@dataclass(frozen=True)
class CylinderBody(ConvexBody):
    """A cylinder about the z axis of ``radius`` and ``half_length`` [m], its rims rounded by ``rim`` [m]; 0 is sharp.

    With a rounded rim the body is all points within ``rim`` of a cylinder that is smaller by ``rim`` all around, and has no edge.
    Raises ValueError for a rim that leaves no such cylinder.
    """

    radius: float
    half_length: float
    rim: float = 0.0

    def __post_init__(self) -> None:
        require_positive("a cylinder", radius=self.radius, half_length=self.half_length)
        if not 0.0 <= self.rim < min(self.radius, self.half_length):
            most = min(self.radius, self.half_length)
            raise ValueError(
                f"a cylinder with a rim of {self.rim} m; from 0 to less than {most} m is accepted"
            )

    @property
    def bound(self) -> float:
        """As :attr:`ConvexBody.bound`."""
        core = self._core
        return float(np.linalg.norm(core)) + self.rim

    @property
    def is_smooth(self) -> bool:
        """With a rounded rim."""
        return self.rim > 0.0

    @property
    def symmetry(self) -> Array:
        """The z axis."""
        return _Z

    @cached_property
    def flats(self) -> tuple[Flat, ...]:
        """The two caps: top, bottom."""
        radius = self.radius - self.rim
        return tuple(Flat(sign * self.half_length * _Z, sign * _Z, radius) for sign in (1.0, -1.0))

    @cached_property
    def solid(self) -> Solid:
        """As :attr:`ConvexBody.solid`; a rounded rim is integrated over slices, whose radius is known in closed form."""
        core, half = self.radius - self.rim, self.half_length
        # In z the slice's radius has a square root at the end of the rim: with the angle as variable it is smooth.
        x, weight = np.polynomial.legendre.leggauss(40)
        angle = 0.25 * pi * (x + 1.0)
        z = half - self.rim * (1.0 - np.sin(angle))
        r = core + self.rim * np.cos(angle)
        dz = 2.0 * 0.25 * pi * weight * self.rim * np.cos(angle)
        z, r = np.append(z, 0.0), np.append(r, self.radius)
        dz = np.append(dz, 2.0 * (half - self.rim))
        z_square = z**2
        z_square[-1] = (half - self.rim) ** 2 / 3.0
        area = pi * r**2 * dz
        along = float(np.sum(area * r**2 / 2.0))
        across = float(np.sum(area * (r**2 / 4.0 + z_square)))
        return Solid(float(area.sum()), np.zeros(3), np.diag([across, across, along]))

    def project(self, P: ArrayLike) -> Projection:
        """As :meth:`ConvexBody.project`: in the plane through the axis and the point the cylinder is a rectangle."""
        points = as_points(P)
        rho, around = normalize(points * [1.0, 1.0, 0.0], np.array([1.0, 0.0, 0.0]))
        plane = np.stack([rho, points[..., 2]], axis=-1)
        core = _project_on_box(plane, self._core)

        def lift(v: Array) -> Array:
            return v[..., :1] * around + v[..., 1:] * _Z

        return Projection(
            lift(core.point + self.rim * core.normal), lift(core.normal), core.distance - self.rim
        )

    def support(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.support`."""
        d = normalize(as_points(direction), _Z)[1]
        _, around = normalize(d * [1.0, 1.0, 0.0], np.zeros(3))
        end = np.where(d[..., 2:] < 0.0, -self._core[1], self._core[1]) * _Z
        return np.asarray(self._core[0] * around + end + self.rim * d)

    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """As :meth:`ConvexBody.measure_edge_distance`: infinite with a rounded rim."""
        points = as_points(point)
        if self.rim > 0.0:
            return np.full(points.shape[:-1], np.inf)
        rho = np.linalg.norm(points[..., :2], axis=-1)
        return np.asarray(np.abs(self.radius - rho) + np.abs(self.half_length - np.abs(points[..., 2])))

    @property
    def _core(self) -> Array:
        """Radius and half length (2,) [m] of what is rounded."""
        return np.array([self.radius - self.rim, self.half_length - self.rim])


def _project_on_box(P: Array, half: Array) -> Projection:
    """Return the nearest points of a box (or rectangle) about the origin with half sizes ``half`` (D,) to ``P`` (..., D)."""
    inside = np.clip(P, -half, half)
    distance, normal = normalize(P - inside, np.zeros_like(P))
    # Inside, the nearest face is the one with least room before it.
    room = half - np.abs(P)
    face = np.argmin(room, axis=-1, keepdims=True)
    sign = np.where(np.take_along_axis(P, face, axis=-1) < 0.0, -1.0, 1.0)
    on_face, outward = inside.copy(), np.zeros_like(P)
    np.put_along_axis(on_face, face, sign * half[face], axis=-1)
    np.put_along_axis(outward, face, sign, axis=-1)
    is_inside = distance <= 0.0
    depth = np.take_along_axis(room, face, axis=-1)[..., 0]
    return Projection(
        np.where(is_inside[..., None], on_face, inside),
        np.where(is_inside[..., None], outward, normal),
        np.where(is_inside, -depth, distance),
    )
