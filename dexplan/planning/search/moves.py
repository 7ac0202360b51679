"""What leads from one grip to the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dexplan.plans.contacts import Contacts
from dexplan.plans.tip_roll import TipRoll


@dataclass(frozen=True)
class Go:
    """The grip takes the object ``stops`` further, to the next stretch where it is ``over`` the end of one."""

    stops: int


@dataclass(frozen=True)
class Place:
    """The free ``finger`` lands; ``touch`` is its contact as the oracle knows it."""

    finger: int
    touch: object


@dataclass(frozen=True)
class Lift:
    """The ``finger`` leaves its contact ``touch``."""

    finger: int
    touch: object


@dataclass(frozen=True, eq=False)
class RollTo:
    """Fingers roll on the object to where two of them hold; ``contacts`` after it, with its ``margins``, and why it is done."""

    rolls: tuple[TipRoll, ...]
    contacts: Contacts
    margins: Mapping[str, float] = field(default_factory=dict)
    why: str = ""


Move = Go | Place | Lift | RollTo
