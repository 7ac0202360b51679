"""Several contacts of one pair as one: a wrench about the centre of pressure, and the motion there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.rows import ContactRows, PairRows

PRESSES = 1e-12
"""Normal force [N] below which a contact does not press; MuJoCo's are exactly zero there."""
AT_BORDER = 0.99
"""Utilisation from which a contact counts as at the border of its cone.  A sliding one is at 1 to the solver's tolerance;
one per cent keeps coarse solvers there, and is half of what verdicts may be wrong by."""


def sum_pairs(rows: ContactRows, party_count: int) -> PairRows:
    """Return ``rows`` summed per (sample, on, by)."""
    pressing = np.flatnonzero(rows.force[:, 2] > PRESSES)
    key = (rows.sample[pressing] * party_count + rows.on[pressing]) * party_count + rows.by[pressing]
    keys, inverse = np.unique(key, return_inverse=True)
    count = len(keys)

    def add(values: NDArray) -> Array:
        out = np.zeros((count, *values.shape[1:]))
        np.add.at(out, inverse, values)
        return out

    normal = rows.force[pressing, 2]
    total = add(normal)
    share = normal / total[inverse]

    def mean(values: NDArray) -> Array:
        return add(share.reshape(-1, *[1] * (values.ndim - 1)) * values)

    R_WC = rows.rotation_W[pressing]
    point = mean(rows.point_W[pressing])
    force_W = np.einsum("nij,nj->ni", R_WC, rows.force[pressing])
    arm = rows.point_W[pressing] - point[inverse]
    moment_W = np.einsum("nij,nj->ni", R_WC, rows.moment[pressing]) + np.cross(arm, force_W)
    direction = mean(R_WC[:, :, 2])
    used = rows.utilisation[pressing]
    known = np.isfinite(used)
    weight = add(np.where(known, share, 0.0))
    used = add(np.where(known, share * np.nan_to_num(used), 0.0))
    widest = np.zeros(count, dtype=np.intp)
    np.maximum.at(widest, inverse, rows.dim[pressing])
    deepest = np.full(count, -np.inf)
    np.maximum.at(deepest, inverse, rows.penetration[pressing])
    # Contacts at their border give way to those inside, which alone decide how fast the pair drifts.
    holds = np.where(rows.utilisation[pressing] < AT_BORDER, share, 0.0)
    carried = add(holds)[inverse]
    holding = np.divide(holds, carried, out=np.zeros_like(holds), where=carried > 0.0)
    slip, roll, creep = rows.slip[pressing], rows.roll[pressing], rows.creep[pressing]
    with np.errstate(invalid="ignore", divide="ignore"):
        return PairRows(
            sample=keys // party_count**2,
            on=keys // party_count % party_count,
            by=keys % party_count,
            count=np.bincount(inverse, minlength=count),
            dim=widest,
            point_W=point,
            normal_W=direction / np.linalg.norm(direction, axis=1, keepdims=True),
            force_W=add(force_W),
            moment_W=add(moment_W),
            normal_force=total,
            slip_W=mean(np.einsum("nij,nj->ni", R_WC[:, :, :2], slip[:, :2])),
            spin=mean(rows.spin[pressing]),
            roll_W=mean(np.einsum("nij,nj->ni", R_WC[:, :, :2], roll)),
            utilisation=np.where(weight > 0.0, used / weight, np.nan),
            penetration=deepest,
            creep_W=add(holding[:, None] * np.einsum("nij,nj->ni", R_WC[:, :, :2], creep[:, :2])),
            creep_spin=add(holding * creep[:, 2]),
        )
