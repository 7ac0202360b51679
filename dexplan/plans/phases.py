"""Phases: stretches of an action during which the demanded contacts do not change."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.plans.contacts import Contacts

MUST, MAY, MUST_NOT = "must", "may", "must_not"
"""Whether a finger has to touch the object throughout a phase, may begin or end to touch in it, or has to stay off."""
TRAVEL = "travel"
"""Name of the phase in which a finger goes between home and hover."""


@dataclass(frozen=True)
class PlannedPhase:
    """One phase: its name, a demand per finger, and how long it is planned to take [s].

    ``duration`` is None until the plan has been timed.  The controller ends the phase "approach" when the finger touches.
    Raises ValueError for a duration that is not positive.
    """

    name: str
    touch: tuple[str, ...]
    duration: float | None = None

    def __post_init__(self) -> None:
        if self.duration is not None and not self.duration > 0.0:
            raise ValueError(f"phase {self.name} takes {self.duration} s; more than 0 is accepted")


def demand_touch(contacts: Contacts, changing: int | None = None) -> tuple[str, ...]:
    """Return the demand per finger while ``contacts`` hold; finger ``changing`` begins or ends to touch meanwhile."""
    return tuple(
        MAY if finger == changing else MUST_NOT if contact is None else MUST
        for finger, contact in enumerate(contacts)
    )


def build_placing(finger: int, before: Contacts, after: Contacts) -> tuple[PlannedPhase, ...]:
    """Return the phases in which ``finger`` comes down from its home, with the contacts ``before`` and ``after`` that."""
    return (
        PlannedPhase(TRAVEL, demand_touch(before)),
        PlannedPhase("approach", demand_touch(before, finger)),
        PlannedPhase("load", demand_touch(after)),
    )


def build_lifting(finger: int, before: Contacts, after: Contacts) -> tuple[PlannedPhase, ...]:
    """Return the phases in which ``finger`` leaves its contact and goes home, with the contacts ``before`` and ``after`` that."""
    return (
        PlannedPhase("unload", demand_touch(before)),
        PlannedPhase("retreat", demand_touch(before, finger)),
        PlannedPhase(TRAVEL, demand_touch(after)),
    )
