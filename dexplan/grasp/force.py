"""Which forces should the fingers exert?  A program built once per contact mode, solved every tick.

Unknowns are the contact forces f (sum m) on the object, each in its contact frame:

    minimise    w_n sum (f_n - target)^2 + w_t sum |f_t / c|^2 [+ w_s |f - previous|^2, in the same units]
    subject to  G f = wrench                              exactly, or within a band
                A_i f_i <= 0                              pyramid inscribed in the exact cone
                floor <= f_n <= ceiling
                lower <= bias + (torque map) f <= upper   joint torques

A minimum-norm solution would ride its cone; a normal force pulled to a target well inside does not.  The
wrench is a constraint and never a cost: a weight that trades it against force under-delivers without a word
and drops the object.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
import osqp
from numpy.typing import ArrayLike
from scipy.sparse import csc_matrix

from dexplan.contact.friction import NORMAL, ContactModel
from dexplan.grasp.recovery import Program, measure_infeasibility, solve_exact
from dexplan.grasp.solution import ForceLimits, ForceSolution
from dexplan.spatial import Array

__all__ = ["ForceLimits", "ForceSolution", "ForceSolver"]

_INFINITY = 1e30  # what OSQP takes for "no bound"
_GROUPS = ("wrench", "friction", "normal force", "joint torque")  # the rows, in this order
_CURES = {
    "wrench": "only another wrench would do: the contacts miss this one by {:.3g} N",
    "friction": "friction worth {:.3g} N more normal force per contact would do",
    "normal force": "normal-force limits wider by {:.3g} N would do",
    "joint torque": "{:.3g} N m more joint torque would do",
}


GENTLE_FRICTION = 0.02
"""Friction weight for planning and control.  Between contacts that are not opposite, less tangential force also means less
squeeze, and less squeeze is nearer to sliding under the load: the weight only has to decide what the squeeze leaves open."""


@final
class ForceSolver:
    """The quadratic program of one contact mode (which fingers touch, and how): fixed sparsity, warm started.

    Unknowns are scaled to y = f / c (f_n itself for the normal), which makes every cone the same round one,
    the friction rows constant and the costs comparable; OSQP's own scaling and polishing (which can print)
    are then not needed.  Wrench rows of torque are divided by ``length`` and joint rows by ``reach``, so that
    all rows read in newtons.

    Args:
        models: contact models in the order of the columns of G.
        joints_per_finger: number J of joints with torque limits per finger; 0 for none.
        length: size of the object [m].
        reach: typical lever arm of a joint [m].
        normal_weight, friction_weight, smoothness: w_n, w_t, w_s.
        wrench_tolerance: half width [N] of the band around the wrench (torque: times ``length``), or 0.
        tolerance: OSQP's absolute and relative tolerance [N].
        max_iterations: when an exact method takes over from OSQP.
    """

    def __init__(
        self,
        models: Sequence[ContactModel],
        joints_per_finger: int = 0,
        *,
        length: float = 0.035,
        reach: float = 0.1,
        normal_weight: float = 1.0,
        friction_weight: float = 0.1,
        smoothness: float = 0.0,
        wrench_tolerance: float = 0.0,
        tolerance: float = 1e-6,
        max_iterations: int = 400,
    ) -> None:
        if not models:
            raise ValueError("no contact models; one or more are accepted")
        if min(normal_weight, friction_weight) <= 0.0 or min(smoothness, wrench_tolerance) < 0.0:
            raise ValueError(
                "normal_weight and friction_weight are to be > 0, smoothness and wrench_tolerance >= 0"
            )
        self.models = tuple(models)
        self._joints = joints_per_finger
        self._length, self._reach = length, reach
        self._weight, self._smoothness = normal_weight, smoothness
        self._band, self._tolerance = wrench_tolerance, tolerance
        count, dims = len(models), [model.dimension for model in self.models]
        starts = np.concatenate([[0], np.cumsum(dims)])
        size = int(starts[-1])
        self._normal = starts[:-1] + NORMAL
        self._scale = np.concatenate([np.insert(model.capacity, NORMAL, 1.0) for model in self.models])
        # where the unknowns stand in a (F, 4) array
        self._padded = np.concatenate([4 * i + np.arange(d) for i, d in enumerate(dims)])

        # Rows: wrench | facets per contact | normal forces | joint torques per finger.
        facets = [
            model.facets() * self._scale[starts[i] : starts[i + 1]] for i, model in enumerate(self.models)
        ]
        ends = 6 + np.concatenate([[0], np.cumsum([len(rows) for rows in facets])])
        self._first_normal = int(ends[-1])
        self._first_torque = self._first_normal + count
        rows_total = self._first_torque + count * joints_per_finger
        matrix, pattern = np.zeros((rows_total, size)), np.zeros((rows_total, size), dtype=bool)
        pattern[:6] = True
        for i, rows in enumerate(facets):
            columns = slice(starts[i], starts[i + 1])
            matrix[ends[i] : ends[i + 1], columns] = rows
            pattern[ends[i] : ends[i + 1], columns] = True
            first = self._first_torque + i * joints_per_finger
            pattern[first : first + joints_per_finger, columns] = True
        matrix[self._first_normal + np.arange(count), self._normal] = 1.0
        pattern |= matrix != 0.0

        # Column-major positions of all entries; those of G and of the torque maps change, the others never
        # do.
        columns_of, rows_of = np.nonzero(pattern.T)
        place = np.full(pattern.shape, -1)
        place[rows_of, columns_of] = np.arange(len(rows_of))
        torque_rows, torque_columns = np.nonzero(pattern[self._first_torque :])
        finger = torque_rows // joints_per_finger if joints_per_finger else torque_rows
        self._map_index = (finger, torque_rows - finger * joints_per_finger, torque_columns - starts[finger])
        self._map_scale = self._scale[torque_columns] / reach
        self._map_width = max(dims)
        self._G_scale = self._scale / np.array([1.0, 1.0, 1.0, length, length, length])[:, None]
        self._places = np.concatenate(
            [place[:6].ravel(), place[self._first_torque + torque_rows, torque_columns]]
        ).astype(np.int32)
        self._entries = np.zeros(len(self._places))

        self._indices = (rows_of, np.concatenate([[0], np.cumsum(pattern.sum(axis=0))]))
        self._values = matrix[rows_of, columns_of]
        self._shape = pattern.shape
        self._p = np.full(size, friction_weight + smoothness)
        self._p[self._normal] = normal_weight + smoothness
        self._q = np.zeros(size)
        self._lower, self._upper = np.full(rows_total, -_INFINITY), np.zeros(rows_total)
        self._upper[self._first_torque :] = _INFINITY
        self._solver = osqp.OSQP(algebra="builtin")
        diagonal = csc_matrix((self._p, np.arange(size), np.arange(size + 1)), shape=(size, size))
        self._solver.setup(
            diagonal,
            self._q,
            csc_matrix((self._values, *self._indices), shape=self._shape),
            self._lower,
            self._upper,
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

    def solve(
        self,
        G: Array,
        wrench: ArrayLike,
        limits: ForceLimits,
        target_normal: ArrayLike,
        torque_maps: Array | None = None,
        torque_bias: Array | None = None,
        previous: Array | None = None,
    ) -> ForceSolution:
        """Return the contact forces; an infeasible problem is a status, never an exception.

        Args:
            G: grasp map (6, sum m).
            wrench: (f, tau) (6,) [N, N m] for the fingers to exert on the object, about the origin of G.
            limits: of normal forces and joint torques.
            target_normal: (F,) [N] normal forces to aim at.
            torque_maps: (F, J, m) joint torque per contact force; m is the largest dimension of the models.
            torque_bias: (F, J) [N m] joint torques at zero contact force; zero by default.
            previous: (F, 4) forces that ``smoothness`` keeps near; the target without friction by default.

        Raises:
            ValueError: shapes that do not fit this mode.
        """
        G, wrench = np.array(G, dtype=np.float64), np.array(wrench, dtype=np.float64)
        count = len(self.models)
        if G.shape != (6, self._shape[1]) or wrench.shape != (6,) or limits.normal_floor.shape != (count,):
            raise ValueError(
                f"G {G.shape}, wrench {wrench.shape}, limits {limits.normal_floor.shape}; "
                f"(6, {self._shape[1]}), (6,), ({count},) are accepted"
            )
        changed = self._write_matrix(G, torque_maps)
        self._write_bounds(wrench, limits, torque_bias)
        target = np.asarray(target_normal, dtype=np.float64)
        if previous is not None and self._smoothness:
            self._q[:] = -self._smoothness * np.asarray(previous).ravel()[self._padded] / self._scale
            self._q[self._normal] -= self._weight * target
        else:
            self._q[:] = 0.0
            self._q[self._normal] = -(self._weight + self._smoothness) * target
        if changed:
            self._solver.update(
                q=self._q, l=self._lower, u=self._upper, Ax=self._entries, Ax_idx=self._places
            )
        else:
            self._solver.update(q=self._q, l=self._lower, u=self._upper)

        faults: tuple[str, ...] = ()
        status, y, iterations = self._iterate(G, wrench)
        if status != "solved":
            status, faults, y, more = self._recover(G, wrench)
            iterations += more
        forces = np.zeros((count, 4))
        forces.ravel()[self._padded] = y * self._scale
        for array in (forces, G, wrench):
            array.setflags(write=False)
        return ForceSolution(forces, status, faults, iterations, self.models, G, wrench)

    def _write_matrix(self, G: Array, torque_maps: Array | None) -> bool:
        """Put G and the torque maps into the entries of the matrix; return whether any changed."""
        entries = np.empty_like(self._entries)
        entries[: G.size] = (G * self._G_scale).ravel()
        if self._joints:
            shape = (len(self.models), self._joints, self._map_width)
            if torque_maps is None or torque_maps.shape != shape:
                given = None if torque_maps is None else torque_maps.shape
                raise ValueError(f"torque maps {given}; {shape} is accepted")
            entries[G.size :] = torque_maps[self._map_index] * self._map_scale
        if np.array_equal(entries, self._entries):
            return False
        self._entries = entries
        return True

    def _write_bounds(self, wrench: Array, limits: ForceLimits, torque_bias: Array | None) -> None:
        lower, upper = self._lower, self._upper
        lower[:3], lower[3:6] = wrench[:3], wrench[3:] / self._length
        upper[:6] = lower[:6] + self._band
        lower[:6] -= self._band
        lower[self._first_normal : self._first_torque] = limits.normal_floor
        upper[self._first_normal : self._first_torque] = np.minimum(limits.normal_ceiling, _INFINITY)
        if self._joints:
            bias = 0.0 if torque_bias is None else np.asarray(torque_bias)
            for bounds, limit in ((lower, limits.torque_lower), (upper, limits.torque_upper)):
                if limit is not None:
                    bounds[self._first_torque :] = np.clip(
                        (limit - bias).ravel() / self._reach, -_INFINITY, _INFINITY
                    )
                else:
                    bounds[self._first_torque :] = -_INFINITY if bounds is lower else _INFINITY

    def _iterate(self, G: Array, wrench: Array) -> tuple[str, Array, int]:
        """Run OSQP, finish its work if it stops short, and believe it only if the wrench checks."""
        result = self._solver.solve(raise_error=False)
        y, iterations, said = result.x, int(result.info.iter), result.info.status
        if said != "solved":
            exact = solve_exact(self._as_program())
            if exact is not None:
                if "infeasible" in said:  # mistaken, and its iterates have run away
                    self._forget()
                y, said = exact, "solved"
        if said != "solved":
            return f"unsolved: OSQP reports {said} after {iterations} iterations", y, iterations
        residual = G @ (y * self._scale) - wrench
        residual[3:] /= self._length
        allowed = self._band + 10.0 * self._tolerance * (1.0 + np.abs(y).max())
        if not np.abs(residual).max() <= allowed:
            return f"unsolved: the wrench is missed by {np.abs(residual).max():.1e} N", y, iterations
        return "solved", y, iterations

    def _recover(self, G: Array, wrench: Array) -> tuple[str, tuple[str, ...], Array, int]:
        """Find out why there is no solution; if there should be one, start OSQP afresh."""
        self._forget()
        edges = [0, 6, self._first_normal, self._first_torque, self._shape[0]]
        groups = {name: slice(*edges[i : i + 2]) for i, name in enumerate(_GROUPS) if edges[i] < edges[i + 1]}
        needed = measure_infeasibility(self._as_program(), groups)
        nearest = needed["wrench"][1] if "wrench" in needed else np.full(self._shape[1], np.nan)
        if needed and min(amount for amount, _ in needed.values()) < 1e-6:
            status, y, iterations = self._iterate(G, wrench)
            if status == "solved":
                return status, (), y, iterations
            self._forget()
            return status, (), nearest, iterations
        # Any problem yields if the object need not be held: that is a fault only if nothing else cures it.
        faults = tuple(name for name in needed if name != "wrench") or tuple(needed)
        units = {"joint torque": self._reach}
        cures = [_CURES[name].format(needed[name][0] * units.get(name, 1.0)) for name in faults]
        return (
            "infeasible: " + (" or ".join(cures) or "the limits contradict one another"),
            faults,
            nearest,
            0,
        )

    def _forget(self) -> None:
        """Drop the warm start: what is left of a failed solve would poison the next."""
        self._solver.warm_start(np.zeros(self._shape[1]), np.zeros(self._shape[0]))

    def _as_program(self) -> Program:
        values = self._values.copy()
        values[self._places] = self._entries
        A = csc_matrix((values, *self._indices), shape=self._shape).toarray()
        return Program(self._p, self._q, A, self._lower, self._upper)
