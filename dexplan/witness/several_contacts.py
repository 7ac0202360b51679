"""Do any number of soft contacts hold an object, each pressed as hard as it has to be?  A cone program, solved by Clarabel.

Three contacts hold wherever two of them do, if the third may be pressed as lightly as one likes.  It may not: a contact that is
in a grasp keeps its least normal force, and what it presses the others have to bear.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from dexplan.spatial import Array
from dexplan.witness.force_audit import load_clarabel
from dexplan.witness.two_contacts import LEVER, PairLimits, PairTorques


def measure_grasp_spare(
    arms: Array, frames: Array, wrench: Array, limits: PairLimits, torques: PairTorques
) -> float:
    """Return the force [N] that K contacts have to spare while they exert ``wrench`` (6,) on the object; below 0 they cannot.

    The same number as of :func:`~dexplan.witness.two_contacts.measure_spare`, for K contacts instead of two and for one grasp
    instead of many; -inf where no forces give the wrench, or where the solver gives up.

    Args:
        arms: contact points (K, 3) [m] from the point about which ``wrench`` counts, in W.
        frames: contact frames (K, 3, 3) in W, z into the object.
        wrench: force and torque (6,) [N, N m] in W.
        limits: friction and normal forces.
        torques: of one grasp: ``maps`` (1, K, J, 4), ``bias`` (1, K, J), ``limits`` (K, J).
    """
    clarabel, count = load_clarabel(), len(arms)
    capacity = np.array([limits.friction.sliding, limits.friction.sliding, 1.0, limits.friction.torsional])
    length = max(float(np.linalg.norm(arms, axis=1).mean()), 1e-3)
    size, per_length = 4 * count + 1, np.repeat([1.0, 1.0 / length], 3)
    equal, rows, bounds, cones = np.zeros((6, size)), list[Array](), list[float](), list[Array]()
    for k in range(count):
        own = slice(4 * k, 4 * k + 4)
        G = np.zeros((6, 4))
        G[:3, :3] = frames[k]
        G[3:, :3] = np.cross(arms[k], frames[k], axis=0)
        G[3:, 3] = frames[k][:, 2]
        equal[:, own] = G * capacity * per_length[:, None]
        room = torques.limits[k]
        joints = torques.maps[0, k] * capacity / LEVER
        normal = np.eye(4)[2]
        # Each row: part . f + spare <= bound.
        for part, bound in (
            (-normal, -limits.floor),
            (normal, limits.ceiling),
            *zip(joints, (room - torques.bias[0, k]) / LEVER, strict=True),
            *zip(-joints, (room + torques.bias[0, k]) / LEVER, strict=True),
        ):
            row = np.zeros(size)
            row[own], row[-1] = part, 1.0
            rows.append(row)
            bounds.append(float(bound))
        cone = np.zeros((4, size))
        cone[0, 4 * k + 2], cone[0, -1] = -1.0, 1.0
        cone[[1, 2, 3], [4 * k, 4 * k + 1, 4 * k + 3]] = -1.0
        cones.append(cone)
    cost = np.zeros(size)
    cost[-1] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    answer = clarabel.DefaultSolver(
        csc_matrix((size, size)),
        cost,
        csc_matrix(np.vstack([equal, *rows, *cones])),
        np.concatenate([wrench * per_length, bounds, np.zeros(4 * count)]),
        [
            clarabel.ZeroConeT(6),
            clarabel.NonnegativeConeT(len(rows)),
            *[clarabel.SecondOrderConeT(4)] * count,
        ],
        settings,
    ).solve()
    return float(answer.x[-1]) if str(answer.status) in ("Solved", "AlmostSolved") else -np.inf
