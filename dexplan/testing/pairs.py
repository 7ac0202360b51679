"""Several contacts of one pair as one: a wrench about the centre of pressure, and the motion there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dexplan.spatial import Array
from dexplan.testing.cones import compute_pyramid_drift
from dexplan.testing.rows import AT_BORDER, ContactRows, PairRows

PRESSES = 1e-12
"""Normal force [N] below which a contact does not press; MuJoCo's are exactly zero there."""


def sum_pairs(rows: ContactRows, party_count: int, *, is_elliptic: bool) -> PairRows:
    """Return ``rows`` summed per (sample, on, by); the contacts' cones are elliptic, or they are pyramids."""
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
    held = add(holds)
    carried = held[inverse]
    holding = np.divide(holds, carried, out=np.zeros_like(holds), where=carried > 0.0)
    slip, roll, creep = rows.slip[pressing], rows.roll[pressing], rows.creep[pressing]
    net = add(force_W)
    shared = np.einsum("nji,nj->ni", R_WC, share[:, None] * net[inverse])
    drift = np.zeros((len(pressing), 2)) if is_elliptic else compute_pyramid_drift(rows, pressing, shared)
    with np.errstate(invalid="ignore", divide="ignore"):
        return PairRows(
            sample=keys // party_count**2,
            on=keys // party_count % party_count,
            by=keys % party_count,
            count=np.bincount(inverse, minlength=count),
            dim=widest,
            point_W=point,
            normal_W=direction / np.linalg.norm(direction, axis=1, keepdims=True),
            force_W=net,
            moment_W=add(moment_W),
            normal_force=total,
            slip_W=mean(np.einsum("nij,nj->ni", R_WC[:, :, :2], slip[:, :2])),
            spin=mean(rows.spin[pressing]),
            roll_W=mean(np.einsum("nij,nj->ni", R_WC[:, :, :2], roll)),
            utilisation=np.where(weight > 0.0, used / weight, np.nan),
            penetration=deepest,
            creep_W=add(holding[:, None] * np.einsum("nij,nj->ni", R_WC[:, :, :2], creep[:, :2])),
            creep_spin=add(holding * creep[:, 2]),
            held=held,
            net_creep_W=mean(np.einsum("nij,nj->ni", R_WC[:, :, :2], drift)),
        )
