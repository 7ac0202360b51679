"""Read the contacts of recorded states, in one pass: state, ``mj_forward``, copy; arithmetic once for many samples.

A recorded state is put into a second MjData and ``mj_forward`` is called: that is the first half of the step that was
taken from there (warm start included), so contacts and forces belong to the state, and no reading disturbs anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import mj_forward, mj_setState
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.contact_rows import as_rows, join_rows
from dexplan.testing.parties import Indices, Parties
from dexplan.testing.raw_contacts import CHUNK, RawContacts, RawReader
from dexplan.testing.rows import ContactRows

INTEGRATION = int(mujoco.mjtState.mjSTATE_INTEGRATION)
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


def read_states(model: mujoco.MjModel, parties: Parties, states: Array) -> Readings:
    """Return the readings of ``states`` (T, n), each a ``mjSTATE_INTEGRATION`` whose control is that of the step from there."""
    data = mujoco.MjData(model)
    T = len(states)
    reader = RawReader(model, parties)
    time, iterations = np.zeros(T), np.zeros((T, len(data.solver_niter)), dtype=np.intp)
    saturated = np.zeros((T, model.nu), dtype=bool)
    needed, given = np.full((T, 3), np.nan), np.zeros((T, 3))
    parts = []
    for begin in range(0, T, CHUNK):
        for t in range(begin, min(begin + CHUNK, T)):
            mj_setState(model, data, states[t], INTEGRATION)
            mj_forward(model, data)
            time[t], iterations[t] = data.time, data.solver_niter
            reader.read(t - begin, data)
            if reader.free_dof >= 0:
                needed[t] = reader.read_needed_force(data)
            if model.nu:
                saturated[t] = find_saturated(model, data)
        raw = reader.take(begin)
        if reader.free_dof >= 0:
            force_W = _compute_outer_force(model, raw, reader.object_bodies)
            given += np.stack([np.bincount(raw.sample, f, minlength=T) for f in force_W.T], axis=1)
        parts.append(as_rows(model, parties, raw))
    residual = np.linalg.norm(needed - given, axis=1)
    return Readings(time, join_rows(parts), residual, saturated, iterations.max(axis=1, initial=0))


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


def _compute_outer_force(model: mujoco.MjModel, raw: RawContacts, bodies: list[int]) -> Array:
    """Return the force (N, 3) [N, W] that each contact gives ``bodies`` from outside of them."""
    is_inside = np.isin(model.geom_bodyid[raw.geom], bodies)
    sign = is_inside[:, 1].astype(float) - is_inside[:, 0].astype(float)
    return sign[:, None] * np.einsum("nji,nj->ni", raw.frame, raw.wrench[:, :3])
