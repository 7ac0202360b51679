"""Is this honest physics?  The compiled model, the initial state and the contacts met, against a whitelist.

Nothing is looked for by name of cheat: whatever is not on the list is a departure, listed with the name of
what departs. The list is not an acceptance limit, so a problem file cannot loosen it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from dexplan.sim.judge.checks_case import Case, CheckResult, judge
from dexplan.sim.judge.checks_hand import find_departures_from_scene
from dexplan.sim.judge.object_shape import find_departures_of_object
from dexplan.sim.judge.world import World
from dexplan.spatial import GRAVITY, Array

_TOLERANCE = 1e-6
"""Relative: a model text carries nine digits."""
PROFILES: dict[str, dict[str, float]] = {
    "firm": {"impratio": 100.0, "noslip_iterations": 300, "noslip_tolerance": 1e-10},
    "portable": {"impratio": 3000.0, "noslip_iterations": 0, "noslip_tolerance": 1e-6},
}
"""Solver options that a physics profile sets."""
EARLIER: dict[str, dict[str, float]] = {"firm": {"noslip_iterations": 30}}
"""What a profile set before: runs recorded then are judged by it.  With fewer sweeps contacts creep more, never less."""
OPTIONS: dict[str, Any] = {
    "timestep": 0.001,
    "gravity": [0.0, 0.0, -GRAVITY],
    "wind": [0.0, 0.0, 0.0],
    "density": 0.0,
    "viscosity": 0.0,
    "integrator": int(mujoco.mjtIntegrator.mjINT_EULER),
    "cone": int(mujoco.mjtCone.mjCONE_ELLIPTIC),
    "solver": int(mujoco.mjtSolver.mjSOL_NEWTON),
    "jacobian": int(mujoco.mjtJacobian.mjJAC_DENSE),
    "iterations": 100,
    "ls_iterations": 50,
    "tolerance": 1e-8,
    "ls_tolerance": 0.01,
    "disableflags": 0,
    "enableflags": 0,
    "disableactuator": 0,
}
CONTACT = {"solref": [0.002, 1.0], "solimp": [0.95, 0.99, 0.001, 0.5, 2.0], "condim": 4, "rolling": 1e-4}
ABSENT = (
    "neq",
    "nmocap",
    "ntendon",
    "nplugin",
    "nflex",
    "nskin",
    "nhfield",
    "npair",
    "nexclude",
    "na",
    "nuserdata",
)
"""Counts of model elements that must be zero."""
VISUAL = ("/tip_visual", "/neck_visual")
"""Geoms of a finger that are only seen: the half of the tip that shows, and the bridge between two links of one finger."""
ARMATURE_MAX, DAMPING_MAX = 5e-3, 0.1
"""Of a finger joint [kg m^2], [N m s/rad]: a real geared servo of this size has as much."""
TORQUE_LIMITS = {1: 1.5, 2: 1.5, 3: 1.5, 4: 0.5, 5: 0.5, 6: 0.5}
"""Largest torque of each joint of a finger, from the base out [N m]."""
SHAPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
}
_FINGER_JOINT = re.compile(r"joint_(\d+)")


def check_physics_untouched(case: Case) -> CheckResult:
    """Count the departures of model, initial state, control and contacts met from the whitelist."""
    departures = list(find_departures(case))
    said = departures[:12] + ([f"and {len(departures) - 12} more"] if len(departures) > 12 else [])
    return judge(
        "physics_untouched", len(departures), case.limit("physics_untouched"), "count", note="; ".join(said)
    )


def find_departures(case: Case) -> Iterator[str]:
    """Yield one line per departure."""
    world, problem = case.replay.world, case.problem
    yield from _find_in_options(world, problem)
    yield from _find_in_bodies(world, problem)
    yield from _find_in_geoms(world, problem)
    yield from _find_in_joints(world)
    yield from _find_in_actuators(world)
    yield from _find_in_run(case)
    yield from find_departures_from_scene(world, problem)


def _differs(value: Any, wanted: Any) -> bool:
    """Return whether numbers differ by more than the digits a model text carries; NaN differs."""
    value, wanted = np.asarray(value, dtype=np.float64), np.asarray(wanted, dtype=np.float64)
    return value.shape != wanted.shape or not np.allclose(value, wanted, rtol=_TOLERANCE, atol=0.0)


def _say(what: str, value: Any, wanted: Any) -> str:
    """Return the line for ``what`` being ``value`` rather than ``wanted``."""
    return f"{what} is {np.asarray(value).tolist()}, not {np.asarray(wanted).tolist()}"


def _find_in_options(world: World, problem: Mapping[str, Any]) -> Iterator[str]:
    """Gravity, medium, solver, flags, and elements that have no business here."""
    option = world.model.opt
    profile = problem["control"]["physics_profile"]
    earlier = EARLIER.get(profile, {})
    for name, expected in {**OPTIONS, **PROFILES[profile]}.items():
        value = getattr(option, name)
        if _differs(value, expected) and (name not in earlier or _differs(value, earlier[name])):
            yield _say(f"option {name}", value, expected)
    for name in ABSENT:
        if getattr(world.model, name):
            yield _say(f"model {name}", getattr(world.model, name), 0)
    for name in ("control", "passive", "contactfilter", "act_dyn", "act_gain", "act_bias"):
        if getattr(mujoco, f"get_mjcb_{name}")() is not None:
            yield f"a callback {name} is installed"


def _find_in_bodies(world: World, problem: Mapping[str, Any]) -> Iterator[str]:
    """The object is one free body, of the problem's shape and mass; nobody floats; fingers hang from the world."""
    model, body = world.model, world.object_body
    yield from find_departures_of_object(model, world.object_geom, problem["object"])
    if model.body_geomnum[body] != 1:
        yield _say("number of geoms on the object", model.body_geomnum[body], 1)
    if model.body_parentid[body] != 0 or np.any(model.body_parentid[1:] == body):
        yield "the object is attached to another body"
    if model.body_jntnum[body] != 1:
        yield _say("number of joints of the object", model.body_jntnum[body], 1)
    if len(world.fingers) != len(problem["hand"]["tip_radii_m"]):
        yield _say("number of fingers", len(world.fingers), len(problem["hand"]["tip_radii_m"]))
    for b in range(1, model.nbody):
        name = model.body(b).name
        if model.body_gravcomp[b] != 0:
            yield _say(f"gravcomp of {name}", model.body_gravcomp[b], 0.0)
        if b != body and not name.startswith(tuple(f"{finger}/" for finger in world.fingers)):
            yield f"body {name!r} belongs to neither finger nor object"


def _find_in_geoms(world: World, problem: Mapping[str, Any]) -> Iterator[str]:
    """Every geom is known, collides, and has the problem's friction and the package's contact settings."""
    model, friction = world.model, problem["friction"]
    rub = [float(friction["sliding"]), float(friction["torsional_m"]), CONTACT["rolling"]]
    settings = {
        "friction": rub,
        "solref": CONTACT["solref"],
        "solimp": CONTACT["solimp"],
        "condim": CONTACT["condim"],
        "margin": 0.0,
        "gap": 0.0,
        "priority": 0,
        "solmix": 1.0,
        "contype": 1,
        "conaffinity": 1,
    }
    obstacles = {
        f"obstacle_{k}": obstacle for k, obstacle in enumerate(problem.get("obstacles") or (), start=1)
    }
    for g, name in enumerate(world.geom_names):
        if name.endswith(VISUAL) and world.geom_finger[g] >= 0:
            if model.geom_contype[g] or model.geom_conaffinity[g]:
                yield f"geom {name} collides"
            continue
        for key, wanted in settings.items():
            value = getattr(model, f"geom_{key}")[g]
            if _differs(value, wanted):
                yield _say(f"{key} of geom {name}", value, wanted)
        if world.geom_finger[g] < 0 and g != world.object_geom and name != "floor" and name not in obstacles:
            yield f"geom {name} is not in the problem"
    radii = [
        (f"{f}/tip", float(r)) for f, r in zip(world.fingers, problem["hand"]["tip_radii_m"], strict=False)
    ]
    for name, radius in radii:
        geom = model.geom(name)
        if geom.type[0] != mujoco.mjtGeom.mjGEOM_SPHERE:
            kind = mujoco.mjtGeom(int(geom.type[0])).name.removeprefix("mjGEOM_").lower()
            yield f"{name} is of type {kind}, not a sphere"
        elif _differs(geom.size[0], radius):
            yield _say(f"radius of {name}", geom.size[0], radius)
    for name, obstacle in obstacles.items():
        if name not in world.geom_names:
            yield f"{name} of the problem is not in the model"
            continue
        geom = model.geom(name)
        size = np.asarray(obstacle["size_m"], dtype=np.float64)
        if (
            geom.type[0] != SHAPES.get(obstacle["kind"])
            or _differs(geom.size[: len(size)], size)
            or not np.allclose(geom.pos, obstacle["pos_m"], atol=_TOLERANCE)
            or not np.allclose(np.abs(geom.quat), [1.0, 0.0, 0.0, 0.0], atol=_TOLERANCE)
            or geom.bodyid[0] != 0
        ):
            yield f"{name} is not the problem's"


def _find_in_joints(world: World) -> Iterator[str]:
    """Fingers have hinges with modest armature and damping; the object's free joint has nothing at all."""
    model = world.model
    for j in range(model.njnt):
        joint = model.joint(j)
        dofs = np.flatnonzero(model.dof_jntid == j)
        is_object = joint.name == "object/free/"
        is_finger = joint.name.startswith(tuple(f"{finger}/" for finger in world.fingers))
        expected = mujoco.mjtJoint.mjJNT_FREE if is_object else mujoco.mjtJoint.mjJNT_HINGE
        if joint.type[0] != expected or not (is_object or is_finger):
            yield f"joint {joint.name!r} does not belong here"
        if np.any(model.dof_frictionloss[dofs]):
            yield _say(f"frictionloss of joint {joint.name}", model.dof_frictionloss[dofs].max(), 0.0)
        if np.any(model.jnt_stiffness[j]):
            yield _say(f"stiffness of joint {joint.name}", model.jnt_stiffness[j], 0.0)
        if np.any(model.jnt_margin[j]) or np.any(model.jnt_actgravcomp[j]):
            yield f"joint {joint.name} has a margin or gravity compensation by its actuator"
        for key, most in (("armature", ARMATURE_MAX), ("damping", DAMPING_MAX)):
            values = getattr(model, f"dof_{key}")[dofs]
            most = 0.0 if is_object else most
            # The polynomial terms some versions of MuJoCo have beside the linear damping count as well.
            if not np.all((values >= 0) & (values <= most)):
                yield f"{key} of joint {joint.name} is {np.asarray(values).max()}, more than {most}"


def _find_in_actuators(world: World) -> Iterator[str]:
    """Actuators are position servos on finger joints with limited torque, one per joint."""
    model = world.model
    finger_joints = {
        j for j in range(model.njnt) if model.joint(j).name.startswith(tuple(f"{f}/" for f in world.fingers))
    }
    driven: list[int] = []
    for a in range(model.nu):
        name = model.actuator(a).name
        joint = int(model.actuator_trnid[a, 0])
        if model.actuator_trntype[a] != mujoco.mjtTrn.mjTRN_JOINT or joint not in finger_joints:
            yield f"actuator {name!r} does not act on a finger joint"
            continue
        driven.append(joint)
        gain, bias = model.actuator_gainprm[a], model.actuator_biasprm[a]
        is_servo = (
            model.actuator_gaintype[a] == mujoco.mjtGain.mjGAIN_FIXED
            and model.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_AFFINE
            and model.actuator_dyntype[a] == mujoco.mjtDyn.mjDYN_NONE
            and gain[0] > 0
            and bias[0] == 0
            and bias[1] == -gain[0]
            and bias[2] <= 0
            and not np.any(gain[1:])
            and not np.any(bias[3:])
            and np.array_equal(model.actuator_gear[a], [1, 0, 0, 0, 0, 0])
        )
        if not is_servo:
            yield f"actuator {name} is not a position servo"
        number = _FINGER_JOINT.search(model.joint(joint).name)
        most = TORQUE_LIMITS.get(int(number.group(1)), 0.0) if number else 0.0
        limit = world.torque_limit[a]
        if not limit <= most * (1 + _TOLERANCE):
            yield f"torque limit of actuator {name} is {limit}, more than {most}"
        low, high = model.actuator_forcerange[a]
        if low != -high:
            yield f"force range of actuator {name} is not symmetric"
    if len(set(driven)) != len(driven):
        yield "a joint is driven by several actuators"


def _find_in_run(case: Case) -> Iterator[str]:
    """Forces hidden in the initial state or the record, controls that are not numbers, odd contacts, solver
    trouble.
    """
    world, state = case.replay.world, case.initial_state
    model = world.model
    if state is not None:
        data = mujoco.MjData(model)
        if not np.isfinite(state).all():
            yield "the initial state holds a value that is not a number"
        mujoco.mj_setState(model, data, np.ascontiguousarray(state), mujoco.mjtState.mjSTATE_INTEGRATION)
        for key in ("qfrc_applied", "xfrc_applied"):
            if np.any(getattr(data, key) != 0):
                yield f"the initial state applies a force ({key})"
    control = case.columns.get("ctrl")
    if control is None or not np.isfinite(control).all():
        yield "a control is not a number"
    elif np.any(limited := model.actuator_ctrllimited.astype(bool)):
        low, high = model.actuator_ctrlrange[limited].T
        if np.any((control[:, limited] < low) | (control[:, limited] > high)):
            yield "a control is out of its actuator's range"
    disturbance = case.columns.get("xfrc_applied")
    if disturbance is not None and np.any(disturbance != 0) and not case.problem.get("disturbance"):
        yield "the record applies a force that the problem does not declare"
    for row in case.replay.contact_settings:
        if _differs(np.array(row), _expected_row(case.problem["friction"])):
            yield f"a contact met on the object has (friction, solref, solimp, condim) {row}"
    for name, count in case.replay.warnings.items():
        yield f"MuJoCo warns of {name}, {count} times"


def _expected_row(friction: Mapping[str, Any]) -> Array:
    """Return the friction (5,), solref (2,), solimp (5,) and condim of a tip on the object, as one row."""
    mu, torsional, rolling = float(friction["sliding"]), float(friction["torsional_m"]), CONTACT["rolling"]
    return np.array(
        [mu, mu, torsional, rolling, rolling, *CONTACT["solref"], *CONTACT["solimp"], CONTACT["condim"]]  # type: ignore[misc]
    )
