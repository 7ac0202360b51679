"""OSQP, an operator-splitting method, behind a fixed pattern of non-zeros."""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np
import osqp
from scipy.sparse import csc_matrix

from dexplan.grasp.force.program import Program
from dexplan.spatial import Array


class SplittingAnswer(NamedTuple):
    """What OSQP ``said``, its ``x`` (n,), and how many ``iterations`` it took."""

    said: str
    x: Array
    iterations: int


@final
class Splitting:
    """OSQP for programs of one pattern: set up once, then values only.

    The unknowns come well scaled, so OSQP's own scaling is not needed, nor is its polishing, which can print.
    """

    def __init__(self, program: Program, pattern: Array, tolerance: float, max_iterations: int) -> None:
        """Set up for the non-zeros of ``pattern`` (k, n) bool; ``tolerance`` is absolute and relative."""
        columns_of, self._rows_of = np.nonzero(pattern.T)
        self._columns_of, size = columns_of, len(program.p)
        starts = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
        self._shape = program.A.shape
        self._solver = osqp.OSQP(algebra="builtin")
        values = program.A[self._rows_of, columns_of]
        self._solver.setup(
            csc_matrix((program.p, np.arange(size), np.arange(size + 1)), shape=(size, size)),
            program.q,
            csc_matrix((values, self._rows_of, starts), shape=self._shape),
            program.lower,
            program.upper,
            verbose=False,
            eps_abs=tolerance,
            eps_rel=tolerance,
            eps_prim_inf=1e-5,
            max_iter=max_iterations,
            scaling=0,
            rho=0.1,
            check_termination=5,
            polishing=False,
        )

    def solve(self, program: Program) -> SplittingAnswer:
        """Return what OSQP finds, starting from where it is."""
        self._solver.update(
            q=program.q, l=program.lower, u=program.upper, Ax=program.A[self._rows_of, self._columns_of]
        )
        result = self._solver.solve(raise_error=False)
        return SplittingAnswer(result.info.status, result.x, int(result.info.iter))

    def start(self, x: Array, multipliers: Array) -> None:
        """Start the next solve from a point and its multipliers."""
        self._solver.warm_start(x, multipliers)

    def forget(self) -> None:
        """Drop the warm start: what is left of a failed solve would poison the next."""
        self._solver.warm_start(np.zeros(self._shape[1]), np.zeros(self._shape[0]))
