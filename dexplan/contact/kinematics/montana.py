"""The contact equations: how the place of contact moves when two bodies roll, slide and pivot on each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.kinematics.coordinates import ContactCoordinates, build_psi_rotation
from dexplan.contact.surfaces.surface import AbstractSurface, ChartGeometry
from dexplan.spatial import Array

_FLATTEST = 1e-9  # of the larger relative curvature: a smaller one means contact along a line


def build_rolling_twist(w_x: ArrayLike, w_y: ArrayLike, spin: ArrayLike = 0.0) -> Array:
    """Return twists (..., 6) at the contact, axes C, that roll about x and y [rad/s] and spin about z (into the body)."""
    w = np.broadcast_arrays(np.asarray(w_x, dtype=np.float64), w_y, spin)
    zero = np.zeros_like(w[0])
    return np.stack([zero, zero, zero, *w], axis=-1)


def build_sliding_twist(v_x: ArrayLike, v_y: ArrayLike) -> Array:
    """Return twists (..., 6) at the contact, axes C, that slide along x and y [m/s] without turning."""
    v = np.broadcast_arrays(np.asarray(v_x, dtype=np.float64), v_y)
    zero = np.zeros_like(v[0])
    return np.stack([*v, zero, zero, zero, zero], axis=-1)


def build_pivoting_twist(spin: ArrayLike) -> Array:
    """Return twists (..., 6) at the contact, axes C, that only turn about the normal z (into the body) [rad/s]."""
    return build_rolling_twist(np.zeros_like(np.asarray(spin, dtype=np.float64)), 0.0, spin)


def compute_rates(
    tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates, V_C: ArrayLike
) -> Array:
    """Return the rates (..., 5) of (u_f, v_f, u_o, v_o, psi) under a relative twist.  Montana's equations.

    With s_f = M_f (u_f, v_f)', s_o = M_o (u_o, v_o)', P the upper left of R_CoCf and w = (-w_y, w_x):

        s_o = v + P s_f                          (the point moves with the tip, and along it)
        K_o s_o + P K_f s_f = w                  (the normals stay opposite)
        =>  s_f = (K_f + P K_o P)^-1 P (w - K_o v),   psi' = T_f s_f + T_o s_o - w_z

    [Montana 1988; MLS 1994, eq. 5.28, there in the tip's frame and with outward normals].

    Args:
        tip: surface of F.
        body: surface of O.
        at: contacts (...).
        V_C: twists (..., 6) = (v, w) of the tip relative to the body **at the contact point**, in the axes of the body's
            Gauss frame C (z into the body).  v_z must vanish: the surfaces stay in touch.

    Raises:
        ValueError: v_z is not zero, coordinates lie on a border of their chart, or the relative curvature K_f + P K_o P is
            not positive definite, so that the surfaces do not touch in a single point.
    """
    V = np.asarray(V_C, dtype=np.float64)
    on_f, on_o = compute_geometries(tip, body, at)
    if np.any(np.abs(V[..., 2]) > 1e-9 * (1e-3 + np.linalg.norm(V[..., :3], axis=-1))):
        raise ValueError(
            "v_z is not zero, so the contact breaks or digs in; twists with v_z = 0 are accepted"
        )
    s_f, s_o, psi = solve_rates(on_f, on_o, at.psi, V)
    return np.concatenate([s_f / on_f.lengths, s_o / on_o.lengths, psi[..., None]], axis=-1)


def compute_twist(
    tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates, rates: ArrayLike
) -> Array:
    """Return the relative twist (..., 6) in C that gives these rates (..., 5): :func:`compute_rates` backwards.

    v = s_o - P s_f, (-w_y, w_x) = K_o s_o + P K_f s_f, w_z = T_f s_f + T_o s_o - psi'.
    """
    rates = np.asarray(rates, dtype=np.float64)
    on_f, on_o = compute_geometries(tip, body, at)
    s_f, s_o = rates[..., 0:2] * on_f.lengths, rates[..., 2:4] * on_o.lengths
    P = build_psi_rotation(at.psi)[..., :2, :2]
    v = s_o - _apply(P, s_f)
    w = _apply(on_o.curvature, s_o) + _apply(P @ on_f.curvature, s_f)
    w_z = np.sum(on_f.torsion * s_f, axis=-1) + np.sum(on_o.torsion * s_o, axis=-1) - rates[..., 4]
    return np.stack([v[..., 0], v[..., 1], np.zeros_like(w_z), w[..., 1], -w[..., 0], w_z], axis=-1)


def compute_contact_twist(
    tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates, V_OF_F: ArrayLike
) -> Array:
    """Return, at the contact and in C, the relative twist (..., 6) given for the tip's own frame.

    Args:
        tip: surface of F.
        body: surface of O.
        at: contacts (...).
        V_OF_F: (..., 6) = velocity of F's origin and angular velocity of F, relative to O, in axes F.
    """
    V = np.asarray(V_OF_F, dtype=np.float64)
    on_f, _ = compute_geometries(tip, body, at)
    R_CF = build_psi_rotation(at.psi) @ np.swapaxes(on_f.frame, -1, -2)
    v = V[..., :3] + np.cross(V[..., 3:], on_f.point)
    return np.concatenate([_apply(R_CF, v), _apply(R_CF, V[..., 3:])], axis=-1)


def compute_tip_twist(
    tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates, V_C: ArrayLike
) -> Array:
    """Return V_OF_F (..., 6), the tip's twist in its own frame, from that at the contact: :func:`compute_contact_twist` back."""
    V = np.asarray(V_C, dtype=np.float64)
    on_f, _ = compute_geometries(tip, body, at)
    R_FC = on_f.frame @ np.swapaxes(build_psi_rotation(at.psi), -1, -2)
    w = _apply(R_FC, V[..., 3:])
    return np.concatenate([_apply(R_FC, V[..., :3]) - np.cross(w, on_f.point), w], axis=-1)


def compute_geometries(
    tip: AbstractSurface, body: AbstractSurface, at: ContactCoordinates
) -> tuple[ChartGeometry, ChartGeometry]:
    """Return the geometry of tip and body at the contacts; raises ValueError on the border of a chart."""
    on_f, on_o = tip.geometry(at.u_f, at.v_f, at.chart_f), body.geometry(at.u_o, at.v_o, at.chart_o)
    for name, on in (("tip", on_f), ("body", on_o)):
        shortest, longest = on.lengths.min(axis=-1), on.lengths.max(axis=-1)
        if not np.all(shortest > 1e-9 * longest):
            raise ValueError(
                f"the contact lies on a border of its chart of the {name}, where rates are unbounded; "
                "leave_borders(tip, body, at) is accepted"
            )
    return on_f, on_o


class ContactRates(NamedTuple):
    """How a contact moves: s_f, s_o (..., 2) [m/s] over tip and body, in each surface's Gauss axes, and psi' (...) [rad/s]."""

    s_f: Array
    s_o: Array
    psi: Array


def solve_rates(on_f: ChartGeometry, on_o: ChartGeometry, psi: Array, V_C: Array) -> ContactRates:
    """Return the rates of contacts that move with the twist ``V_C`` (..., 6); see :func:`compute_rates`."""
    P = build_psi_rotation(psi)[..., :2, :2]
    v, w = V_C[..., :2], np.stack([-V_C[..., 4], V_C[..., 3]], axis=-1)
    relative = compute_relative_curvature(on_f, on_o, P)
    right = _apply(P, w - _apply(on_o.curvature, v))
    s_f = np.asarray(np.linalg.solve(relative, right[..., None])[..., 0], dtype=np.float64)
    s_o = v + _apply(P, s_f)
    rate = np.sum(on_f.torsion * s_f, axis=-1) + np.sum(on_o.torsion * s_o, axis=-1) - V_C[..., 5]
    return ContactRates(s_f, s_o, rate)


def compute_relative_curvature(on_f: ChartGeometry, on_o: ChartGeometry, P: Array) -> Array:
    """Return K_f + P K_o P (..., 2, 2) [1/m]; raises ValueError where it is not positive definite."""
    relative = on_f.curvature + P @ on_o.curvature @ P
    trace = relative[..., 0, 0] + relative[..., 1, 1]
    det = relative[..., 0, 0] * relative[..., 1, 1] - relative[..., 0, 1] * relative[..., 1, 0]
    if not np.all((trace > 0.0) & (det > _FLATTEST * trace**2)):
        raise ValueError(
            "the surfaces touch along a line or a patch, so the contact has no rate; relative curvature that is "
            "positive in every direction is accepted"
        )
    return relative


def _apply(A: Array, x: Array) -> Array:
    return (A @ x[..., None])[..., 0]
