"""Random questions for the planner, made without asking it: goal attitudes, and start contacts on a friction's closure alone."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.kinematics.chain import compute_joint_margin
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.spatial import Array

TRIES = 400
"""Directions drawn at a time."""


def sample_attitude(rng: np.random.Generator) -> Array:
    """Return an attitude (3, 3), uniform over all rotations."""
    return Rotation.random(rng=rng).as_matrix()


def sample_start(hand: HandModel, rng: np.random.Generator) -> tuple[Array | None, ...]:
    """Return start contacts: per finger an outward normal (3,) in W, None for free ones.

    Directions are uniform over the object.  A finger can be at a contact if its joints, the tip's pole along the normal, are
    within their limits; two of the fingers, drawn at random, are taken whose contacts are force closed with the believed
    friction.  Loads, clearances and gaits are not looked at, so not every start holds.  Raises ValueError where no two fingers
    have such contacts.
    """
    center = hand.object.X_WO_home[:3, 3]
    cosine = np.cos(2.0 * compute_pair_angle_max(hand.friction))
    count = len(hand.fingers)
    for _ in range(20):
        first, second = (int(i) for i in rng.permutation(count)[:2])
        reach = [_sample_contacts(hand, f, center, rng) for f in (first, second)]
        pairs = np.argwhere(-(reach[0] @ reach[1].T) > cosine)
        if len(pairs):
            i, j = pairs[rng.integers(len(pairs))]
            start: list[Array | None] = [None] * count
            start[first], start[second] = reach[0][i], reach[1][j]
            return tuple(start)
    raise ValueError(
        "no two fingers reach contacts that are force closed; a hand and friction that allow some are accepted"
    )


def _sample_contacts(hand: HandModel, finger: int, center: Array, rng: np.random.Generator) -> Array:
    """Return directions (N, 3), of ``TRIES`` drawn uniformly those that the finger's joints can reach."""
    normals = rng.normal(size=(TRIES, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    chain, workspace = hand.fingers[finger].chain, hand.workspaces[finger]
    if not len(workspace.postures):
        return np.zeros((0, 3))
    q, reached = workspace.solve(build_aligned(hand, finger, center, normals))
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    return normals[reached & (compute_joint_margin(chain, q) >= 0.0)]
