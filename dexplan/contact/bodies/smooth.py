"""Bodies without a sharp edge: ball, ellipsoid, capsule."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.bodies.body import ConvexBody, Projection, Solid, as_points, normalize, require_positive
from dexplan.spatial import Array, read_only

_STEPS = 60
"""Newton steps of an ellipsoid's nearest point at most; about six are needed, more right beside the middle of a flat one."""
_X = read_only(np.array([1.0, 0.0, 0.0]))
_Z = read_only(np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class BallBody(ConvexBody):
    """A ball of ``radius`` [m] about the origin."""

    radius: float

    def __post_init__(self) -> None:
        require_positive("a ball", radius=self.radius)

    @property
    def bound(self) -> float:
        """As :attr:`ConvexBody.bound`."""
        return self.radius

    @property
    def is_smooth(self) -> bool:
        """True."""
        return True

    @property
    def symmetry(self) -> Array:
        """One of all axes."""
        return _Z

    def is_symmetric_about(self, axis: ArrayLike) -> bool:
        """Return True: every axis is an axis of symmetry."""
        return True

    @cached_property
    def solid(self) -> Solid:
        """As :attr:`ConvexBody.solid`."""
        volume = 4.0 / 3.0 * pi * self.radius**3
        return Solid(volume, np.zeros(3), 0.4 * volume * self.radius**2 * np.eye(3))

    def project(self, P: ArrayLike) -> Projection:
        """As :meth:`ConvexBody.project`."""
        points = as_points(P)
        length, normal = normalize(points, _X)
        is_off_center = (length > 0.0)[..., None]
        with np.errstate(invalid="ignore", divide="ignore"):
            # To the last bit what ``Sphere.radial`` says: plans for balls are compared by their bits.
            point = np.where(is_off_center, self.radius * points / length[..., None], self.radius * normal)
        return Projection(point, normal, length - self.radius)

    def support(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.support`."""
        return self.radius * normalize(as_points(direction), _X)[1]

    def radial(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.radial`."""
        return self.support(direction)

    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """Return infinity: there is no edge."""
        return np.full(as_points(point).shape[:-1], np.inf)


@dataclass(frozen=True)
class EllipsoidBody(ConvexBody):
    """An ellipsoid about the origin with the semi-axes ``a``, ``b``, ``c`` [m] along x, y, z."""

    a: float
    b: float
    c: float

    def __post_init__(self) -> None:
        require_positive("an ellipsoid", a=self.a, b=self.b, c=self.c)

    @property
    def semi_axes(self) -> Array:
        """(3,) [m]."""
        return np.array([self.a, self.b, self.c])

    @property
    def bound(self) -> float:
        """As :attr:`ConvexBody.bound`."""
        return max(self.a, self.b, self.c)

    @property
    def is_smooth(self) -> bool:
        """True."""
        return True

    @property
    def symmetry(self) -> Array | None:
        """The axis along which the semi-axis differs from two equal ones."""
        for k, (one, other) in enumerate(((self.b, self.c), (self.a, self.c), (self.a, self.b))):
            if one == other:
                return np.asarray(np.eye(3)[k])
        return None

    def is_symmetric_about(self, axis: ArrayLike) -> bool:
        """As :meth:`ConvexBody.is_symmetric_about`."""
        return (self.a == self.b == self.c) or super().is_symmetric_about(axis)

    @cached_property
    def solid(self) -> Solid:
        """As :attr:`ConvexBody.solid`."""
        volume = 4.0 / 3.0 * pi * self.a * self.b * self.c
        squares = self.semi_axes**2
        return Solid(volume, np.zeros(3), volume / 5.0 * np.diag(squares.sum() - squares))

    def project(self, P: ArrayLike) -> Projection:
        """As :meth:`ConvexBody.project`.

        The nearest point is p_i = a_i^2 P_i / (t + a_i^2) for the largest root t of sum (a_i P_i / (t + a_i^2))^2 = 1, where
        the normal at p points at P [Eberly, Distance from a point to an ellipsoid, 2013].  Newton steps on the reciprocal of the
        norm, a concave function of t, rise to the root from the left and never pass it.
        """
        points = as_points(P)
        flat = points.reshape(-1, 3)
        axes = self.semi_axes
        square, least = axes**2, int(axes.argmin())
        size = np.abs(flat)
        t = (axes * size - square).max(axis=1)
        for _ in range(_STEPS):
            with np.errstate(divide="ignore", invalid="ignore"):
                w = axes * size / (t[:, None] + square)
                norm = np.linalg.norm(w, axis=1)
                slope = np.sum(w**2 / (t[:, None] + square), axis=1)
                step = (norm - 1.0) * norm**2 / slope
            step = np.where(np.isfinite(step) & (step > 0.0), step, 0.0)
            t = t + step
            if np.all(step <= 1e-16 * (np.abs(t) + square[least])):
                break
        with np.errstate(divide="ignore", invalid="ignore"):
            p = square * flat / (t[:, None] + square)
            # On the middle of the flattest section two points are equally near, one on either side of it.
            is_between = (axes[least] * size[:, least] <= 1e-12 * square[least]) & (
                np.linalg.norm(np.delete(axes * size / (square - square[least]), least, axis=1), axis=1) < 1.0
            )
            middle = np.where(square > square[least], square * flat / (square - square[least]), 0.0)
        middle[:, least] = 0.0
        rest = np.sqrt(np.maximum(1.0 - np.sum((middle / axes) ** 2, axis=1), 0.0))
        middle[:, least] = axes[least] * np.where(flat[:, least] < 0.0, -rest, rest)
        p = np.where(is_between[:, None] | ~np.isfinite(p), middle, p)
        # Rounding is taken out along the ray, which does not turn the normal.
        p = p / np.linalg.norm(p / axes, axis=1, keepdims=True)
        normal = p / square
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        distance = np.sum((flat - p) * normal, axis=1)
        shape = points.shape
        return Projection(p.reshape(shape), normal.reshape(shape), distance.reshape(shape[:-1]))

    def support(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.support`."""
        scaled = self.semi_axes * as_points(direction)
        return self.semi_axes * normalize(scaled, _X)[1]

    def radial(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.radial`."""
        d = as_points(direction)
        return np.asarray(d / np.linalg.norm(d / self.semi_axes, axis=-1, keepdims=True))

    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """Return infinity: there is no edge."""
        return np.full(as_points(point).shape[:-1], np.inf)


@dataclass(frozen=True)
class CapsuleBody(ConvexBody):
    """All points within ``radius`` [m] of the segment of the z axis from -``half_length`` to ``half_length`` [m]."""

    radius: float
    half_length: float

    def __post_init__(self) -> None:
        require_positive("a capsule", radius=self.radius, half_length=self.half_length)

    @property
    def bound(self) -> float:
        """As :attr:`ConvexBody.bound`."""
        return self.radius + self.half_length

    @property
    def is_smooth(self) -> bool:
        """True."""
        return True

    @property
    def symmetry(self) -> Array:
        """The z axis."""
        return _Z

    @cached_property
    def solid(self) -> Solid:
        """As :attr:`ConvexBody.solid`: a cylinder and two half balls, whose centres lie 3/8 r beyond its ends."""
        r, h = self.radius, self.half_length
        tube, ball = 2.0 * pi * r**2 * h, 4.0 / 3.0 * pi * r**3
        along = 0.5 * tube * r**2 + 0.4 * ball * r**2
        across = tube * (r**2 / 4.0 + h**2 / 3.0) + ball * (0.4 * r**2 + 0.75 * r * h + h**2)
        return Solid(tube + ball, np.zeros(3), np.diag([across, across, along]))

    def project(self, P: ArrayLike) -> Projection:
        """As :meth:`ConvexBody.project`."""
        points = as_points(P)
        core = self._core(points)
        length, normal = normalize(points - core, _X)
        return Projection(core + self.radius * normal, normal, length - self.radius)

    def support(self, direction: ArrayLike) -> Array:
        """As :meth:`ConvexBody.support`."""
        d = normalize(as_points(direction), _X)[1]
        end = np.where(d[..., 2:] < 0.0, -self.half_length, self.half_length) * _Z
        return np.asarray(end + self.radius * d)

    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """Return infinity: there is no edge."""
        return np.full(as_points(point).shape[:-1], np.inf)

    def _core(self, points: Array) -> Array:
        core = np.zeros_like(points)
        core[..., 2] = np.clip(points[..., 2], -self.half_length, self.half_length)
        return core
