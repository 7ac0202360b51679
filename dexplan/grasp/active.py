"""The point nearest to another within linear bounds, found fast if one knows almost which bounds it will rest on."""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv, dpotrs

from dexplan.spatial import Array

Indices = NDArray[np.intp]

_BOUND = 1e-9
"""A row may be overstepped by this much [the rows' unit], and a multiplier be negative."""
_RIDGE = 1e-12
"""Relative ridge that keeps redundant rows from stopping the factorisation; refinement takes its effect out again."""
_DEPENDENT = 1e-9
"""Share of a row's square below which it lies in the span of the active rows."""


class ActiveAnswer(NamedTuple):
    """``x`` (n,) the optimum, the active ``rows`` with their ``multipliers`` (positive at an upper bound), ``rounds`` it took."""

    x: Array
    rows: Indices
    multipliers: Array
    rounds: int


@final
class ActiveRows:
    """Remembers which rows were at their bounds, and tries those first on the next program.

    A program that changes a little from tick to tick mostly keeps its active rows.  With them known, the optimum of
    ``minimise |x - aim|^2 / 2  s.t.  lower <= D x <= upper`` is one small linear system; what it returns is *the*
    optimum if no row is overstepped and no multiplier has the wrong sign (Karush, Kuhn and Tucker: the program is
    strictly convex), whichever way the rows were guessed.  If not, rows of the wrong sign leave, and the dual method
    of [Goldfarb & Idnani 1983] goes on from the rest: the most overstepped row enters, after as many others have
    left as its multiplier drives to zero.  Every answer passes the test above: without proof there is none.
    """

    def __init__(self, fixed: int, rounds: int) -> None:
        """Start with the first ``fixed`` rows, which are equations; give up after ``rounds`` linear systems."""
        self._fixed, self._limit = fixed, rounds
        self._rounds = 0
        self.forget()

    def forget(self) -> None:
        """Begin anew with the equations alone."""
        self._rows: Indices = np.arange(self._fixed, dtype=np.intp)
        self._sides: Array = np.ones(self._fixed)

    def guess(self, multipliers: Array, least: float) -> None:
        """Begin with the rows whose ``multipliers`` (k,) exceed ``least`` in size."""
        inner = self._fixed + np.flatnonzero(np.abs(multipliers[self._fixed :]) > least)
        self._rows = np.concatenate([np.arange(self._fixed, dtype=np.intp), inner])
        self._sides = np.concatenate([np.ones(self._fixed), np.sign(multipliers[inner])])

    def solve(self, D: Array, aim: Array, lower: Array, upper: Array) -> ActiveAnswer | None:
        """Return the optimum, or None if it was not found: there is none, or the rounds are used up."""
        rows, sides, fixed = self._rows, self._sides, self._fixed
        self._rounds = 0
        while self._rounds < self._limit:
            # x = aim - B' m with B x = b, so (B B') m = B aim - b
            self._rounds += 1
            B = D[rows]
            b = upper[rows]
            if len(rows) > fixed:
                b = np.where(sides > 0.0, b, lower[rows])
            factor, m, failed = _solve_gram(B, B @ aim - b)
            if failed:
                return None
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
            right = sides * m >= -_BOUND
            right[:fixed] = True
            if len(rows) > fixed and not right.all():
                rows, sides = rows[right], sides[right]
            elif excess[worst] <= _BOUND:
                self._rows, self._sides = rows, sides
                return ActiveAnswer(x, rows, m, self._rounds)
            else:
                found = self._add(
                    D, m * sides, rows, sides, worst, float(excess[worst]), value[worst] > upper[worst]
                )
                if found is None:
                    return None
                rows, sides = found
        return None

    def _add(
        self, D: Array, u: Array, rows: Indices, sides: Array, new: int, excess: float, is_upper: bool
    ) -> tuple[Indices, Array] | None:
        """Return the active rows with row ``new``, less those that it drives out; None if the bounds leave no room for it.

        ``u`` are the multipliers of the active rows, >= 0 but for equations; ``excess`` by how much x oversteps ``new``.
        """
        side = 1.0 if is_upper else -1.0
        d = side * D[new]
        while self._rounds < self._limit:
            if new in rows or not excess < np.inf:  # redundant rows at the edge of precision, or not a number
                return None
            self._rounds += 1
            N = D[rows] * sides[:, None]
            _, r, failed = _solve_gram(N, N @ d)
            if failed:
                return None
            # While the new multiplier grows by t, the others change by -t r and x by -t z.
            z = d - r @ N
            square = float(z @ z)
            full = excess / square if square > _DEPENDENT * float(d @ d) else np.inf
            r[: self._fixed] = 0.0
            ratios = np.where(r > _BOUND, np.maximum(u, 0.0) / np.maximum(r, _BOUND), np.inf)
            leaving = int(ratios.argmin()) if len(ratios) else -1
            if leaving < 0 or full <= ratios[leaving]:
                return (np.append(rows, new), np.append(sides, side)) if full < np.inf else None
            t = ratios[leaving]
            if t == np.inf:
                return None
            u = np.delete(u - t * r, leaving)
            rows, sides = np.delete(rows, leaving), np.delete(sides, leaving)
            if full < np.inf:
                excess -= t * square
        return None


def _solve_gram(B: Array, right: Array) -> tuple[Array, Array, bool]:
    """Solve (B B') m = right; return the factor, m, and whether it failed."""
    if not len(B):
        return np.zeros((0, 0)), np.zeros(0), False
    S = B @ B.T
    S.ravel()[:: len(S) + 1] += _RIDGE * (S[0, 0] + S[-1, -1])
    factor, m, info = dposv(
        S.T, right, overwrite_a=True
    )  # transposed: as LAPACK stores it, so that nothing is copied
    return factor, m, info != 0
