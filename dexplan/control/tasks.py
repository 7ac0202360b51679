"""Our mink task and limit.  Both write what they answer into arrays of their own, anew at every question."""

from __future__ import annotations

import math

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array

_POSITIVE, _NEGATIVE = np.array([7, 2, 3]), np.array([5, 6, 1])
"""The entries of a flat rotation matrix whose differences are twice the sine times the axis."""


class FingertipTask(mink.Task):
    """All fingertips at given world poses, as one stacked task: 6 rows (position [m], rotation [rad]) per finger.

    One task for the whole hand costs a fraction of one `mink.FrameTask` per finger, whose bookkeeping per frame outweighs
    its arithmetic at 250 Hz.  The error is linear in the world frame: exact in the limit of small steps, which control ticks
    are.  ``rotation_length`` [m] makes a radian of error comparable to a metre.
    """

    def __init__(self, sites: NDArray[np.intp], n_joints: int, rotation_length: float = 0.05) -> None:
        count = len(sites)
        cost = np.tile([1.0, 1.0, 1.0, *[rotation_length] * 3], count) / rotation_length
        super().__init__(cost=cost)
        self._sites = sites
        self._target_p = np.zeros((count, 3))
        self._target_R = np.tile(np.eye(3), (count, 1, 1))
        self._p, self._R = np.empty((count, 3)), np.empty((count, 9))
        self._turn, self._error = np.empty((count, 3, 3)), np.empty((count, 6))
        self._sines = np.empty((count, 3))
        self._jacobian = J = np.zeros((6 * count, n_joints))
        self._rows = [(J[6 * k : 6 * k + 3], J[6 * k + 3 : 6 * k + 6], site) for k, site in enumerate(sites)]
        self._column = self.cost[:, None]
        self._weighted_J, self._weighted_error = np.empty_like(J), np.empty(6 * count)

    def set_targets(self, X_WF: Array) -> None:
        """Aim at the fingertip poses (F, 4, 4)."""
        self._target_p = X_WF[:, :3, 3]
        self._target_R = X_WF[:, :3, :3].swapaxes(1, 2)

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """Return (6 F,): current minus target, position then rotation vector, in world axes."""
        data, error, turn = configuration.data, self._error, self._turn
        data.site_xpos.take(self._sites, axis=0, out=self._p, mode="clip")
        data.site_xmat.take(self._sites, axis=0, out=self._R, mode="clip")
        np.subtract(self._p, self._target_p, out=error[:, :3])
        # First order in the rotation error; its third-order remainder is far below a microradian per tick.
        np.matmul(self._R.reshape(-1, 3, 3), self._target_R, out=turn)
        flat = turn.reshape(-1, 9)
        np.subtract(flat[:, _POSITIVE], flat[:, _NEGATIVE], out=self._sines)
        np.multiply(self._sines, 0.5, out=error[:, 3:])
        return error.ravel()

    def compute_distance(self, configuration: mink.Configuration) -> float:
        """Return the largest distance [m] of a fingertip's centre from where it is aimed at."""
        found = configuration.data.site_xpos.take(self._sites, axis=0).tolist()
        return max(map(math.dist, found, self._target_p.tolist()))

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """Return the stacked tip Jacobians (6 F, nv) at the tips' centres, world axes."""
        model, data = configuration.model, configuration.data
        for linear, angular, site in self._rows:
            mujoco.mj_jacSite(model, data, linear, angular, site)
        return self._jacobian

    def compute_qp_residual(self, configuration: mink.Configuration) -> tuple[Array, Array, float]:
        """Return Jacobian (6 F, nv) and error (6 F,) times the cost, the error with its sign turned round, and no damping."""
        np.multiply(self.compute_error(configuration), -self.gain, out=self._weighted_error)
        self._weighted_error *= self.cost
        np.multiply(self.compute_jacobian(configuration), self._column, out=self._weighted_J)
        return self._weighted_J, self._weighted_error, 0.0


class JointLimit(mink.Limit):
    """Joint ranges and joint speeds as one pair of rows per joint, whichever of the two is nearer.

    The same bounds as `mink.ConfigurationLimit` with `mink.VelocityLimit`, in half the rows: the QP is solved at every tick.
    """

    def __init__(self, lower: Array, upper: Array, speed: float, gain: float = 0.95) -> None:
        self._lower, self._upper = lower, upper
        self._speed, self._gain = speed, gain
        eye, count = np.eye(len(lower)), len(lower)
        self._h = np.empty(2 * count)
        self._to_upper, self._to_lower = self._h[:count], self._h[count:]
        self._constraint = mink.Constraint(G=np.vstack([eye, -eye]), h=self._h)

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Return the rows ``G dq <= h`` for a step of ``dt`` [s] from the current posture."""
        q = configuration.data.qpos
        np.subtract(self._upper, q, out=self._to_upper)
        np.subtract(q, self._lower, out=self._to_lower)
        self._h *= self._gain
        np.minimum(self._h, self._speed * dt, out=self._h)
        return self._constraint
