"""A finger as a chain of hinges: poses, Jacobians and inverse kinematics of many configurations at once.

mink follows one configuration; the planner asks about thousands.  This module is the batched form it needs, in numpy, and
is checked against the compiled MuJoCo model.  Poses are world poses X_WF of the fingertip frame F: origin at the centre of
the tip's sphere, z towards its pole.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array, cross_all, hat, read_only

IK_DAMPING = 1e-4
IK_MAX_STEP = 0.35


@dataclass(frozen=True, eq=False)
class Chain:
    """An open chain of J hinges.

    ``offsets`` (J, 4, 4) are the poses of each joint frame in the one before at zero angle (the first in the world),
    ``axes`` (J, 3) the unit hinge axes in their joint frames, ``X_JF`` (4, 4) the fingertip in the last joint frame,
    ``lower`` and ``upper`` (J,) the joint limits [rad].
    """

    offsets: Array
    axes: Array
    X_JF: Array
    lower: Array
    upper: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("offsets", "axes", "X_JF", "lower", "upper"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @cached_property
    def turns(self) -> Array:
        """Constant factors (J, 3, 9) of the hinges' turns, one beside the other.

        By Rodrigues' formula the turn of joint j in the frame before is ``T[:, :3] + sin(q) T[:, 3:6] + (1 - cos(q)) T[:, 6:]``.
        """
        K = hat(self.axes)
        R = self.offsets[:, :3, :3]
        return read_only(np.concatenate([R, R @ K, R @ K @ K], axis=2))

    @property
    def n_joints(self) -> int:
        """Number of hinges J."""
        return len(self.axes)

    @cached_property
    def has_tip_roll(self) -> bool:
        """Whether the last hinge turns the tip about its own pole, so that spin about the pole is that joint's angle."""
        axis_F = self.X_JF[:3, :3].T @ self.axes[-1]
        arm = np.cross(self.axes[-1], self.X_JF[:3, 3])
        return bool(abs(abs(axis_F[2]) - 1.0) < 1e-9 and np.linalg.norm(arm) < 1e-9)

    @cached_property
    def roll_sign(self) -> float:
        """+1 where the last hinge turns the tip positively about its pole, -1 where negatively."""
        return float(np.sign(self.X_JF[:3, 2] @ self.axes[-1]))


class _Walk(NamedTuple):
    """Tip rotations (N, 3, 3), tip positions (N, 3), hinge axes (N, J, 3) and hinge positions (N, J, 3), in W."""

    R: Array
    p: Array
    axes: Array
    origins: Array


def _walk(chain: Chain, q: Array) -> _Walk:
    """Return where tip and hinges are at joint angles ``q`` (N, J) [rad]."""
    n = len(q)
    # Of all rotations the rows, one under the other: plain products with constants instead of n small ones.
    R, p = np.tile(np.eye(3), (n, 1)), np.zeros((n, 3))
    axes, origins = np.empty((n, chain.n_joints, 3)), np.empty((n, chain.n_joints, 3))
    sine, rest = np.repeat(np.sin(q), 3, axis=0), np.repeat(1.0 - np.cos(q), 3, axis=0)
    for j, T in enumerate(chain.turns):
        p = p + (R @ chain.offsets[j, :3, 3]).reshape(n, 3)
        origins[:, j] = p
        turned = R @ T
        axes[:, j] = (turned[:, :3] @ chain.axes[j]).reshape(n, 3)
        R = turned[:, :3] + sine[:, j, None] * turned[:, 3:6] + rest[:, j, None] * turned[:, 6:]
    R3 = R.reshape(n, 3, 3)
    return _Walk(R3 @ chain.X_JF[:3, :3], p + R3 @ chain.X_JF[:3, 3], axes, origins)


def compute_tip_pose(chain: Chain, q: ArrayLike) -> Array:
    """Return X_WF (..., 4, 4) at joint angles ``q`` (..., J) [rad]."""
    q = np.asarray(q, dtype=np.float64)
    R, p, _, _ = _walk(chain, q.reshape(-1, chain.n_joints))
    X = np.zeros((len(p), 4, 4))
    X[:, :3, :3], X[:, :3, 3], X[:, 3, 3] = R, p, 1.0
    return X.reshape(*q.shape[:-1], 4, 4)


def compute_hinge_positions(chain: Chain, q: Array) -> Array:
    """Return where the hinges are (N, J, 3) [m] in W at joint angles ``q`` (N, J) [rad]."""
    return _walk(chain, q).origins


def compute_tip_jacobian(chain: Chain, q: ArrayLike) -> Array:
    """Return the tip Jacobians (..., 6, J) at ``q`` (..., J): twist (v, w) of the tip's centre in world axes per joint rate."""
    q = np.asarray(q, dtype=np.float64)
    _, p, axes, origins = _walk(chain, q.reshape(-1, chain.n_joints))
    J = _jacobian(p, axes, origins)
    return J.reshape(*q.shape[:-1], 6, chain.n_joints)


def compute_tip_motion(chain: Chain, q: Array) -> tuple[Array, Array]:
    """Return X_WF (N, 4, 4) and the tip Jacobians (N, 6, J) at ``q`` (N, J), in the time of one of them."""
    R, p, axes, origins = _walk(chain, q)
    X = np.zeros((len(p), 4, 4))
    X[:, :3, :3], X[:, :3, 3], X[:, 3, 3] = R, p, 1.0
    return X, _jacobian(p, axes, origins)


def _jacobian(p: Array, axes: Array, origins: Array) -> Array:
    linear = cross_all(axes, p[:, None, :] - origins)
    return np.concatenate([linear, axes], axis=-1).swapaxes(-1, -2)


def _rotation_error(R: Array, R_goal: Array) -> Array:
    """Return rotation vectors (N, 3) in W that turn R into R_goal, well behaved up to half a turn."""
    E = R_goal @ R.swapaxes(-1, -2)
    w = np.stack([E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]], axis=-1)
    sine = 0.5 * np.linalg.norm(w, axis=-1)
    cosine = 0.5 * (np.trace(E, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sine, cosine)
    return w * np.where(sine > 1e-9, 0.5 * angle / np.maximum(sine, 1e-9), 0.5)[:, None]


def solve_ik(
    chain: Chain, X_WF: Array, q_start: Array, *, iterations: int = 20, tolerance: float = 1e-7
) -> tuple[Array, NDArray[np.bool_]]:
    """Return joint angles (N, J) that bring the tip to the poses ``X_WF`` (N, 4, 4), and which were reached (N,).

    Damped Newton steps from ``q_start`` (N, J), so the answer continues from there; the length of a step is bounded.
    Joint limits are not enforced: judge the answer with :func:`compute_joint_margin`.  ``tolerance`` is in metres and
    radians together.
    """
    q = np.array(q_start, dtype=np.float64)
    reached = np.zeros(len(q), dtype=bool)
    active = np.arange(len(q))
    for _ in range(iterations + 1):
        R, p, axes, origins = _walk(chain, q[active])
        error = np.concatenate([X_WF[active, :3, 3] - p, _rotation_error(R, X_WF[active, :3, :3])], axis=-1)
        done = np.abs(error).max(axis=-1) < tolerance
        reached[active[done]] = True
        active = active[~done]
        if not len(active):
            break
        J = _jacobian(p[~done], axes[~done], origins[~done])
        e = error[~done][..., None]
        # Lengths are scaled so that a radian and 60 mm weigh the same in the damping.
        J[:, :3] /= 0.06
        e[:, :3] /= 0.06
        JT = J.swapaxes(-1, -2)
        damping = IK_DAMPING * np.minimum(1.0, (e**2).sum(axis=1))[..., None] + 1e-12
        step = np.linalg.solve(JT @ J + damping * np.eye(chain.n_joints), JT @ e)[..., 0]
        longest = np.abs(step).max(axis=-1, keepdims=True)
        q[active] += step * np.minimum(1.0, IK_MAX_STEP / np.maximum(longest, 1e-12))
    return q, reached


def wrap_to_limits(chain: Chain, q: Array) -> Array:
    """Return ``q`` (..., J) with whole turns added so that each angle is as near as can be to the middle of its range."""
    middle = 0.5 * (chain.lower + chain.upper)
    return q - 2.0 * np.pi * np.round((q - middle) / (2.0 * np.pi))


def compute_joint_margin(chain: Chain, q: Array) -> Array:
    """Return the smallest distance (...) [rad] of the joint angles ``q`` (..., J) to their limits; negative beyond them."""
    margin: Array = np.minimum(q - chain.lower, chain.upper - q).min(axis=-1)
    return margin


def compute_dexterity(chain: Chain, q: Array) -> Array:
    """Return the smallest singular value (...) of the tip Jacobian at ``q`` (..., J), lengths in units of 60 mm.

    Zero at a singular configuration, where some tip motion would need infinite joint rates.
    """
    J = np.array(compute_tip_jacobian(chain, q))
    J[..., :3, :] /= 0.06
    return np.asarray(np.linalg.svd(J, compute_uv=False)[..., -1], dtype=np.float64)


def wrap_near(q: Array, q_near: Array) -> Array:
    """Return ``q`` with whole turns added so that each angle is within half a turn of ``q_near``."""
    return q - 2.0 * np.pi * np.round((q - q_near) / (2.0 * np.pi))
