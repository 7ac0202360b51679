"""What the controller believes and how it is tuned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

RATE = 250.0
"""Ticks per second, where nobody asks for others."""
TORQUE_RESERVE = 0.07
"""Share of the torque limits that the controller's forces may take beyond what plans keep to; more gives the force QP room where
tips stand otherwise than planned, and leaves the servos less."""
FORCE_SOLVERS = ("daqp", "osqp")
"""Who may solve for the contact forces."""


@dataclass(frozen=True)
class ControlOptions:
    """What the controller believes and how it is tuned.

    ``sliding`` and ``torsional`` [m] are the *believed* friction.  ``feedforward`` and ``object_feedback`` scale the two loops,
    for ablations.
    """

    sliding: float
    torsional: float
    normal_floor: float | None = None
    normal_ceiling: float | None = None
    """Least and greatest normal force of a loaded contact [N]; None: the plan's."""
    torque_fraction: float = 0.77
    """Share of the torque limits that forces may take: plans keep to 0.70, and what the servos add has to stay below 0.8 (see
    :func:`compute_torque_fraction`)."""
    feedforward: float = 1.0
    object_feedback: float = 1.0
    object_gain: float = 2.0
    """Rate [1/s] at which the object's pose error moves the fingertips' targets."""
    relaxation: float = 0.02
    """Time constant [s] in which a fingertip's carried pose follows the measured one, tick by tick: unwanted squeeze goes.

    While load goes from finger to finger tips give way, and forces lag by what they give way in this time.  At 0.15 s, five
    ticks at a time, a landing finger bore 0.10 N less than it was told and was twisted by 0.68 mN m (7 g, tips of 7 mm); at
    0.05 s, every tick, 0.04 N and 0.30 mN m.  Elsewhere (4 g): 0.06 N and 0.84 mN m at 0.05 s, 0.03 N and 0.38 mN m at 0.02 s."""
    joint_speed: float = 8.0
    """Fastest joint motion that mink may ask for [rad/s]."""
    force_solver: Literal["daqp", "osqp"] = "daqp"
    """Who solves for the contact forces: DAQP with OSQP behind it, or OSQP alone."""
    rate: float = RATE
    """Ticks per second.  A command is held for a whole tick, so the servos of joints that move are ahead of their mean at its
    beginning and behind at its end: their torques go up and down, and twist the tips on the object (see ``choose_rate``)."""

    @property
    def tick(self) -> float:
        """Control period [s]."""
        return 1.0 / self.rate

    def __post_init__(self) -> None:
        if not self.rate > 0.0:
            raise ValueError(f"rate is {self.rate}; a positive number of ticks per second is accepted")
        if self.force_solver not in FORCE_SOLVERS:
            raise ValueError(f"force solver {self.force_solver!r}; accepted: {' or '.join(FORCE_SOLVERS)}")


def compute_torque_fraction(planned: float) -> float:
    """Return the share of the torque limits that the controller's forces may take, where plans keep to the share ``planned``."""
    # Rounded so that 0.70 gives 0.77 and no neighbour of it.
    return min(1.0, round(planned + TORQUE_RESERVE, 12))
