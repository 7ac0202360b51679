"""What a search may ask about contacts: one protocol, whatever the body and the hand.

A *grip* says which fingers touch, and where; what it is made of is the oracle's own business, a search only hands it on.  The
object's way is cut into *stretches*, and these into *stops*, at which fingers may be relocated.  ``OrbitContacts`` answers for a
body that looks the same all around the axes of its way: its stretches are legs, its stops stations.  ``SiteContacts`` answers for
any way of the object: one stretch, its stops are poses.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, NamedTuple, Protocol, TypeVar

from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.stops import Stop
from dexplan.planning.ways.travel import Way
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal

Grip = TypeVar("Grip")
Touch = TypeVar("Touch")


class Progress(NamedTuple):
    """How far the object has come: ``stop`` on the stretch number ``stretch`` of its way."""

    stretch: int
    stop: int


class Purpose(StrEnum):
    """What a finger lands for."""

    CARRY = "carry"
    """The pair that it makes with the finger kept takes the object far."""
    ADVANCE = "advance"
    """The finger itself could go far."""
    STAND_IN = "stand_in"
    """The pair holds well where it is."""


@dataclass(frozen=True)
class Landfall(Generic[Grip, Touch]):
    """A question: where can the free ``finger`` land to hold with ``keep``, while the grip ``held`` holds, at the stop ``done``?

    ``keep`` is None where any of those that hold will do.
    """

    finger: int
    keep: Touch | None
    held: Grip
    done: int
    purpose: Purpose = Purpose.CARRY


@dataclass(frozen=True)
class Landing(Generic[Touch]):
    """A place to land: the contact, for how many stops the pair it makes then carries, and the share of the cone in use."""

    held: Touch
    promise: int
    load: float


@dataclass(frozen=True)
class Reach:
    """A grip can take the object ``stops`` further; what ends that, and the finger that it is about, None where it is no finger.

    ``stops`` is -1 where the grip does not hold at all.  ``refusals``: everything that kept the object from going farther.
    """

    stops: int
    end: Stop | Refusal
    finger: int | None = None
    refusals: tuple[Refusal, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """What a grip leaves to spare while it takes the object along, in the units of ``plan.json``; or why it cannot."""

    margins: Mapping[str, float]
    refusal: Refusal | None = None

    def joined(self, later: Verdict) -> Verdict:
        """Return the verdict on this stretch and a later one."""
        rows = [row for row in (self.margins, later.margins) if row]
        names = rows[0] if rows else ()
        pick = {name: max if name == "torque_share" else min for name in names}
        margins = {name: pick[name](row[name] for row in rows) for name in names}
        return Verdict(margins, self.refusal or later.refusal)


class Contacts(Protocol[Grip, Touch]):
    """The oracle.  Every question may be asked at any time, in any order; answers are kept and do not change."""

    @property
    def hand(self) -> HandModel:
        """The hand whose fingers these are."""
        ...

    def count_stops(self, stretch: int) -> int:
        """Return the number of a stretch's last stop; the first is 0."""
        ...

    def list_touching(self, grip: Grip) -> tuple[int, ...]:
        """Return the fingers that touch."""
        ...

    def change(self, grip: Grip, finger: int, touch: Touch | None) -> Grip:
        """Return the grip with a finger at another contact, or, None, at none."""
        ...

    def land(self, stretch: int, asked: Sequence[Landfall[Grip, Touch]]) -> list[list[Landing[Touch]]]:
        """Return for each of ``asked`` the places to land that are worth a try, as far as is quickly known."""
        ...

    def go(self, grip: Grip, at: Progress, most: int | None = None) -> Reach:
        """Return how far on a stretch a grip can take the object, at most so many stops; not all states are looked at."""
        ...

    def advance(self, grip: Grip, at: Progress, stops: int) -> Grip:
        """Return the grip so many stops further on; it is known to get there."""
        ...

    def refuse_carry(self, grip: Grip, at: Progress, stops: int) -> Refusal | None:
        """Return why a grip cannot take the object so many stops on: more states are looked at than by :meth:`go`."""
        ...

    def judge_carry(self, grip: Grip, at: Progress, stops: int) -> Verdict:
        """Return the same with every state judged exactly, and the worst margins of them all."""
        ...

    def judge(self, grip: Grip, at: Progress) -> Margins:
        """Return the margins of holding the object with a grip, all other fingers at home."""
        ...

    def list_rests(self, grip: Grip, at: Progress) -> list[tuple[Touch, Grip]]:
        """Return which contacts can be lifted, each with the grip that is left: two of it hold alone."""
        ...

    def find_way(self, touch: Touch, holding: Grip, at: Progress, looks_around: bool) -> Way:
        """Return how a free finger goes between home and a contact while others hold; a detour only if it ``looks_around``."""
        ...

    def class_of(self, grip: Grip, at: Progress) -> Hashable:
        """Return what small variations of a grip have in common."""
        ...

    def key_of(self, grip: Grip, at: Progress) -> Hashable:
        """Return what makes two grips the same to a search."""
        ...

    def place(self, touch: Touch, at: Progress) -> Placement:
        """Return a contact as a plan's value."""
        ...
