"""From a relative pose to contact coordinates: the closest points of two surfaces."""

from __future__ import annotations

import numpy as np

from dexplan.contact.kinematics.coordinates import ContactCoordinates, build_coordinates, leave_borders
from dexplan.contact.surfaces.surface import AbstractSurface
from dexplan.spatial import Array

_PROJECTIONS = 12
_NEWTON_STEPS = 60
_LONGEST_TURN = 0.3  # of a normal in one Newton step [rad]


def find_closest_points(
    tip: AbstractSurface, body: AbstractSurface, X_OF: Array, near: ContactCoordinates | None = None
) -> tuple[ContactCoordinates, Array]:
    """Return where the surfaces are closest, and the gap (...) [m] there (0 touching, negative penetrating).

    At the closest points the normals are opposite and the line between the points is along them; Newton's method on

        E_o^T (p_f - p_o) = 0,   E_o^T n_f = 0        (E_o = [x_o, y_o])

    whose Jacobian, with steps s in metres on each surface, is [[P, -(I + gap K_o)], [P K_f, K_o]]: the same curvatures as in
    the contact equations.

    Args:
        tip: surface of F.
        body: surface of O.
        X_OF: tip poses (..., 4, 4).
        near: where to start; by default from points found by projecting to and fro between the surfaces.

    Raises:
        ValueError: the search does not settle, as where surfaces touch along a line.
    """
    X = np.asarray(X_OF, dtype=np.float64)
    R, p = X[..., :3, :3], X[..., :3, 3]
    p_F, p_O = _project_to_and_fro(tip, body, R, p) if near is None else (
        tip.point(near.u_f, near.v_f, near.chart_f),
        body.point(near.u_o, near.v_o, near.chart_o),
    )  # fmt: skip
    charts = None if near is None else (near.chart_f, near.chart_o)
    at = build_coordinates(tip, body, R, p_F, p_O, charts)
    for _ in range(_NEWTON_STEPS):
        on_f, on_o = tip.geometry(at.u_f, at.v_f, at.chart_f), body.geometry(at.u_o, at.v_o, at.chart_o)
        apart = p + _turn(R, on_f.point) - on_o.point
        E = np.stack([on_o.x, on_o.y], axis=-2)
        E_f = R @ np.stack([on_f.x, on_f.y], axis=-1)
        gap = np.sum(apart * on_o.normal, axis=-1)
        residual = np.concatenate([_turn(E, apart), _turn(E, _turn(R, on_f.normal))], axis=-1)
        P = E @ E_f
        J = np.zeros((*gap.shape, 4, 4))
        J[..., :2, :2], J[..., 2:, :2] = P, P @ on_f.curvature
        J[..., :2, 2:] = -(np.eye(2) + gap[..., None, None] * on_o.curvature)
        J[..., 2:, 2:] = on_o.curvature
        try:
            step = -np.linalg.solve(J, residual[..., None])[..., 0]
        except np.linalg.LinAlgError:
            break
        # Far from the solution a full step may fly off: no normal turns by more than a third of a radian.
        turn = np.linalg.norm(
            np.concatenate(
                [_turn(on_f.curvature, step[..., :2]), _turn(on_o.curvature, step[..., 2:])], axis=-1
            ),
            axis=-1,
        )
        step = step * np.minimum(1.0, _LONGEST_TURN / np.maximum(turn, _LONGEST_TURN))[..., None]
        values = at.as_array()
        values[..., 0:2] += step[..., :2] / on_f.lengths
        values[..., 2:4] += step[..., 2:] / on_o.lengths
        at = ContactCoordinates.from_array(values, at.chart_f, at.chart_o)
        if near is None:
            at = leave_borders(tip, body, at)
        if np.all(np.linalg.norm(step, axis=-1) <= 1e-15 + 4e-16 * np.linalg.norm(p, axis=-1)) or (
            np.all(np.linalg.norm(residual, axis=-1) < 1e-12) and np.all(turn < 1e-15)
        ):
            break
    facing = np.sum(_turn(R, on_f.normal) * on_o.normal, axis=-1)
    if not (np.all(np.linalg.norm(residual, axis=-1) < 1e-9) and np.all(facing < 0.0)):
        raise ValueError(
            "no single pair of closest points found; surfaces that touch in a point are accepted, or a start `near` it"
        )
    final = build_coordinates(
        tip,
        body,
        R,
        tip.point(at.u_f, at.v_f, at.chart_f),
        body.point(at.u_o, at.v_o, at.chart_o),
        (at.chart_f, at.chart_o),
    )
    return final, gap


def _project_to_and_fro(
    tip: AbstractSurface, body: AbstractSurface, R: Array, p: Array
) -> tuple[Array, Array]:
    """Return points (..., 3) on tip (in F) and body (in O) that approach each other."""
    back = np.swapaxes(R, -1, -2)
    p_O = body.project(p)
    for _ in range(_PROJECTIONS):
        p_F = tip.project(_turn(back, p_O - p))
        p_O = body.project(p + _turn(R, p_F))
    return p_F, p_O


def _turn(R: Array, p: Array) -> Array:
    return (R @ p[..., None])[..., 0]
