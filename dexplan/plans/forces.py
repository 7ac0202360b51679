"""How hard a loaded contact presses: the one place where the usual normal forces stand."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NormalForces:
    """Normal forces of a contact that bears its full load [N]; the defaults are what a problem file gets that says nothing.

    Raises ValueError unless ``0 < floor <= target <= ceiling``.
    """

    target: float = 5.5
    """What the contact aims at; the force QP raises it where the load asks for more.  More squeeze leaves more friction unused,
    costs torque, and lets tips stand deeper in the object."""
    floor: float = 4.0
    """Least normal force."""
    ceiling: float = 12.0
    """Greatest normal force."""

    def __post_init__(self) -> None:
        if not 0.0 < self.floor <= self.target <= self.ceiling:
            raise ValueError(
                f"normal forces {self.floor}, {self.target}, {self.ceiling} N; 0 < floor <= target <= ceiling is accepted"
            )
