"""What a fingertip can transmit: exact friction cones, and pyramids inscribed in them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Self, final

import numpy as np
from numpy.typing import ArrayLike

from dexplan.spatial import Array, read_only

NORMAL = 2
"""Index of the normal component in every contact force (f_t1, f_t2, f_n[, tau_n])."""

_OTHERS = (0, 1, 3)  # the components that friction carries

# Rings (latitude [deg], count, phase in steps) whose 2 + 2 * (6 + 10 + 14) + 14 = 76 points cover the unit sphere evenly: found
# by maximising the inradius over the three free latitudes; mirrored rings keep the set symmetric about the equator.
_SOFT_RINGS = (
    (90.0, 1, 0.0),
    (63.038404, 6, 0.0),
    (44.309688, 10, 0.5),
    (24.190253, 14, 0.0),
    (0.0, 14, 0.5),
    (-24.190253, 14, 0.0),
    (-44.309688, 10, 0.5),
    (-63.038404, 6, 0.0),
    (-90.0, 1, 0.0),
)


class ContactModel(ABC):
    """A point contact with friction; forces act **on the object**, in the contact frame (z into it).

    The components are (f_t1, f_t2, f_n) for a hard finger and (f_t1, f_t2, f_n, tau_n) for a soft one [MLS
    1994, §5.2]. With ``capacity`` c holding the largest force or torque that one newton of normal force can
    carry in each direction other than the normal, the friction cone is an ellipsoidal one

        f_n >= sqrt(sum_j (f_j / c_j)^2)

    which is exactly MuJoCo's elliptic cone: f_n^2 >= (f_t1^2 + f_t2^2) / mu^2 + tau_n^2 / mu_t^2.

    Linear programs want a pyramid.  Cutting the cone at f_n = 1 and dividing by c leaves the unit ball (a
    disc for hard fingers); any polytope {x : n_i . x <= h} with its vertices on that ball is inscribed, and h
    is its inradius: what remains of friction in the worst direction.  An octagon for force times an interval
    for torsion is *not* inscribed: its corners ask for sqrt(2) of the cone.
    """

    @property
    @abstractmethod
    def capacity(self) -> Array:
        """Force [N] and torque [N m] per newton of normal force, (m - 1,), in the order of the components."""

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return this model with ``factor`` times the friction: belief is ``scaled(1 / safety)``."""

    @property
    @abstractmethod
    def section(self) -> tuple[Array, float]:
        """Unit facet normals (k, m - 1) and inradius of the default polytope inscribed in the unit ball."""

    @property
    def dimension(self) -> int:
        """Number m of force components that the contact transmits."""
        return len(self.capacity) + 1

    @property
    def facet_inradius(self) -> float:
        """Share of friction that :meth:`facets` keeps in its worst direction, in (0, 1)."""
        return self.section[1]

    def wrench_basis(self) -> Array:
        """Return B (6, m): the wrench about the contact point, in the contact frame, is ``B @ f``."""
        return np.eye(6)[:, [0, 1, 2, 5][: self.dimension]]

    def load(self, f: ArrayLike) -> Array:
        """Return the normal force (...) [N] that friction needs for the other parts of f (..., m)."""
        f = np.asarray(f, dtype=np.float64)
        if f.shape[-1] != self.dimension:
            raise ValueError(f"contact force has {f.shape[-1]} components; {self.dimension} are accepted")
        needed: Array = np.linalg.norm(f[..., _OTHERS[: self.dimension - 1]] / self.capacity, axis=-1)
        return needed

    def utilisation(self, f: ArrayLike) -> Array:
        """Return the used share (...) of the exact cone: 1 slides, inf is friction without pressure."""
        load, normal = self.load(f), np.asarray(f, dtype=np.float64)[..., NORMAL]
        with np.errstate(divide="ignore", invalid="ignore"):
            used = np.where(normal > 0.0, load / normal, np.inf)
        return np.where((normal <= 0.0) & (load == 0.0), 0.0, used)

    def cone_margin(self, f: ArrayLike) -> Array:
        """Return the normal force (...) [N] to spare before sliding; negative outside the exact cone."""
        return np.asarray(f, dtype=np.float64)[..., NORMAL] - self.load(f)

    def facets(self) -> Array:
        """Return A (k, m) such that ``A @ f <= 0`` is a pyramid inside the exact cone.

        Rows are dimensionless per newton of normal force: a violation of A @ f is in newtons of normal force.
        """
        return self._build_facets(*self.section)

    def _build_facets(self, normals: Array, inradius: float) -> Array:
        return np.insert(normals / self.capacity, NORMAL, -inradius, axis=1)


@final
@dataclass(frozen=True)
class HardFinger(ContactModel):
    """Point contact with friction: a force inside a circular cone, no torque about the normal.

    ``sliding`` is the friction coefficient mu = tan(theta) [-].
    """

    sliding: float

    def __post_init__(self) -> None:
        _require_positive("sliding", self.sliding)

    @property
    def capacity(self) -> Array:
        """(mu, mu)."""
        return read_only([self.sliding, self.sliding])

    @property
    def section(self) -> tuple[Array, float]:
        """An octagon with facet normals along both tangents."""
        return _build_polygon(8, 0.0)

    def scaled(self, factor: float) -> HardFinger:
        """Return a hard finger with ``factor`` times the friction."""
        return HardFinger(self.sliding * factor)

    def facets(self, edges: int = 8, phase: float = 0.0) -> Array:
        """Return the inscribed pyramid (edges, 3) with any number of edges.

        ``phase`` turns it, in units of one facet: 0 puts a facet across t1 (the pyramid is weakest there, by
        cos(pi / edges)), 0.5 puts an edge there (as strong as the cone).  Raises ValueError below three
        edges.
        """
        return self._build_facets(*_build_polygon(edges, phase))


@final
@dataclass(frozen=True)
class SoftFinger(ContactModel):
    """Point contact that also resists spin: shear and torsion share one ellipsoidal cone.

    ``sliding`` is mu [-]; ``torsional`` is mu_t [m], MuJoCo's unit: torque per newton of normal force.  A
    rubber patch of radius a gives about mu_t = (3 pi / 16) mu a (Hertz).
    """

    sliding: float
    torsional: float

    def __post_init__(self) -> None:
        _require_positive("sliding", self.sliding)
        _require_positive("torsional", self.torsional)

    @property
    def capacity(self) -> Array:
        """(mu, mu, mu_t)."""
        return read_only([self.sliding, self.sliding, self.torsional])

    @property
    def section(self) -> tuple[Array, float]:
        """A polytope of 76 facets in (f_x / mu, f_y / mu, tau / mu_t), inradius 0.964."""
        return _build_soft_section()

    def scaled(self, factor: float) -> SoftFinger:
        """Return a soft finger with ``factor`` times both frictions."""
        return SoftFinger(self.sliding * factor, self.torsional * factor)


def _require_positive(name: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} friction is {value}; a positive finite number is accepted")


@lru_cache(maxsize=32)
def _build_polygon(edges: int, phase: float) -> tuple[Array, float]:
    if edges < 3:
        raise ValueError(f"a pyramid with {edges} edges has no inside; three or more are accepted")
    angle = 2.0 * np.pi * (np.arange(edges) + phase) / edges
    return read_only(np.stack([np.cos(angle), np.sin(angle)], axis=1)), float(np.cos(np.pi / edges))


@lru_cache(maxsize=1)
def _build_soft_section() -> tuple[Array, float]:
    """Return normals (76, 3) and the largest h that keeps {n . x <= h} inside the unit ball."""
    rows = []
    for latitude, count, phase in _SOFT_RINGS:
        u, v = np.radians(latitude), 2.0 * np.pi * (np.arange(count) + phase) / count
        rows.append(
            np.stack([np.cos(u) * np.cos(v), np.cos(u) * np.sin(v), np.full(count, np.sin(u))], axis=1)
        )
    normals = np.concatenate(rows)
    # Vertices of {n . x <= 1} are those intersections of three facets that violate no other: few enough to
    # try them all.
    triples = normals[np.array(list(combinations(range(len(normals)), 3)))]
    triples = triples[np.abs(np.linalg.det(triples)) > 1e-9]
    points = np.linalg.solve(triples, np.ones((len(triples), 3, 1)))[..., 0]
    vertices = points[np.all(points @ normals.T <= 1.0 + 1e-9, axis=1)]
    return read_only(normals), float(1.0 / np.linalg.norm(vertices, axis=1).max())
