"""What the force audit is asked, and what it answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.spatial import Array

FEASIBLE, INFEASIBLE, UNDECIDED = "feasible", "infeasible", "undecided"


@dataclass(frozen=True, eq=False)
class SharedLimits:
    """Limits that the contacts keep together, as those of a joint that several of them load: low <= maps f <= high.

    ``maps`` (S, 4 K) [-, m, 1/m]: what each force adds; ``low``, ``high`` (S,), not both infinite.
    """

    maps: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class ForceQuestion:
    """Contacts of K fingers with J joints each, and the wrench that they should give the object.

    ``maps`` (6, 4 K): wrench about the object's centre of mass per force (f_t1, f_t2, f_n, tau_n) of each
    contact on the object [N, N m]; ``wrench`` (6,) in the same axes; ``friction`` (K, 2): sliding [-] and
    torsional [m]; ``ceiling`` [N]: greatest normal force.  ``torque_maps`` (K, J, 4): joint torque per
    force; ``torque_bias`` (K, J): joint torque without any [N m]; ``torque_limit`` (K, J) [N m], infinite
    where a finger has no such joint.  ``shared``: limits that several contacts keep together, None: there are none.
    """

    maps: Array
    wrench: Array
    friction: Array
    ceiling: float
    torque_maps: Array
    torque_bias: Array
    torque_limit: Array
    shared: SharedLimits | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """How many contacts, joints of each, and shared limits there are."""
        return *self.torque_bias.shape, 0 if self.shared is None else len(self.shared.low)

    def with_friction(self, factor: float) -> ForceQuestion:
        """Return the question with both frictions multiplied by ``factor``."""
        return ForceQuestion(**{**vars(self), "friction": factor * self.friction})

    @property
    def length(self) -> float:
        """Typical lever arm of a contact about the object's centre [m]."""
        arms = self.maps[3:].reshape(3, -1, 4)[:, :, :3]
        return float(np.sqrt((arms**2).sum(axis=(0, 2)).max(initial=1e-12) / 2.0))

    @property
    def scale(self) -> Array:
        """Force per unknown x and newton of the ceiling (K, 4): (mu, mu, 1, mu_t)."""
        mu, torsional = self.friction.T
        return np.stack([mu, mu, np.ones_like(mu), torsional], axis=1)

    @property
    def is_finite(self) -> bool:
        """Whether every number is one."""
        values = [self.maps, self.wrench, self.friction, self.torque_maps, self.torque_bias]
        values += [] if self.shared is None else [self.shared.maps]
        return all(bool(np.isfinite(value).all()) for value in values)


@dataclass(frozen=True, eq=False)
class Certificate:
    """What proves that there are no forces, up to a positive factor.

    ``twist`` (6,) [m/s, rad/s] about the object's centre of mass, in the axes of the question: contacts can do less work on
    this motion than the wrench has to.  The object can give way along its negative.  ``joints`` (K J + S,): what loosening
    the torque limits and the shared limits is worth, of either sign.
    """

    twist: Array
    joints: Array


@dataclass(frozen=True, eq=False)
class ForceAnswer:
    """``verdict``: feasible, infeasible or undecided, after ``rounds`` solves of ``iterations`` in all.

    ``forces`` (K, 4) [N, N m] answer a feasible question; they leave cones and limits by at most
    ``excess`` [N].  Of an infeasible one, every force within friction, ceiling and torque limits misses
    the wrench by ``shortfall`` [N] or more (torques over the question's length; infinite where the
    torque limits alone cannot be kept).  OSQP's ``certificate`` proves it; its rows cancel but for
    ``residual``, as a share of its largest entry.
    """

    verdict: str
    forces: Array | None = None
    excess: float = np.nan
    shortfall: float = np.nan
    residual: float = np.nan
    rounds: int = 0
    iterations: int = 0
    certificate: Certificate | None = None
