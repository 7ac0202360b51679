"""Where fingers touch the object: as planned, and as asked for."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.brief import brief_repr
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class Placement:
    """Where and how one finger touches the object.

    ``point_O``, ``normal_O`` (3,): contact point [m] and outward normal in the object frame; ``X_OF`` (4, 4): the fingertip in
    the object frame, spin included; ``q`` (J,): the finger's posture when it lands [rad].
    """

    finger: int
    point_O: Array
    normal_O: Array
    X_OF: Array
    q: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("point_O", "normal_O", "X_OF", "q"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


@dataclass(frozen=True, eq=False)
class GoalContact:
    """Where a finger has to touch in the end: contact point [m] and outward normal (3,) in the object frame."""

    finger: int
    point_O: Array
    normal_O: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("point_O", "normal_O"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


Contacts = tuple[Placement | None, ...]
"""Per finger where it touches, None where it is free."""


def list_holding(contacts: Contacts) -> tuple[int, ...]:
    """Return the fingers that touch, in their order."""
    return tuple(finger for finger, contact in enumerate(contacts) if contact is not None)
