"""Test worlds: a ball held still by servos alone, no planner and no controller involved."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from dexplan.scene.compose import build_model_xml
from dexplan.scene.description import SceneParameters
from dexplan.sim.judge.checks_case import Case
from dexplan.sim.judge.replay import replay
from dexplan.sim.judge.validate import load_default_limits
from dexplan.sim.trace import Trace

# The profile "firm", spelled out: the whitelist must not follow the scene.
OPTION = (
    '<option timestep="0.001" integrator="Euler" cone="elliptic" impratio="100" '
    'noslip_iterations="300" noslip_tolerance="1e-10" jacobian="dense"/>'
)
MODEL_XML = build_model_xml(SceneParameters())
for pattern, text in (
    (r"<option [^>]*/>", OPTION),
    (r'solref="[^"]*"', 'solref="0.002 1"'),
    (r'solimp="[^"]*"', 'solimp="0.95 0.99 0.001 0.5 2"'),
):
    MODEL_XML = re.sub(pattern, text, MODEL_XML)
AZIMUTHS = (0.0, 120.0, 240.0)
STEPS = 4
HOME = [0.0, 0.0, 0.16, 1.0, 0.0, 0.0, 0.0]
RADIUS, TIP = 0.035, 0.018


def make_problem(**sections: Any) -> dict[str, Any]:
    """Return the problem "hold still", its sections updated by ``sections``."""
    problem: dict[str, Any] = {
        "format": 1,
        "name": "hold",
        "scene": "three_finger_sphere",
        "seed": 0,
        "object": {"radius_m": RADIUS, "mass_kg": 0.060},
        "hand": {"tip_radii_m": [TIP] * 3, "tip_polar_limit_deg": 80.0, "tip_rotation_limit_deg": 75.0},
        "friction": {"sliding": 0.55, "torsional_m": 0.0025, "safety": 1.3},
        "start": {"contacts_deg": [[a, 0.0] for a in AZIMUTHS]},
        "goal": {"kind": "object_manipulation", "rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 0.0}},
        "gait": {"primitives": ["substitution"], "node_budget": 1000},
        "obstacles": [],
        "control": {"physics_profile": "firm", "speed_deg_s": 30.0},
        "acceptance": {},
    }
    for name, values in sections.items():
        problem[name] = {**problem[name], **values} if isinstance(values, dict) else values
    return problem


def make_contacts(azimuths: dict[str, float]) -> dict[str, Any]:
    """Return equatorial contacts as plan data."""
    out: dict[str, Any] = {f"finger_{k}": None for k in (1, 2, 3)}
    for name, azimuth in azimuths.items():
        normal = [float(np.cos(np.radians(azimuth))), float(np.sin(np.radians(azimuth))), 0.0]
        out[name] = {"point_O": [RADIUS * x for x in normal], "normal_O": normal}
    return out


def make_plan(phases: list[dict[str, str]] | None = None) -> dict[str, Any]:
    """Return the plan of one hold with the given touch tables, one per phase; all fingers must touch by
    default.
    """
    everyone = {f"finger_{k}": "must" for k in (1, 2, 3)}
    contacts = make_contacts({f"finger_{k}": a for k, a in zip((1, 2, 3), AZIMUTHS, strict=True)})
    action = {
        "index": 0,
        "kind": "hold",
        "finger": None,
        "grasping": list(everyone),
        "object_pose_start": HOME,
        "object_pose_end": HOME,
        "rotation": {"axis_W": [0.0, 0.0, 1.0], "angle_deg": 0.0},
        "contacts_end": contacts,
        "phases": [{"name": f"phase_{i}", "touch": touch} for i, touch in enumerate(phases or [everyone])],
    }
    goal = {"kind": "object_manipulation", "object_pose": HOME, "axis_W": [0, 0, 1], "turned_angle_deg": 0.0}
    start = {"object_pose": HOME, "contacts": contacts}
    return {
        "format": 1,
        "status": "solved",
        "fingers": list(everyone),
        "start": start,
        "goal": goal,
        "actions": [action],
    }


@lru_cache
def solve_posture(squeeze: float = 4.0) -> tuple[np.ndarray, np.ndarray]:
    """Return (qpos, ctrl): tips on the ball's equator, servos aimed so that each presses ``squeeze`` [N] and
    lifts a third.
    """
    model = mujoco.MjModel.from_xml_string(MODEL_XML)
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0
    ctrl = np.zeros(model.nu)
    feedforward = np.zeros(model.nv)
    for k, azimuth in enumerate(np.radians(AZIMUTHS), start=1):
        normal = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        dofs = [int(model.joint(f"finger_{k}/joint_{j}").qposadr[0]) for j in range(1, 7)]
        site = model.site(f"finger_{k}/tip_center").id
        target = np.array([0, 0, 0.16]) + (RADIUS + TIP - 5e-5) * normal

        def miss(q, dofs=dofs, site=site, target=target, normal=normal):
            data.qpos[dofs] = q
            mujoco.mj_kinematics(model, data)
            pole = data.site_xmat[site].reshape(3, 3)[:, 2]
            return np.concatenate([10 * (data.site_xpos[site] - target), pole + normal, [1e-3 * q[3], q[5]]])

        solution = least_squares(miss, [0.0, -1.2, 1.8, 0.0, 0.8, 0.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
        miss(solution.x)
        mujoco.mj_comPos(model, data)
        jacobian = np.zeros((3, model.nv))
        force = -squeeze * normal + np.array([0, 0, 0.060 * 9.81 / 3])
        point = target - TIP * normal
        mujoco.mj_jac(model, data, jacobian, None, point, model.geom(f"finger_{k}/tip").bodyid[0])
        feedforward += jacobian.T @ force
    mujoco.mj_forward(model, data)
    for a in range(model.nu):
        joint = model.actuator_trnid[a, 0]
        dof, adr = model.jnt_dofadr[joint], model.jnt_qposadr[joint]
        ctrl[a] = data.qpos[adr] + (data.qfrc_bias[dof] + feedforward[dof]) / model.actuator_gainprm[a, 0]
    return data.qpos.copy(), ctrl


def record(
    xml: str = MODEL_XML,
    ctrl: np.ndarray | None = None,
    samples: int = 250,
    settle: int = 250,
    qpos: np.ndarray | None = None,
    xfrc: np.ndarray | None = None,
) -> Trace:
    """Simulate and return the trace; ``ctrl`` (samples, nu) defaults to holding still, after ``settle``
    steps.
    """
    start, hold = solve_posture()
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[: len(start)] = start if qpos is None else qpos
    data.ctrl[: len(hold)] = hold
    mujoco.mj_step(model, data, nstep=settle)
    data.time = 0.0
    if ctrl is None:
        ctrl = np.tile(np.concatenate([hold, np.zeros(model.nu - len(hold))]), (samples, 1))
    signature = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, signature))
    mujoco.mj_getState(model, data, state, signature)
    rows: dict[str, list[Any]] = {"time": [], "qpos": [], "qvel": []}
    for t, u in enumerate(ctrl):
        rows["time"].append(data.time)
        rows["qpos"].append(data.qpos.copy())
        rows["qvel"].append(data.qvel.copy())
        data.ctrl[:] = u
        if xfrc is not None:
            data.xfrc_applied[:] = xfrc[t]
        mujoco.mj_step(model, data, nstep=STEPS)
    T = len(ctrl)
    columns: dict[str, Any] = {
        **{name: np.array(values) for name, values in rows.items()},
        "ctrl": ctrl,
        "initial_state": state,
        "physics_steps_per_sample": np.array(STEPS),
        "object_pose_reference": np.tile(HOME, (T, 1)),
        "action_index": np.zeros(T, dtype=np.int64),
        "phase_index": np.zeros(T, dtype=np.int64),
    }
    if xfrc is not None:
        columns["xfrc_applied"] = xfrc
    return Trace(xml, columns, {"seed": 0})


def make_case(
    trace: Trace | None = None, problem: dict[str, Any] | None = None, plan: dict[str, Any] | None = None
) -> Case:
    """Return the case of a run held still, with the columns a controller would have added."""
    trace = record() if trace is None else trace
    replayed = replay(
        trace.model_xml, trace["initial_state"], trace["ctrl"], STEPS, trace.columns.get("xfrc_applied")
    )
    T = len(replayed.time)
    columns = {
        **trace.columns,
        "contact_active": replayed.contact_active,
        "contact_point_O": replayed.contact_point_O,
        "contact_rotation_O": replayed.contact_rotation_O,
        "contact_force": replayed.contact_force,
        "contact_force_reference": replayed.contact_force,
        "qp_status": np.zeros(T, dtype=np.int64),
        "qp_wrench_residual": np.zeros(T),
        "tip_tracking_error": np.zeros(T),
        "ik_at_limit": np.zeros(T, dtype=bool),
    }
    return Case(
        make_problem() if problem is None else problem,
        make_plan() if plan is None else plan,
        columns,
        replayed,
        load_default_limits(),
        trace["initial_state"],
    )


def slide(case: Case, speed: float, finger: int = 0) -> Case:
    """Return ``case`` with one tip, and its contact with it, sliding along the ball at ``speed`` [m/s]."""
    replayed = case.replay
    tangent = replayed.contact_rotation_O[:, finger, :, 0]
    path_O = speed * (replayed.time - replayed.time[0])[:, None] * tangent
    R_WO = Rotation.from_quat(replayed.object_pose[:, 3:], scalar_first=True)
    point, tip = np.array(replayed.contact_point_O), np.array(replayed.tip_position)
    point[:, finger] += path_O
    tip[:, finger] += R_WO.apply(path_O)
    return replace(case, replay=replace(replayed, contact_point_O=point, tip_position=tip))
