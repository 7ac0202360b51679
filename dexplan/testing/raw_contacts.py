"""Copy contacts out of MuJoCo's data, as MuJoCo has them, many samples at a time."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.parties import Indices, Parties, list_descendants

MOST_ROWS = 10
"""Constraint rows of one contact at most: a pyramid of condim 6 has two edges for each of its five directions."""
MOST_ROWS_ELLIPTIC = 6
"""Those of an elliptic contact: its normal and five directions of friction."""
FREE = int(mujoco.mjtJoint.mjJNT_FREE)
TIES = int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)
"""Equalities between bodies; those of joints and tendons give a free joint no force."""
CHUNK = 500
"""Samples that are copied before they are turned into rows: whole arrays are copied, since that takes one call each, and
turning them takes as long for a thousand samples as for one.  More needs memory, fewer need time.
"""


@dataclass(frozen=True, eq=False)
class RawContacts:
    """N contacts as MuJoCo has them: normal from the first geom to the second, forces on the second.

    ``sample`` (N,), ``geom`` (N, 2), ``dim`` (N,), ``frame`` (N, 3, 3) with rows n, t1, t2, ``pos`` (N, 3), ``dist`` (N,),
    ``friction`` (N, 5); ``wrench`` (N, 6), normal-first.  ``twist`` (N, 2, 6) are ``cvel`` (angular, linear) of both bodies
    about the centres of mass ``center`` (N, 2, 3) of their trees.  ``rows_R``, ``rows_force`` (N, 6 or 10) are the
    contact's constraint rows.  The reference acceleration that MuJoCo asks of its first row is -``damping`` (N,) times its
    velocity, less ``pull`` (N,), told for pyramids alone.
    """

    sample: Indices
    geom: Indices
    dim: Indices
    frame: Array
    pos: Array
    dist: Array
    friction: Array
    wrench: Array
    twist: Array
    center: Array
    rows_R: Array
    rows_force: Array
    damping: Array
    pull: Array


class _Buffer:
    """Arrays of many samples, to be joined: an append costs one copy."""

    def __init__(self, shape: tuple[int, ...] = (), dtype: type = np.float64) -> None:
        self._empty: NDArray = np.empty((0, *shape), dtype=dtype)
        self._parts: list[NDArray] = [self._empty]
        self.append = self._parts.append

    def take(self) -> NDArray:
        """Return all rows as one array, and forget them."""
        rows = np.concatenate(self._parts)
        self._parts[:] = [self._empty]
        return rows


class RawReader:
    """Copies each sample's contacts and constraint rows whole, and picks what is watched when all are there."""

    def __init__(self, model: mujoco.MjModel, parties: Parties) -> None:
        self.model = model
        self.object_bodies = list_descendants(model, parties.object_body) if parties.object_body > 0 else []
        self.is_kept = parties.is_watched[parties.of_geom] | np.isin(model.geom_bodyid, self.object_bodies)
        self.free_dof = find_free_dof(model, parties.object_body, self.object_bodies)
        self._force = np.zeros(model.nv)
        whole = np.intp
        self._counts: list[tuple[int, int, int]] = []
        self._contacts = (_Buffer((2,), whole), _Buffer((), whole), _Buffer((), whole))
        self._shapes = _Buffer((9,)), _Buffer((3,)), _Buffer(), _Buffer((5,))
        self._rows, self._pull = (_Buffer(), _Buffer(), _Buffer()), _Buffer()
        self.is_elliptic = model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
        self._twist, self._center = np.zeros((CHUNK, model.nbody, 6)), np.zeros((CHUNK, model.nbody, 3))

    def read(self, t: int, data: mujoco.MjData) -> None:
        """Copy sample ``t`` of this chunk."""
        if not data.ncon:
            return
        contact = data.contact
        self._counts.append((t, data.ncon, data.nefc))
        geom, address, dim = self._contacts
        geom.append(contact.geom.copy())
        address.append(contact.efc_address.copy())
        dim.append(contact.dim.copy())
        frame, pos, dist, friction = self._shapes
        frame.append(contact.frame.copy())
        pos.append(contact.pos.copy())
        dist.append(contact.dist.copy())
        friction.append(contact.friction.copy())
        if data.nefc:
            R, force, damping = self._rows
            R.append(data.efc_R.copy())
            force.append(data.efc_force.copy())
            KBIP = data.efc_KBIP
            damping.append(KBIP[:, 1].copy())
            if not self.is_elliptic:
                self._pull.append(KBIP[:, 0] * KBIP[:, 2] * (data.efc_pos - data.efc_margin))
        self._twist[t], self._center[t] = data.cvel, data.subtree_com

    def take(self, begin: int) -> RawContacts:
        """Return the watched contacts of this chunk that take part in the dynamics, and begin the next one.

        ``begin`` is the index of the chunk's first sample.
        """
        counts = np.array(self._counts, dtype=np.intp).reshape(-1, 3)
        self._counts = []
        sample = np.repeat(counts[:, 0], counts[:, 1])
        first_row = np.repeat(np.cumsum(counts[:, 2]) - counts[:, 2], counts[:, 1])
        geom, address, dim = (buffer.take() for buffer in self._contacts)
        frame, pos, dist, friction = (buffer.take() for buffer in self._shapes)
        R, force, damping = (buffer.take() for buffer in self._rows)
        pull = np.zeros(len(R)) if self.is_elliptic else self._pull.take()
        # A contact with a flex has no geom; one within a gap has no constraint.
        kept = np.flatnonzero(
            (address >= 0) & (geom.min(axis=1, initial=0) >= 0) & self.is_kept[geom].any(axis=1)
        )
        first = (first_row + address)[kept]
        width = MOST_ROWS_ELLIPTIC if self.is_elliptic else MOST_ROWS
        rows = np.minimum(first[:, None] + np.arange(width), max(len(R) - 1, 0))
        body = self.model.geom_bodyid[geom[kept]]
        when = sample[kept][:, None]
        row_force = force[rows]
        decode = _decode_elliptic if self.is_elliptic else _decode_pyramidal
        return RawContacts(
            sample=begin + sample[kept],
            geom=geom[kept],
            dim=dim[kept],
            frame=frame[kept].reshape(-1, 3, 3),
            pos=pos[kept],
            dist=dist[kept],
            friction=friction[kept],
            wrench=decode(row_force, friction[kept], dim[kept]),
            twist=self._twist[when, body],
            center=self._center[when, self.model.body_rootid[body]],
            rows_R=R[rows],
            rows_force=row_force,
            damping=damping[first],
            pull=pull[first],
        )

    def read_needed_force(self, data: mujoco.MjData) -> Array:
        """Return the force (3,) [N] in the world that contacts must give the object for the acceleration it has.

        The three translations of a free joint are the momentum of everything on it, gravity and all other applied forces
        are in ``qfrc_smooth``; what is left is what contacts have to do.
        """
        mujoco.mj_mulM(self.model, data, self._force, data.qacc)
        dofs = slice(self.free_dof, self.free_dof + 3)
        return self._force[dofs] - data.qfrc_smooth[dofs]


def _decode_elliptic(rows: Array, friction: Array, dim: Indices) -> Array:
    """Return the wrenches (N, 6) of contacts from their constraint rows (N, 10): with elliptic cones they are the rows."""
    return np.where(np.arange(6) < dim[:, None], rows[:, :6], 0.0)


def _decode_pyramidal(rows: Array, friction: Array, dim: Indices) -> Array:
    """Return the wrenches (N, 6) from the edges of pyramids: edges 2 i and 2 i + 1 are n + mu_i t_i and n - mu_i t_i.

    A contact of condim 1 is one row, its normal.
    """
    out = np.zeros((len(rows), 6))
    has = np.arange(5) < dim[:, None] - 1
    plus, minus = np.where(has, rows[:, 0::2], 0.0), np.where(has, rows[:, 1::2], 0.0)
    out[:, 0] = np.where(dim == 1, rows[:, 0], (plus + minus).sum(axis=1))
    out[:, 1:] = (plus - minus) * friction
    return out


def find_free_dof(model: mujoco.MjModel, body: int, bodies: list[int]) -> int:
    """Return the address of the object's free joint in ``qvel``; -1 where it has none, or where an equality or friction in
    its joint gives it forces that are no contacts.
    """
    if body <= 0 or model.body_jntnum[body] != 1:
        return -1
    joint = int(model.body_jntadr[body])
    if int(model.jnt_type[joint]) != FREE:
        return -1
    dof = int(model.jnt_dofadr[joint])
    if model.dof_frictionloss[dof : dof + 6].any():
        return -1
    for e in range(model.neq):
        if int(model.eq_type[e]) not in TIES:
            continue
        ends = np.array([model.eq_obj1id[e], model.eq_obj2id[e]])
        if int(model.eq_objtype[e]) == int(mujoco.mjtObj.mjOBJ_SITE):
            ends = model.site_bodyid[ends]
        if np.isin(ends, bodies).any():
            return -1
    return dof
