"""How good a grasp is, as one number: smallest singular value of G, and the Ferrari-Canny radius."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from dexplan.contact.friction import NORMAL
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.spatial import Array


def compute_singular_value_min(grasp: Grasp, length: float = 1.0) -> float:
    """Return the smallest of the six singular values of G, torques divided by ``length`` [m].

    Zero means that some wrench cannot be exerted at all; it knows nothing of friction limits.
    """
    G = compute_grasp_map(grasp)
    G[3:] /= length
    values = np.linalg.svd(G, compute_uv=False)
    return float(values[5]) if len(values) >= 6 else 0.0


def compute_support(grasp: Grasp, direction: Array, length: float) -> float:
    """Return the largest ``direction . wrench`` of forces in the exact cones with f_n in [0, 1] N.

    ``direction`` (6,) pairs with (f, tau / length).  The wrench set is a Minkowski sum, so its support
    function is the sum over contacts of max(0, a_n + |c * a_t|) with a = G_i^T direction: no hull has to be
    built.
    """
    return float(sum(max(0.0, gain) for gain in _gains(_build_blocks(grasp, length), direction)))


def compute_ferrari_canny(grasp: Grasp, length: float, starts: int = 40, seed: int = 0) -> float:
    """Return the radius [N] of the largest ball of wrenches that unit normal forces can resist.

    Torques are divided by ``length`` [m] (the radius of a sphere).  This is the Minkowski-sum form [Ferrari &
    Canny 1992]: the least support over all unit directions, zero without force closure.  Three equatorial
    hard fingers: 3 mu / sqrt(5).

    The search is local from ``starts`` seeded random directions and the twelve axes, so that the value is
    never too small and too large only if all of them miss the weakest direction.
    """
    blocks = _build_blocks(grasp, length)
    count = len(blocks)
    rng = np.random.default_rng(seed)
    directions = np.concatenate([np.eye(6), -np.eye(6), rng.normal(size=(starts, 6))])

    # Epigraph form: minimise sum s with s_i >= 0, s_i >= gain_i(d), |d| = 1; kinks of the support become
    # constraints.
    def slack(z: Array) -> Array:
        return z[6:] - np.array(_gains(blocks, z[:6]))

    def slack_jacobian(z: Array) -> Array:
        out = np.zeros((count, 6 + count))
        out[:, 6:] = np.eye(count)
        for i, (normal, shear) in enumerate(blocks):
            b = shear @ z[:6]
            out[i, :6] = -normal - (b / np.sqrt(b @ b + 1e-18)) @ shear
        return out

    cost = np.concatenate([np.zeros(6), np.ones(count)])
    constraints = [
        {"type": "ineq", "fun": slack, "jac": slack_jacobian},
        {
            "type": "eq",
            "fun": lambda z: z[:6] @ z[:6] - 1.0,
            "jac": lambda z: np.concatenate([2.0 * z[:6], np.zeros(count)]),
        },
    ]
    bounds = [(None, None)] * 6 + [(0.0, None)] * count
    best = np.inf
    for direction in directions / np.linalg.norm(directions, axis=1, keepdims=True):
        start = np.concatenate([direction, np.maximum(0.0, _gains(blocks, direction))])
        with np.errstate(all="ignore"):
            answer = minimize(
                lambda z: cost @ z,
                start,
                jac=lambda z: cost,
                bounds=bounds,
                constraints=constraints,
                method="SLSQP",
            )
        d = answer.x[:6] / np.linalg.norm(answer.x[:6])
        best = min(best, compute_support(grasp, direction, length), compute_support(grasp, d, length))
    return best


def _build_blocks(grasp: Grasp, length: float) -> list[tuple[Array, Array]]:
    """Return per contact the rows that map a direction (6,) to a_n and to c * a_t."""
    G = compute_grasp_map(grasp)
    G[3:] /= length
    blocks = []
    for contact, part in zip(grasp.contacts, grasp.slices, strict=True):
        block = G[:, part].T
        blocks.append((block[NORMAL], np.delete(block, NORMAL, axis=0) * contact.model.capacity[:, None]))
    return blocks


def _gains(blocks: list[tuple[Array, Array]], direction: Array) -> list[float]:
    return [float(normal @ direction + np.linalg.norm(shear @ direction)) for normal, shear in blocks]
