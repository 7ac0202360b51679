"""A compiled scene: the model, the ids everything else needs, and the descriptions read back from the compiled model.

Descriptions are read from the model rather than kept beside it, so there is one truth about lengths, limits and masses.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.errors import DexplanError
from dexplan.kinematics.chain import (
    Chain,
    compute_hinge_positions,
    compute_tip_pose,
    solve_ik,
    wrap_to_limits,
)
from dexplan.kinematics.finger import FingerDescription
from dexplan.kinematics.land import reach_centers
from dexplan.scene.compose import build_model_xml
from dexplan.scene.description import ObjectDescription, SceneParameters
from dexplan.scene.object_parts import read_object
from dexplan.spatial import Array, as_pose, build_frame, invert_pose, lock_arrays, make_pose, rotate_about

HOME_GAP = 0.025
"""At home each fingertip points at the object from this far off its surface [m]."""
HOME_CLEARANCE = 0.002
"""Distance [m] that a finger at home keeps to itself and the object, where it can."""
PARKING, LOOKED_AT = 4096, 64
"""Postures drawn for a finger that can point at the object from nowhere; so many of the best are asked whether they are clear."""
_FREE = 6  # joints that a tip takes to have any pose
WAITING = tuple(
    sorted(
        product((0.025, 0.012, 0.045, 0.07), (0.0, 25.0, -25.0, 50.0, -50.0), (0.0, 25.0, -25.0, 50.0, 75.0)),
        key=lambda at: (abs(at[1]) + abs(at[2]), abs(at[0] - HOME_GAP)),
    )
)
"""Where else a tip may point at the object from: gap [m], azimuth and elevation from the line to its base [deg]."""


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

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

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
    """Compose the model text, compile it and describe what came out."""
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
    body, properties = read_object(model)
    home = as_pose(model.qpos0[object_joint.qposadr[0] : object_joint.qposadr[0] + 7])
    description = ObjectDescription(body, properties, home)
    joints = [_finger_joints(model, f) for f in finger_names]
    actuators = [
        [int(np.flatnonzero(model.actuator_trnid[:, 0] == j)[0]) for j in finger] for finger in joints
    ]
    fingers = [
        _describe_finger(model, data, f, j, a, home, body)
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
        object_body=int(model.geom_bodyid[object_geom]),
    )


def _read_radius(model: mujoco.MjModel, name: str) -> float:
    """Return the radius [m] of a geom that has to be a sphere; raises DexplanError where it is none."""
    geom = model.geom(name)
    kind = mujoco.mjtGeom(int(geom.type[0]))
    if kind != mujoco.mjtGeom.mjGEOM_SPHERE:
        raise DexplanError(
            f"geom {name!r} is of type {kind.name.removeprefix('mjGEOM_').lower()}; fingertips are balls, and "
            'type="sphere" is accepted'
        )
    return float(geom.size[0])


def _finger_joints(model: mujoco.MjModel, finger: str) -> list[int]:
    return [j for j in range(model.njnt) if model.joint(j).name.startswith(f"{finger}/")]


def _describe_finger(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    name: str,
    joints: list[int],
    actuators: list[int],
    X_WO: Array,
    body: ConvexBody,
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
        q_home=_solve_home(
            chain,
            frames[0][:3, 3],
            X_WO,
            body,
            tip_radius,
            _ClearOfItself(model, name, joints),
        ),
    )


def _solve_home(
    chain: Chain,
    base: Array,
    X_WO: Array,
    body: ConvexBody,
    tip_radius: float,
    is_clear: Callable[[Array], bool],
) -> Array:
    """Return the posture in which a finger waits.

    The tip is on the line from the object's centre to the base, ``HOME_GAP`` beyond what the object reaches, and points at it.  A
    finger whose joints do not allow that, or that would meet itself or the object (``is_clear`` says no), points at the object
    from the first of the ``WAITING`` places where it can; one that can point at it from nowhere is parked.
    """
    center = X_WO[:3, 3]
    outward = np.array([*(base - center)[:2], 0.0])
    if np.linalg.norm(outward) < tip_radius:
        # A base over the object: the finger's own side is where its tip is in the middle of its range.
        middle = compute_tip_pose(chain, 0.5 * (chain.lower + chain.upper))[:3, 3]
        outward = np.array([*(middle - center)[:2], 0.0])
    outward /= np.linalg.norm(outward)
    (reach,) = _measure_extent(body, outward[None] @ X_WO[:3, :3]) + tip_radius
    (home,) = _aim(chain, center, reach + HOME_GAP, outward[None], 256, 60)
    if home is not None and is_clear(home):
        return home
    azimuth, elevation = np.radians([at[1:] for at in WAITING]).T
    flat, up = rotate_about([0.0, 0.0, 1.0], azimuth) @ outward, np.array([0.0, 0.0, 1.0])
    directions = np.cos(elevation)[:, None] * flat + np.sin(elevation)[:, None] * up
    reaches = _measure_extent(body, directions @ X_WO[:3, :3]) + tip_radius
    found = _aim(chain, center, reaches + np.array([at[0] for at in WAITING]), directions, 12, 40)
    for posture in found:
        if posture is not None and is_clear(posture):
            return posture
    named = [posture for posture in (home, *found) if posture is not None]
    return named[0] if named else _park(chain, center, outward, body.bound + tip_radius + HOME_GAP, is_clear)


def _measure_extent(body: ConvexBody, directions: Array) -> Array:
    """Return how far (N,) [m] the object reaches along unit ``directions`` (N, 3) in its axes: a plane so far out clears it."""
    # A ball's is its radius to the last digit, whatever the direction's last digits are.
    return np.round(np.sum(body.support(directions) * directions, axis=-1), 12)


def _aim(
    chain: Chain, center: Array, distance: float | Array, directions: Array, count: int, iterations: int
) -> list[Array | None]:
    """Return postures with the tip ``distance`` [m] from the object's centre along ``directions`` (N, 3), pointing at it, or as
    near to that as fewer than six joints allow.

    None where there is none.  Of the answers that Newton's method finds from a fixed set of ``count`` starts, the one deepest
    inside the joint limits; spin about the pole is put to the middle of its range where the last hinge is that spin.
    """
    X_WF = np.stack([make_pose(build_frame(-d)) for d in directions])
    X_WF[:, :3, 3] = center + np.reshape(distance, (-1, 1)) * directions
    starts = np.random.default_rng(0).uniform(chain.lower, chain.upper, (count, chain.n_joints))
    aims, starts = np.repeat(X_WF, count, axis=0), np.tile(starts, (len(X_WF), 1))
    if chain.n_joints < _FREE:
        q, reached = reach_centers(chain, starts, aims[:, :3, 3], aims[:, :3, 2])
    else:
        q, reached = solve_ik(chain, aims, starts, iterations=iterations)
    q = wrap_to_limits(chain, q)
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    room = np.minimum(q - chain.lower, chain.upper - q).min(axis=1)
    # Elbow and wrist answers with the same room differ in posture; least motion from the middle decides between them.
    middle = 0.5 * (chain.lower + chain.upper)
    score = np.where(reached, room - 0.05 * np.abs(q - middle).sum(axis=1), -np.inf)
    best = np.argmax(np.round(score.reshape(-1, count), 6), axis=1) + count * np.arange(len(X_WF))
    return [
        np.clip(q[k], chain.lower, chain.upper) if reached[k] and room[k] >= -1e-6 else None for k in best
    ]


def _park(
    chain: Chain, center: Array, outward: Array, distance: float, is_clear: Callable[[Array], bool]
) -> Array:
    """Return a posture near the middle of the joint ranges in which the finger is out of the way, as far as there is one.

    Tip and hinges are at least ``distance`` [m] from the object's centre, and the tip within 60 degrees of ``outward`` (3,),
    which is the finger's own side.
    """
    rng, size = np.random.default_rng(0), chain.upper - chain.lower
    drawn = rng.uniform(chain.lower, chain.upper, (PARKING, chain.n_joints))
    q = np.vstack([0.5 * (chain.lower + chain.upper), drawn])
    points = np.concatenate(
        [compute_hinge_positions(chain, q), compute_tip_pose(chain, q)[:, None, :3, 3]], axis=1
    )
    gaps = np.linalg.norm(points - center, axis=2).min(axis=1) - distance
    arm = points[:, -1, :2] - center[:2]
    gaps = np.minimum(gaps, arm @ outward[:2] - 0.5 * np.linalg.norm(arm, axis=1))
    off = np.abs((q - q[0]) / np.maximum(size, 1e-12)).sum(axis=1)
    # Out of the way first, in whole centimetres, then near the middle.
    ranked = q[np.lexsort((off, -np.round(np.minimum(gaps, 0.0), 2)))]
    return np.asarray(next((row for row in ranked[:LOOKED_AT] if is_clear(row)), ranked[0]))


class _ClearOfItself:
    """Answers whether a finger at a posture keeps ``HOME_CLEARANCE`` to itself and the object, whatever else there is."""

    def __init__(self, model: mujoco.MjModel, finger: str, joints: list[int]) -> None:
        self._model = copy.copy(model)
        self._model.geom_margin[:] = self._model.body_margin[:] = HOME_CLEARANCE
        self._data = mujoco.MjData(self._model)
        self._joints = model.jnt_qposadr[joints]
        names = [model.geom(g).name for g in range(model.ngeom)]
        self._own = np.array([name.startswith((f"{finger}/", "object/")) for name in names])

    def __call__(self, q: Array) -> bool:
        self._data.qpos[:] = self._model.qpos0
        self._data.qpos[self._joints] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        near = self._data.contact.dist < HOME_CLEARANCE
        return not bool(self._own[self._data.contact.geom[near]].all(axis=1).any())
