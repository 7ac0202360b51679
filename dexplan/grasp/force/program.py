"""The contact-force program as numbers: rows in a fixed order and with a fixed sparsity, their values rewritten every tick."""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np

from dexplan.contact.friction import NORMAL
from dexplan.grasp.force.problem import ForceLimits, ForceProblem, ForceSettings
from dexplan.spatial import Array

INFINITY = 1e30
"""What OSQP takes for "no bound"."""

GROUPS = ("wrench", "friction", "normal force", "joint torque")
"""The groups of rows, in this order."""


class Program(NamedTuple):
    """``minimise 1/2 x' diag(p) x + q' x  s.t.  lower <= A x <= upper``, as dense arrays.

    ``p`` (n,) > 0, ``q`` (n,), ``A`` (k, n), ``lower`` and ``upper`` (k,); bounds of 1e30 and more count as none.
    """

    p: Array
    q: Array
    A: Array
    lower: Array
    upper: Array


@final
class ForceRows:
    """The rows of one contact mode, held in place from tick to tick.

    Forces are scaled twice.  y = f / c (f_n itself for the normal) makes every cone the same round one, the friction rows
    constant and the costs comparable; wrench rows of torque are divided by ``length`` and joint rows by ``reach``, so that
    all rows read in newtons.  x = sqrt(p) y then makes the cost the plain distance |x - aim|^2 / 2, so that the program asks
    for the point nearest to ``aim`` within ``lower <= D x <= upper``.
    """

    def __init__(self, settings: ForceSettings, joints: int) -> None:
        models = settings.models
        count, dims = len(models), [model.dimension for model in models]
        starts = np.concatenate([[0], np.cumsum(dims)])
        size = int(starts[-1])
        self.settings, self._joints = settings, joints
        self.normal = starts[:-1] + NORMAL
        self.scale = np.concatenate([np.insert(model.capacity, NORMAL, 1.0) for model in models])
        # where the unknowns stand in a (F, 4) array
        self.padded = np.concatenate([4 * i + np.arange(d) for i, d in enumerate(dims)])
        self.p = np.full(size, settings.friction_weight)
        self.p[self.normal] = settings.normal_weight
        self.root = np.sqrt(self.p)
        self.force_of_x = self.scale / self.root

        # Rows: wrench | facets per contact | normal forces | joint torques per finger.
        facets = [model.facets() for model in models]
        ends = 6 + np.concatenate([[0], np.cumsum([len(rows) for rows in facets])])
        first_normal = int(ends[-1])
        first_torque = first_normal + count
        total = first_torque + count * joints
        A, pattern = np.zeros((total, size)), np.zeros((total, size), dtype=bool)
        pattern[:6] = True
        self.contact = np.full(total, -1)  # of which contact a row speaks; -1 for all
        self.room = np.ones(total)  # what one newton [N] of loosening is worth to a row, see `groups`
        for i, rows in enumerate(facets):
            columns, own = slice(starts[i], starts[i + 1]), slice(ends[i], ends[i + 1])
            A[own, columns] = rows * self.scale[columns]
            pattern[own, columns] = True
            self.contact[own], self.room[own] = i, models[i].facet_inradius
            first = first_torque + i * joints
            pattern[first : first + joints, columns] = True
            self.contact[first : first + joints] = i
        A[first_normal + np.arange(count), self.normal] = 1.0
        self.contact[first_normal:first_torque] = np.arange(count)
        self.pattern = pattern | (A != 0.0)
        edges = [0, 6, first_normal, first_torque, total]
        self.groups = {n: slice(*edges[i : i + 2]) for i, n in enumerate(GROUPS) if edges[i] < edges[i + 1]}

        # The entries of G and of the torque maps change, the others never do.
        self._lengths = np.repeat([1.0, settings.length], 3)
        self._G_scale = self.force_of_x / self._lengths[:, None]
        rows_of, columns_of = np.nonzero(self.pattern[first_torque:])
        finger = rows_of // joints if joints else rows_of
        # places in the flattened matrix, and where their values stand in the flattened maps
        self._torque_place = (first_torque + rows_of) * size + columns_of
        self._map_index = rows_of * max(dims) + columns_of - starts[finger]
        self._map_scale = self.force_of_x[columns_of] / settings.reach
        self.map_width = max(dims)
        self.D = A / self.root
        self.aim = np.zeros(size)
        self.lower, self.upper = np.full(total, -INFINITY), np.zeros(total)
        self.upper[first_torque:] = INFINITY
        self._torque_lower, self._torque_upper = (
            bounds[first_torque:].reshape(count, joints) for bounds in (self.lower, self.upper)
        )
        self._aimed = slice(NORMAL, None, dims[0]) if len(set(dims)) == 1 else self.normal
        self.is_new = True  # whether the last `write` changed the matrix
        self._limits: ForceLimits | None = None
        self._G: Array | None = None
        self._torque_maps: Array | None = None

    def write(self, problem: ForceProblem) -> None:
        """Take over the values of ``problem``."""
        settings, limits, joints = self.settings, problem.limits, self._joints
        lower, upper = self.lower, self.upper
        # What cannot be written has not changed: the same arrays have the same numbers.
        self.is_new = not (problem.G is self._G and (problem.torque_maps is self._torque_maps or not joints))
        if self.is_new:
            self._write_matrix(problem)
        band = settings.wrench_tolerance
        np.divide(problem.wrench, self._lengths, out=lower[:6])
        upper[:6] = lower[:6]
        if band:
            upper[:6] += band
            lower[:6] -= band
        if limits is not self._limits:
            normal = self.groups["normal force"]
            lower[normal], upper[normal] = limits.normal_floor, limits.normal_ceiling
            self._limits = limits
        if joints:
            self._write_torques(problem)
        aim = self.aim
        aim[:] = 0.0
        aim[self._aimed] = problem.target_normal
        if problem.previous is not None:
            s = settings.smoothness
            aim += s * problem.previous.ravel()[self.padded] / self.scale
            aim /= 1.0 + s
        aim *= self.root

    def _write_torques(self, problem: ForceProblem) -> None:
        limits, bias = problem.limits, problem.torque_bias
        for bounds, limit, none in (
            (self._torque_lower, limits.torque_lower, -INFINITY),
            (self._torque_upper, limits.torque_upper, INFINITY),
        ):
            if limit is None:
                bounds[:] = none
            else:
                np.subtract(limit, 0.0 if bias is None else bias, out=bounds)
                bounds /= self.settings.reach

    def _write_matrix(self, problem: ForceProblem) -> None:
        np.multiply(problem.G, self._G_scale, out=self.D[:6])
        if self._joints:
            assert problem.torque_maps is not None
            self.D.ravel()[self._torque_place] = (
                problem.torque_maps.ravel()[self._map_index] * self._map_scale
            )
        self._G, self._torque_maps = problem.G, problem.torque_maps

    def as_program(self) -> Program:
        """Return the program in y, as dense copies."""
        return Program(
            self.p, -self.root * self.aim, self.D * self.root, self.lower.copy(), self.upper.copy()
        )
