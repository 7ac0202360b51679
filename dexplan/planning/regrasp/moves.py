"""What an adjustment of the grasp is made of: moves as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, lock_arrays

SAME_PLACE = 1e-7
"""Contacts nearer to one another than this are one [m]: what a file and a few turns of the object round off is less."""


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


def is_same_place(a: Placement, b: Placement) -> bool:
    """Return whether two contacts of a finger are at the same place of the object."""
    return bool(np.linalg.norm(a.point_O - b.point_O) < SAME_PLACE)


def is_same(a: Contacts, b: Contacts) -> bool:
    """Return whether the fingers touch at the same places."""
    return all(
        (x is None) == (y is None) and (x is None or y is None or is_same_place(x, y))
        for x, y in zip(a, b, strict=True)
    )
