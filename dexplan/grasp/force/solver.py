"""Which forces should the fingers exert?  A program built once per contact mode, solved every tick.

Unknowns are the contact forces f (sum m) on the object, each in its contact frame:

    minimise    w_n sum (f_n - target)^2 + w_t sum |f_t / c|^2  [+ s times the same squares of f - previous]
    subject to  G f = wrench                              exactly, or within a band
                A_i f_i <= 0                              pyramid inscribed in the exact cone
                floor <= f_n <= ceiling
                lower <= bias + (torque map) f <= upper   joint torques

A minimum-norm solution would ride its cone; a normal force pulled to a target well inside does not.  The
wrench is a constraint and never a cost: a weight that trades it against force under-delivers without a word
and drops the object.

**Smoothness.**  Call P(z) the feasible forces nearest to z in the norm of the cost, and t the target without friction.  Without
smoothness the answer is P(t).  With it the two sums of squares are one about (t + s previous) / (1 + s), so the answer is

    f = P((t + s previous) / (1 + s))

and, as P moves no two points apart, |f - P(previous)| <= |t - previous| / (1 + s).  P(previous) is the least change that
today's constraints ask for, and it is made at once: the wrench never lags.  The rest is a first-order filter: where no
inequality is active P is affine, and each tick leaves s / (1 + s) of the way to the optimum P(t), the same for all components;
:func:`compute_smoothness` turns a time constant into s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from dexplan.grasp.force.active_set import ActiveSetAnswer, DualActiveSet
from dexplan.grasp.force.diagnosis import Loosening, diagnose, explain
from dexplan.grasp.force.problem import ForceLimits, ForceProblem, ForceSettings
from dexplan.grasp.force.program import ForceRows, Program
from dexplan.grasp.force.recovery import solve_exact
from dexplan.grasp.force.solution import ForceSolution
from dexplan.grasp.force.splitting import Splitting
from dexplan.spatial import Array

__all__ = [
    "ForceLimits",
    "ForceProblem",
    "ForceSettings",
    "ForceSolution",
    "ForceSolver",
    "SolverOptions",
    "compute_smoothness",
]

GENTLE_FRICTION = 0.02
"""Friction weight for planning and control.  Between contacts that are not opposite, less tangential force also means less
squeeze, and less squeeze is nearer to sliding under the load: the weight only has to decide what the squeeze leaves open."""


EXCHANGES = 200
"""DAQP's exchanges of active rows before OSQP takes over: warm ticks take a handful, cold ones some dozens."""


def compute_smoothness(tick: float, time_constant: float) -> float:
    """Return the ``smoothness`` s with which forces follow a new optimum in ``time_constant`` [s], one solve per ``tick`` [s].

    After that time 1/e of the way is left: (s / (1 + s))^(time_constant / tick) = 1/e, so
    s = 1 / (exp(tick / time_constant) - 1), about time_constant / tick for slow ones; 0 for no time at all.
    Raises ValueError for a tick <= 0 or a time constant < 0.
    """
    if not (tick > 0.0 and time_constant >= 0.0):
        raise ValueError(f"tick {tick} s, time constant {time_constant} s; > 0 and >= 0 are accepted")
    return 1.0 / float(np.expm1(tick / time_constant)) if time_constant > 1e-3 * tick else 0.0


class _Iterated(NamedTuple):
    """What OSQP and the exact method behind it came to: scaled unknowns ``y``, whose they are, and after how many iterations."""

    status: str
    y: Array
    method: str
    iterations: int


@dataclass(frozen=True)
class SolverOptions:
    """How hard the methods try: OSQP's absolute and relative ``tolerance`` [N]; after ``max_iterations`` of OSQP an exact method
    takes over, and after ``exchanges`` of active rows by DAQP, OSQP; 0 leaves all to OSQP.
    """

    tolerance: float = 1e-6
    max_iterations: int = 400
    exchanges: int = EXCHANGES


@final
class ForceSolver:
    """The quadratic program of one contact mode (which fingers touch, and how): fixed sparsity, warm started.

    DAQP, a dual active-set method, starts from the rows that were active in the last answer, and is believed only
    with a proof (:mod:`dexplan.grasp.force.active_set`).  OSQP takes over where it finds none, and an exact method where
    OSQP stops short.

    Args:
        settings: what stays the same while the mode lasts.
        joints_per_finger: number J of joints with torque limits per finger; 0 for none.
        options: how hard the methods try.
    """

    def __init__(
        self, settings: ForceSettings, joints_per_finger: int = 0, options: SolverOptions | None = None
    ) -> None:
        self.settings, self.models = settings, settings.models
        self._joints, self._options = joints_per_finger, options or SolverOptions()
        self._rows = ForceRows(settings, joints_per_finger)
        self._size = len(self._rows.p)
        self._empty = self._rows.as_program()
        self.forget()

    def forget(self) -> None:
        """Be as new: what was solved before leaves nothing to start from."""
        self._active_set = DualActiveSet(self._options.exchanges) if self._options.exchanges else None
        self._made_splitting: Splitting | None = None
        self._last: ActiveSetAnswer | None = None  # an optimum that OSQP has not seen

    @property
    def _splitting(self) -> Splitting:
        """OSQP, set up when it is first needed: where DAQP finds everything it never is."""
        if self._made_splitting is None:
            self._made_splitting = Splitting(
                self._empty, self._rows.pattern, self._options.tolerance, self._options.max_iterations
            )
        return self._made_splitting

    def solve(self, problem: ForceProblem, *, explain: bool = True) -> ForceSolution:
        """Return the contact forces; an infeasible problem is a status, never an exception.

        ``explain``: whether to find out what would help where there are no forces, which takes longer than the rest.  Raises
        ValueError for settings or shapes that do not fit this mode, and for numbers that are not finite.
        """
        self._check_fit(problem)
        rows = self._rows
        rows.write(problem)
        if self._active_set is not None:
            answer = self._active_set.solve(rows.D, rows.aim, rows.lower, rows.upper, rows.is_new)
            if answer is not None:
                self._last = answer
                return self._as_solution(answer.x, "solved", problem, (), "DAQP", answer.iterations)
        return self._solve_slowly(problem, explain)

    def _check_fit(self, problem: ForceProblem) -> None:
        if problem.settings is not self.settings and problem.settings != self.settings:
            raise ValueError(f"the problem has {problem.settings}; {self.settings} is accepted")
        G, wrench, limits = problem.G, problem.wrench, problem.limits
        count = len(self.models)
        if G.shape != (6, self._size) or wrench.shape != (6,) or limits.normal_floor.shape != (count,):
            raise ValueError(
                f"G {G.shape}, wrench {wrench.shape}, limits {limits.normal_floor.shape}; "
                f"(6, {self._size}), (6,), ({count},) are accepted"
            )
        shape = (count, self._joints, self._rows.map_width) if self._joints else None
        given = None if problem.torque_maps is None else problem.torque_maps.shape
        if given != shape:
            raise ValueError(f"torque maps {given}; {shape} is accepted")

    def _as_solution(
        self,
        x: Array,
        status: str,
        problem: ForceProblem,
        cures: tuple[tuple[Loosening, ...], ...],
        method: str,
        iterations: int,
    ) -> ForceSolution:
        forces = x * self._rows.force_of_x
        if len(forces) < 4 * len(self.models):
            padded = np.zeros(4 * len(self.models))
            padded[self._rows.padded] = forces
            forces = padded
        forces.setflags(write=False)
        return ForceSolution(forces.reshape(-1, 4), status, problem, cures, method, iterations)

    def _solve_slowly(self, problem: ForceProblem, is_explained: bool) -> ForceSolution:
        """Run OSQP, then an exact method; failing both, say why there are no forces if that is asked for."""
        _check_finite(problem)
        rows, program = self._rows, self._rows.as_program()
        if self._last is not None:
            self._splitting.start(self._last.x / rows.root, self._last.multipliers)
            self._last = None
        status, y, method, iterations = self._iterate(program, problem)
        if status == "solved":
            return self._as_solution(y * rows.root, status, problem, (), method, iterations)
        # Find out why there is no solution; if there should be one, start OSQP afresh.
        self._splitting.forget()
        if not is_explained:
            nowhere = np.full(self._size, np.nan)
            return self._as_solution(nowhere, f"{status} (not explained)", problem, (), method, iterations)
        cures, nearest = diagnose(rows)
        if nearest is not None and not cures:
            status, y, method, more = self._iterate(program, problem)
            iterations += more
            if status == "solved":
                return self._as_solution(y * rows.root, status, problem, (), method, iterations)
            self._splitting.forget()
        else:
            status = f"infeasible: {explain(cures, self.settings.length)}"
        x = np.full(self._size, np.nan) if nearest is None else nearest * rows.root
        return self._as_solution(x, status, problem, cures, "linear program", iterations)

    def _iterate(self, program: Program, problem: ForceProblem) -> _Iterated:
        """Run OSQP, finish its work if it stops short, and believe it only if the wrench checks."""
        rows, settings = self._rows, self.settings
        answer = self._splitting.solve(program)
        y, said, method = answer.x, answer.said, "OSQP"
        if said != "solved":
            exact = solve_exact(program)
            if exact is not None:
                if "infeasible" in said:  # mistaken, and its iterates have run away
                    self._splitting.forget()
                y, said, method = exact, "solved", "exact"
        if said != "solved":
            text = f"unsolved: OSQP reports {said} after {answer.iterations} iterations"
            return _Iterated(text, y, method, answer.iterations)
        residual = problem.G @ (y * rows.scale) - problem.wrench
        residual[3:] /= settings.length
        allowed = settings.wrench_tolerance + 10.0 * self._options.tolerance * (1.0 + np.abs(y).max())
        if not np.abs(residual).max() <= allowed:
            text = f"unsolved: the wrench is missed by {np.abs(residual).max():.1e} N"
            return _Iterated(text, y, method, answer.iterations)
        return _Iterated("solved", y, method, answer.iterations)


def _check_finite(problem: ForceProblem) -> None:
    for name in ("G", "wrench", "target_normal", "torque_maps", "torque_bias", "previous"):
        value = getattr(problem, name)
        if value is not None and not np.isfinite(value).all():
            raise ValueError(f"{name} has entries that are not finite; finite numbers are accepted")
