"""Inverse kinematics of a fingertip that points: where its centre is and along what its pole looks, at any spin.

A contact asks no more of a finger whose last joint turns the tip about its pole.  Numbers of questions are answered at once, at a
fraction of the cost of full poses; fingers that differ only in where they stand share one call.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dexplan.kinematics.chain import IK_DAMPING, IK_MAX_STEP, Chain
from dexplan.spatial import Array, hat

LENGTH = 0.06
"""A radian weighs as much as this distance [m]."""
_LOST = 0.3


def move_to_base(chain: Chain, positions: Array, poles: Array) -> tuple[Array, Array]:
    """Return ``positions`` and ``poles`` (N, 3), given in W, in the frame of the chain's first joint."""
    R, p = chain.offsets[0][:3, :3], chain.offsets[0][:3, 3]
    return (positions - p) @ R, poles @ R


@lru_cache(maxsize=256)
def can_point(chain: Chain) -> bool:
    """Return whether :func:`solve_pointing` serves a chain: six joints, the last of which spins the tip about its pole."""
    return chain.n_joints == 6 and chain.has_tip_roll


@lru_cache(maxsize=256)
def is_same_finger(one: Chain, other: Chain) -> bool:
    """Return whether two chains differ at most in where they stand, and in joint limits."""
    return one is other or (
        one.n_joints == other.n_joints
        and np.allclose(one.offsets[1:], other.offsets[1:], rtol=0.0, atol=1e-12)
        and np.allclose(one.axes, other.axes, rtol=0.0, atol=1e-12)
        and np.allclose(one.X_JF, other.X_JF, rtol=0.0, atol=1e-12)
    )


class PointingAnswer(NamedTuple):
    """Postures ``q`` (N, J) [rad], whether each is what was asked for (N,), and their dexterity (N,)."""

    q: Array
    is_reached: NDArray[np.bool_]
    dexterity: Array


def solve_pointing(
    chain: Chain,
    positions: Array,
    poles: Array,
    q_start: Array,
    *,
    iterations: int = 12,
    tolerance: float | Array = 1e-4,
    is_asked: NDArray[np.bool_] | None = None,
) -> PointingAnswer:
    """Return postures whose tips are at ``positions`` (N, 3) [m] with ``poles`` (N, 3).

    Both in the frame of the chain's first joint.  For chains that :func:`can_point`: the spin is left as it comes out.  Newton
    steps from ``q_start`` (N, J), one more after the error (radians, and metres in units of ``LENGTH``) has fallen below
    ``tolerance``, one or (N,): what is then left is its square.  The dexterity, the smallest singular value of the tip's
    Jacobian, is that of the posture before this last step, and zero where ``is_asked`` (N,) says that nobody asks.
    """
    q = np.array(q_start, dtype=np.float64)
    tolerance = np.broadcast_to(tolerance, len(q))
    reached, dexterity = np.zeros(len(q), dtype=bool), np.zeros(len(q))
    active = np.arange(len(q))
    for step in range(iterations):
        z, p, J = _walk(chain, q[active])
        goal = poles[active]
        error = np.empty((len(active), 6))
        error[:, :3] = (positions[active] - p) / LENGTH
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            error[:, 3 + k] = z[:, m] * goal[:, n] - z[:, n] * goal[:, m]
        size = np.abs(error).max(axis=1)
        done = (size < tolerance[active]) & ((z * goal).sum(axis=1) > 0.0)
        try:
            # The last joint takes up whatever spin the others bring about.
            move = np.linalg.solve(J, error[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # some posture is exactly singular
            JT = J.swapaxes(1, 2)
            move = np.linalg.solve(JT @ J + IK_DAMPING * np.eye(6), JT @ error[:, :, None])[:, :, 0]
        longest = np.abs(move).max(axis=1, keepdims=True)
        q[active] += move * np.minimum(1.0, IK_MAX_STEP / np.maximum(longest, 1e-12))
        if done.any():
            rows = active[done]
            reached[rows] = True
            if is_asked is not None:
                done_asked = done & is_asked[active]
                rows = active[done_asked]
            else:
                done_asked = done
            squares = np.linalg.eigvalsh(J[done_asked] @ J[done_asked].swapaxes(1, 2))
            dexterity[rows] = np.sqrt(np.maximum(squares[:, 0], 0.0))
        # What is far off half way is not reached by Newton steps.
        going = ~done & (size < _LOST) if step == iterations // 2 else ~done
        active = active[going]
        if not len(active):
            break
    return PointingAnswer(q, reached, dexterity)


class _Pointed(NamedTuple):
    """Poles ``z`` (N, 3), tip centres ``p`` (N, 3) [m], in the base frame, and Jacobians (N, 6, J), lengths in ``LENGTH``."""

    z: Array
    p: Array
    J: Array


def _walk(chain: Chain, q: Array) -> _Pointed:
    """Return where tips are and point at joint angles ``q`` (N, J) [rad]."""
    count, joints = q.shape
    # Columns of the rotation, each (3, N): joint frames keep their z along the hinge, so that a turn mixes two columns.
    A = np.empty((3, 3, count))
    A[:] = np.eye(3)[:, :, None]
    p = np.zeros((3, count))
    axes, arms = np.empty((joints, 3, count)), np.empty((joints, 3, count))
    cosine, sine = np.cos(q.T), np.sin(q.T)
    for j, step in enumerate(_align(chain)):
        # Three rows turn the frame, the fourth carries its origin along.
        moved = (step @ A.reshape(3, -1)).reshape(4, 3, count)
        p += moved[3]
        if j < joints:
            c, s = cosine[j], sine[j]
            A = moved[:3]
            turned = c * A[0] + s * A[1]
            A[1] = c * A[1] - s * A[0]
            A[0] = turned
            axes[j], arms[j] = A[2], p
    np.subtract(p, arms, out=arms)
    arms /= LENGTH
    J = np.empty((count, 6, joints))
    J[:, 3:] = axes.transpose(2, 1, 0)
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        J[:, k] = (axes[:, m] * arms[:, n] - axes[:, n] * arms[:, m]).T
    return _Pointed(moved[2].T, p.T, J)


@lru_cache(maxsize=64)
def _align(chain: Chain) -> tuple[Array, ...]:
    """Return each joint frame, z along its hinge, in the one before: axes and origin as rows (4, 3); the tip's comes last."""
    steps, undo = [], np.eye(3)
    for j, axis in enumerate(chain.axes):
        offset, turn = chain.offsets[j] if j else np.eye(4), _turn_to(axis)
        steps.append(np.vstack([(undo @ offset[:3, :3] @ turn).T, undo @ offset[:3, 3]]))
        undo = turn.T
    steps.append(np.vstack([(undo @ chain.X_JF[:3, :3]).T, undo @ chain.X_JF[:3, 3]]))
    return tuple(steps)


def _turn_to(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is the unit ``axis`` (3,)."""
    v = np.cross([0.0, 0.0, 1.0], axis)
    c = float(axis[2])
    if c < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    K = hat(v)
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + c))
