"""When the fast solvers of a quadratic program stop short: finish exactly.

Slower than a warm solve by a factor of ten or more, and run only after one has failed.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from dexplan.grasp.force.program import INFINITY, Program
from dexplan.spatial import Array


def solve_exact(program: Program, tolerance: float = 1e-7) -> Array | None:
    """Return the minimiser (n,) to machine precision, or None if the program is infeasible.

    With z = sqrt(p) x + q / sqrt(p) the program asks for the shortest z with E z = e and C z >= h.  The
    equations leave z = z0 + N w; the dual in w is a non-negative least-squares problem that ends after
    finitely many pivots [Lawson & Hanson 1974, ch. 23, algorithm LDP].  An answer that violates a row by
    more than ``tolerance`` is not given.
    """
    p, q, A, lower, upper = program
    root = np.sqrt(p)
    scaled, shift = A / root, A @ (q / p)
    fixed = lower == upper
    above, below = (upper < INFINITY) & ~fixed, (lower > -INFINITY) & ~fixed
    # Equations are eliminated, not split into two inequalities: opposite rows make the pivots singular.
    U, S, Vt = np.linalg.svd(scaled[fixed])
    rank = int(np.sum(S > 1e-10))
    z0 = Vt[:rank].T @ ((U[:, :rank].T @ (lower + shift)[fixed]) / S[:rank])
    N = Vt[rank:].T
    C = np.concatenate([scaled[below], -scaled[above]])
    h = np.concatenate([(lower + shift)[below], -(upper + shift)[above]]) - C @ z0
    E = np.vstack([(C @ N).T, h])
    target = np.zeros(len(E))
    target[-1] = 1.0
    try:
        multiplier, _ = nnls(E, target, maxiter=20 * E.shape[1])
    except RuntimeError:  # too many pivots
        return None
    residual = E @ multiplier - target
    # |residual|^2 = 1 / (1 + |w|^2): zero means that the rows combine to 0 >= 1
    if -residual[-1] < 1e-9:
        return None
    x = (z0 - N @ residual[:-1] / residual[-1]) / root - q / p
    value = A @ x
    return x if np.maximum(value - upper, lower - value).max() <= tolerance else None
