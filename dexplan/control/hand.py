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
from dexplan.scene.scene import Scene
from dexplan.spatial import Array


@dataclass(frozen=True, eq=False)
class HandBody:
    """The model of a scene's hand alone; the same joints in the same order, but no object.

    ``joints`` (F, J) are the joints' addresses in qpos and qvel, ``sites`` (F,) the fingertips'; ``lower`` and ``upper`` (F, J)
    the joint limits [rad].
    """

    model: mujoco.MjModel
    joints: NDArray[np.intp]
    sites: NDArray[np.intp]
    lower: Array
    upper: Array

    __repr__ = brief_repr


@lru_cache(maxsize=4)
def build_hand_body(scene: Scene) -> HandBody:
    """Return the hand of ``scene``, compiled once; nobody may write to its model."""
    spec = mujoco.MjSpec.from_string(scene.xml)
    spec.delete(spec.body("object/"))
    model = spec.compile()
    return HandBody(
        model,
        np.array([[model.joint(j).id for j in f.joint_names] for f in scene.fingers]),
        np.array([model.site(f"{f.name}/tip_center").id for f in scene.fingers]),
        np.stack([f.chain.lower for f in scene.fingers]),
        np.stack([f.chain.upper for f in scene.fingers]),
    )


class MeasuredHand:
    """What the hand's model says at the measured posture; arrays are written anew by every :meth:`measure`.

    ``X_WF`` (F, 4, 4) tip poses; ``bias`` (F, J) [N m] torques that gravity and velocities ask for; ``qpos`` (nq,) the model's.
    """

    def __init__(self, body: HandBody) -> None:
        self._model, self._joints, self._sites = body.model, body.joints, body.sites
        self._data = data = mink.Configuration(body.model).data
        count, (nv,) = len(body.sites), data.qvel.shape
        self.qpos, self._qvel = data.qpos, data.qvel
        self._site_xmat, self._site_xpos = data.site_xmat, data.site_xpos
        self._flat_bias, self._flat, self._inertial = np.zeros(nv), np.zeros(nv), np.zeros(nv)
        self._damping = body.model.dof_damping[body.joints]
        self._tips = body.model.site_bodyid[body.sites].tolist()
        self._J = np.zeros((6, nv))
        self.X_WF = np.tile(np.eye(4), (count, 1, 1))
        self.bias = np.zeros(body.joints.shape)

    def measure(self, q: Array, qdot: Array) -> None:
        """Take over the posture and velocity (F, J) of the joints."""
        model, data = self._model, self._data
        self.qpos[self._joints], self._qvel[self._joints] = q, qdot
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, self._flat_bias)
        self.bias = self._flat_bias[self._joints]
        self.X_WF[:, :3, :3] = self._site_xmat[self._sites].reshape(-1, 3, 3)
        self.X_WF[:, :3, 3] = self._site_xpos[self._sites]

    def compute_jacobian(self, finger: int) -> Array:
        """Return the Jacobian (6, J) of the finger's tip's centre in world axes, for its own joints."""
        mujoco.mj_jacSite(self._model, self._data, self._J[:3], self._J[3:], self._sites[finger])
        return self._J[:, self._joints[finger]]

    def compute_push_torque(self, rows: Sequence[int], forces: Array, moments: Array, points: Array) -> Array:
        """Return the joint torques (F, J) [N m] with which the tips ``rows`` push with ``forces`` [N] at ``points`` [m] and twist
        with ``moments`` [N m], one row (3,) each in world axes.
        """
        self._flat[:] = 0.0
        for i, force, moment, point in zip(rows, forces, moments, points, strict=True):
            mujoco.mj_applyFT(self._model, self._data, force, moment, point, self._tips[i], self._flat)
        return self._flat[self._joints]

    def compute_motion_torque(self, qdot: Array, acceleration: Array) -> Array:
        """Return the joint torques (F, J) that a motion takes at this posture: its inertia and the joints' own damping."""
        self._flat[self._joints] = acceleration
        mujoco.mj_crb(self._model, self._data)
        mujoco.mj_mulM(self._model, self._data, self._inertial, self._flat)
        return self._inertial[self._joints] + self._damping * qdot
