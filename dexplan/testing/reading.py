"""Read the contacts of recorded states, in one pass: state, ``mj_forward``, copy; arithmetic once for all samples.

A recorded state is put into a second MjData and ``mj_forward`` is called: that is the first half of the step that was
taken from there (warm start included), so contacts and forces belong to the state, and no reading disturbs anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.measurement import ContactRows
from dexplan.testing.parties import Indices, Parties, list_descendants

INTEGRATION = int(mujoco.mjtState.mjSTATE_INTEGRATION)
MOST_ROWS = 10
"""Constraint rows of one contact at most: a pyramid of condim 6 has two edges for each of its five directions."""
EACH_ROW = np.arange(MOST_ROWS)
AT_LIMIT = 1e-9
"""Share of its range within which a clamped number is at the end of it; clamping copies the bound."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What one pass over T states gave: contacts, and per sample what judging them needs (see ``Measurement``)."""

    time: Array
    contacts: ContactRows
    newton_residual: Array
    saturated: NDArray[np.bool_]
    solver_iterations: Indices


COLUMNS: Mapping[str, tuple[tuple[int, ...], type]] = MappingProxyType(
    {
        "sample": ((), np.intp),
        "geom": ((2,), np.intp),
        "dim": ((), np.intp),
        "frame": ((9,), np.float64),
        "pos": ((3,), np.float64),
        "dist": ((), np.float64),
        "friction": ((5,), np.float64),
        "wrench": ((6,), np.float64),
        "twist": ((2, 6), np.float64),
        "center": ((2, 3), np.float64),
        "rows_R": ((MOST_ROWS,), np.float64),
        "rows_force": ((MOST_ROWS,), np.float64),
        "KBIP": ((4,), np.float64),
        "position": ((), np.float64),
    }
)
"""What is copied of each contact, as MuJoCo has it, with its shape; it is turned and named afterwards.

``wrench`` is normal-first and acts on the second geom; ``twist`` are ``cvel`` (angular, linear) of both bodies about the
centres of mass ``center`` of their trees; ``rows_R``, ``rows_force`` the constraint rows; ``KBIP`` and ``position`` (distance
less margin) of the first row say what reference acceleration MuJoCo asks for.
"""
FIRST_CONTACTS = 4096
"""Contacts that the first buffers hold; they are doubled when they are full."""


def read_states(model: mujoco.MjModel, parties: Parties, states: Array) -> Readings:
    """Return the readings of ``states`` (T, n), each a ``mjSTATE_INTEGRATION`` whose control is that of the step from there."""
    data = mujoco.MjData(model)
    T = len(states)
    reader = _Reader(model, parties)
    time, iterations = np.zeros(T), np.zeros(T, dtype=np.intp)
    saturated = np.zeros((T, model.nu), dtype=bool)
    needed = np.full((T, 3), np.nan)
    for t in range(T):
        mujoco.mj_setState(model, data, states[t], INTEGRATION)
        mujoco.mj_forward(model, data)
        time[t], iterations[t] = data.time, data.solver_niter.max()
        if data.ncon:
            reader.read(t, data)
        if reader.free_dof >= 0:
            needed[t] = reader.read_needed_force(data)
        if model.nu:
            saturated[t] = find_saturated(model, data)
    raw = reader.as_columns()
    rows = _as_rows(model, parties, raw)
    residual = np.linalg.norm(needed - _sum_on_bodies(model, raw, reader.object_bodies, T), axis=1)
    return Readings(time, rows, residual, saturated, iterations)


class _Reader:
    """Copies what is needed of each sample's contacts."""

    def __init__(self, model: mujoco.MjModel, parties: Parties) -> None:
        self.model = model
        self.object_bodies = list_descendants(model, parties.object_body) if parties.object_body > 0 else []
        self.is_kept = parties.is_watched[parties.of_geom] | np.isin(model.geom_bodyid, self.object_bodies)
        self.body_of_geom = model.geom_bodyid.copy()
        self.root_of_body = model.body_rootid.copy()
        self.free_dof = _find_free_dof(model, parties.object_body, self.object_bodies)
        self._force = np.zeros(model.nv)
        self._count = 0
        self._buffers = {k: np.empty((FIRST_CONTACTS, *s), dtype=t) for k, (s, t) in COLUMNS.items()}

    def as_columns(self) -> dict[str, NDArray]:
        """Return each of :data:`COLUMNS` over all contacts read."""
        return {name: buffer[: self._count] for name, buffer in self._buffers.items()}

    def read(self, t: int, data: mujoco.MjData) -> None:
        """Copy the contacts of sample ``t`` that take part in the dynamics and are watched."""
        contact = data.contact
        geoms, addresses = contact.geom, contact.efc_address
        # A contact with a flex has no geom there.
        is_kept = (addresses >= 0) & (geoms.min(axis=1) >= 0) & self.is_kept[geoms].any(axis=1)
        count = int(np.count_nonzero(is_kept))
        if not count:
            return
        kept = slice(None) if count == len(is_kept) else is_kept
        start, stop = self._count, self._count + count
        out = self._buffers
        while stop > len(out["sample"]):
            for name, buffer in out.items():
                out[name] = np.concatenate([buffer, np.empty_like(buffer)])
        self._count = stop
        geom, first = geoms[kept], addresses[kept]
        body = self.body_of_geom[geom]
        rows = np.minimum(first[:, None] + EACH_ROW, data.nefc - 1)
        out["sample"][start:stop] = t
        out["geom"][start:stop] = geom
        out["dim"][start:stop] = contact.dim[kept]
        out["frame"][start:stop] = contact.frame[kept]
        out["pos"][start:stop] = contact.pos[kept]
        out["dist"][start:stop] = contact.dist[kept]
        out["friction"][start:stop] = contact.friction[kept]
        out["twist"][start:stop] = data.cvel[body]
        out["center"][start:stop] = data.subtree_com[self.root_of_body[body]]
        out["rows_R"][start:stop] = data.efc_R[rows]
        out["rows_force"][start:stop] = data.efc_force[rows]
        out["KBIP"][start:stop] = data.efc_KBIP[first]
        out["position"][start:stop] = data.efc_pos[first] - data.efc_margin[first]
        wrench = out["wrench"]
        for k, c in enumerate(range(count) if count == len(is_kept) else np.flatnonzero(is_kept).tolist(), start):
            mujoco.mj_contactForce(self.model, data, c, wrench[k])

    def read_needed_force(self, data: mujoco.MjData) -> Array:
        """Return the force (3,) [N] in the world that contacts must give the object for the acceleration it has.

        The three translations of a free joint are the momentum of everything on it, gravity and all other applied forces
        are in ``qfrc_smooth``; what is left is what contacts have to do.
        """
        mujoco.mj_mulM(self.model, data, self._force, data.qacc)
        dofs = slice(self.free_dof, self.free_dof + 3)
        return self._force[dofs] - data.qfrc_smooth[dofs]


def find_saturated(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.bool_]:
    """Return which actuators (nu,) give all they can: force or joint torque at the end of its range, or control clipped."""
    force = data.actuator_force
    low, high = model.actuator_forcerange.T
    reach = AT_LIMIT * np.maximum(high - low, 1.0)
    out = (model.actuator_forcelimited > 0) & ((force <= low + reach) | (force >= high - reach))
    low, high = model.actuator_ctrlrange.T
    out |= (model.actuator_ctrllimited > 0) & ((data.ctrl < low) | (data.ctrl > high))
    on_joint = np.isin(
        model.actuator_trntype, (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    )
    joint = np.where(on_joint, model.actuator_trnid[:, 0], 0)
    if model.njnt and on_joint.any():
        low, high = model.jnt_actfrcrange[joint].T
        torque = data.qfrc_actuator[model.jnt_dofadr[joint]]
        reach = AT_LIMIT * np.maximum(high - low, 1.0)
        limited = on_joint & (model.jnt_actfrclimited[joint] > 0)
        out |= limited & ((torque <= low + reach) | (torque >= high - reach))
    return out.astype(bool)


def _find_free_dof(model: mujoco.MjModel, body: int, bodies: list[int]) -> int:
    """Return the address of the object's free joint in ``qvel``; -1 where it has none, or where an equality or friction in
    its joint gives it forces that are no contacts.
    """
    if body <= 0 or model.body_jntnum[body] != 1:
        return -1
    joint = int(model.body_jntadr[body])
    if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
        return -1
    dof = int(model.jnt_dofadr[joint])
    if model.dof_frictionloss[dof : dof + 6].any():
        return -1
    for e in range(model.neq):
        if model.eq_type[e] not in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            continue
        ends = np.array([model.eq_obj1id[e], model.eq_obj2id[e]])
        if model.eq_objtype[e] == mujoco.mjtObj.mjOBJ_SITE:
            ends = model.site_bodyid[ends]
        if np.isin(ends, bodies).any():
            return -1
    return dof


def _sum_on_bodies(model: mujoco.MjModel, raw: dict[str, NDArray], bodies: list[int], samples: int) -> Array:
    """Return the sums (T, 3) [N, W] of the contact forces on ``bodies`` from outside of them."""
    is_inside = np.isin(model.geom_bodyid[raw["geom"]], bodies)
    force_W = np.einsum("nji,nj->ni", raw["frame"].reshape(-1, 3, 3), raw["wrench"][:, :3])
    sign = is_inside[:, 1].astype(float) - is_inside[:, 0].astype(float)
    out = np.zeros((samples, 3))
    np.add.at(out, raw["sample"], sign[:, None] * force_W)
    return out


def _as_rows(model: mujoco.MjModel, parties: Parties, raw: dict[str, NDArray]) -> ContactRows:
    """Turn MuJoCo's contacts, normal from the first geom to the second, into what ``by`` does to ``on``."""
    party = parties.of_geom[raw["geom"]]
    rank = np.ones(len(parties.names), dtype=int)
    rank[list(parties.tips)] = 0
    if parties.object >= 0:
        rank[parties.object] = 2
    is_second = rank[party[:, 1]] >= rank[party[:, 0]]
    s = np.where(is_second, 1.0, -1.0)
    frame, wrench, dim = raw["frame"].reshape(-1, 3, 3), raw["wrench"], raw["dim"]
    # n and t2 flip where `on` is the first geom, which keeps the frame right-handed; forces on it are the opposite ones.
    R_WC = np.stack([frame[:, 1], s[:, None] * frame[:, 2], s[:, None] * frame[:, 0]], axis=2)
    force = np.stack([s * wrench[:, 1], wrench[:, 2], wrench[:, 0]], axis=1)
    moment = np.stack([s * wrench[:, 4], wrench[:, 5], wrench[:, 3]], axis=1)
    twist = raw["twist"]
    velocity = twist[:, :, 3:] + np.cross(twist[:, :, :3], raw["pos"][:, None] - raw["center"])
    # The first geom against the second where `on` is the second.
    relative = s[:, None] * (velocity[:, 0] - velocity[:, 1])
    turning = s[:, None] * (twist[:, 0, :3] - twist[:, 1, :3])
    slip = np.einsum("nji,nj->ni", R_WC, relative)
    turning = np.einsum("nji,nj->ni", R_WC, turning)
    is_elliptic = model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    # Drift is that of the second geom against the first, like the force; `by` against `on` is the opposite where `on` is second.
    drift = _compute_elliptic_creep(raw) if is_elliptic else _compute_pyramidal_creep(raw)
    creep = np.stack([-s * drift[:, 0], -drift[:, 1], -drift[:, 2]], axis=1)
    pick = np.arange(len(s)), is_second.astype(int)
    other = np.arange(len(s)), 1 - is_second.astype(int)
    return ContactRows(
        sample=raw["sample"],
        on=party[pick],
        by=party[other],
        geom_on=raw["geom"][pick],
        geom_by=raw["geom"][other],
        dim=dim,
        point_W=raw["pos"],
        rotation_W=R_WC,
        force=force,
        moment=moment,
        slip=slip,
        spin=turning[:, 2],
        roll=turning[:, :2],
        friction=raw["friction"],
        utilisation=compute_utilisation(wrench, raw["friction"], dim, is_elliptic),
        penetration=-raw["dist"],
        creep=creep,
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


def _compute_elliptic_creep(raw: dict[str, NDArray]) -> Array:
    """Return the steady drift (N, 3) along t1, t2 [m/s] and about n [rad/s] of the second geom against the first.

    Inside an elliptic cone a row of friction obeys a + R f = -B v (its position is zero by definition), so that at rest
    v = -R f / B.
    """
    has = np.arange(1, 4) < raw["dim"][:, None]
    drift = -raw["rows_R"][:, 1:4] * raw["rows_force"][:, 1:4] / raw["KBIP"][:, 1:2]
    return np.where(has, drift, 0.0)


def _compute_pyramidal_creep(raw: dict[str, NDArray]) -> Array:
    """Return what :func:`_compute_elliptic_creep` does, for pyramids.

    The edges n + mu t and n - mu t obey R p = -B (v_n +- mu v_t) - K I r at rest.  Where both push, their difference gives
    v_t = -R (p+ - p-) / (2 mu B); where one alone does, v_n = 0 gives mu v_t = -(R p + K I r) / B with its sign.
    """
    has = np.arange(1, 4) < raw["dim"][:, None]
    mu = np.where(has & (raw["friction"][:, :3] > 0), raw["friction"][:, :3], np.inf)
    mu[:, 1:] = np.where(has[:, 1:], raw["friction"][:, 1:3], np.inf)
    R, damping = raw["rows_R"][:, :1], raw["KBIP"][:, 1:2]
    pull = (raw["KBIP"][:, 0] * raw["KBIP"][:, 2] * raw["position"])[:, None]
    plus, minus = raw["rows_force"][:, 0:6:2], raw["rows_force"][:, 1:6:2]
    both = -R * (plus - minus) / (2.0 * mu * damping)
    alone = np.maximum(R * np.maximum(plus, minus) + pull, 0.0) / (damping * mu) * -np.sign(plus - minus)
    return np.where(has, np.where((plus > 0.0) & (minus > 0.0), both, alone), 0.0)
