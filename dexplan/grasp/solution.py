"""What goes into and comes out of the contact-force program, as values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dexplan.contact.friction import ContactModel
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class ForceLimits:
    """Bounds on normal forces (F,) [N] and, unless None, on joint torques (F, J) [N m].

    A contact being loaded or unloaded has floor 0 and a ceiling that ramps from or to 0.
    """

    normal_floor: Array
    normal_ceiling: Array
    torque_lower: Array | None = None
    torque_upper: Array | None = None

    def __post_init__(self) -> None:
        for name in ("normal_floor", "normal_ceiling", "torque_lower", "torque_upper"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, read_only(value))
        floor, ceiling = self.normal_floor, self.normal_ceiling
        if floor.shape != ceiling.shape:
            raise ValueError(
                f"normal floor {floor.shape}, ceiling {ceiling.shape}; equal shapes (F,) are accepted"
            )
        if (floor < 0.0).any() or (floor > ceiling).any():
            given = f"normal floor {floor.tolist()} N, ceiling {ceiling.tolist()} N"
            raise ValueError(f"{given}; 0 <= floor <= ceiling is accepted")
        if (
            self.torque_lower is not None
            and self.torque_upper is not None
            and (self.torque_lower > self.torque_upper).any()
        ):
            raise ValueError("a lower torque limit exceeds the upper one; lower <= upper is accepted")


@dataclass(frozen=True, eq=False)
class ForceSolution:
    """Contact forces with the problem they answer, from which they compute their own residuals.

    ``forces`` (F, 4) are (f_t1, f_t2, f_n, tau_n) [N, N m] on the object in each contact frame, tau_n = 0 for
    hard fingers; ``status`` is "solved", "infeasible: ..." with what would help, or "unsolved: ...".
    ``faults`` names the constraint groups whose loosening alone would make an infeasible problem feasible.
    Forces of an infeasible problem keep every other constraint and miss the wrench by as little as can be;
    they are NaN when even that is impossible.
    """

    forces: Array
    status: str
    faults: tuple[str, ...]
    iterations: int
    models: tuple[ContactModel, ...]
    G: Array
    wrench: Array

    @property
    def is_solved(self) -> bool:
        """Whether the forces meet every constraint."""
        return self.status == "solved"

    @cached_property
    def wrench_residual(self) -> Array:
        """``G f - wrench`` (6,) [N, N m]."""
        f = np.concatenate(
            [row[: model.dimension] for row, model in zip(self.forces, self.models, strict=True)]
        )
        return self.G @ f - self.wrench

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
