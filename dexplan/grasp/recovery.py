"""When the fast solver of a quadratic program stops short: finish exactly, or say why nothing can.

Both functions see the program ``minimise 1/2 x' diag(p) x + q' x  s.t.  lower <= A x <= upper`` as dense
arrays; they are slower than a warm solve by a factor of ten and run only after one has failed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog, nnls

from dexplan.spatial import Array

_INFINITY = 1e30


class Program(NamedTuple):
    """``p`` (n,) > 0, ``q`` (n,), ``A`` (k, n), ``lower`` and ``upper`` (k,); bounds of 1e30 and more count
    as none."""

    p: Array
    q: Array
    A: Array
    lower: Array
    upper: Array


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
    above, below = (upper < _INFINITY) & ~fixed, (lower > -_INFINITY) & ~fixed
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


def measure_infeasibility(program: Program, groups: Mapping[str, slice]) -> dict[str, tuple[float, Array]]:
    """Return per group of rows the least loosening that alone cures the program, and its x (n,).

    A loosening of zero means that the program is feasible as it stands; groups that cannot cure it alone are
    left out.
    """
    _, _, A, lower, upper = program
    above, below = upper < _INFINITY, lower > -_INFINITY
    rows = np.concatenate([A[above], -A[below]])
    bounds = np.concatenate([upper[above], -lower[below]])
    size = A.shape[1]
    cost = np.append(np.zeros(size), 1.0)
    found = {}
    for name, part in groups.items():
        member = np.zeros(len(A))
        member[part] = 1.0
        loose = np.concatenate([member[above], member[below]])
        answer = linprog(
            cost,
            A_ub=np.column_stack([rows, -loose]),
            b_ub=bounds,
            bounds=[(None, None)] * size + [(0.0, None)],
        )
        if answer.status == 0:
            found[name] = (float(answer.x[-1]), answer.x[:size])
    return found
