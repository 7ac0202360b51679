"""Turn MuJoCo's contacts into what one party does to another, with the share of the cone used and the drift inside it."""

from __future__ import annotations

from dataclasses import fields

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.parties import Indices, Parties
from dexplan.testing.raw_contacts import RawContacts
from dexplan.testing.rows import ContactRows


def as_rows(model: mujoco.MjModel, parties: Parties, raw: RawContacts) -> ContactRows:
    """Turn MuJoCo's contacts, normal from the first geom to the second, into what ``by`` does to ``on``."""
    party = parties.of_geom[raw.geom]
    rank = np.ones(len(parties.names), dtype=int)
    rank[list(parties.tips)] = 0
    if parties.object >= 0:
        rank[parties.object] = 2
    is_second = rank[party[:, 1]] >= rank[party[:, 0]]
    s = np.where(is_second, 1.0, -1.0)
    frame, wrench, dim = raw.frame, raw.wrench, raw.dim
    # n and t2 flip where `on` is the first geom, which keeps the frame right-handed; forces on it are the opposite ones.
    R_WC = np.stack([frame[:, 1], s[:, None] * frame[:, 2], s[:, None] * frame[:, 0]], axis=2)
    force = np.stack([s * wrench[:, 1], wrench[:, 2], wrench[:, 0]], axis=1)
    moment = np.stack([s * wrench[:, 4], wrench[:, 5], wrench[:, 3]], axis=1)
    twist = raw.twist
    velocity = twist[:, :, 3:] + np.cross(twist[:, :, :3], raw.pos[:, None] - raw.center)
    # The first geom against the second where `on` is the second.
    relative = s[:, None] * (velocity[:, 0] - velocity[:, 1])
    turning = s[:, None] * (twist[:, 0, :3] - twist[:, 1, :3])
    slip = np.einsum("nji,nj->ni", R_WC, relative)
    turning = np.einsum("nji,nj->ni", R_WC, turning)
    is_elliptic = model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    # Drift is that of the second geom against the first, like the force; `by` against `on` is the opposite where `on` is second.
    # A contact without damping (solref of a user's own) never comes to rest: it has no drift that could be told, NaN.
    with np.errstate(invalid="ignore", divide="ignore"):
        drift = _compute_elliptic_creep(raw) if is_elliptic else _compute_pyramidal_creep(raw)
    creep = np.stack([-s * drift[:, 0], -drift[:, 1], -drift[:, 2]], axis=1)
    pick = np.arange(len(s)), is_second.astype(int)
    other = np.arange(len(s)), 1 - is_second.astype(int)
    return _make_rows(
        sample=raw.sample,
        on=party[pick],
        by=party[other],
        geom_on=raw.geom[pick],
        geom_by=raw.geom[other],
        dim=dim,
        point_W=raw.pos,
        rotation_W=R_WC,
        force=force,
        moment=moment,
        slip=slip,
        spin=turning[:, 2],
        roll=turning[:, :2],
        friction=raw.friction,
        utilisation=compute_utilisation(wrench, raw.friction, dim, is_elliptic),
        penetration=-raw.dist,
        creep=creep,
        softness=raw.rows_R[:, 0] / raw.damping,
    )


def compute_utilisation(wrench: Array, friction: Array, dim: Indices, is_elliptic: bool) -> Array:
    """Return the shares (N,) of their cones that contacts use, 1 at the border; NaN without normal force or friction.

    ``wrench`` (N, 6) is normal-first.  MuJoCo's elliptic cone is sqrt(sum (f_i / mu_i)^2) <= f_n, its pyramid
    sum |f_i / mu_i| <= f_n, both over the condim - 1 directions that the contact has friction in.
    """
    has = np.arange(1, 6) < dim[:, None]
    part = np.where(has, wrench[:, 1:] / np.where(friction > 0.0, friction, np.inf), 0.0)
    used = np.sqrt((part**2).sum(axis=1)) if is_elliptic else np.abs(part).sum(axis=1)
    counts = (dim > 1) & (wrench[:, 0] > 0.0)
    return np.where(counts, used / np.where(counts, wrench[:, 0], 1.0), np.nan)


def _compute_elliptic_creep(raw: RawContacts) -> Array:
    """Return the steady drift (N, 3) along t1, t2 [m/s] and about n [rad/s] of the second geom against the first.

    Inside an elliptic cone a row of friction obeys a + R f = -B v (its position is zero by definition), so that at rest
    v = -R f / B.
    """
    has = np.arange(1, 4) < raw.dim[:, None]
    drift = -raw.rows_R[:, 1:4] * raw.rows_force[:, 1:4] / raw.damping[:, None]
    return np.where(has, drift, 0.0)


def _compute_pyramidal_creep(raw: RawContacts) -> Array:
    """Return what :func:`_compute_elliptic_creep` does, for pyramids.

    The edges n + mu t and n - mu t obey R p = -B (v_n +- mu v_t) - K I r at rest.  Where both push, their difference gives
    v_t = -R (p+ - p-) / (2 mu B); where one alone does, v_n = 0 gives mu v_t = -(R p + K I r) / B with its sign.
    """
    has = np.arange(1, 4) < raw.dim[:, None]
    mu = np.where(has & (raw.friction[:, :3] > 0), raw.friction[:, :3], np.inf)
    mu[:, 1:] = np.where(has[:, 1:], raw.friction[:, 1:3], np.inf)
    R, damping = raw.rows_R[:, :1], raw.damping[:, None]
    pull = raw.pull[:, None]
    plus, minus = raw.rows_force[:, 0:6:2], raw.rows_force[:, 1:6:2]
    both = -R * (plus - minus) / (2.0 * mu * damping)
    alone = np.maximum(R * np.maximum(plus, minus) + pull, 0.0) / (damping * mu) * -np.sign(plus - minus)
    return np.where(has, np.where((plus > 0.0) & (minus > 0.0), both, alone), 0.0)


def join_rows(parts: list[ContactRows]) -> ContactRows:
    """Return the rows of all chunks as one, locked."""
    if len(parts) == 1:
        return parts[0]
    return _make_rows(
        **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(ContactRows)}
    )


def _make_rows(**columns: NDArray) -> ContactRows:
    """Return rows of arrays that nobody else holds: they are locked as they are, for a copy of each would cost as much as
    reading them did.
    """
    for values in columns.values():
        values.setflags(write=False)
    return ContactRows(**columns)
