"""What the validator knows of a model: names, ids and sizes, found by name in the compiled text."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.errors import RunFolderError
from dexplan.spatial import Array

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class World:
    """Names, ids and sizes of a model in dexplan's naming: fingers ``<name>/tip``, object ``object/surface``.

    Per finger (F,): ``tip_geoms``, ``tip_sites``, ``tip_radius`` [m], ``base_position`` (F, 3) [m, W].
    ``geom_finger`` (ngeom,) is the finger a geom belongs to or -1.  Hinges (J,): ``joint_names``,
    ``joint_qpos``, ``joint_range`` (J, 2) [rad]. Servos (nu,): ``actuator_names``, ``torque_limit`` [N m].
    ``object_radius`` [m] is NaN unless object and tips are spheres; ``home_pose`` (7,) is the object's at
    qpos0; ``timestep`` [s].
    """

    model: mujoco.MjModel
    fingers: tuple[str, ...]
    tip_geoms: Indices
    tip_sites: Indices
    tip_radius: Array
    base_position: Array
    geom_names: tuple[str, ...]
    geom_finger: Indices
    joint_names: tuple[str, ...]
    joint_qpos: Indices
    joint_range: Array
    actuator_names: tuple[str, ...]
    torque_limit: Array
    object_geom: int
    object_body: int
    object_qpos: int
    object_radius: float
    object_mass: float
    home_pose: Array
    timestep: float

    __repr__ = brief_repr


@lru_cache(maxsize=1)
def read_world(model_xml: str) -> World:
    """Compile ``model_xml`` and find its fingers and object by name; RunFolderError where that fails.

    The last one is kept, since one judgement asks twice: nobody may write to the model.
    """
    accepted = "a model text as dexplan writes it is needed"
    try:
        model = mujoco.MjModel.from_xml_string(model_xml)
    except ValueError as error:
        raise RunFolderError("model.xml", f"MuJoCo cannot compile it ({error})", accepted) from error
    geom_names = tuple(model.geom(g).name or f"geom {g} without a name" for g in range(model.ngeom))
    joint_names = tuple(model.joint(j).name for j in range(model.njnt))
    fingers = tuple(name.removesuffix("/tip") for name in geom_names if name.endswith("/tip"))
    if not fingers or "object/surface" not in geom_names or "object/free/" not in joint_names:
        raise RunFolderError("model.xml", "it lacks fingertips or the free object", accepted)
    if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "floor") < 0:
        raise RunFolderError("model.xml", "it lacks the floor", accepted)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    tips = np.array([model.geom(f"{name}/tip").id for name in fingers])
    sites = np.array([_site_id(model, f"{name}/tip_center") for name in fingers])
    ball = int(model.geom("object/surface").id)
    owner = np.full(model.ngeom, -1)
    for k, name in enumerate(fingers):
        owner[[g for g, geom in enumerate(geom_names) if geom.startswith(f"{name}/")]] = k
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    unlimited = np.tile([-np.inf, np.inf], (len(hinges), 1))
    limited = model.jnt_limited[hinges].astype(bool)
    are_spheres = bool(np.all(model.geom_type[[ball, *tips]] == mujoco.mjtGeom.mjGEOM_SPHERE))
    address = int(model.joint("object/free/").qposadr[0])
    return World(
        model=model,
        fingers=fingers,
        tip_geoms=tips,
        tip_sites=sites,
        tip_radius=model.geom_size[tips, 0].copy(),
        base_position=np.array([_base_position(data, name) for name in fingers]),
        geom_names=geom_names,
        geom_finger=owner,
        joint_names=tuple(joint_names[j] for j in hinges),
        joint_qpos=model.jnt_qposadr[hinges].astype(np.intp),
        joint_range=np.where(limited[:, None], model.jnt_range[hinges], unlimited),
        actuator_names=tuple(model.actuator(a).name for a in range(model.nu)),
        torque_limit=np.where(
            model.actuator_forcelimited, np.abs(model.actuator_forcerange).min(axis=1), np.inf
        ),
        object_geom=ball,
        object_body=int(model.geom_bodyid[ball]),
        object_qpos=address,
        object_radius=float(model.geom_size[ball, 0]) if are_spheres else float("nan"),
        object_mass=float(model.body_mass[model.geom_bodyid[ball]]),
        home_pose=model.qpos0[address : address + 7].copy(),
        timestep=float(model.opt.timestep),
    )


def _site_id(model: mujoco.MjModel, name: str) -> int:
    """Return the id of site ``name``; RunFolderError where the model has none."""
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, name)
    if index < 0:
        raise RunFolderError("model.xml", f"it lacks the site {name}", "each fingertip needs its tip_center")
    return int(index)


def _base_position(data: mujoco.MjData, finger: str) -> Array:
    """Return where the finger's root body stands (3,) [m, W]."""
    index = mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_BODY, f"{finger}/")
    if index < 0:
        raise RunFolderError(
            "model.xml", f"it lacks the body {finger}/", "each finger hangs from a body of its own name"
        )
    return data.xpos[index].copy()
