"""Which postures of a finger touch which places of a body: landings, for a finger of any number of joints.

The tip's centre has to be at ``p + r n`` for a place p with the outward normal n: three equations.  What more joints leave free
turns the tip's pole towards -n, so that the contact is as near to the pole as it can be; a finger of three joints takes the pole
as it comes, and the landing is kept where the contact lies within the part of the tip that may touch.  Damped Newton steps from
sampled postures, since most fingers have no closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.stats import qmc

from dexplan.brief import brief_repr
from dexplan.kinematics.carry import SINGULAR, Carrier
from dexplan.kinematics.chain import (
    Chain,
    compute_joint_margin,
    compute_tip_jacobian,
    compute_tip_pose,
    wrap_to_limits,
)
from dexplan.spatial import Array, hat, lock_arrays, read_only

SAMPLES = 10
"""Postures that are sampled, as a power of two: more find branches that only a small part of the joints' range leads to."""
SEEDS = 6
"""Sampled postures, the nearest ones, from which each place is tried."""
STEPS = 25
"""Newton steps at most."""
SAME = 0.05
"""Postures that differ by less in every joint are one [rad]."""
_REACHED = 1e-9  # distance of the tip's centre from where it should be [m]
_LONGEST = 0.35  # longest joint step [rad]
_LENGTH = 0.06  # a length of 60 mm counts as one radian, as everywhere in this room


@dataclass(frozen=True, eq=False)
class Landings:
    """N postures ``q`` (N, J) [rad] that touch; ``site`` (N,) is the place that each touches, ``lean`` (N,) [rad] the angle of
    the contact from the tip's pole.  Ordered by site, then by lean.
    """

    site: NDArray[np.intp]
    q: Array
    lean: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def __len__(self) -> int:
        return len(self.site)


def land(carrier: Carrier, points_W: Array, normals_W: Array, near: Array | None = None) -> Landings:
    """Return postures that touch at given places within the carrier's joint margin and polar limit, away from singular ones.

    Args:
        carrier: the finger and its limits.
        points_W: places (S, 3) [m] on the object's surface, world axes.
        normals_W: **outward** unit normals (S, 3) there.
        near: postures (M, J) [rad] to start from, too; where the finger is, say.

    Returns:
        All postures found, none twice; of several branches each.
    """
    chain, count = carrier.chain, len(points_W)
    centers = points_W + carrier.tip_radius * normals_W
    sampled, tips = _sample(chain)
    _, nearest = cKDTree(tips).query(centers, k=SEEDS)
    seeds = sampled[np.reshape(nearest, (count, -1))]
    if near is not None:
        seeds = np.concatenate([seeds, np.broadcast_to(near, (count, *np.shape(near)))], axis=1)
    tried = seeds.shape[1]
    site = np.repeat(np.arange(count), tried)
    q, reached = reach_centers(chain, seeds.reshape(-1, chain.n_joints), centers[site], -normals_W[site])
    q = wrap_to_limits(chain, q)
    pole = compute_tip_pose(chain, q)[:, :3, 2]
    lean = np.arccos(np.clip(-np.sum(pole * normals_W[site], axis=1), -1.0, 1.0))
    J = compute_tip_jacobian(chain, q)
    contact = (J[:, :3] + carrier.tip_radius * hat(normals_W[site]) @ J[:, 3:]) / _LENGTH
    good = reached & (compute_joint_margin(chain, q) >= carrier.joint_margin)
    good &= (lean <= carrier.polar_limit) & (np.linalg.svd(contact, compute_uv=False)[:, -1] >= SINGULAR)
    rows = np.flatnonzero(good)
    rows = rows[np.lexsort((rows, np.round(lean[rows], 6), site[rows]))]
    kept: list[int] = []
    for row in rows:
        same = (k for k in reversed(kept) if site[k] == site[row] and np.abs(q[k] - q[row]).max() < SAME)
        if next(same, None) is None:
            kept.append(int(row))
    return Landings(site[kept], q[kept], lean[kept])


@lru_cache(maxsize=16)
def _sample(chain: Chain) -> tuple[Array, Array]:
    """Return postures (2^SAMPLES, J) spread evenly over the joints' range, always the same, and the tips' places."""
    unit = qmc.Sobol(chain.n_joints, scramble=False).random_base2(SAMPLES)
    q = chain.lower + unit * (chain.upper - chain.lower)
    return read_only(q), read_only(compute_tip_pose(chain, q)[:, :3, 3])


def reach_centers(chain: Chain, q: Array, centers: Array, poles: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return postures (N, J) [rad] with the tips' centres at ``centers`` (N, 3) [m], and which of them were reached (N,).

    Joints beyond the third turn the poles as near to ``poles`` (N, 3) as can be.  Newton steps from ``q`` (N, J); joint limits
    are not looked at.
    """
    q = np.array(q)
    for _ in range(STEPS):
        X = compute_tip_pose(chain, q)
        J = compute_tip_jacobian(chain, q)
        error = (centers - X[:, :3, 3]) / _LENGTH
        rows = J[:, :3] / _LENGTH
        inverse = rows.swapaxes(1, 2) @ np.linalg.inv(rows @ rows.swapaxes(1, 2) + 1e-10 * np.eye(3))
        dq = (inverse @ error[..., None])[..., 0]
        if chain.n_joints > 3:
            # What is left free turns the pole; the spin about it is nobody's.
            free = np.eye(chain.n_joints) - inverse @ rows
            across = hat(X[:, :3, 2])
            wanted = np.cross(X[:, :3, 2], np.cross(X[:, :3, 2], poles))
            turning = -across @ J[:, 3:]
            missing = -wanted - (turning @ dq[..., None])[..., 0]
            dq = dq + (free @ np.linalg.pinv(turning @ free, rcond=1e-3) @ missing[..., None])[..., 0]
        longest = np.abs(dq).max(axis=1, keepdims=True)
        q += dq * np.minimum(1.0, _LONGEST / np.maximum(longest, 1e-12))
    gap = np.linalg.norm(compute_tip_pose(chain, q)[:, :3, 3] - centers, axis=1)
    return q, gap < _REACHED
