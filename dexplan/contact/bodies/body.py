"""A convex body as a fingertip meets it: one geometric question, ``project``, and what mass it has."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dexplan.brief import brief_repr
from dexplan.spatial import Array, lock_arrays

_BISECTIONS = 60
"""Halvings of a ray that is searched for the surface: the last is shorter than a rounding error of the body's size."""
SHARP = float(np.radians(20.0))
"""An edge is sharp where the surface bends by this much or more [rad].  Less, and what meets there is taken for a surface that
was cut into facets: a normal that is off by the half of it stays well inside the cone of friction.
"""


@dataclass(frozen=True, eq=False)
class Projection:
    """Nearest points of a surface, in the body's axes.

    ``point`` (..., 3) [m] on the surface, the **outward** unit ``normal`` (..., 3) there, and the signed ``distance`` (...) [m],
    negative inside: ``P = point + distance * normal``.
    """

    point: Array
    normal: Array
    distance: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Solid:
    """What a homogeneous body of density 1 weighs: ``volume`` [m^3], centre of mass ``com`` (3,) [m] and ``inertia`` (3, 3) [m^5]
    about that centre, in the body's axes.  A mass m has the inertia ``m / volume * inertia``.
    """

    volume: float
    com: Array
    inertia: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Flat:
    """A plane part of a surface: ``center`` (3,) [m] on it, **outward** ``normal`` (3,), and the ``radius`` [m] about the centre
    that contains it.
    """

    center: Array
    normal: Array
    radius: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


class ConvexBody(ABC):
    r"""A convex body, with its origin inside, in its own axes.

    **Tips are spheres.**  A tip of radius r with its centre at c touches the body where ``project(c)`` says that the distance
    is r: at that point p, along that outward normal n, with ``c = p + r n``.  That holds on faces, edges and corners alike; the
    map is continuous outside the body and MuJoCo finds the same contact.  A body therefore answers one question about contacts.
    Charts, which Montana's equations need, belong to :class:`~dexplan.contact.surfaces.surface.AbstractSurface`.

    **Three directions, three questions.**  :meth:`radial` is where a ray from the origin leaves the body, :meth:`support` the
    point that is farthest along a direction (there the direction is a normal), :meth:`project` the nearest point.  They agree on
    a ball about its centre and nowhere else: on an ellipsoid of 25/35/45 mm the normal at the radial point of a direction is up
    to 32 degrees off that direction.

    A subclass is final and implements what is abstract here.  All methods accept one vector or many, (..., 3).
    """

    @property
    @abstractmethod
    def bound(self) -> float:
        """Radius [m] of the smallest ball about the origin that contains the body: its length scale."""

    @property
    @abstractmethod
    def solid(self) -> Solid:
        """Volume, centre of mass and inertia at density 1."""

    @property
    @abstractmethod
    def symmetry(self) -> Array | None:
        """Unit axis (3,) about which every turn leaves the body as it is; None where there is none.  A ball has all axes."""

    @property
    def flats(self) -> tuple[Flat, ...]:
        """The plane parts of the surface."""
        return ()

    @abstractmethod
    def project(self, P: ArrayLike) -> Projection:
        """Return the surface's nearest points to ``P`` (..., 3) [m], inside or outside.

        Where several are equally near (in the middle of a box, say) one of them is returned, always the same.
        """

    @abstractmethod
    def support(self, direction: ArrayLike) -> Array:
        """Return the points (..., 3) [m] farthest along ``direction`` (..., 3), of any length but zero."""

    @abstractmethod
    def measure_edge_distance(self, point: ArrayLike) -> Array:
        """Return how far (...) [m] points (..., 3) on the surface are from the nearest sharp edge (see :data:`SHARP`).

        Infinite where there is no edge on the part of the surface that the point lies on.
        """

    @property
    def is_smooth(self) -> bool:
        """Whether the normal turns without a jump everywhere, so that a tip may roll over all of the surface."""
        return False

    def is_symmetric_about(self, axis: ArrayLike) -> bool:
        """Return whether every turn about ``axis`` (3,) through the origin leaves the body as it is."""
        own, asked = self.symmetry, np.asarray(axis, dtype=np.float64)
        if own is None:
            return False
        return bool(np.linalg.norm(np.cross(own, asked)) <= 1e-9 * np.linalg.norm(asked))

    def normal_at(self, point: ArrayLike) -> Array:
        """Return the **outward** unit normals (..., 3) at points (..., 3) [m] on the surface; on an edge one of its faces'."""
        return self.project(point).normal

    def radial(self, direction: ArrayLike) -> Array:
        """Return where rays (..., 3) from the origin leave the body, (..., 3) [m]; of any length but zero."""
        d = np.asarray(direction, dtype=np.float64)
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
        near, far = np.zeros(d.shape[:-1]), np.full(d.shape[:-1], self.bound)
        for _ in range(_BISECTIONS):
            middle = 0.5 * (near + far)
            is_inside = self.project(middle[..., None] * d).distance < 0.0
            near, far = np.where(is_inside, middle, near), np.where(is_inside, far, middle)
        return np.asarray(0.5 * (near + far)[..., None] * d)


def normalize(v: Array, fallback: Array) -> tuple[Array, Array]:
    """Return lengths (...) and unit vectors (..., 3) of ``v`` (..., 3); ``fallback`` (..., 3) where the length is zero."""
    length = np.linalg.norm(v, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = np.where((length > 0.0)[..., None], v / length[..., None], fallback)
    return length, unit


def require_positive(kind: str, **lengths: float) -> None:
    """Raise ValueError unless all lengths [m] of a body are positive and finite."""
    wrong = [f"{name} {value}" for name, value in lengths.items() if not (np.isfinite(value) and value > 0.0)]
    if wrong:
        raise ValueError(f"{kind} with {', '.join(wrong)} m; positive finite lengths are accepted")


def as_points(P: ArrayLike) -> Array:
    """Return points or directions as floats (..., 3); raises ValueError for another shape."""
    points = np.asarray(P, dtype=np.float64)
    if points.shape[-1:] != (3,):
        raise ValueError(f"points of shape {points.shape}; (..., 3) is accepted")
    return points
