"""What an action leaves to spare, in words: what each number is, its unit, its limit, and which of them is tightest.

``plan.json`` keeps the numbers; limits belong to the problem, so whoever shows both brings them (:class:`MarginLimits`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class MarginLimits:
    """What plans of a problem have to leave to spare; the units are those of the names.

    ``dexterity`` is the smallest singular value of a finger's Jacobian with lengths in 60 mm; shares lie between 0 and 1.
    """

    joint_deg: float
    dexterity: float
    cone_share: float
    torque_share: float
    clearance_mm: float


@dataclass(frozen=True)
class Margin:
    """One margin of an action: ``words`` say what ``value`` in ``unit`` is; ``limit`` is None where nobody brought it.

    ``is_floor``: the value may not be less than the limit; else not more.
    """

    key: str
    words: str
    value: float
    unit: str
    is_floor: bool
    limit: float | None = None

    @property
    def used(self) -> float:
        """How much of the limit is used: 0 far from it, 1 at it; 0 without a limit."""
        if self.limit is None:
            return 0.0
        part, whole = (self.limit, self.value) if self.is_floor else (self.value, self.limit)
        return part / whole if whole > 0.0 else float("inf")

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        text = f"{self.words} {self.value:.3g}{unit}"
        if self.limit is None:
            return text
        return f"{text} ({'at least' if self.is_floor else 'at most'} {self.limit:.3g})"


@dataclass(frozen=True)
class _Kind:
    words: str
    unit: str
    is_floor: bool
    get_limit: Callable[[MarginLimits], float]


_KINDS: Mapping[str, _Kind] = {
    "load": _Kind("friction cone used", "", False, lambda x: x.cone_share),
    "joint_deg": _Kind("joints from their limits", "deg", True, lambda x: x.joint_deg),
    "dexterity": _Kind("dexterity", "", True, lambda x: x.dexterity),
    "torque_share": _Kind("torque used", "", False, lambda x: x.torque_share),
    "clearance_mm": _Kind("clearance", "mm", True, lambda x: x.clearance_mm),
}
"""Key of ``plan.json`` -> what it is.

``load`` is the share of the believed friction cone that is left; in words, the share that is used.  ``dexterity`` is the smallest
singular value of a holding finger's Jacobian, lengths in 60 mm: 0 at a singular posture.
"""


def describe_margins(margins: Mapping[str, float], limits: MarginLimits | None = None) -> tuple[Margin, ...]:
    """Return the margins of an action, those known first and in one order."""
    found = []
    for key, kind in _KINDS.items():
        if key in margins:
            value = 1.0 - margins[key] if key == "load" else margins[key]
            limit = None if limits is None else kind.get_limit(limits)
            found.append(Margin(key, kind.words, value, kind.unit, kind.is_floor, limit))
    found += [Margin(key, key, value, "", True) for key, value in margins.items() if key not in _KINDS]
    return tuple(found)


def find_tightest(margins: tuple[Margin, ...]) -> Margin | None:
    """Return the margin that uses most of its limit, None where no limits are known."""
    limited = [margin for margin in margins if margin.limit is not None]
    return max(limited, key=lambda margin: margin.used) if limited else None


def spell_margins(margins: Mapping[str, float], limits: MarginLimits | None = None) -> str:
    """Return the margins of an action in one line, the tightest marked."""
    described = describe_margins(margins, limits)
    tightest = find_tightest(described)
    return ", ".join(f"{margin}{' [tightest]' if margin is tightest else ''}" for margin in described)
