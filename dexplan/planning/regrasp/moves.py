"""What an adjustment of the grasp is made of: moves as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dexplan.planning.rolling.roll_to_goal import measure_angle
from dexplan.plans.contacts import Contacts
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, lock_arrays


@dataclass(frozen=True, eq=False)
class Move:
    """One move: ``kind`` place, lift, roll or carry; ``finger`` the one placed or lifted; ``contacts`` after it.

    The object is at ``X_WO`` (4, 4), or goes through ``motion`` in a carry.
    """

    kind: str
    finger: int | None
    contacts: Contacts
    X_WO: Array
    margins: Mapping[str, float] = field(default_factory=dict)
    rolls: tuple[TipRoll, ...] = ()
    why: str = ""
    motion: ObjectMotion | None = None
    way: Array | None = None
    """The postures (K, J) of the finger's way where they are not the arc's, as it walks them."""

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The answer of a search: the moves, or in ``refusal`` what stopped it nearest to the goal; ``opened`` counts nodes.

    ``is_exhausted``: there is no move left that it could try.
    """

    moves: tuple[Move, ...] | None
    refusal: Refusal | None = None
    opened: int = 0
    is_exhausted: bool = False


def reverse_roll(roll: TipRoll) -> TipRoll:
    """Return the same way walked backwards."""
    return TipRoll(roll.finger, roll.X_OF[::-1], roll.normal_O[::-1])


def is_same(a: Contacts, b: Contacts) -> bool:
    """Return whether the fingers touch at the same places."""
    return all(
        (x is None) == (y is None)
        and (x is None or y is None or measure_angle(x.normal_O, y.normal_O) < 1e-6)
        for x, y in zip(a, b, strict=True)
    )
