"""A compiled scene: the model, the ids everything else needs, and the descriptions read back from the compiled model.

Descriptions are read from the model rather than kept beside it, so there is one truth about lengths, limits and masses.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.contact.shapes import Sphere
from dexplan.errors import DexplanError
from dexplan.scene.chain import Chain, solve_ik, wrap_to_limits
from dexplan.scene.compose import build_model_xml
from dexplan.scene.description import FingerDescription, ObjectDescription, SceneParameters
from dexplan.spatial import Array, as_pose, build_frame, invert_pose, make_pose

HOME_GAP = 0.025
"""At home each fingertip points at the object from this far off its surface [m]."""


@dataclass(frozen=True, eq=False)
class Scene:
    """One hand around one object.

    ``xml`` is the text the ``model`` was compiled from.  Index arrays have one row per finger: ``joint_qpos``, ``joint_dof``,
    ``actuators`` (F, J), ``tip_geoms``, ``tip_sites`` (F,).  ``object_qpos`` and ``object_dof`` are the first addresses of
    the object's free joint, ``object_geom`` and ``object_body`` its ids.
    """

    name: str
    xml: str
    model: mujoco.MjModel
    fingers: tuple[FingerDescription, ...]
    object: ObjectDescription
    joint_qpos: NDArray[np.intp]
    joint_dof: NDArray[np.intp]
    actuators: NDArray[np.intp]
    tip_geoms: NDArray[np.intp]
    tip_sites: NDArray[np.intp]
    object_qpos: int
    object_dof: int
    object_geom: int
    object_body: int

    @property
    def n_fingers(self) -> int:
        """Number of fingers F."""
        return len(self.fingers)

    def as_qpos(self, q: Array, X_WO: Array) -> Array:
        """Return the model's qpos (nq,) for joint angles ``q`` (F, J) and the object at ``X_WO`` (4, 4)."""
        qpos = np.zeros(self.model.nq)
        qpos[self.joint_qpos] = q
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(X_WO[:3, :3]).ravel())
        qpos[self.object_qpos : self.object_qpos + 7] = [*X_WO[:3, 3], *quat]
        return qpos


def build_scene(parameters: SceneParameters) -> Scene:
    """Compose the model text, compile it and describe what came out.  Raises DexplanError where a finger cannot reach home."""
    return scene_from_xml(parameters.scene, build_model_xml(parameters))


def scene_from_xml(name: str, xml: str) -> Scene:
    """Return the scene described by a model text whose parts carry the names used in ``models/``."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    finger_names = [
        model.geom(g).name[:-4] for g in range(model.ngeom) if model.geom(g).name.endswith("/tip")
    ]
    object_joint = model.joint("object/free/")
    object_geom = model.geom("object/surface").id
    surface = Sphere(_read_radius(model, "object/surface"))
    object_body = int(model.geom_bodyid[object_geom])
    _check_object(model, object_geom, object_body)
    home = as_pose(model.qpos0[object_joint.qposadr[0] : object_joint.qposadr[0] + 7])
    description = ObjectDescription(
        surface, float(model.body_mass[object_body]), np.diag(model.body_inertia[object_body]), home
    )
    joints = [_finger_joints(model, f) for f in finger_names]
    actuators = [
        [int(np.flatnonzero(model.actuator_trnid[:, 0] == j)[0]) for j in finger] for finger in joints
    ]
    fingers = [
        _describe_finger(model, data, f, j, a, home, surface.radius)
        for f, j, a in zip(finger_names, joints, actuators, strict=True)
    ]
    return Scene(
        name=name,
        xml=xml,
        model=model,
        fingers=tuple(fingers),
        object=description,
        joint_qpos=model.jnt_qposadr[np.array(joints)].astype(np.intp),
        joint_dof=model.jnt_dofadr[np.array(joints)].astype(np.intp),
        actuators=np.array(actuators, dtype=np.intp),
        tip_geoms=np.array([model.geom(f"{f}/tip").id for f in finger_names], dtype=np.intp),
        tip_sites=np.array([model.site(f"{f}/tip_center").id for f in finger_names], dtype=np.intp),
        object_qpos=int(object_joint.qposadr[0]),
        object_dof=int(object_joint.dofadr[0]),
        object_geom=int(object_geom),
        object_body=object_body,
    )


def _read_radius(model: mujoco.MjModel, name: str) -> float:
    """Return the radius [m] of a geom that has to be a sphere; raises DexplanError where it is none."""
    geom = model.geom(name)
    kind = mujoco.mjtGeom(int(geom.type[0]))
    if kind != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise DexplanError(
            f"geom {name!r} is of type {kind.name.removeprefix('mjGEOM_').lower()}; objects and fingertips are described as "
            'balls so far, and type="sphere" is accepted'
        )
    return float(geom.size[0])


def _check_object(model: mujoco.MjModel, geom: int, body: int) -> None:
    """Raise DexplanError where the object is not described by one radius, its mass and a diagonal inertia about its centre."""
    count = int(model.body_geomnum[body])
    if count != 1:
        raise DexplanError(f"the object consists of {count} geoms; one, named 'object/surface', is accepted")
    for what, offset in (("surface", model.geom_pos[geom]), ("centre of mass", model.body_ipos[body])):
        if np.any(offset):
            raise DexplanError(
                f"the object's {what} is {offset.tolist()} m from the origin of its body; no offset is accepted"
            )


def _finger_joints(model: mujoco.MjModel, finger: str) -> list[int]:
    return [j for j in range(model.njnt) if model.joint(j).name.startswith(f"{finger}/")]


def _describe_finger(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    name: str,
    joints: list[int],
    actuators: list[int],
    X_WO: Array,
    object_radius: float,
) -> FingerDescription:
    """Read the finger's chain off the zero pose of the compiled model, and solve for its home posture."""
    frames = [make_pose(data.xmat[model.jnt_bodyid[j]].reshape(3, 3), data.xanchor[j]) for j in joints]
    site = model.site(f"{name}/tip_center").id
    X_WF = make_pose(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])
    before = [np.eye(4), *frames[:-1]]
    chain = Chain(
        offsets=np.stack([invert_pose(a) @ b for a, b in zip(before, frames, strict=True)]),
        axes=np.stack([model.jnt_axis[j] for j in joints]),
        X_JF=invert_pose(frames[-1]) @ X_WF,
        lower=model.jnt_range[joints, 0],
        upper=model.jnt_range[joints, 1],
    )
    tip_radius = _read_radius(model, f"{name}/tip")
    return FingerDescription(
        name=name,
        joint_names=tuple(model.joint(j).name for j in joints),
        tip_radius=tip_radius,
        chain=chain,
        torque_limit=model.actuator_forcerange[actuators, 1],
        servo_gain=model.actuator_gainprm[actuators, 0],
        servo_damping=-model.actuator_biasprm[actuators, 2],
        q_home=_solve_home(name, chain, frames[0][:3, 3], X_WO[:3, 3], object_radius + tip_radius + HOME_GAP),
    )


def _solve_home(name: str, chain: Chain, base: Array, center: Array, distance: float) -> Array:
    """Return the posture with the tip on the line from the object's centre to the base, pointing at the object.

    Of the answers that Newton's method finds from a fixed set of starts, the one deepest inside the joint limits; spin about
    the pole is put to the middle of its range where the last hinge is that spin.
    """
    outward = np.array([*(base - center)[:2], 0.0])
    outward /= np.linalg.norm(outward)
    X_WF = make_pose(build_frame(-outward), center + distance * outward)
    starts = np.random.default_rng(0).uniform(chain.lower, chain.upper, (256, chain.n_joints))
    q, reached = solve_ik(chain, np.broadcast_to(X_WF, (256, 4, 4)), starts, iterations=60)
    q = wrap_to_limits(chain, q)
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    room = np.minimum(q - chain.lower, chain.upper - q)
    # Elbow and wrist answers with the same room differ in posture; least motion from the middle decides between them.
    score = np.where(
        reached, room.min(axis=1) - 0.05 * np.abs(q - 0.5 * (chain.lower + chain.upper)).sum(axis=1), -np.inf
    )
    best = int(np.argmax(np.round(score, 6)))
    if not reached[best] or room[best].min() < -1e-6:
        raise DexplanError(
            f"{name} cannot point at the object from home: its joint ranges leave no posture with the tip "
            f"{1e3 * distance:.0f} mm from the object's centre; widen them, move the base, or use a smaller object"
        )
    return np.clip(q[best], chain.lower, chain.upper)
