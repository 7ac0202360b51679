"""The contact forces found, which prove themselves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import ContactModel
from dexplan.grasp.force.certificate import OptimalityProof, prove_optimality
from dexplan.grasp.force.diagnosis import Loosening
from dexplan.grasp.force.problem import ForceProblem
from dexplan.spatial import Array, lock_arrays


@dataclass(frozen=True, eq=False)
class ForceSolution:
    """Contact forces with the problem they answer, from which they compute their own residuals, when asked.

    ``forces`` (F, 4) are (f_t1, f_t2, f_n, tau_n) [N, N m] on the object in each contact frame, tau_n = 0 for
    hard fingers; ``status`` is "solved", "infeasible: ..." with what would help, or "unsolved: ...".
    ``cures``, each enough by itself, make an infeasible problem feasible: a cure is one loosening or several together.
    ``method`` that found the forces took ``iterations``.
    Forces of an infeasible problem keep every other constraint and miss the wrench by as little as can be;
    they are NaN when even that is impossible.
    """

    forces: Array
    status: str
    problem: ForceProblem
    cures: tuple[tuple[Loosening, ...], ...] = ()
    method: str = ""
    iterations: int = 0

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def is_solved(self) -> bool:
        """Whether the forces meet every constraint."""
        return self.status == "solved"

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the constraint groups that occur in the cures of an infeasible problem."""
        return tuple(dict.fromkeys(loosening.group for cure in self.cures for loosening in cure))

    @property
    def models(self) -> tuple[ContactModel, ...]:
        """Contact models in the order of the contacts."""
        return self.problem.settings.models

    @cached_property
    def wrench_residual(self) -> Array:
        """``G f - wrench`` (6,) [N, N m]."""
        return self.problem.compute_wrench_residual(self.forces)

    @cached_property
    def primal_residual(self) -> dict[str, float]:
        """By how much the worst row of each group of constraints is violated; 0 where all are kept.

        "wrench" beyond its band [N], torque divided by the object's length; "friction" by the pyramid, in newtons of normal
        force; "normal force" [N]; "joint torque" [N m].
        """
        problem, settings = self.problem, self.problem.settings
        per_length = np.repeat([1.0, 1.0 / settings.length], 3)
        miss = np.abs(self.wrench_residual * per_length) - settings.wrench_tolerance
        excess = {
            "wrench": miss,
            "friction": problem.compute_friction_excess(self.forces),
            "normal force": problem.compute_normal_excess(self.forces),
            "joint torque": problem.compute_torque_excess(self.forces),
        }
        return {name: float(np.max(values, initial=0.0)) for name, values in excess.items()}

    @cached_property
    def optimality(self) -> OptimalityProof:
        """How far from the optimum the forces can be at most; NaN for forces that break a constraint on purpose."""
        return prove_optimality(self.problem, self.forces)

    @cached_property
    def cone_margins(self) -> Array:
        """Normal force (F,) [N] to spare before each contact slides, by its **exact** cone."""
        rows = zip(self.forces, self.models, strict=True)
        return np.array([model.cone_margin(row[: model.dimension]) for row, model in rows])

    @cached_property
    def utilisation(self) -> Array:
        """Used share (F,) of each **exact** cone; 1 slides."""
        rows = zip(self.forces, self.models, strict=True)
        return np.array([model.utilisation(row[: model.dimension]) for row, model in rows])
