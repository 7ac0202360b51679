"""Do two soft contacts hold an object?  Written down once more, apart from the planner's pairs, loads and force program.

Two soft contacts exert eight numbers, and six of them balance a wrench.  The two that are left, how hard the pair squeezes and
how it shares torsion, are looked through on a grid that is refined around its best point.  All cones are the exact ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.kinematics.chain import compute_tip_jacobian
from dexplan.kinematics.finger import FingerDescription
from dexplan.spatial import Array, lock_arrays

LEVER = 0.1
"""A joint torque over this length [m] reads as a force."""
_SQUEEZES, _TWISTS = 9, 13
"""Points of the first grid: mean normal forces, and shares of torsion."""
_ZOOMS = 5
"""Refinements of the grid, each half as wide."""


@dataclass(frozen=True, eq=False)
class PairLimits:
    """What contacts may give: ``friction``, normal forces from ``floor`` to ``ceiling`` [N]."""

    friction: SoftFinger
    floor: float
    ceiling: float

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class PairTorques:
    """What N pairs' forces ask of joints, J per finger.

    ``maps`` (N, 2, J, 4): joint torques [N m] per unit of (f_t1, f_t2, f_n, tau_n) on the object; ``bias`` (N, 2, J) [N m] the
    fingers' own weight; ``limits`` (2, J) or (N, 2, J) [N m] what may be used of the servos.
    """

    maps: Array
    bias: Array
    limits: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def is_closed(points: Array, normals: Array, angle: float) -> Array:
    """Return which pairs are force closed: the line between both points lies inside both friction cones [Nguyen 1988].

    ``points`` (N, 2, 3) [m], outward unit ``normals`` (N, 2, 3), cones of half ``angle`` [rad].
    """
    line = points[:, 1] - points[:, 0]
    line = line / np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-12)
    along = np.stack([-np.sum(line * normals[:, 0], axis=1), np.sum(line * normals[:, 1], axis=1)])
    return np.asarray(along.min(axis=0) > np.cos(angle))


def build_frames_into(normals: Array) -> Array:
    """Return contact frames (N, 3, 3) with z into the object, against the outward unit ``normals`` (N, 3)."""
    z = -normals
    # The axis that z has least of is never along it.
    least = np.eye(3)[np.abs(z).argmin(axis=1)]
    x = np.cross(least, z)
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def map_to_joints(finger: FingerDescription, q: Array, X_WF: Array, point_W: Array, frame_W: Array) -> Array:
    """Return the joint torques (J, 4) that exert (f_t1, f_t2, f_n, tau_n) on the object at ``point_W`` (3,) [m].

    ``q`` (J,) [rad] with the tip at ``X_WF`` (4, 4); ``frame_W`` (3, 3) as of :func:`build_frames_into`.
    """
    J = compute_tip_jacobian(finger.chain, q)
    wrench = np.zeros((6, 4))
    wrench[:3, :3] = frame_W
    wrench[3:, :3] = np.cross(point_W - X_WF[:3, 3], frame_W, axis=0)
    wrench[3:, 3] = frame_W[:, 2]
    return np.asarray(J.T @ wrench)


def measure_spare(
    arms: Array, frames: Array, wrench: Array, limits: PairLimits, torques: PairTorques | None = None
) -> Array:
    """Return the force (N,) [N] that pairs have to spare while they exert ``wrench`` (6,) on the object; below 0 they cannot.

    That is the least of: normal force beyond what friction needs, beyond the floor, below the ceiling, and, where ``torques`` are
    given, joint torque left over :data:`LEVER`.  The best is not looked for once all pairs are known to hold.

    Args:
        arms: contact points (N, 2, 3) [m] from the point about which ``wrench`` counts, in W.
        frames: contact frames (N, 2, 3, 3) in W, z into the object.
        wrench: force and torque (6,) [N, N m] in W.
        limits: friction and normal forces.
        torques: what the forces ask of the joints; None where that is not looked at.
    """
    count = len(arms)
    if not count:
        return np.zeros(0)
    friction = limits.friction
    capacity = np.array([friction.sliding, friction.sliding, 1.0, friction.torsional])
    G = np.zeros((count, 6, 8))
    for k in range(2):
        own = slice(4 * k, 4 * k + 3)
        G[:, :3, own] = frames[:, k]
        G[:, 3:, own] = np.cross(arms[:, k, :, None], frames[:, k], axis=1)
        G[:, 3:, 4 * k + 3] = frames[:, k, :, 2]
    # Friction counts in shares of what it can give; torque over the arms' length, as large as force.
    length = max(float(np.linalg.norm(arms, axis=2).mean()), 1e-3)
    G = G * np.tile(capacity, 2)
    G[:, 3:] /= length
    right = np.concatenate([wrench[:3], wrench[3:] / length])
    left, values, rows = np.linalg.svd(G)
    is_regular = values[:, -1] > 1e-6 * values[:, 0]
    inverse = np.where(is_regular[:, None], 1.0 / np.maximum(values, 1e-12), 0.0)
    fixed = np.einsum("nrk,nr->nk", rows[:, :6], inverse * np.einsum("nkr,k->nr", left, right))
    free = rows[:, 6:].swapaxes(1, 2)
    # The first free direction raises the mean normal force by one newton, the second leaves it.
    rise = 0.5 * (free[:, 2] + free[:, 6])
    size = np.maximum(np.linalg.norm(rise, axis=1), 1e-9)
    squeeze = np.einsum("nkz,nz->nk", free, rise / size[:, None] ** 2)
    twist = np.einsum("nkz,nz->nk", free, np.stack([-rise[:, 1], rise[:, 0]], axis=1) / size[:, None])
    mean = 0.5 * (fixed[:, 2] + fixed[:, 6])

    def spare(m: Array, t: Array) -> Array:
        y = fixed[:, None] + (m - mean[:, None])[..., None] * squeeze[:, None] + t[..., None] * twist[:, None]
        y = y.reshape(*m.shape, 2, 4)
        normal = y[..., 2]
        shear = np.sqrt(y[..., 0] ** 2 + y[..., 1] ** 2 + y[..., 3] ** 2)
        least = np.minimum(normal - shear, np.minimum(normal - limits.floor, limits.ceiling - normal))
        least = least.min(axis=-1)
        if torques is not None:
            asked = torques.bias[:, None] + np.einsum("ncji,nzci->nzcj", torques.maps, y * capacity)
            room = np.broadcast_to(torques.limits, torques.bias.shape)[:, None] - np.abs(asked)
            least = np.minimum(least, room.min(axis=(-1, -2)) / LEVER)
        return np.asarray(least)

    wide = 2.0 * limits.ceiling
    m, t = np.meshgrid(
        np.linspace(limits.floor, limits.ceiling, _SQUEEZES), np.linspace(-wide, wide, _TWISTS)
    )
    m, t = (np.tile(v.ravel(), (count, 1)) for v in (m, t))
    step = np.array([(limits.ceiling - limits.floor) / (_SQUEEZES - 1), 2.0 * wide / (_TWISTS - 1)])
    near_m, near_t = (
        v.ravel() for v in np.meshgrid([-1.0, -0.5, 0.0, 0.5, 1.0], [-1.0, -0.5, 0.0, 0.5, 1.0])
    )
    each = np.arange(count)
    best = np.full(count, -np.inf)
    for _ in range(1 + _ZOOMS):
        found = spare(m, t)
        top = found.argmax(axis=1)
        best = np.maximum(best, found[each, top])
        if best.min() >= 0.0:
            break
        m, t = m[each, top, None] + step[0] * near_m, t[each, top, None] + step[1] * near_t
        step = 0.5 * step
    return np.where(is_regular, best, -np.inf)
