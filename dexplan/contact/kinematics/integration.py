"""Integration of the contact equations for any two surfaces: sixth order, switching charts on the way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.kinematics.coordinates import (
    SWITCH_BELOW,
    ContactCoordinates,
    build_psi_rotation,
    leave_borders,
)
from dexplan.contact.kinematics.montana import compute_relative_curvature, solve_rates
from dexplan.contact.surfaces.surface import AbstractSurface, ChartGeometry
from dexplan.spatial import Array

ORDER = 6
"""Halving the step divides the error by 2^ORDER."""

# Runge-Kutta method of order 6 in seven stages [Butcher 1964]: stage i starts from y + h sum_j A_ij k_j at time t + h c_i.
_A = (
    (),
    (1 / 3,),
    (0.0, 2 / 3),
    (1 / 12, 1 / 3, -1 / 12),
    (-1 / 16, 9 / 8, -3 / 16, -3 / 8),
    (0.0, 9 / 8, -3 / 8, -3 / 4, 1 / 2),
    (9 / 44, -9 / 11, 63 / 44, 18 / 11, 0.0, -16 / 11),
)
_B = (11 / 120, 0.0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120)
_C = (0.0, 1 / 3, 2 / 3, 1 / 3, 1 / 2, 1 / 2, 1.0)

_TOO_NEAR = 0.2  # a step that begins away from a border (SWITCH_BELOW) and ends this near it is too long to be accurate
_TOO_FAR = 0.5  # so is one that turns a normal by so much [rad]: it could leap over a border unseen

Motion = Callable[[float, Array, Array], Array]
"""``motion(t, X_OC, X_OF)`` -> twists (..., 6) of the tip relative to the body at the contact point, in **O axes**.

X_OC (..., 4, 4) are the contact frames in O, z into the body, X_OF (..., 4, 4) the tip's poses.  O axes, because C turns where
the chart changes.
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

    Butcher's Runge-Kutta method: global error O(h^6), :data:`ORDER`.  Between steps, coordinates that come near the border of
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
        R_OF = frame @ build_psi_rotation(y[..., 4]) @ np.swapaxes(on_f.frame, -1, -2)
        X_OC, X_OF = (np.zeros((*frame.shape[:-2], 4, 4)) for _ in range(2))
        X_OC[..., :3, :3], X_OC[..., :3, 3], X_OC[..., 3, 3] = frame, on_o.point, 1.0
        X_OF[..., :3, :3], X_OF[..., 3, 3] = R_OF, 1.0
        X_OF[..., :3, 3] = on_o.point - (R_OF @ on_f.point[..., None])[..., 0]
        V = np.asarray(motion(t, X_OC, X_OF), dtype=np.float64)
        back = np.swapaxes(frame, -1, -2)
        V_C = np.concatenate([(back @ V[..., :3, None])[..., 0], (back @ V[..., 3:, None])[..., 0]], axis=-1)
        s_f, s_o, psi = solve_rates(on_f, on_o, y[..., 4], V_C)
        return np.concatenate([s_f / on_f.lengths, s_o / on_o.lengths, psi[..., None]], axis=-1)

    at = leave_borders(tip, body, start)
    out, h = [at], duration / steps
    for k in range(steps):
        y = _step(tip, body, flow, at, k * h, at.as_array(), h)
        at = _settle(tip, body, ContactCoordinates.from_array(y, at.chart_f, at.chart_o))
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
        turns: (L,) or (L, ...) [rad] to the left, seen from outside the body, before each leg.
        lengths: (L,) or (L, ...) [m].
        steps: Runge-Kutta steps per leg; global error O(steps^-6), :data:`ORDER`.

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
        rates: Array = y[..., 6:] * np.concatenate(
            [s_f / on_f.lengths, s_o / on_o.lengths, rest, 0.0 * rest[..., :1]], axis=-1
        )
        return rates

    turns, lengths = _spread(turns, start.shape), _spread(lengths, start.shape)
    at = leave_borders(tip, body, start)
    heading = np.broadcast_to(np.asarray(heading_O, dtype=np.float64), (*start.shape, 3))
    out, rolled = [at], [np.zeros(start.shape)]
    for turn, length in zip(turns, lengths, strict=True):
        angle = _measure_heading(body, at, heading) - turn  # left from outside is right from inside
        for k in range(steps):
            y = np.concatenate([at.as_array(), angle[..., None], length[..., None]], axis=-1)
            y = _step(tip, body, flow, at, k / steps, y, 1.0 / steps)
            moved, angle = ContactCoordinates.from_array(y[..., :5], at.chart_f, at.chart_o), y[..., 5]
            at = _settle(tip, body, moved)
            if at is not moved or k == steps - 1:
                heading = _point_heading(body, moved, angle)
                angle = _measure_heading(body, at, heading)
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


def _spread(values: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return one value per leg (L, ...), given for each contact or once for all."""
    a = np.asarray(values, dtype=np.float64)
    a = a.reshape(a.shape + (1,) * (1 + len(shape) - a.ndim))
    return np.broadcast_to(a, (len(a), *shape))


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
        raise ValueError(
            "the heading is along the normal; a direction with a part along the surface is accepted"
        )
    angle: Array = np.arctan2(east, north)
    return angle


def _step(
    tip: AbstractSurface,
    body: AbstractSurface,
    flow: _Flow,
    at: ContactCoordinates,
    t: float,
    y: Array,
    h: float,
) -> Array:
    """Return y (..., 5 or more) after one Runge-Kutta step within the charts that ``at`` uses."""
    stages: list[Array] = []
    for row, c in zip(_A, _C, strict=True):
        state = y + h * sum((a * k for a, k in zip(row, stages, strict=True) if a), np.zeros(()))
        on_f = tip.geometry(state[..., 0], state[..., 1], at.chart_f)
        on_o = body.geometry(state[..., 2], state[..., 3], at.chart_o)
        stages.append(flow(t + c * h, on_f, on_o, state))
        if len(stages) == 1:
            _require_short(tip, on_f, h * stages[0][..., 0:2])
            _require_short(body, on_o, h * stages[0][..., 2:4])
    return y + h * sum((b * k for b, k in zip(_B, stages, strict=True) if b), np.zeros(()))


def _require_short(surface: AbstractSurface, on: ChartGeometry, step: Array) -> None:
    turn = np.linalg.norm((on.curvature @ (on.lengths * step)[..., None])[..., 0], axis=-1)
    if surface.chart_count > 1 and not np.all(turn < _TOO_FAR):
        raise ValueError(f"one step turns a normal by {turn.max():.3g} rad; more steps are accepted")


def _settle(tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates) -> ContactCoordinates:
    """Return the contacts away from the borders of their charts: the very same value where they are."""
    for name, surface, u, v, chart in (
        ("tip", tip, at.u_f, at.v_f, at.chart_f),
        ("body", body, at.u_o, at.v_o, at.chart_o),
    ):
        if surface.chart_count == 1:
            continue
        margin = surface.margin(u, v, chart).min()
        if not margin > _TOO_NEAR:
            raise ValueError(f"one step crosses most of a chart of the {name}; more steps are accepted")
        if margin < SWITCH_BELOW:
            return leave_borders(tip, body, at)
    return at
