"""Integration of the contact equations for any two surfaces: fourth order, switching charts on the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.coordinates import ContactCoordinates, build_psi_rotation, leave_borders
from dexplan.contact.montana import compute_geometries, compute_relative_curvature, solve_rates
from dexplan.contact.surface import AbstractSurface, ChartGeometry, Charts
from dexplan.spatial import Array

ORDER = 4
"""Halving the step divides the error by 2^ORDER (classical Runge-Kutta)."""

Motion = Callable[[float, Array], Array]
"""``motion(t, X_OC)`` -> twists (..., 6) of the tip relative to the body at the contact point, in **O axes**.

X_OC (..., 4, 4) are the contact frames in O, z into the body.  O axes, because C turns where the chart changes.
"""

_Flow = Callable[[float, ChartGeometry, ChartGeometry, Array], Array]


def integrate_motion(
    tip: AbstractSurface,
    body: AbstractSurface,
    start: ContactCoordinates,
    motion: Motion,
    duration: float,
    steps: int,
) -> ContactCoordinates:
    """Return the contact coordinates (steps + 1, ...) at even times while the tip moves as told.

    Classical Runge-Kutta: global error O(h^4), :data:`ORDER`.  Between steps, coordinates that come near the border of
    their chart move to another one, so u, v and psi jump while the contact does not.

    Args:
        tip: surface of F.
        body: surface of O.
        start: contacts (...).
        motion: the relative twist; its component along the normal is left out (the surfaces stay in touch).
        duration: time [s].
        steps: number of steps, at least 1.

    Raises:
        ValueError: the steps are so long that one crosses the border of a chart, or the surfaces touch along a line.
    """
    _require_steps(steps)

    def flow(t: float, on_f: ChartGeometry, on_o: ChartGeometry, y: Array) -> Array:
        frame = on_o.frame
        X_OC = np.zeros((*frame.shape[:-2], 4, 4))
        X_OC[..., :3, :3], X_OC[..., :3, 3], X_OC[..., 3, 3] = frame, on_o.point, 1.0
        V = np.asarray(motion(t, X_OC), dtype=np.float64)
        back = np.swapaxes(frame, -1, -2)
        V_C = np.concatenate([(back @ V[..., :3, None])[..., 0], (back @ V[..., 3:, None])[..., 0]], axis=-1)
        s_f, s_o, psi = solve_rates(on_f, on_o, y[..., 4], V_C)
        return np.concatenate([s_f / on_f.lengths, s_o / on_o.lengths, psi[..., None]], axis=-1)

    at = leave_borders(tip, body, start)
    out, h = [at], duration / steps
    for k in range(steps):
        y = _step(tip, body, flow, k * h, at.as_array(), at.chart_f, at.chart_o, h)
        at = leave_borders(tip, body, ContactCoordinates.from_array(y, at.chart_f, at.chart_o))
        out.append(at)
    return stack_coordinates(out)


def integrate_legs(
    tip: AbstractSurface,
    body: AbstractSurface,
    start: ContactCoordinates,
    heading_O: ArrayLike,
    turns: ArrayLike,
    lengths: ArrayLike,
    steps: int,
) -> tuple[ContactCoordinates, Array]:
    """Roll without sliding or spin along geodesics of the body, one after the other.

    Rolling without spin keeps geodesic curvature: the contact draws a geodesic on the tip, too, and turns by the same angle
    where it turns (on spheres: Theory 2 of the paper).  The heading is transported along: with s_o = (cos a, sin a),
    a' = -T_o s_o, s_f = P s_o, psi' = T_f s_f + T_o s_o per metre.

    Args:
        tip: surface of F.
        body: surface of O.
        start: contacts (...).
        heading_O: directions (..., 3) in O; their tangential parts are the headings before the first turn.
        turns: (L, ...) [rad] to the left, seen from outside the body, before each leg.
        lengths: (L, ...) [m].
        steps: Runge-Kutta steps per leg (:data:`ORDER` 4).

    Returns:
        The coordinates (L * steps + 1, ...), and the lengths rolled (L * steps + 1, ...) [m].

    Raises:
        ValueError: as :func:`integrate_motion`, and for a heading along the normal.
    """
    _require_steps(steps)

    def flow(_: float, on_f: ChartGeometry, on_o: ChartGeometry, y: Array) -> Array:
        P = build_psi_rotation(y[..., 4])[..., :2, :2]
        compute_relative_curvature(on_f, on_o, P)
        s_o = np.stack([np.cos(y[..., 5]), np.sin(y[..., 5])], axis=-1)
        s_f = (P @ s_o[..., None])[..., 0]
        turn_o, turn_f = np.sum(on_o.torsion * s_o, axis=-1), np.sum(on_f.torsion * s_f, axis=-1)
        rest = np.stack([turn_f + turn_o, -turn_o], axis=-1)
        return y[..., 6:] * np.concatenate([s_f / on_f.lengths, s_o / on_o.lengths, rest, 0.0 * rest[..., :1]], axis=-1)

    turns, lengths = (np.broadcast_to(a, (len(a), *start.shape)) for a in (np.asarray(turns), np.asarray(lengths)))
    at = leave_borders(tip, body, start)
    heading = np.broadcast_to(np.asarray(heading_O, dtype=np.float64), (*start.shape, 3))
    out, rolled = [at], [np.zeros(start.shape)]
    for turn, length in zip(turns, lengths, strict=True):
        angle = _measure_heading(body, at, heading) - turn  # left from outside is right from inside
        for k in range(steps):
            y = np.concatenate([at.as_array(), angle[..., None], length[..., None]], axis=-1)
            y = _step(tip, body, flow, k / steps, y, at.chart_f, at.chart_o, 1.0 / steps)
            moved = ContactCoordinates.from_array(y[..., :5], at.chart_f, at.chart_o)
            heading = _point_heading(body, moved, y[..., 5])
            at = leave_borders(tip, body, moved)
            angle = _measure_heading(body, at, heading) if at is not moved else y[..., 5]
            out.append(at)
            rolled.append(rolled[-1] + np.abs(length) / steps)
    return stack_coordinates(out), np.stack(rolled)


def stack_coordinates(parts: Sequence[ContactCoordinates]) -> ContactCoordinates:
    """Return contacts (...) as a stack (K, ...)."""
    return ContactCoordinates.from_array(
        np.stack([p.as_array() for p in parts]),
        np.stack([p.chart_f for p in parts]),
        np.stack([p.chart_o for p in parts]),
    )


def _require_steps(steps: int) -> None:
    if steps < 1:
        raise ValueError(f"{steps} integration steps; one or more are accepted")


def _point_heading(body: AbstractSurface, at: ContactCoordinates, angle: Array) -> Array:
    on_o = body.geometry(at.u_o, at.v_o, at.chart_o)
    return np.cos(angle)[..., None] * on_o.x + np.sin(angle)[..., None] * on_o.y


def _measure_heading(body: AbstractSurface, at: ContactCoordinates, heading_O: Array) -> Array:
    """Return the angles (...) from x_o to y_o of directions (..., 3) in O."""
    on_o = body.geometry(at.u_o, at.v_o, at.chart_o)
    north, east = np.sum(heading_O * on_o.x, axis=-1), np.sum(heading_O * on_o.y, axis=-1)
    if np.any(np.hypot(north, east) <= 1e-9 * np.linalg.norm(heading_O, axis=-1)):
        raise ValueError("the heading is along the normal; a direction with a part along the surface is accepted")
    return np.arctan2(east, north)


def _step(
    tip: AbstractSurface,
    body: AbstractSurface,
    flow: _Flow,
    t: float,
    y: Array,
    chart_f: Charts,
    chart_o: Charts,
    h: float,
) -> Array:
    """Return y (..., 5 or more) after one classical Runge-Kutta step within the present charts."""

    def slope(time: float, state: Array) -> Array:
        at = ContactCoordinates.from_array(state[..., :5], chart_f, chart_o)
        return flow(time, *compute_geometries(tip, body, at), state)

    k_1 = slope(t, y)
    k_2 = slope(t + 0.5 * h, y + 0.5 * h * k_1)
    k_3 = slope(t + 0.5 * h, y + 0.5 * h * k_2)
    k_4 = slope(t + h, y + h * k_3)
    after = y + h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
    for name, surface, u, v, chart in (
        ("tip", tip, after[..., 0], after[..., 1], chart_f),
        ("body", body, after[..., 2], after[..., 3], chart_o),
    ):
        # A step that ends deep in a border's neighbourhood began far from it: it is too long to be accurate.
        if surface.chart_count > 1 and not np.all(surface.margin(u, v, chart) > 0.2):
            raise ValueError(f"one step crosses most of a chart of the {name}; more steps are accepted")
    return after
