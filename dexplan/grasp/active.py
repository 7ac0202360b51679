"""The point nearest to another within linear bounds, if one knows almost which bounds it will rest on."""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np
from scipy.linalg.lapack import dposv, dpotrs

from dexplan.spatial import Array

_BOUND = 1e-9
"""A row may be overstepped by this much [the rows' unit], and a multiplier be negative."""
_RIDGE = 1e-12
"""Relative ridge that keeps redundant rows from stopping the factorisation; refinement takes its effect out again."""


class ActiveAnswer(NamedTuple):
    """``x`` (n,) the optimum, ``multipliers`` (k,) of all rows (positive at an upper bound), ``rounds`` it took."""

    x: Array
    multipliers: Array
    rounds: int


@final
class ActiveRows:
    """Remembers which rows were at their bounds, and tries those first on the next program.

    A program that changes a little from tick to tick mostly keeps its active rows.  With them known, the optimum of
    ``minimise |x - aim|^2 / 2  s.t.  lower <= D x <= upper`` is one small linear system; what it returns is *the*
    optimum if no row is overstepped and no multiplier has the wrong sign (Karush, Kuhn and Tucker: the program is
    strictly convex), whichever way the rows were guessed.  If not, rows of the wrong sign leave, the most overstepped
    row enters, and so on for a few rounds.  That need not converge: without proof there is no answer.
    """

    def __init__(self, fixed: int, rounds: int) -> None:
        """Start with the first ``fixed`` rows, which are equations; give up after ``rounds``."""
        self._fixed, self._rounds = fixed, rounds
        self.forget()

    def forget(self) -> None:
        """Begin anew with the equations alone."""
        self._rows, self._sides = np.arange(self._fixed), np.ones(self._fixed)

    def guess(self, multipliers: Array, least: float) -> None:
        """Begin with the rows whose ``multipliers`` (k,) exceed ``least`` in size."""
        inner = self._fixed + np.flatnonzero(np.abs(multipliers[self._fixed :]) > least)
        self._rows = np.concatenate([np.arange(self._fixed), inner])
        self._sides = np.concatenate([np.ones(self._fixed), np.sign(multipliers[inner])])

    def solve(self, D: Array, aim: Array, lower: Array, upper: Array) -> ActiveAnswer | None:
        """Return the optimum, or None if it was not found."""
        rows, sides, fixed = self._rows, self._sides, self._fixed
        for count in range(1, self._rounds + 1):
            # x = aim - B' m with B x = b, so (B B') m = B aim - b
            B = D[rows]
            b = np.where(sides > 0.0, upper[rows], lower[rows])
            S = B @ B.T
            diagonal = S.ravel()[:: len(S) + 1]
            diagonal += _RIDGE * diagonal.max() if len(S) else 0.0
            factor, m, failed = dposv(S, B @ aim - b) if len(S) else (S, b, 0)
            if failed:
                break
            x = aim - m @ B
            value = D @ x
            excess = np.maximum(value - upper, lower - value)
            worst = int(excess.argmax())
            if excess[worst] > _BOUND and worst in rows:
                m += dpotrs(factor, value[rows] - b)[0]
                x = aim - m @ B
                value = D @ x
                excess = np.maximum(value - upper, lower - value)
                worst = int(excess.argmax())
            wrong = sides * m < -_BOUND
            wrong[:fixed] = False
            is_kept = excess[worst] <= _BOUND
            is_signed = not wrong.any()
            if is_kept and is_signed:
                self._rows, self._sides = rows, sides
                multipliers = np.zeros(len(D))
                multipliers[rows] = m
                return ActiveAnswer(x, multipliers, count)
            if not is_signed:
                rows, sides = rows[~wrong], sides[~wrong]
            if not is_kept:
                if not excess[worst] > _BOUND or worst in rows:  # not a number, or no way out
                    break
                rows = np.append(rows, worst)
                sides = np.append(sides, 1.0 if value[worst] > upper[worst] else -1.0)
        return None
