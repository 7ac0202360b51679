"""Our mink task and limit."""

from __future__ import annotations

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array


class FingertipTask(mink.Task):
    """All fingertips at given world poses, as one stacked task: 6 rows (position [m], rotation [rad]) per finger.

    One task for the whole hand costs a fraction of one `mink.FrameTask` per finger, whose bookkeeping per frame outweighs
    its arithmetic at 250 Hz.  The error is linear in the world frame: exact in the limit of small steps, which control ticks
    are.  ``rotation_length`` [m] makes a radian of error comparable to a metre.
    """

    def __init__(self, sites: NDArray[np.intp], n_joints: int, rotation_length: float = 0.05) -> None:
        cost = np.tile([1.0, 1.0, 1.0, *[rotation_length] * 3], len(sites)) / rotation_length
        super().__init__(cost=cost)
        self._sites = sites
        self._target_p = np.zeros((len(sites), 3))
        self._target_R = np.tile(np.eye(3), (len(sites), 1, 1))
        self._jacobian = np.zeros((6 * len(sites), n_joints))

    def set_targets(self, X_WF: Array) -> None:
        """Aim at the fingertip poses (F, 4, 4)."""
        self._target_p = X_WF[:, :3, 3]
        self._target_R = X_WF[:, :3, :3]

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """Return (6 F,): current minus target, position then rotation vector, in world axes."""
        data = configuration.data
        R = data.site_xmat[self._sites].reshape(-1, 3, 3)
        E = R @ self._target_R.swapaxes(1, 2)
        error = np.empty((len(self._sites), 6))
        error[:, :3] = data.site_xpos[self._sites] - self._target_p
        # First order in the rotation error; its third-order remainder is far below a microradian per tick.
        error[:, 3] = 0.5 * (E[:, 2, 1] - E[:, 1, 2])
        error[:, 4] = 0.5 * (E[:, 0, 2] - E[:, 2, 0])
        error[:, 5] = 0.5 * (E[:, 1, 0] - E[:, 0, 1])
        return error.ravel()

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """Return the stacked tip Jacobians (6 F, nv) at the tips' centres, world axes."""
        for k, site in enumerate(self._sites):
            block = self._jacobian[6 * k : 6 * k + 6]
            mujoco.mj_jacSite(configuration.model, configuration.data, block[:3], block[3:], site)
        return self._jacobian


class JointLimit(mink.Limit):
    """Joint ranges and joint speeds as one pair of rows per joint, whichever of the two is nearer.

    The same bounds as `mink.ConfigurationLimit` with `mink.VelocityLimit`, in half the rows: the QP is solved at every tick.
    """

    def __init__(self, lower: Array, upper: Array, speed: float, gain: float = 0.95) -> None:
        self._lower, self._upper = lower, upper
        self._speed, self._gain = speed, gain
        eye = np.eye(len(lower))
        self._rows = np.vstack([eye, -eye])

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Return the rows ``G dq <= h`` for a step of ``dt`` [s] from the current posture."""
        q, step = configuration.q, self._speed * dt
        h = np.concatenate([self._upper - q, q - self._lower])
        return mink.Constraint(G=self._rows, h=np.minimum(self._gain * h, step))
