"""What is asked of the contact forces, as values."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import NORMAL, ContactModel
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

    __repr__ = brief_repr

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


@dataclass(frozen=True)
class ForceSettings:
    """What stays the same while a contact mode lasts.

    ``models`` of the contacts, in the order of the columns of G.  Torque of the wrench is divided by ``length`` [m], the size of
    the object, to read as force, and torque of a joint by ``reach`` [m], its typical lever arm.  ``normal_weight`` and
    ``friction_weight`` are w_n and w_t [-]; ``smoothness`` is s [-], the weight of the change since the tick before (see
    :func:`dexplan.grasp.force.solver.compute_smoothness`).  ``wrench_tolerance`` [N] is half the width of the band around the
    wrench (torque: times ``length``), or 0.  Raises ValueError for no models, weights that are not positive and negative numbers.
    """

    models: tuple[ContactModel, ...]
    length: float = 0.035
    reach: float = 0.1
    normal_weight: float = 1.0
    friction_weight: float = 0.1
    smoothness: float = 0.0
    wrench_tolerance: float = 0.0

    def __post_init__(self) -> None:
        if not self.models:
            raise ValueError("no contact models; one or more are accepted")
        if not (
            min(self.normal_weight, self.friction_weight) > 0.0
            and min(self.smoothness, self.wrench_tolerance) >= 0.0
        ):
            raise ValueError(
                "normal_weight and friction_weight are to be > 0, smoothness and wrench_tolerance >= 0"
            )


@dataclass(frozen=True, eq=False)
class ForceProblem:
    """One question to the fingers: which contact forces?

    ``G`` (6, sum m) is the grasp map; ``wrench`` (6,) = (f, tau) [N, N m] what the fingers are to exert on the object, about the
    origin of G; ``limits`` those of normal forces and joint torques; ``target_normal`` (F,) [N] the normal forces to aim at.
    ``torque_maps`` (F, J, m) is joint torque per contact force, m the largest dimension of the models, and ``torque_bias`` (F, J)
    [N m] joint torque without contact forces; None: no joints, no such torque.  ``previous`` (F, 4) [N, N m] are the forces of
    the tick before, for ``smoothness``; None where there is no such tick.
    """

    settings: ForceSettings
    G: Array
    wrench: Array
    limits: ForceLimits
    target_normal: Array
    torque_maps: Array | None = None
    torque_bias: Array | None = None
    previous: Array | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("G", "wrench", "target_normal", "torque_maps", "torque_bias", "previous"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, read_only(value))

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where each contact's components stand in the stacked force vector (sum m,)."""
        ends = np.cumsum([model.dimension for model in self.settings.models])
        return tuple(
            slice(int(end) - model.dimension, int(end))
            for end, model in zip(ends, self.settings.models, strict=True)
        )

    def stack(self, forces: Array) -> Array:
        """Return ``forces`` (F, 4) without the padding of hard fingers (sum m,), as the columns of G want them."""
        models = self.settings.models
        return np.concatenate([row[: model.dimension] for row, model in zip(forces, models, strict=True)])

    def compute_wrench_residual(self, forces: Array) -> Array:
        """Return ``G f - wrench`` (6,) [N, N m] of ``forces`` (F, 4)."""
        return self.G @ self.stack(forces) - self.wrench

    def compute_friction_excess(self, forces: Array) -> Array:
        """Return the normal force (F,) [N] that each pyramid wants besides the given; negative is room to spare."""
        rows = zip(forces, self.settings.models, strict=True)
        return np.array([np.max(m.facets() @ row[: m.dimension]) / m.facet_inradius for row, m in rows])

    def compute_normal_excess(self, forces: Array) -> Array:
        """Return how far the normal forces (F,) [N] are outside their limits; negative is room to the nearer limit."""
        normal = forces[:, NORMAL]
        return np.maximum(normal - self.limits.normal_ceiling, self.limits.normal_floor - normal)

    def compute_torque(self, forces: Array) -> Array | None:
        """Return the joint torques (F, J) [N m] that ``forces`` take, or None without torque maps."""
        if self.torque_maps is None:
            return None
        torque: Array = np.einsum("fjm,fm->fj", self.torque_maps, forces[:, : self.torque_maps.shape[2]])
        return torque if self.torque_bias is None else torque + self.torque_bias

    def compute_torque_excess(self, forces: Array) -> Array:
        """Return how far the joint torques (F, J) [N m] are outside their limits; negative is room, -inf without limits."""
        torque = self.compute_torque(forces)
        excess = np.full((len(forces), 0) if torque is None else torque.shape, -np.inf)
        if torque is not None and self.limits.torque_upper is not None:
            excess = np.maximum(excess, torque - self.limits.torque_upper)
        if torque is not None and self.limits.torque_lower is not None:
            excess = np.maximum(excess, self.limits.torque_lower - torque)
        return excess

    def compute_cost(self, forces: Array) -> float:
        """Return what ``forces`` (F, 4) cost [N^2]: w_n (f_n - target)^2 + w_t |f_t / c|^2, and s times that of the change."""
        s = self.settings.smoothness
        aim = np.zeros_like(forces)
        aim[:, NORMAL] = self.target_normal
        cost = self._square(forces - aim)
        return cost if self.previous is None else cost + s * self._square(forces - self.previous)

    def _square(self, difference: Array) -> float:
        return float(self.weights @ self.stack(difference) ** 2)

    @cached_property
    def weights(self) -> Array:
        """Weights (sum m,) of the squares of the components of the force: w_n, and w_t / c^2."""
        friction, normal = self.settings.friction_weight, self.settings.normal_weight
        return np.concatenate(
            [np.insert(friction / m.capacity**2, NORMAL, normal) for m in self.settings.models]
        )
