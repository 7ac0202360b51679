"""The hand's own model, without the object, and what the controller computes with it about its own body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.control.poses import IDENTITY, Pose
from dexplan.scene.scene import Scene
from dexplan.spatial import Array


@dataclass(frozen=True, eq=False)
class HandBody:
    """The model of a scene's hand alone; the same joints in the same order, but no object.

    qpos and qvel are the joints alone, finger by finger: reshaped to (F, J) they are postures.  ``sites`` (F,) are the
    fingertips'; ``lower`` and ``upper`` (F, J) the joint limits [rad].
    """

    model: mujoco.MjModel
    sites: NDArray[np.intp]
    lower: Array
    upper: Array

    __repr__ = brief_repr


@lru_cache(maxsize=4)
def build_hand_body(scene: Scene) -> HandBody:
    """Return the hand of ``scene``, compiled once; nobody may write to its model.

    Raises ValueError for a hand with other joints than those of its fingers, or in another order than theirs.
    """
    spec = mujoco.MjSpec.from_string(scene.xml)
    spec.delete(spec.body("object/"))
    model = spec.compile()
    joints = [model.joint(name).id for finger in scene.fingers for name in finger.joint_names]
    if joints != list(range(model.nq)):
        raise ValueError(
            f"the fingers' joints are at {joints} of {model.nq}; all of them, finger by finger, are accepted"
        )
    return HandBody(
        model,
        np.array([model.site(f"{f.name}/tip_center").id for f in scene.fingers]),
        np.stack([f.chain.lower for f in scene.fingers]),
        np.stack([f.chain.upper for f in scene.fingers]),
    )


def read_poses(xmat: Array, xpos: Array, rows: NDArray[np.intp]) -> list[Pose]:
    """Return the poses of ``rows`` (K,) of MuJoCo's arrays of rotations (N, 9) and positions (N, 3)."""
    rotations, positions = xmat.take(rows, axis=0).tolist(), xpos.take(rows, axis=0).tolist()
    return [Pose(R, p) for R, p in zip(rotations, positions, strict=True)]


class MeasuredHand:
    """What the hand's model says at the measured posture; arrays are written anew by every :meth:`measure`.

    ``tips`` are the fingertips' poses X_WF; ``bias`` (F, J) [N m] torques that gravity and velocities ask for; ``qpos`` (nq,) the
    model's.
    """

    def __init__(self, body: HandBody) -> None:
        self._model, self._sites = body.model, body.sites
        self._data = data = mink.Configuration(body.model).data
        count, (nv,) = len(body.sites), data.qvel.shape
        self._shape = shape = body.lower.shape
        self.qpos = data.qpos
        self._q, self._qdot = data.qpos.reshape(shape), data.qvel.reshape(shape)
        self._site_xmat, self._site_xpos = data.site_xmat, data.site_xpos
        self._flat_bias, self._flat, self._inertial = np.zeros(nv), np.zeros(nv), np.zeros(nv)
        self.bias = self._flat_bias.reshape(shape)
        self._damping = body.model.dof_damping.reshape(shape)
        self._tips = body.model.site_bodyid[body.sites].tolist()
        self._jacobians = np.zeros((count, 2, 3, nv))
        self._rows = [
            (J[0], J[1], site) for J, site in zip(self._jacobians, body.sites.tolist(), strict=True)
        ]
        self.tips = [IDENTITY] * count

    def measure(self, q: Array, qdot: Array) -> None:
        """Take over the posture and velocity (F, J) of the joints."""
        model, data = self._model, self._data
        self._q[:], self._qdot[:] = q, qdot
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, self._flat_bias)
        self.tips = read_poses(self._site_xmat, self._site_xpos, self._sites)

    def compute_jacobians(self, rows: Sequence[int]) -> Array:
        """Return the Jacobians (K, 2, 3, J), for position and rotation, of the centres of the tips ``rows`` in world axes, each
        for its finger's own joints.
        """
        for i in rows:
            linear, angular, site = self._rows[i]
            mujoco.mj_jacSite(self._model, self._data, linear, angular, site)
        joints = self._shape[1]
        return np.array([self._jacobians[i, :, :, i * joints : (i + 1) * joints] for i in rows])

    def compute_push_torque(self, rows: Sequence[int], pushes: Array, points: Array) -> Array:
        """Return the joint torques (F, J) [N m] with which the K tips ``rows`` push: forces and moments ``pushes`` (K, 2, 3)
        [N, N m] at ``points`` (K, 3) [m], in world axes.
        """
        self._flat[:] = 0.0
        for i, (force, moment), point in zip(rows, pushes, points, strict=True):
            mujoco.mj_applyFT(self._model, self._data, force, moment, point, self._tips[i], self._flat)
        return self._flat.reshape(self._shape).copy()

    def compute_motion_torque(self, qdot: Array, acceleration: Array) -> Array:
        """Return the joint torques (F, J) that a motion takes at this posture: its inertia and the joints' own damping."""
        self._flat[:] = acceleration.reshape(-1)
        mujoco.mj_crb(self._model, self._data)
        mujoco.mj_mulM(self._model, self._data, self._inertial, self._flat)
        return self._inertial.reshape(self._shape) + self._damping * qdot
