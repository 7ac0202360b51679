"""The ellipsoid with three different axes, in orthogonal charts that are regular everywhere but at two poles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from dexplan.brief import brief_repr
from dexplan.contact.surfaces.polar_axes import CHART_COUNT, POLE_AXES, from_chart_axes, to_chart_axes
from dexplan.contact.surfaces.surface import AbstractSurface, ChartGeometry, as_chart_points
from dexplan.spatial import Array

_NEWTON_STEPS = 60
_BISECTIONS = 50
_SMALLEST_COSINE = 1e-150  # keeps logarithms finite on the very pole of a chart


@final
@dataclass(frozen=True)
class Ellipsoid(AbstractSurface):
    """Ellipsoid x^2/a^2 + y^2/b^2 + z^2/c^2 = 1 with ``semi_axes`` (a, b, c) [m].

    **Chart.** Latitude and longitude are not orthogonal on three different axes, and lines of curvature break down at four
    umbilics in the middle of the surface.  Here u counts height, z = c sin u, and v = const follows the steepest way up,
    whose differential equation dx : dy = x / a^2 : y / b^2 has the solution

        x = a cos v exp(-tau / a^2),  y = b sin v exp(-tau / b^2),  z = c sin u,
        cos^2 v exp(-2 tau / a^2) + sin^2 v exp(-2 tau / b^2) = cos^2 u

    with tau(u, v) >= 0 and v the angle where the way starts on the equator.  Curves of equal height and steepest ways are
    orthogonal.  For a = b it is latitude and longitude.  Charts 0, 1, 2 have their poles on z, x, y.

    With D = diag(1/a^2, 1/b^2, 1/c^2), N = D p and E = [x, y]: ``K = E^T D E / |N|``;  with S = sum (p_i / a_i^2)^2,
    tau_u = sin u cos u / S:  ``T = [tau_u^2 / M_u^2 sum y_i p_i / a_i^4, -tau_u / M_u sum y_i^2 / a_i^2]``, sums over the two
    axes that are not the pole's.  docs/theory.md derives it.
    """

    semi_axes: tuple[float, float, float]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        axes = np.asarray(self.semi_axes, dtype=np.float64)
        if axes.shape != (3,) or not (np.all(np.isfinite(axes)) and np.all(axes > 0.0)):
            raise ValueError(
                f"ellipsoid semi-axes are {self.semi_axes} m; three positive lengths are accepted"
            )

    @property
    def chart_count(self) -> int:
        """Three: poles on z, x, y."""
        return CHART_COUNT

    def geometry(self, u: ArrayLike, v: ArrayLike, chart: ArrayLike = 0) -> ChartGeometry:
        """Return the geometry at height u and starting angle v [rad]: x up the steepest way, y along equal height."""
        u, v, chart = as_chart_points(u, v, chart, CHART_COUNT)
        axes = to_chart_axes(np.asarray(self.semi_axes), chart)
        flat = axes[..., :2]  # the two semi-axes that do not hold the poles
        su, cu = np.sin(u), np.cos(u)
        start = np.stack([np.cos(v), np.sin(v)], axis=-1)
        tau = _solve_climb(start**2, flat, np.log(np.maximum(np.abs(cu), _SMALLEST_COSINE)))
        shrink = np.exp(-tau[..., None] / flat**2)
        side = flat * start * shrink  # (x, y)
        point = np.concatenate([side, (axes[..., 2] * su)[..., None]], axis=-1)
        # First derivatives of tau, of the constraint's.
        S = np.maximum(np.sum((side / flat**2) ** 2, axis=-1), _SMALLEST_COSINE)
        tau_u = su * cu / S
        tau_v = (start[..., 0] * start[..., 1]) * (shrink[..., 1] ** 2 - shrink[..., 0] ** 2) / S
        p_u = np.concatenate([-side * (tau_u[..., None] / flat**2), (axes[..., 2] * cu)[..., None]], axis=-1)
        slope = np.stack([-start[..., 1], start[..., 0]], axis=-1)
        p_v = flat * slope * shrink - side * (tau_v[..., None] / flat**2)
        lengths = np.stack([np.linalg.norm(p_u, axis=-1), np.linalg.norm(p_v, axis=-1)], axis=-1)
        x = p_u / lengths[..., :1]
        y2 = p_v / lengths[..., 1:]
        y = np.concatenate([y2, np.zeros_like(y2[..., :1])], axis=-1)
        N = point / axes**2
        size = np.linalg.norm(N, axis=-1, keepdims=True)
        E = np.stack([x, y], axis=-1)
        K = np.swapaxes(E, -1, -2) @ (E / axes[..., None] ** 2) / size[..., None]
        climb = tau_u / lengths[..., 0]
        T = np.stack(
            [climb**2 * np.sum(y2 * side / flat**4, axis=-1), -climb * np.sum(y2**2 / flat**2, axis=-1)],
            axis=-1,
        )
        out = [from_chart_axes(a, chart) for a in (point, x, y, N / size)]
        return ChartGeometry(out[0], out[1], out[2], out[3], lengths, K, T)

    def coordinates(self, p_O: ArrayLike, chart: ArrayLike = 0) -> tuple[Array, Array]:
        """Return u, v (...) [rad] of points (..., 3), taken radially onto the surface."""
        chart = as_chart_points(0.0, 0.0, chart, CHART_COUNT).chart
        p = to_chart_axes(self.radial(p_O), chart)
        axes = to_chart_axes(np.asarray(self.semi_axes), chart)
        unit, flat = p / axes, axes[..., :2]
        side = unit[..., :2]
        u = np.arctan2(unit[..., 2], np.linalg.norm(side, axis=-1))
        # Logarithms, because near a pole the way down is long and its factors leave the range of numbers.
        logs = 0.5 * _log(side**2)
        tau = _solve_descent(2.0 * logs, flat)
        start = np.copysign(np.exp(logs + tau[..., None] / flat**2), side)
        return u, np.arctan2(start[..., 1], start[..., 0])

    def chart_margins(self, p_O: ArrayLike) -> Array:
        """Return cos u of the three charts (..., 3) at points (..., 3)."""
        unit = self.radial(p_O) / np.asarray(self.semi_axes)
        cosine: Array = np.sqrt(np.clip(1.0 - unit[..., POLE_AXES] ** 2, 0.0, None))
        return cosine

    def radial(self, direction: ArrayLike) -> Array:
        """Return the points (..., 3) [m] in these directions; raises ValueError for a zero one."""
        direction = np.asarray(direction, dtype=np.float64)
        length = np.linalg.norm(direction / np.asarray(self.semi_axes), axis=-1, keepdims=True)
        if np.any(length == 0.0):
            raise ValueError("direction is zero; a vector that points somewhere is accepted")
        on_surface: Array = direction / length
        return on_surface

    def project(self, p_O: ArrayLike) -> Array:
        """Return the nearest points (..., 3) [m]; where several are as near, one of them.

        The foot is p_i a_i^2 / (a_i^2 + t), and t is the largest root of sum (a_i p_i / (a_i^2 + t))^2 = 1.
        """
        p = np.asarray(p_O, dtype=np.float64)
        axes = np.asarray(self.semi_axes)
        low = np.max(axes * np.abs(p) - axes**2, axis=-1)
        high = np.linalg.norm(axes * p, axis=-1) - np.min(axes) ** 2
        for _ in range(_BISECTIONS):
            t = 0.5 * (low + high)
            with np.errstate(divide="ignore", invalid="ignore"):
                terms = np.where(p == 0.0, 0.0, (axes * p / (axes**2 + t[..., None])) ** 2)
            above = np.sum(terms, axis=-1) > 1.0
            low, high = np.where(above, t, low), np.where(above, high, t)
        below = axes**2 + high[..., None]
        # A vanishing denominator (inside, on a plane of symmetry): that component makes up what the others leave.
        is_open = below <= 1e-12 * axes**2
        foot = np.where(is_open, 0.0, p * axes**2 / np.where(is_open, 1.0, below))
        rest = np.sqrt(np.clip(1.0 - np.sum((foot / axes) ** 2, axis=-1, keepdims=True), 0.0, None))
        share = is_open / np.sqrt(np.maximum(np.sum(is_open, axis=-1, keepdims=True), 1))
        return self.radial(foot + np.where(is_open, rest * share * axes, 0.0))


def _solve_climb(weights: Array, flat: Array, log_cosine: Array) -> Array:
    """Return tau >= 0 (...) with sum_i weights_i exp(-2 tau / flat_i^2) = cos^2 u.

    The logarithm of the sum is convex and falls: Newton from 0 never overshoots.
    """
    rate = 2.0 / flat**2
    logs = _log(weights)
    tau = np.zeros(np.broadcast_shapes(log_cosine.shape, logs.shape[:-1], flat.shape[:-1]))
    for _ in range(_NEWTON_STEPS):
        value, slope = _sum_of_exponentials(logs - rate * tau[..., None], rate)
        step = (value - 2.0 * log_cosine) / slope
        tau = np.maximum(tau + step, 0.0)
        if np.all(np.abs(step) * slope <= 1e-15):
            break
    return tau


def _solve_descent(logs: Array, flat: Array) -> Array:
    """Return tau (...) with sum_i exp(logs_i + 2 tau / flat_i^2) = 1: back down to the equator.

    The logarithm of the sum is convex and grows: Newton from where it is positive never overshoots.
    """
    rate = 2.0 / flat**2
    tau: Array = np.maximum(-np.max(logs, axis=-1), 0.0) / np.min(rate, axis=-1)
    for _ in range(_NEWTON_STEPS):
        value, slope = _sum_of_exponentials(logs + rate * tau[..., None], rate)
        step = value / slope
        tau = tau - step
        if np.all(np.abs(step) * slope <= 1e-15):
            break
    return tau


def _log(squares: Array) -> Array:
    """Return logarithms (..., 2), -inf for zeros; (0, -inf) where both vanish: on a pole any v will do."""
    is_pole = np.all(squares == 0.0, axis=-1, keepdims=True)
    with np.errstate(divide="ignore"):
        return np.log(np.where(is_pole, [1.0, 0.0], squares))


def _sum_of_exponentials(exponents: Array, rate: Array) -> tuple[Array, Array]:
    """Return log sum_i exp(e_i) (...) and its slope sum_i rate_i exp(e_i) / sum_i exp(e_i)."""
    top = np.max(exponents, axis=-1)
    terms = np.exp(exponents - top[..., None])
    total = np.sum(terms, axis=-1)
    return np.log(total) + top, np.sum(rate * terms, axis=-1) / total
