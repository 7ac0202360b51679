"""Why something cannot be, as a value: what kind of no, who it is about, what was measured, what is needed, what would help.

Whoever decides reads ``kind`` and ``subject``; the sentence is for people and is made when somebody asks for it.  A refusal that
follows from others names them in ``because``, so that "finger_1 cannot be relocated, a joint of finger_1 comes near its limit"
still tells a program that it is a joint limit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

Key = tuple[str, tuple[str, ...], tuple[Any, ...]]

_SCALE = {"mm": 1e3, "deg": float(np.degrees(1.0))}
"""What a number in SI units is multiplied with to be told in these."""


class RefusalKind(StrEnum):
    """What kind of no.

    ``sentence`` tells it in words, with ``{who}`` for the subject, ``{measured}`` for the number and ``{because}`` for what it
    follows from; ``general`` is the same without the number.  ``unit`` is that of the numbers in words and in ``plan.json``.
    """

    sentence: str
    general: str
    unit: str

    def __new__(cls, value: str, sentence: str = "", general: str = "", unit: str = "") -> RefusalKind:
        """Return the member written ``value`` in ``plan.json``."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.sentence, member.general, member.unit = sentence, general or sentence, unit
        return member

    # one state of the hand
    JOINT_LIMIT = (
        "joint_limit",
        "a joint of {who} comes within {measured} deg of its limit",
        "a joint of {who} comes near its limit",
        "deg",
    )
    SINGULAR = "singular", "{who} comes near a singular posture"
    NEAR_STANDING = "near_standing", "{who} come within {measured} mm", "{who} come too near", "mm"
    """Something comes too near to an obstacle, or to the floor."""
    NEAR_FINGER = "near_finger", "{who} come within {measured} mm", "{who} come too near", "mm"
    """Two fingers come too near to one another."""
    NEAR_ITSELF = "near_itself", "{who} come within {measured} mm", "{who} come too near", "mm"
    """Two links of one finger come too near to one another."""
    NEAR_OBJECT = "near_object", "{who} come within {measured} mm", "{who} come too near", "mm"
    """A finger comes too near to the object with what should not touch it."""
    LOAD = "load", "the contacts cannot carry the load"
    ORDER = "order", "the fingers would change their order"
    OUT_OF_REACH = "out_of_reach", "{who} comes to the end of its workspace"
    # rolling
    TIP_POLE = "tip_pole", "{who} would roll too far off its tip's pole", "", "deg"
    TIP_ROTATION = "tip_rotation", "{who} would roll too far round on its tip", "", "deg"
    LEFT_TO_TORSION = (
        "left_to_torsion",
        "{who} leave a turn of the object to torsional friction that is overcome",
    )
    """Contacts that pivot fix points of the object, and these are too few to fix all of it."""
    PIVOT_SLIP = (
        "pivot_slip",
        "the tip of {who} would slide by {measured} mm while it turns about the normal",
        "the tip of {who} would slide too far while it turns about the normal",
        "mm",
    )
    PAIR_NOT_OPENED = "pair_not_opened", "no pair of contacts can be opened far enough"
    CANNOT_ROLL_APART = (
        "cannot_roll_apart",
        "no two of the {who} contacts hold, and rolling cannot make two that do: {because}",
    )
    # relocations
    ON_WAY = "on_way", "{because} on the way"
    NO_WAY_AROUND = "no_way_around", "{because}, and there is no way around"
    CANNOT_LEAVE = "cannot_leave", "{because} when {who} leaves"
    CANNOT_RELOCATE = "cannot_relocate", "{who} cannot be relocated, {because}"
    CANNOT_TAKE_GOAL = "cannot_take_goal", "{who} cannot take its goal contact, {because}"
    CANNOT_COME_LAST = "cannot_come_last", "{who} cannot come last, {because}"
    CANNOT_CARRY_ON = "cannot_carry_on", "the object cannot be carried on, {because}"
    NOT_ALONE = "not_alone", "the other two do not hold alone"
    NO_PLACE = "no_place", "no place lets another finger go"
    NO_PAIR = "no_pair", "no two fingers hold the object somewhere on its way"
    NO_CHAIN = "no_chain", "no exchange of fingers leads on"
    NO_ROOM = "no_room", "a third finger would find no room beside them either"
    # gaits
    THEOREM_1 = "theorem_1", "there is no gait for {who} [paper, Theorem 1]", "", "deg"
    """The paper's necessary condition for a gait is not met [paper §2.2]."""
    NO_FREE_FINGER = "no_free_finger", "no finger is free"
    NO_LANDING = "no_landing", "no placement holds with a finger that holds already"
    LEG_END = "leg_end", "{who} cannot go on after the leg"
    GAIT_CUT_SHORT = (
        "gait_cut_short",
        "no gait was found that brings the object there, within {measured} nodes",
    )
    NOT_BROUGHT = "not_brought", "the object cannot be brought there ({because})"
    # ways to goal contacts
    GOAL_CONTACT_OUT_OF_REACH = (
        "goal_contact_out_of_reach",
        "{who} cannot reach the goal contact where the grasp would be adjusted",
    )
    GOAL_GRASP_FAILS = (
        "goal_grasp_fails",
        "the goal grasp does not hold where it would be made: {because}",
    )
    CANNOT_CARRY_TO_GOAL = (
        "cannot_carry_to_goal",
        "the goal grasp cannot carry the object to the goal: {because}",
    )
    NO_WAY_IN = "no_way_in", "there is no way into the goal grasp where it would be made: {because}"
    NO_ADJUSTMENT = "no_adjustment", "no way from the grasp there to the goal grasp: {because}"
    WORK_USED_UP = "work_used_up", "the work was used up before the search for the grasp began"
    # before anything moves
    OVERLAP = "overlap", "{who} overlap by {measured} mm wherever the fingers are", "{who} overlap", "mm"
    WAITING = "waiting", "{who} waits at home while it is free, and {because} there"
    LOCKED_JOINT = "locked_joint", "{who} has no room between its limits", "", "deg"
    NOT_ALLOWED = "not_allowed", "the contact of {who} lies outside object.allowed_regions"
    NOT_CLOSED = "not_closed", "the contacts are not force closed with the believed friction", "", "deg"
    TOO_HEAVY = "too_heavy", "no two fingers can carry its weight"
    TOO_LIGHT = "too_light", "the object is too light for this hand", "", "N"


@dataclass(frozen=True, slots=True)
class Cure:
    """What would help, in words; ``is_checked``: it was tried and does help, else it is what usually does."""

    text: str
    is_checked: bool = False

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why something cannot be.

    ``subject``: names of fingers, bodies or joints that it is about.  ``measured`` is the number that was found and ``needed``
    the one that it fell short of, both in SI units (m, rad, N).  ``because``: what it follows from, the commonest first.
    ``words``: the sentence, where that of the kind does not say it well.
    """

    kind: RefusalKind
    subject: tuple[str, ...] = ()
    measured: float | None = None
    needed: float | None = None
    cure: Cure | None = None
    because: tuple[Refusal, ...] = ()
    words: str = ""

    def __str__(self) -> str:
        if self.words:
            return self.words
        text = self.kind.general if self.measured is None else self.kind.sentence
        return text.format(
            who=" and ".join(self.subject),
            measured="" if self.measured is None else self._spell(self.measured),
            because="; ".join(map(str, self.because)),
        )

    def _spell(self, value: float) -> str:
        unit = self.kind.unit
        return f"{_SCALE.get(unit, 1.0) * value:.1f}" if unit else f"{value:.0f}"

    @property
    def key(self) -> Key:
        """What like refusals share: the kind and the subject, of what they follow from as well; numbers do not count."""
        return self.kind.value, self.subject, tuple([r.key for r in self.because])

    @property
    def root(self) -> Refusal:
        """What it comes down to: the first refusal that follows from no other."""
        return self.because[0].root if self.because else self

    @property
    def chain(self) -> tuple[RefusalKind, ...]:
        """The kinds from this refusal down to its root."""
        return (self.kind, *(self.because[0].chain if self.because else ()))

    @property
    def without_numbers(self) -> Refusal:
        """The same without what differs from state to state, to speak of many alike; words of its own stay as they are."""
        if self.words or (self.measured is None and not self.because):
            return self
        return replace(self, measured=None, because=tuple(r.without_numbers for r in self.because))

    def as_dict(self) -> dict[str, Any]:
        """Return the refusal as JSON data; numbers in the ``unit`` of its kind."""
        scale = _SCALE.get(self.kind.unit, 1.0)
        return {
            "kind": self.kind.value,
            "subject": list(self.subject),
            "measured": None if self.measured is None else round(scale * self.measured, 9),
            "needed": None if self.needed is None else round(scale * self.needed, 9),
            "unit": self.kind.unit,
            "cure": None if self.cure is None else self.cure.text,
            "checked": self.cure is not None and self.cure.is_checked,
            "because": [r.as_dict() for r in self.because],
            "text": str(self),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Refusal:
        """Return the refusal that :meth:`as_dict` described, with its sentence as it was written."""
        kind = RefusalKind(data["kind"])
        scale = _SCALE.get(kind.unit, 1.0)
        return cls(
            kind,
            tuple(data["subject"]),
            None if data["measured"] is None else float(data["measured"]) / scale,
            None if data["needed"] is None else float(data["needed"]) / scale,
            None if data["cure"] is None else Cure(data["cure"], bool(data["checked"])),
            tuple(cls.from_dict(r) for r in data["because"]),
            data["text"],
        )


@dataclass(eq=False)
class RefusalCount:
    """Counts refusals, those of the same kind and subject together."""

    _counts: dict[Key, int] = field(default_factory=dict)
    _first: dict[Key, Refusal] = field(default_factory=dict)

    def add(self, refusal: Refusal, times: int = 1) -> None:
        """Count a refusal."""
        key = refusal.key
        self._counts[key] = self._counts.get(key, 0) + times
        self._first.setdefault(key, refusal)

    def update(self, refusals: Iterable[Refusal]) -> None:
        """Count several refusals."""
        for refusal in refusals:
            self.add(refusal)

    def __bool__(self) -> bool:
        return bool(self._counts)

    @property
    def counts(self) -> list[tuple[Refusal, int]]:
        """The first refusal of every kind and subject and how many there were; the commonest first, then the earliest."""
        ranked = sorted(self._counts, key=lambda key: -self._counts[key])
        return [(self._first[key], self._counts[key]) for key in ranked]

    def list_common(self, most: int | None = None) -> list[Refusal]:
        """Return the commonest refusals, numbers left out."""
        return [refusal.without_numbers for refusal, _ in self.counts[:most]]
