"""The spin with which fingers begin: the one that the motion ahead asks of their tips."""

from __future__ import annotations

from dexplan.planning.actions.coordinated import center_spin
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.tasks.starting import Start
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion


def center_start_spins(hand: HandModel, landed: Contacts, start: Start, motion: ObjectMotion) -> Contacts:
    """Return the start contacts with their spins chosen for the first ``motion``; a tip that stands there already stays."""
    given = start or (None,) * len(landed)
    return tuple(
        c if c is None or isinstance(one, Placement) else center_spin(hand, c, motion)
        for c, one in zip(landed, given, strict=True)
    )
