"""Fingers standing on the object, pressing with wanted forces, in static equilibrium and without a controller.

An experiment must show what contacts can bear, not what a controller can save.  So each servo gets one command that is
worked out beforehand and never corrected: the posture it stands in, plus what gravity and the wanted contact forces ask of it,

    ctrl = q + (gravity torque + J^T f) / kp.

The world starts at rest with each tip as deep in the object as its wanted normal force presses it.  If the wanted forces lie
inside the friction cones, this is an equilibrium of the whole hand; if they do not, nothing holds it.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import NORMAL
from dexplan.grasp.grasp import map_contact
from dexplan.kinematics.chain import (
    Chain,
    compute_joint_margin,
    compute_tip_jacobian,
    compute_tip_pose,
    solve_ik,
    wrap_to_limits,
)
from dexplan.scene.scene import Scene
from dexplan.scene.touch import compute_static_normal_force
from dexplan.spatial import Array, build_frame, make_pose, read_only, rotate_about

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
JOINT_MARGIN = 0.05
"""Room to the joint limits [rad] that a posture must leave."""
FIRST_DEPTH = 2e-4
CLEARANCE = 2e-3
"""Whatever is not to touch stays this far away [m]."""
TILTS_DEG = (12.5, 25.0, 37.5, 50.0, 62.5)
"""How far the tip's pole may stand off the contact: the line of force can then pass near the wrist."""


@dataclass(frozen=True, eq=False)
class Stance:
    """A hand that stands on the object.

    ``fingers`` (N,) are those that touch, in the order in which their forces are stacked; ``q`` (F, J) [rad] the posture of
    all; ``bias`` (F, J) [N m] what gravity asks of the joints; ``torque_maps`` (N, J, 4) the joint torques per unit of each
    contact's (f_t1, f_t2, f_n, tau); ``state`` is MuJoCo's integration state at the start.
    """

    scene: Scene
    fingers: tuple[int, ...]
    q: Array
    bias: Array
    torque_maps: Array
    state: Array

    __repr__ = brief_repr

    def compute_torques(self, forces: Array) -> Array:
        """Return joint torques (..., F, J) [N m] that press with ``forces`` (..., N, 4) and carry the fingers' own weight."""
        torques = np.broadcast_to(self.bias, (*forces.shape[:-2], *self.bias.shape)).copy()
        for k, finger in enumerate(self.fingers):
            torques[..., finger, :] += forces[..., k, :] @ self.torque_maps[k].T
        return torques

    def compute_command(self, forces: Array) -> Array:
        """Return servo commands (..., nu) [rad] that press with ``forces`` (..., N, 4)."""
        gain = np.stack([finger.servo_gain for finger in self.scene.fingers])
        wanted = self.q + self.compute_torques(forces) / gain
        command = np.zeros((*forces.shape[:-2], self.scene.model.nu))
        command[..., self.scene.actuators] = wanted
        return command

    def compute_torque_share(self, forces: Array) -> float:
        """Return the largest share of its limit that any servo needs for ``forces`` (..., N, 4)."""
        limit = np.stack([finger.torque_limit for finger in self.scene.fingers])
        return float((np.abs(self.compute_torques(forces)) / limit).max())


def solve_stance(scene: Scene, directions: Mapping[int, Array], forces: Array) -> Stance | None:
    """Return fingers standing on the object at home, or None where one cannot.

    ``directions`` gives per finger that touches the outward unit direction (3,) of its contact from the object's centre, in
    W; ``forces`` (M, N, 4) the sets of contact forces on the object, in the frames of
    :func:`dexplan.grasp.grasp.contact_on_sphere`, that it must be able to press with: the world starts with the first set,
    and of the postures that reach a contact the one is taken that needs the least share of its servos' torque for all sets.
    """
    fingers = tuple(directions)
    radius = _object_radius(scene)
    X_WO = scene.object.X_WO_home
    q = np.stack([finger.q_home for finger in scene.fingers])
    for k, i in enumerate(fingers):
        # Those that are still to be placed will not stay at home.
        waiting = set(fingers[k + 1 :])
        for candidate in _rank_postures(scene, i, directions[i], forces[:, k]):
            q[i] = candidate
            if _stands_clear(scene, q, waiting):
                break
        else:
            return None
    data = mujoco.MjData(scene.model)
    depth = np.full(len(fingers), FIRST_DEPTH)
    tips = [compute_tip_pose(scene.fingers[i].chain, q[i]) for i in fingers]
    for _ in range(8):
        for k, i in enumerate(fingers):
            tip = scene.fingers[i]
            target = tips[k].copy()
            target[:3, 3] = X_WO[:3, 3] + (radius + tip.tip_radius - depth[k]) * directions[i]
            q[i] = solve_ik(tip.chain, target[None], q[i][None], tolerance=1e-11)[0][0]
        data.qpos[:] = scene.as_qpos(q, X_WO)
        mujoco.mj_forward(scene.model, data)
        static = np.array([compute_static_normal_force(scene, data, i) for i in fingers])
        wanted = forces[0, :, NORMAL]
        if (static <= 0.0).any() or (wanted <= 0.0).any():
            return None
        if np.abs(static / wanted - 1.0).max() < 1e-7:
            break
        depth *= wanted / static
    maps = []
    for k, i in enumerate(fingers):
        tip = scene.fingers[i]
        middle = radius - 0.5 * depth[k]  # where MuJoCo puts the contact: halfway into the overlap
        offset = -(tip.tip_radius - 0.5 * depth[k]) * directions[i]
        maps.append(map_contact(compute_tip_jacobian(tip.chain, q[i]), middle * directions[i], offset)[1])
    state = np.zeros(mujoco.mj_stateSize(scene.model, STATE))
    mujoco.mj_getState(scene.model, data, state, STATE)
    bias = data.qfrc_bias[scene.joint_dof]
    return Stance(scene, fingers, read_only(q), read_only(bias), read_only(maps), read_only(state))


def _object_radius(scene: Scene) -> float:
    return float(np.linalg.norm(scene.object.surface.radial(np.array([1.0, 0.0, 0.0]))))


def _rank_postures(scene: Scene, finger: int, direction: Array, forces: Array) -> Array:
    """Return postures (K, J) that touch at ``direction``, those first that need the least torque for ``forces`` (M, 4)."""
    tip = scene.fingers[finger]
    distance = _object_radius(scene) + tip.tip_radius
    center = scene.object.X_WO_home[:3, 3] + distance * direction
    q = _reach(tip.chain, tip.q_home, center, direction)
    jacobians = compute_tip_jacobian(tip.chain, q)
    # On the object: R f, and the torque about the tip's centre of a force at the contact, plus torsion about the normal.
    R = build_frame(-direction)
    pushes = forces[:, :3] @ R.T
    turns = np.cross(-tip.tip_radius * direction, pushes) + forces[:, 3:] * R[:, 2]
    torques = np.einsum("nij,mi->nmj", jacobians, np.concatenate([pushes, turns], axis=1))
    share = (np.abs(torques) / tip.torque_limit).max(axis=(1, 2))
    ranked: Array = q[np.argsort(share)]
    return ranked


def _stands_clear(scene: Scene, q: Array, waiting: set[int]) -> bool:
    """Whether at ``q`` (F, J) only fingertips are near the object, and no finger near another, but for those ``waiting``."""
    model, owner = _widen(scene)
    data = mujoco.MjData(model)
    data.qpos[:] = scene.as_qpos(q, scene.object.X_WO_home)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    tips = set(scene.tip_geoms.tolist())
    for first, second in data.contact.geom.tolist() if data.ncon else ():
        if {owner[first], owner[second]} & waiting:
            continue
        is_touch = scene.object_geom in (first, second) and {first, second} & tips
        if not is_touch:
            return False
    return True


@lru_cache(maxsize=8)
def _widen(scene: Scene) -> tuple[mujoco.MjModel, tuple[int, ...]]:
    """Return the world with every geom reaching out, so that collisions are near misses; and the finger of each geom or -1."""
    model = copy.deepcopy(scene.model)
    model.geom_margin[:] = CLEARANCE
    names = [model.geom(g).name for g in range(model.ngeom)]
    owner = tuple(
        next((i for i, f in enumerate(scene.fingers) if name.startswith(f"{f.name}/")), -1) for name in names
    )
    return model, owner


def _reach(chain: Chain, start: Array, center: Array, direction: Array) -> Array:
    """Return postures (K, J) with the tip's centre in place and its pole up to 62.5 degrees off the contact."""
    R = build_frame(-direction)
    frames = [R]
    for tilt in np.radians(TILTS_DEG):
        for way in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
            axis = np.cos(way) * R[:, 0] + np.sin(way) * R[:, 1]
            frames.append(build_frame(rotate_about(axis, tilt) @ R[:, 2]))
    targets = np.stack([make_pose(frame, center) for frame in frames])
    starts = np.broadcast_to(start, (len(targets), len(start)))
    q, reached = solve_ik(chain, targets, starts, iterations=30, tolerance=1e-6)
    q = wrap_to_limits(chain, q)
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    fits: Array = q[reached & (compute_joint_margin(chain, q) > JOINT_MARGIN)]
    return fits
