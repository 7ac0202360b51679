"""Rolling there and back on the tip to get ahead on the ball: the longitude-equator manoeuvre and the rolling triangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, atan2, cos, pi, sin, sqrt, tan
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from dexplan.contact.rolling.curves import SAMPLES, RollingPath, join_paths, roll_turning, split_start
from dexplan.contact.rolling.turning import build_turn, make_tangent
from dexplan.spatial import Array

Rerotation = Literal["mirror", "lift", "none"]
"""What undoes the spin between cycles: the mirrored cycle, a lift that turns the tip back on the spot, or nothing."""


class _Sides(NamedTuple):
    """Arcs A-B and B-C on the ball [rad], and the angle beta between them [rad]."""

    leg: float
    base: float
    angle: float


@dataclass(frozen=True)
class RollingTriangle:
    """Roll the tip along a closed triangle on itself: from its contact A out to B, across to C, and back in to D.

    On the tip A = D is the apex of an isosceles spherical triangle with legs ``leg`` lambda and apex angle ``apex`` gamma; on
    the ball the same three arcs do not close, and the contact gets ahead.  lambda = 90 degrees is the paper's
    longitude-equator manoeuvre A-B-C-D with its rotation limit gamma [paper §3, figure 2].  Any contact on the tip can be
    the apex, so that any two perpendicular great circles of it can be the longitude and the equator.

    ``apex`` > 0 turns to the left at B and C, seen from outside the ball; < 0 is the mirror image.  With r and R the radii of
    tip and ball, L = lambda r/R and b = base r/R:

        sin(base / 2) = sin(lambda) sin(gamma / 2),   cot(beta) = cos(lambda) tan(gamma / 2)
        sin(displacement / 2) = cos L sin(b/2) - sin L cos(beta) cos(b/2)
        alpha = atan2(sin(beta) cos(b/2), -(sin L sin(b/2) + cos L cos(beta) cos(b/2)))
        spin = 2 alpha - pi - gamma

    with alpha the ball's angle at A between the first leg and the way from A to D.  docs/theory.md derives them.  A negative
    displacement (a ball smaller than the tip) is reported as a positive one the other way.

    Raises ValueError for radii that are not positive, a leg outside (0, pi/2], or an apex not within (-pi, pi) or zero.
    """

    tip_radius: float
    object_radius: float
    leg: float
    apex: float

    def __post_init__(self) -> None:
        if not (self.tip_radius > 0.0 and self.object_radius > 0.0):
            raise ValueError(
                f"radii are {self.tip_radius} and {self.object_radius} m; positive lengths are accepted"
            )
        if not 0.0 < self.leg <= 0.5 * pi + 1e-12:
            raise ValueError(f"leg is {self.leg} rad; more than 0 and at most pi/2 is accepted")
        if not 0.0 < abs(self.apex) < pi:
            raise ValueError(f"apex is {self.apex} rad; an angle between -pi and pi other than 0 is accepted")

    @property
    def base_angle(self) -> float:
        """Angle beta [rad] of the tip's triangle at B and C."""
        return atan2(1.0, cos(self.leg) * tan(0.5 * abs(self.apex)))

    @property
    def base(self) -> float:
        """Arc B-C on the tip [rad]."""
        return 2.0 * asin(sin(self.leg) * sin(0.5 * abs(self.apex)))

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of A-B, B-C, C-D [m], the same on tip and ball."""
        r = self.tip_radius
        return r * self.leg, r * self.base, r * self.leg

    @property
    def turns(self) -> tuple[float, ...]:
        """Turns to the left [rad] before A-B (none), B-C and C-D, seen from outside the ball."""
        turn = pi - self.base_angle if self.apex > 0.0 else self.base_angle - pi
        return 0.0, turn, turn

    @property
    def total_length(self) -> float:
        """Length rolled [m]."""
        return sum(self.lengths)

    @property
    def displacement(self) -> float:
        """Angle A-D [rad] that the contact gets ahead on the ball; zero where tip and ball are of one size."""
        return abs(self._signed_displacement)

    @property
    def displacement_length(self) -> float:
        """Arc A-D [m] on the ball."""
        return self.object_radius * self.displacement

    @property
    def first_angle(self) -> float:
        """Angle [rad], to the left from outside, from the direction A to D to that of the first leg: -alpha for apex > 0.

        On a ball smaller than the tip the cycle may go the other way: then half a turn more.
        """
        alpha = self._alpha if self._signed_displacement >= 0.0 else self._alpha - pi
        return -alpha if self.apex > 0.0 else alpha

    @property
    def spin(self) -> float:
        """Turn of the tip [rad] about the ball's outward normal at D, relative to parallel transport from A to D."""
        size = 2.0 * self._alpha - pi - abs(self.apex)
        return size if self.apex > 0.0 else -size

    @property
    def mirrored(self) -> RollingTriangle:
        """The mirror image: the same displacement, the opposite spin."""
        return RollingTriangle(self.tip_radius, self.object_radius, self.leg, -self.apex)

    @property
    def _signed_displacement(self) -> float:
        L, half = self._on_ball
        return 2.0 * asin(cos(L) * sin(half) - sin(L) * cos(self.base_angle) * cos(half))

    @property
    def _alpha(self) -> float:
        L, half = self._on_ball
        beta = self.base_angle
        return atan2(sin(beta) * cos(half), -(sin(L) * sin(half) + cos(L) * cos(beta) * cos(half)))

    @property
    def _on_ball(self) -> tuple[float, float]:
        ratio = self.tip_radius / self.object_radius
        return self.leg * ratio, 0.5 * self.base * ratio

    def end_pose(self, X_OF_start: ArrayLike, direction_O: ArrayLike) -> Array:
        """Return X_OF (4, 4) after the cycle without the path between: transport from A to D, then the spin."""
        R_OF, n = split_start(self.tip_radius, self.object_radius, X_OF_start)
        ahead = build_turn(np.cross(n, make_tangent(n, direction_O)), self.displacement)
        n_D = ahead @ n
        X = np.eye(4)
        X[:3, :3] = build_turn(n_D, self.spin) @ ahead @ R_OF
        X[:3, 3] = (self.tip_radius + self.object_radius) * n_D
        return X

    def roll(self, X_OF_start: ArrayLike, direction_O: ArrayLike, samples: int = SAMPLES) -> RollingPath:
        """Return the path of one cycle that displaces the contact towards ``direction_O`` (3,).

        ``X_OF_start`` (4, 4) is any pose of the tip that touches the ball: it sets the coordinate system in which longitudes
        and equator are meant.
        """
        _, n = split_start(self.tip_radius, self.object_radius, X_OF_start)
        first = build_turn(n, self.first_angle) @ make_tangent(n, direction_O)
        return roll_turning(
            self.tip_radius, self.object_radius, X_OF_start, first, self.turns, self.lengths, samples
        )


def build_longitude_equator(tip_radius: float, object_radius: float, gamma: float) -> RollingTriangle:
    """Return the paper's manoeuvre A-B-C-D: arcs r pi/2, r gamma, r pi/2 with right angles [paper §3, figure 2]."""
    return RollingTriangle(tip_radius, object_radius, 0.5 * pi, gamma)


def solve_apex(
    tip_radius: float, object_radius: float, leg: float, displacement: float, apex_max: float
) -> float | None:
    """Return the apex gamma in (0, apex_max] whose triangle displaces the contact by ``displacement`` [rad] > 0, or None.

    Where the displacement grows beyond what is asked for before apex_max and falls below it again, None is returned, too.
    """

    def excess(apex: float) -> float:
        return RollingTriangle(tip_radius, object_radius, leg, apex).displacement - displacement

    high = min(apex_max, pi - 1e-9)
    if high <= 1e-9 or displacement <= 0.0 or excess(high) < -1e-13:
        return None
    if excess(high) <= 1e-13:
        return high
    return float(brentq(excess, 1e-9, high, xtol=1e-15, rtol=1e-14)) if excess(1e-9) < 0.0 else None


def repeat_triangle(
    triangle: RollingTriangle,
    X_OF_start: ArrayLike,
    direction_O: ArrayLike,
    count: int,
    rerotation: Rerotation = "mirror",
    samples: int = SAMPLES,
) -> tuple[RollingPath, ...]:
    """Repeat the manoeuvre ``count`` times along one great circle, re-rotating the tip between cycles [paper §3].

    Args:
        triangle: the first cycle.
        X_OF_start: (4, 4) pose of the tip touching the ball.
        direction_O: (3,) where to, in O.
        count: cycles, at least 1.
        rerotation: "mirror" makes every second cycle the mirror image, which cancels the spin of the one before;
            "lift" takes the tip off after each cycle and puts it back on the same place, turned back by the spin;
            "none" lets spin add up.
        samples: about how many samples per cycle.

    Returns:
        The paths between lifts: one without lifts, ``count`` with them.
    """
    if count < 1:
        raise ValueError(f"{count} cycles; one or more are accepted")
    apex = [-1.0 if rerotation == "mirror" and k % 2 else 1.0 for k in range(count)]
    cycles = [
        RollingTriangle(triangle.tip_radius, triangle.object_radius, triangle.leg, triangle.apex * a)
        for a in apex
    ]
    return chain_triangles(cycles, X_OF_start, direction_O, rerotation == "lift", samples)


def chain_triangles(
    cycles: Sequence[RollingTriangle],
    X_OF_start: ArrayLike,
    direction_O: ArrayLike,
    is_lifted: bool = False,
    samples: int = SAMPLES,
) -> tuple[RollingPath, ...]:
    """Roll cycles one after the other along one great circle; with ``is_lifted`` the tip is turned back between them."""
    paths: list[RollingPath] = []
    X = np.asarray(X_OF_start, dtype=np.float64)
    direction = np.asarray(direction_O, dtype=np.float64)
    for cycle in cycles:
        path = cycle.roll(X, direction, samples)
        n_A, n_D = path.n_O[0], path.n_O[-1]
        axis = np.cross(n_A, make_tangent(n_A, direction))
        direction = np.cross(axis, n_D)
        paths.append(path)
        X = path.X_OF[-1].copy()
        if is_lifted:
            X[:3, :3] = build_turn(n_D, -cycle.spin) @ X[:3, :3]
    return tuple(paths) if is_lifted else (join_paths(paths),)


def compute_spin(path: RollingPath) -> float:
    """Return the tip's turn [rad, in (-pi, pi]] about the outward normal at the end, relative to parallel transport from
    start to end along their great circle; a tip whose contact returned to its place on it has only such a turn.

    Raises ValueError for ends that are opposite each other, where no great circle is distinguished.
    """
    n_0, n_1 = path.n_O[0], path.n_O[-1]
    cross = np.cross(n_0, n_1)
    sine = float(np.linalg.norm(cross))
    if sine < 1e-12 and n_0 @ n_1 < 0.0:
        raise ValueError("start and end are opposite each other; paths that end elsewhere are accepted")
    ahead = build_turn(cross / sine, atan2(sine, n_0 @ n_1)) if sine > 0.0 else np.eye(3)
    turn = path.X_OF[-1, :3, :3] @ path.X_OF[0, :3, :3].T @ ahead.T
    # The trace-free part along the normal: exact when the whole turn is about it.
    twice = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return atan2(float(twice @ n_1), float(np.trace(turn)) - 1.0)


@dataclass(frozen=True)
class RollingBend:
    """Two legs with a turn between, A-B-C of a rolling triangle without the way back: farther than any straight roll.

    On the tip the contact goes out by ``leg`` and then across to a place as far out, ``apex`` aside; it ends off the apex.
    """

    triangle: RollingTriangle

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of A-B and B-C [m]."""
        return self.triangle.lengths[:2]

    @property
    def total_length(self) -> float:
        """Length rolled [m]."""
        return sum(self.lengths)

    @property
    def displacement(self) -> float:
        """Angle A-C on the ball [rad]: haversines of two sides and the angle beta between them."""
        L, b, beta = self._sides
        h = sin(0.5 * (L - b)) ** 2 + sin(L) * sin(b) * sin(0.5 * beta) ** 2
        return 2.0 * asin(sqrt(min(h, 1.0)))

    @property
    def first_angle(self) -> float:
        """Angle [rad], to the left from outside, from the direction A to C to that of the first leg."""
        L, b, beta = self._sides
        aside = atan2(sin(b) * sin(beta), cos(b) * sin(L) - sin(b) * cos(L) * cos(beta))
        return -aside if self.triangle.apex > 0.0 else aside

    @property
    def _sides(self) -> _Sides:
        ratio = self.triangle.tip_radius / self.triangle.object_radius
        return _Sides(self.triangle.leg * ratio, self.triangle.base * ratio, self.triangle.base_angle)

    def roll(self, X_OF_start: ArrayLike, direction_O: ArrayLike, samples: int = SAMPLES) -> RollingPath:
        """Return the path that takes the contact towards ``direction_O`` (3,) from any touching pose (4, 4)."""
        t = self.triangle
        _, n = split_start(t.tip_radius, t.object_radius, X_OF_start)
        first = build_turn(n, self.first_angle) @ make_tangent(n, direction_O)
        return roll_turning(
            t.tip_radius, t.object_radius, X_OF_start, first, t.turns[:2], self.lengths, samples
        )
