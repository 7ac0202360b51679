"""Is the model the problem's scene?  Hand, home and floor against the packaged scene, with what the problem says of them put in.

The packaged text is read as data and changed through MuJoCo's own editor: nothing of what composes scenes is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import resources
from typing import Any

import mujoco
import numpy as np

from dexplan.sim.judge.world import World
from dexplan.spatial import Array

TOLERANCE = 1e-6
"""Relative to the largest number of an array: a model text carries nine digits."""
OBJECT = "object/"

JOINT = ("type", "pos", "axis", "range", "limited", "stiffness", "margin", "solref", "solimp")
DOF = ("armature", "damping", "frictionloss", "solref", "solimp")
ACTUATOR = (
    "trntype",
    "dyntype",
    "gaintype",
    "biastype",
    "gainprm",
    "biasprm",
    "dynprm",
    "gear",
    "forcerange",
    "forcelimited",
    "ctrlrange",
    "ctrllimited",
)


def find_departures_from_scene(world: World, problem: Mapping[str, Any]) -> Iterator[str]:
    """Yield one line per part of the model that is not as the problem's scene has it.

    What the problem's own numbers say of the object and of frictions is compared elsewhere.
    """
    scene = _build_scene(problem)
    if scene is None:
        yield f"there is no scene {problem.get('scene')!r} to compare the model with"
        return
    model = world.model
    for kind, count in (("body", "nbody"), ("joint", "njnt"), ("actuator", "nu")):
        names, wanted = ({getattr(m, kind)(i).name for i in range(getattr(m, count))} for m in (model, scene))
        for name in sorted(names ^ wanted):
            yield f"{kind} {name!r} is {'not in the scene' if name in names else 'missing'}"
    for kind, compare in _COMPARISONS.items():
        for name in _find_shared(model, scene, kind):
            for what, value, expected in compare(model, scene, name):
                if _differs(value, expected):
                    yield f"{what} of {kind} {name} is {_spell(value)}, not {_spell(expected)}"
    geoms = {model.geom(g).name for g in np.flatnonzero(model.geom_contype | model.geom_conaffinity)}
    known = {scene.geom(g).name for g in range(scene.ngeom)}
    yield from (f"geom {name!r} is not in the scene" for name in sorted(geoms - known) if "/" in name)


def _build_scene(problem: Mapping[str, Any]) -> mujoco.MjModel | None:
    """Return the packaged scene with the problem's hand; None where there is no such scene."""
    name = problem.get("scene", "")
    path = resources.files("dexplan.models").joinpath(f"{name}.xml")
    if not str(name).isidentifier() or not path.is_file():
        return None
    spec = mujoco.MjSpec.from_string(path.read_text(encoding="utf-8"))
    hand = problem["hand"]
    home = np.array(spec.body(OBJECT).pos)
    for k, azimuth in enumerate(hand.get("base_azimuths_deg") or ()):
        body = spec.body(f"finger_{k + 1}/")
        if body is None:
            break
        arm = np.array(body.pos) - home
        _turn_about_vertical(body, home, np.radians(azimuth) - np.arctan2(arm[1], arm[0]))
    for k, radius in enumerate(hand["tip_radii_m"]):
        tip = spec.geom(f"finger_{k + 1}/tip")
        if tip is not None:
            tip.size[0] = radius
    for key, limits in (hand.get("joint_ranges_deg") or {}).items():
        joint = spec.joint(str(key).replace(".", "/"))
        if joint is not None:
            joint.range = np.radians(limits)
    return spec.compile()


def _turn_about_vertical(body: Any, centre: Array, angle: float) -> None:
    """Turn a body of the world about the vertical through ``centre``."""
    turn = np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])
    arm, quat = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(arm, np.array(body.pos) - centre, turn)
    mujoco.mju_mulQuat(quat, turn, np.array(body.quat))
    body.pos, body.quat = centre + arm, quat


Compared = Iterator[tuple[str, Any, Any]]


def _compare_body(model: mujoco.MjModel, scene: mujoco.MjModel, name: str) -> Compared:
    a, b = model.body(name).id, scene.body(name).id
    yield "parent", _name_body(model, model.body_parentid[a]), _name_body(scene, scene.body_parentid[b])
    yield "position", model.body_pos[a], scene.body_pos[b]
    yield "attitude", _as_matrix(model.body_quat[a]), _as_matrix(scene.body_quat[b])
    if name != OBJECT:
        yield "mass", model.body_mass[a], scene.body_mass[b]
        yield "centre of mass", model.body_ipos[a], scene.body_ipos[b]
        # Axes of inertia are not unique, the tensor is.
        yield "inertia", _read_inertia(model, a), _read_inertia(scene, b)


def _name_body(model: mujoco.MjModel, body: int) -> str:
    return str(model.body(int(body)).name)


def _read_inertia(model: mujoco.MjModel, body: int) -> Array:
    """Return the body's tensor of inertia (3, 3) about its centre of mass, in its own axes."""
    R = _as_matrix(model.body_iquat[body])
    return R @ np.diag(model.body_inertia[body]) @ R.T


def _compare_joint(model: mujoco.MjModel, scene: mujoco.MjModel, name: str) -> Compared:
    a, b = model.joint(name).id, scene.joint(name).id
    yield "body", _name_body(model, model.jnt_bodyid[a]), _name_body(scene, scene.jnt_bodyid[b])
    for key in JOINT:
        yield key, getattr(model, f"jnt_{key}")[a], getattr(scene, f"jnt_{key}")[b]
    for key in DOF:
        arrays = getattr(model, f"dof_{key}"), getattr(scene, f"dof_{key}")
        yield key, arrays[0][model.dof_jntid == a], arrays[1][scene.dof_jntid == b]
    for key in ("qpos0", "qpos_spring"):
        yield key, _read_qpos(model, a, key), _read_qpos(scene, b, key)


def _read_qpos(model: mujoco.MjModel, joint: int, key: str) -> Array:
    """Return the joint's part of an array over qpos."""
    start = model.jnt_qposadr[joint]
    count = 7 if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE else 1
    return np.asarray(getattr(model, key)[start : start + count])


def _compare_geom(model: mujoco.MjModel, scene: mujoco.MjModel, name: str) -> Compared:
    a, b = model.geom(name).id, scene.geom(name).id
    if not (scene.geom_contype[b] or scene.geom_conaffinity[b]):
        return
    yield "body", _name_body(model, model.geom_bodyid[a]), _name_body(scene, scene.geom_bodyid[b])
    # Which shape the object has, and where, is the problem's to say.
    if name != f"{OBJECT}surface":
        yield "type", model.geom_type[a], scene.geom_type[b]
        yield "position", model.geom_pos[a], scene.geom_pos[b]
        yield "size", model.geom_size[a], scene.geom_size[b]
        yield "attitude", _as_matrix(model.geom_quat[a]), _as_matrix(scene.geom_quat[b])


def _compare_site(model: mujoco.MjModel, scene: mujoco.MjModel, name: str) -> Compared:
    a, b = model.site(name).id, scene.site(name).id
    yield "body", _name_body(model, model.site_bodyid[a]), _name_body(scene, scene.site_bodyid[b])
    yield "position", model.site_pos[a], scene.site_pos[b]
    yield "attitude", _as_matrix(model.site_quat[a]), _as_matrix(scene.site_quat[b])


def _compare_actuator(model: mujoco.MjModel, scene: mujoco.MjModel, name: str) -> Compared:
    a, b = model.actuator(name).id, scene.actuator(name).id
    yield "target", model.actuator_trnid[a], scene.actuator_trnid[b]
    for key in ACTUATOR:
        yield key, getattr(model, f"actuator_{key}")[a], getattr(scene, f"actuator_{key}")[b]


_COMPARISONS: dict[str, Callable[[mujoco.MjModel, mujoco.MjModel, str], Compared]] = {
    "body": _compare_body,
    "joint": _compare_joint,
    "geom": _compare_geom,
    "site": _compare_site,
    "actuator": _compare_actuator,
}


def _find_shared(model: mujoco.MjModel, scene: mujoco.MjModel, kind: str) -> list[str]:
    """Return the names that both have, of sites the fingertips' alone, for the others are marks."""
    count = {"body": "nbody", "joint": "njnt", "geom": "ngeom", "site": "nsite", "actuator": "nu"}[kind]
    names, known = ([getattr(m, kind)(i).name for i in range(getattr(m, count))] for m in (scene, model))
    shared = [name for name in names if name and name in known]
    return [name for name in shared if kind != "site" or name.endswith("/tip_center")]


def _as_matrix(quat: Array) -> Array:
    """Return the rotation matrix (3, 3) of a quaternion, the same for it and its negative."""
    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, np.asarray(quat, dtype=np.float64))
    return flat.reshape(3, 3)


def _differs(value: Any, expected: Any) -> bool:
    """Return whether two names differ, or two arrays by more than the digits of a model text."""
    if isinstance(expected, str):
        return bool(value != expected)
    value, expected = np.asarray(value, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    scale = max(float(np.abs(expected).max(initial=0.0)), 1e-9)
    return value.shape != expected.shape or not np.abs(value - expected).max(initial=0.0) <= TOLERANCE * scale


def _spell(value: Any) -> str:
    """Return a name or an array in a few characters."""
    if isinstance(value, str):
        return repr(value)
    array = np.asarray(value, dtype=np.float64).ravel()
    told = ", ".join(f"{x:.6g}" for x in array[:4]) + (", ..." if array.size > 4 else "")
    return told if array.size == 1 else f"[{told}]"
