"""A proof that contact forces are optimal, from the problem alone, whoever found them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from dexplan.contact.friction import NORMAL
from dexplan.grasp.force.problem import ForceProblem
from dexplan.spatial import Array

_NEAR = (1e-7, 1e-5, 1e-3)
"""Rows with less room than this [N] are taken to bear on the optimum; the best bound counts."""
_BROKEN = 1e-2
"""Forces that overstep a row by more than this [N] answer another problem: nothing is proven."""


@dataclass(frozen=True)
class OptimalityProof:
    """What weak duality says about forces f of cost C(f): no feasible forces cost less than C(f) - ``gap``.

    ``cost`` C(f) and ``gap`` in N^2; ``dual_residual`` [N]: largest component of the gradient of the Lagrangian, halved and
    in the scale in which all forces are newtons of normal force; ``distance`` [N]: bound on the norm of the error of the
    forces in that scale (f / c).  ``gap`` may be slightly negative for forces that overstep a row.
    """

    cost: float
    gap: float
    dual_residual: float
    distance: float


def prove_optimality(problem: ForceProblem, forces: Array) -> OptimalityProof:
    """Return the best proof of optimality of ``forces`` (F, 4) that the rows near them give.

    With C(f) = sum w (f - z)^2 + const and rows a . f <= b, E f = e, any multipliers l >= 0 and n bound the optimum from below:

        min C >= min_f L(f) = C(f) - sum r^2 / (4 w) - l . (b - A f) + n . (E f - e),   r = grad C + A' l + E' n

    [Boyd & Vandenberghe 2004, §5.1].  Multipliers that make r small are found by non-negative least squares; they need not be
    those of the solver, nor exact, for the bound to hold.  C grows like w |f - f*|^2 away from its optimum, hence ``distance``.
    """
    settings = problem.settings
    E, e, A, b = _collect_rows(problem)
    f = problem.stack(forces)
    room, miss = b - A @ f, E @ f - e
    if not (np.all(room > -_BROKEN) and np.all(np.abs(miss) < _BROKEN)):
        return OptimalityProof(np.nan, np.nan, np.nan, np.nan)
    s = 0.0 if problem.previous is None else settings.smoothness
    w = (1.0 + s) * problem.weights
    aim = np.zeros_like(forces)
    aim[:, NORMAL] = problem.target_normal
    gradient = 2.0 * problem.weights * (f - problem.stack(aim))
    if problem.previous is not None:
        gradient += 2.0 * s * problem.weights * (f - problem.stack(problem.previous))
    # In half the metric of the cost: minimise |g + E' n + A' l| over l >= 0; n by projection.
    half = 1.0 / (2.0 * np.sqrt(w))
    g, Es, As = gradient * half, E * half, A * half
    _, S, Vt = np.linalg.svd(Es)
    is_spanned = 1e-10 * S.max(initial=0.0) < S
    rank = np.count_nonzero(is_spanned)
    span, rest = Vt[:rank].T, Vt[rank:].T
    gap, r = np.inf, g
    for limit in _NEAR:
        near = room < limit
        multipliers = np.zeros(np.count_nonzero(near))
        if near.any():
            try:
                multipliers, _ = nnls((As[near] @ rest).T, -rest.T @ g, maxiter=100 * len(multipliers))
            except RuntimeError:  # too many pivots: this bound is not to be had
                continue
        partial = g + multipliers @ As[near]
        n = np.linalg.lstsq(Es.T, -span @ (span.T @ partial), rcond=None)[0]
        remainder = partial + n @ Es
        bound = float(remainder @ remainder + multipliers @ room[near] - n @ miss)
        if bound < gap:
            gap, r = bound, remainder
    scale = np.concatenate([np.insert(m.capacity, NORMAL, 1.0) for m in settings.models])
    # |f - f*|_w^2 <= C(f) - C(f*), with the weights per (f / c)^2
    distance = np.sqrt(abs(gap) / (w * scale**2).min())
    dual = float(np.abs(r / half * scale / 2.0).max())
    return OptimalityProof(problem.compute_cost(forces), gap, dual, float(distance))


class _Rows(NamedTuple):
    """The constraints ``E f = e``, ``A f <= b``."""

    E: Array
    e: Array
    A: Array
    b: Array


def _collect_rows(problem: ForceProblem) -> _Rows:
    """Return E, e, A, b of ``E f = e``, ``A f <= b`` in plain forces, every row in newtons."""
    settings, limits = problem.settings, problem.limits
    size, per_length = problem.G.shape[1], np.repeat([1.0, 1.0 / settings.length], 3)
    G, wrench, band = problem.G * per_length[:, None], problem.wrench * per_length, settings.wrench_tolerance
    rows: list[Array] = []
    bounds: list[Array] = []
    if band > 0.0:
        rows += [G, -G]
        bounds += [wrench + band, band - wrench]
    for i, (model, own) in enumerate(zip(settings.models, problem.slices, strict=True)):
        facets = model.facets()
        block = np.zeros((len(facets) + 2, size))
        block[: len(facets), own] = facets
        block[-2:, own.start + NORMAL] = 1.0, -1.0
        rows.append(block)
        limit = [limits.normal_ceiling[i], -limits.normal_floor[i]]
        bounds.append(np.concatenate([np.zeros(len(facets)), limit]))
        if problem.torque_maps is None:
            continue
        bias = 0.0 if problem.torque_bias is None else problem.torque_bias[i]
        for sign, torque in ((1.0, limits.torque_upper), (-1.0, limits.torque_lower)):
            if torque is not None:
                block = np.zeros((len(torque[i]), size))
                block[:, own] = sign * problem.torque_maps[i][:, : model.dimension]
                rows.append(block / settings.reach)
                bounds.append(sign * (torque[i] - bias) / settings.reach)
    A, b = np.concatenate(rows), np.concatenate(bounds)
    finite = np.isfinite(b)
    E, e = (np.zeros((0, size)), np.zeros(0)) if band > 0.0 else (G, wrench)
    return _Rows(E, e, A[finite], b[finite])
