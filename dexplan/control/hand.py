"""The hand's own model, without the object, and what the controller computes with it about its own body."""

from __future__ import annotations

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

    ``X_WF`` (F, 4, 4) tip poses; ``J`` (F, 6, J) Jacobians of the tips' centres in world axes, each for its own finger's joints;
    ``bias`` (F, J) [N m] the torques that gravity and velocities ask for; ``qpos`` (nq,) the model's.
    """

    def __init__(self, body: HandBody) -> None:
        self._model, self._joints, self._sites = body.model, body.joints, body.sites
        self._data = data = mink.Configuration(body.model).data
        count, (nv,) = len(body.sites), data.qvel.shape
        self.qpos, self._qvel = data.qpos, data.qvel
        self._site_xmat, self._site_xpos = data.site_xmat, data.site_xpos
        self._flat_bias, self._flat, self._inertial = np.zeros(nv), np.zeros(nv), np.zeros(nv)
        self._damping = body.model.dof_damping[body.joints]
        J = np.zeros((count, 6, nv))
        self._J, self._rows = J, [(J[k, :3], J[k, 3:], site) for k, site in enumerate(body.sites)]
        self._own = (np.arange(count)[:, None, None], np.arange(6)[None, :, None], body.joints[:, None, :])
        self.X_WF = np.tile(np.eye(4), (count, 1, 1))
        self.J, self.bias = self._J[self._own], np.zeros(body.joints.shape)

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
        for linear, angular, site in self._rows:
            mujoco.mj_jacSite(model, data, linear, angular, site)
        self.J = self._J[self._own]

    def compute_motion_torque(self, qdot: Array, acceleration: Array) -> Array:
        """Return the joint torques (F, J) that a motion takes at this posture: its inertia and the joints' own damping."""
        self._flat[self._joints] = acceleration
        mujoco.mj_crb(self._model, self._data)
        mujoco.mj_mulM(self._model, self._data, self._inertial, self._flat)
        return self._inertial[self._joints] + self._damping * qdot
