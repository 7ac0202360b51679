"""DAQP, a dual active-set method, on the point nearest to another within linear bounds; no answer without proof."""

from __future__ import annotations

from typing import NamedTuple, final

import daqp  # type: ignore[import-not-found]
import numpy as np

from dexplan.spatial import Array

_TOLERANCE = 1e-9
"""An answer may miss each of the conditions for an optimum by this much [the rows' unit]."""
_FEASIBLE = 1e-10
"""What DAQP lets pass, of rows divided by their norm.  At 1e-11 its rounding shows: of 1513 feasible programs
whose friction weighs 1e-5 of the normal forces it called 9 infeasible, at 1e-10 and 1e-9 none."""


class ActiveSetAnswer(NamedTuple):
    """``x`` (n,) the optimum, ``multipliers`` (k,) positive at upper bounds, negative at lower ones, ``iterations`` it took."""

    x: Array
    multipliers: Array
    iterations: int


@final
class DualActiveSet:
    """DAQP for ``minimise |x - aim|^2 / 2  s.t.  lower <= D x <= upper``, started from the rows that were active before.

    A program that changes a little from tick to tick mostly keeps its active rows, and with them known the optimum is one
    small linear system.  [Arnstrom, Bemporad & Axehill 2022, "A dual active-set solver for embedded quadratic programming
    using recursive LDL' updates"]
    """

    def __init__(self, iterations: int) -> None:
        """Give up after ``iterations`` of DAQP, of which each changes the active rows by one."""
        self._iterations = iterations
        self._model: daqp.Model | None = None

    def solve(
        self, D: Array, aim: Array, lower: Array, upper: Array, is_new: bool = True
    ) -> ActiveSetAnswer | None:
        """Return the optimum, or None if it was not found: there is none, or the iterations are used up.

        Rows whose bounds are equal are equations, redundant ones included; shapes are the same in every call.  ``is_new``:
        whether ``D`` has other numbers than in the call before; the same ones need not be looked at again.
        """
        if self._model is None:
            model = daqp.Model()
            model.settings = {"primal_tol": _FEASIBLE, "iter_limit": self._iterations}
            flag, _ = model.setup(np.eye(len(aim)), -aim, D, upper, lower)
        else:
            model = self._model
            flag = model.update(f=-aim, A=D if is_new else None, bupper=upper, blower=lower)
        self._model = None  # what a failure leaves behind is not to start from
        if flag < 0:
            return None
        x, _, flag, info = model.solve()
        multipliers = info["lam"]
        if flag < 0 or not is_optimal(x, multipliers, D, aim, lower, upper):
            return None
        self._model = model
        return ActiveSetAnswer(x, multipliers, info["iterations"])


def is_optimal(x: Array, multipliers: Array, D: Array, aim: Array, lower: Array, upper: Array) -> bool:
    """Return whether the conditions of Karush, Kuhn and Tucker hold; they prove the optimum, as the program is strictly convex.

    x = aim - D' multipliers, no row is overstepped, and every row with a multiplier rests on the bound that its sign names,
    each within 1e-9.  Numbers that are not finite prove nothing.
    """
    value = D.dot(x)
    above, below = value - upper, lower - value
    slope = multipliers.dot(D)
    slope += x
    slope -= aim
    np.abs(slope, out=slope)
    # `argmax` finds a NaN before anything else, and takes a tenth of the time of `max`.
    if not (
        above[above.argmax()] <= _TOLERANCE
        and below[below.argmax()] <= _TOLERANCE
        and slope[slope.argmax()] <= _TOLERANCE
    ):
        return False
    # Few rows have a multiplier.
    for k in multipliers.nonzero()[0].tolist():
        multiplier = multipliers[k]
        if multiplier > _TOLERANCE and not above[k] >= -_TOLERANCE:
            return False
        if multiplier < -_TOLERANCE and not below[k] >= -_TOLERANCE:
            return False
    return True
