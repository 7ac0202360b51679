"""Following the holding fingers through a motion: where their joints end, and how fast their contacts may be carried."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dexplan.kinematics.chain import compute_tip_jacobian, solve_ik, wrap_near
from dexplan.kinematics.finger import FingerDescription
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, hat


def follow_contact(
    finger: FingerDescription, placement: Placement, roll: TipRoll | None, X_WO: Array, q_start: Array
) -> tuple[Array, float]:
    """Follow one holding finger while the object moves and, with ``roll``, while its tip rolls on the object.

    Args:
        placement: where it holds.
        roll: sampled at the progress of the object poses; None for a fixed contact.
        X_WO: object poses (K, 4, 4) at evenly spaced progress from 0 to 1.
        q_start: the finger's posture (J,) at the first of them.

    Returns:
        The posture (J,) at the end, and the largest tangential part of J d2q/ds2 [m], s the progress: contacts drift in
        proportion to it (``Timing.contact_time``).
    """
    count, chain = len(X_WO), finger.chain
    if roll is None:
        X_OF = np.broadcast_to(placement.X_OF, (count, 4, 4))
        normals = np.broadcast_to(placement.normal_O, (count, 3))
    else:
        rows = [roll.sample(s) for s in np.linspace(0.0, 1.0, count)]
        X_OF, normals = np.stack([X for X, _ in rows]), np.stack([n for _, n in rows])
    X_WF = X_WO @ X_OF
    q = np.empty((count, chain.n_joints))
    q[0] = q_start
    for k in range(1, count):
        guess = 2.0 * q[k - 1] - q[k - 2] if k > 1 else q[0]
        solved, _ = solve_ik(chain, X_WF[k][None], guess[None])
        q[k] = wrap_near(solved[0], guess)
    bend = np.gradient(np.gradient(q, axis=0), axis=0) * (count - 1) ** 2
    J = compute_tip_jacobian(chain, q)
    n_W = np.einsum("kij,kj->ki", X_WO[:, :3, :3], normals)
    # A rolling contact is another point of the tip at every instant; a fixed one is judged at the tip's centre.
    arm = np.zeros_like(n_W) if roll is None else -finger.tip_radius * n_W
    push = np.einsum("kij,kj->ki", J[:, :3] - hat(arm) @ J[:, 3:], bend)
    push -= (push * n_W).sum(axis=1, keepdims=True) * n_W
    return q[-1], float(np.linalg.norm(push, axis=1).max())


def follow_contacts(
    fingers: tuple[FingerDescription, ...],
    contacts: Contacts,
    rolls: Mapping[int, TipRoll],
    X_WO: Array,
    postures: dict[int, Array],
) -> float:
    """Follow every holding finger, leave its last posture in ``postures``, and return the largest push [m] of all."""
    worst = 0.0
    for i, placement in enumerate(contacts):
        if placement is not None:
            postures[i], push = follow_contact(fingers[i], placement, rolls.get(i), X_WO, postures[i])
            worst = max(worst, push)
    return worst
