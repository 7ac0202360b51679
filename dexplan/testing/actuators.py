"""What the actuators of any MuJoCo model can do at a state: the range of force of each, and of each joint."""

from __future__ import annotations

import mujoco
import numpy as np

from dexplan.spatial import Array

ENDLESS = np.array([-np.inf, np.inf])
FIXED_GAIN, AFFINE_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
NO_BIAS, AFFINE_BIAS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
NO_DYNAMICS = int(mujoco.mjtDyn.mjDYN_NONE)
FILTERS = int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT)
ON_ONE_JOINT = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)


def find_joint_ranges(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Return which generalised forces (nv, 2) [N, N m] actuators can give each dof at the state of ``data``, at any control.

    Endless where no actuator acts, where one acts on several joints at once, and for free and ball joints.
    """
    out, is_shared = np.zeros((model.nv, 2)), np.ones(model.nv, dtype=bool)
    dofs = model.jnt_dofadr[np.isin(model.jnt_type, ON_ONE_JOINT)]
    is_shared[dofs] = False
    is_driven = np.zeros(model.nv, dtype=bool)
    for a in range(model.nu):
        row = slice(int(data.moment_rowadr[a]), int(data.moment_rowadr[a]) + int(data.moment_rownnz[a]))
        moment, touched = data.actuator_moment[row], data.moment_colind[row]
        touched, moment = touched[moment != 0.0], moment[moment != 0.0]
        is_driven[touched] = True
        if len(touched) != 1:
            is_shared[touched] = True
            continue
        ends = moment[0] * find_force_range(model, data, a)
        out[touched[0]] += np.sort(ends)
    out[is_shared | ~is_driven] = ENDLESS
    for joint in np.flatnonzero((model.jnt_actfrclimited > 0) & np.isin(model.jnt_type, ON_ONE_JOINT)):
        dof = int(model.jnt_dofadr[joint])
        if is_driven[dof]:
            out[dof] = np.clip(out[dof], *model.jnt_actfrcrange[joint])
    return out


def find_force_range(model: mujoco.MjModel, data: mujoco.MjData, a: int) -> Array:
    """Return the least and greatest force (2,) of an actuator at the position of ``data``, at rest and at any control."""
    force = ENDLESS.copy()
    gain_type, bias_type = int(model.actuator_gaintype[a]), int(model.actuator_biastype[a])
    if gain_type in (FIXED_GAIN, AFFINE_GAIN) and bias_type in (NO_BIAS, AFFINE_BIAS):
        length = float(data.actuator_length[a])
        gain = float(model.actuator_gainprm[a, 0])
        gain += float(model.actuator_gainprm[a, 1]) * length if gain_type == AFFINE_GAIN else 0.0
        bias = model.actuator_biasprm[a]
        own = float(bias[0] + bias[1] * length) if bias_type == AFFINE_BIAS else 0.0
        if gain != 0.0:
            force = np.sort(gain * _find_input_range(model, a)) + own
    if model.actuator_forcelimited[a]:
        force = np.clip(force, *model.actuator_forcerange[a])
    return force


def _find_input_range(model: mujoco.MjModel, a: int) -> Array:
    """Return the range (2,) of what an actuator's gain multiplies: its control, or its activation."""
    dynamics = int(model.actuator_dyntype[a])
    if dynamics != NO_DYNAMICS and model.actuator_actlimited[a]:
        return model.actuator_actrange[a].copy()
    is_clamped = not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    if dynamics in (NO_DYNAMICS, *FILTERS) and model.actuator_ctrllimited[a] and is_clamped:
        return model.actuator_ctrlrange[a].copy()
    return ENDLESS.copy()
