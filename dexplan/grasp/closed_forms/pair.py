"""The sphere's closed forms [paper §3]: the independent region, two soft fingers, three hard ones, the load of a pair.

``mu = tan(theta)``; directions point from the sphere's centre to the contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dexplan.brief import brief_repr
from dexplan.grasp.closure import ClosureResult, compute_angle
from dexplan.spatial import GRAVITY, Array, build_frame, read_only


@dataclass(frozen=True, eq=False)
class IndependentCones:
    """Two opposite cones about a line through the sphere's centre: ``axis`` (3,) unit, ``half_angle`` [rad]."""

    axis: Array
    half_angle: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        axis = np.asarray(self.axis, dtype=np.float64)
        length = np.linalg.norm(axis)
        if axis.shape != (3,) or not length > 0.0:
            raise ValueError(f"axis is {axis.tolist()}; a vector (3,) that points somewhere is accepted")
        if not 0.0 < self.half_angle < 0.5 * np.pi:
            raise ValueError(f"half angle is {self.half_angle} rad; one between 0 and pi/2 is accepted")
        object.__setattr__(self, "axis", read_only(axis / length))

    def worst_pair(self) -> Array:
        """Return the directions (2, 3) on both rims and on one side that are farthest from being opposite."""
        side = build_frame(self.axis)[:, 0]
        lean, rise = np.sin(self.half_angle) * side, np.cos(self.half_angle) * self.axis
        return np.stack([lean + rise, lean - rise])


def build_independent_cones(axis: ArrayLike, mu: float) -> IndependentCones:
    """Return the largest region of independent contacts about ``axis`` (3,): half angle theta = atan(mu).

    [paper §3, result 1]: two soft fingers anywhere inside opposite cones hold the sphere, and wider cones hold a pair
    that does not: :meth:`IndependentCones.worst_pair`, separated by pi - 2 half_angle.

    Raises ValueError for a zero axis and a friction that is not positive.
    """
    return IndependentCones(np.asarray(axis, dtype=np.float64), float(np.arctan(mu)))


def check_independent_sufficient(
    cones: IndependentCones, direction_1: ArrayLike, direction_2: ArrayLike
) -> ClosureResult:
    """Check the **sufficient** condition that two soft fingers lie inside opposite cones [paper §3, result 1].

    The margin [rad] is how far each finger may stray, whatever the other does: half angle less the larger of their angles
    to their own half of the axis, in the better of both assignments.  It proves closure for cones no wider than
    :func:`build_independent_cones` makes them.  A pair that fails may well be closed, about another axis: ask
    :func:`check_sphere_pair`.
    """
    d1, d2 = np.asarray(direction_1, dtype=np.float64), np.asarray(direction_2, dtype=np.float64)
    off = min(
        max(compute_angle(d1, side * cones.axis), compute_angle(d2, -side * cones.axis))
        for side in (1.0, -1.0)
    )
    margin = cones.half_angle - off
    meaning = "angle by which both contacts stay inside opposite cones (sufficient condition only)"
    return ClosureResult(margin > 0.0, margin, "rad", meaning, strength="sufficient")


def sphere_pair_angle_min(mu: float) -> float:
    """Return the least central angle [rad] of a closed soft pair: pi - 2 atan(mu) [paper §3]."""
    return float(np.pi - 2.0 * np.arctan(mu))


def check_sphere_pair(direction_1: ArrayLike, direction_2: ArrayLike, mu: float) -> ClosureResult:
    """Check two soft fingers on a sphere at directions (3,) from its centre [paper §3, result 2].

    The paper counts the boundary as closed; here it is not, for there the squeeze needed for any load is
    infinite.
    """
    phi = compute_angle(np.asarray(direction_1, dtype=np.float64), np.asarray(direction_2, dtype=np.float64))
    margin = phi - sphere_pair_angle_min(mu)
    return ClosureResult(margin > 0.0, margin, "rad", "central angle beyond the smallest that is closed")


def check_sphere_triple_sufficient(directions: ArrayLike, mu: float) -> ClosureResult:
    """Check the **sufficient** condition for three hard fingers on a sphere, directions in rows.

    [paper §3, result 3]: the triangle is acute and its plane is nearer to the centre than r sin(theta).  A
    grasp that fails may still be closed (equatorial azimuths 0, 60, 150 deg at mu 0.5): ask
    :func:`~dexplan.grasp.closed_forms.triple.check_hard_triple` then.
    """
    d = np.asarray(directions, dtype=np.float64)
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    sides = np.roll(d, -1, axis=0) - d
    # cosine of the angle at each corner, between the sides that leave it
    out, back = sides, -np.roll(sides, 1, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.sum(out * back, axis=1) / (np.linalg.norm(out, axis=1) * np.linalg.norm(back, axis=1))
    area = np.cross(sides[0], sides[1])
    if np.linalg.norm(area) < 1e-12:
        raise ValueError("the three contact points are collinear or coincide; a proper triangle is accepted")
    height = abs(float(np.dot(area, d[0]))) / float(np.linalg.norm(area))
    margin = min(float(np.sin(np.arctan(mu))) - height, float(cosine.min()))
    meaning = "smaller of sin(theta) - h/r and the cosine of the largest corner (sufficient condition only)"
    return ClosureResult(margin > 0.0, margin, "-", meaning, strength="sufficient")


def required_pair_preload(
    mu: float, mu_t: float, mass: float, radius: float, phi: float, utilisation: float = 1.0
) -> float:
    """Return the normal force [N] of each of two soft fingers that hold a ball by a horizontal chord.

    At central angle ``phi`` [rad] the chord passes beside the centre by R sin(beta), beta = 90 deg - phi/2,
    so that each finger carries half the weight, the tangential share N tan(beta) of the squeeze and the
    torque m g R tan(beta) / 2:

        N^2 = [(m g / 2 mu)^2 + (m g R tan(beta) / 2 mu_t)^2] / [u^2 - (tan(beta) / mu)^2].

    ``mu`` [-], ``mu_t`` [m], ``mass`` [kg], ``radius`` [m], ``utilisation`` u in (0, 1].  inf where the
    squeeze alone exceeds u: geometric closure needs infinite squeeze at its boundary.
    """
    slope = np.tan(0.5 * np.pi - 0.5 * phi)
    left = utilisation**2 - (slope / mu) ** 2
    weight = mass * GRAVITY
    if left <= 0.0:
        return float("inf")
    return float(np.sqrt(((weight / (2 * mu)) ** 2 + (weight * radius * slope / (2 * mu_t)) ** 2) / left))
