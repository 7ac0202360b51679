"""Our mink task.  It writes what it answers into arrays of its own, anew at every question."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from dexplan.control.hand import read_poses
from dexplan.control.poses import IDENTITY, Pose, multiply, transpose
from dexplan.spatial import Array


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
        self._targets: Sequence[Pose] = [IDENTITY] * count
        self._jacobian = J = np.zeros((6 * count, n_joints))
        self._rows = [(J[6 * k : 6 * k + 3], J[6 * k + 3 : 6 * k + 6], site) for k, site in enumerate(sites)]
        self._weight, self._column = self.gain * self.cost, self.cost[:, None]
        self._weighted_J, self._weighted_error = np.empty_like(J), np.empty(6 * count)

    def set_targets(self, targets: Sequence[Pose]) -> None:
        """Aim at the fingertip poses X_WF."""
        self._targets = targets

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """Return (6 F,): current minus target, position then rotation vector, in world axes."""
        data = configuration.data
        error: list[float] = []
        for found, target in zip(
            read_poses(data.site_xmat, data.site_xpos, self._sites), self._targets, strict=True
        ):
            (x, y, z), (u, v, w) = found.p, target.p
            _, xy, xz, yx, _, yz, zx, zy, _ = multiply(found.R, transpose(target.R))
            # First order in the rotation error; its third-order remainder is far below a microradian per tick.
            error += (x - u, y - v, z - w, 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy))
        return np.array(error)

    def compute_distance(self, configuration: mink.Configuration) -> float:
        """Return the largest distance [m] of a fingertip's centre from where it is aimed at."""
        found = configuration.data.site_xpos.take(self._sites, axis=0).tolist()
        return max(math.dist(p, target.p) for p, target in zip(found, self._targets, strict=True))

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """Return the stacked tip Jacobians (6 F, nv) at the tips' centres, world axes."""
        model, data = configuration.model, configuration.data
        for linear, angular, site in self._rows:
            mujoco.mj_jacSite(model, data, linear, angular, site)
        return self._jacobian

    def write_objective(self, configuration: mink.Configuration, H: Array, c: Array, damping: float) -> None:
        """Write H (nv, nv) and c (nv,) of the objective ``1/2 dq' H dq + c' dq``, as `mink.build_ik` makes it of this task."""
        np.multiply(self.compute_error(configuration), self._weight, out=self._weighted_error)
        W = np.multiply(self.compute_jacobian(configuration), self._column, out=self._weighted_J)
        np.dot(W.T, W, out=H)
        diagonal = H.reshape(-1)[:: len(c) + 1]
        diagonal += damping
        np.dot(self._weighted_error, W, out=c)
