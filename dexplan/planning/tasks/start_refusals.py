"""What is wrong with a start grasp whose fingers all reach their contacts, and what would help."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dexplan.errors import spell_apart
from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.conditions import Condition, find_unmet
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.gait.search import CURE
from dexplan.planning.tasks.no import No
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.plans.status import Status

START_CLOSURE = float(np.radians(1.0))
"""Angle that a pair to start from keeps to the border of the believed friction cones [rad]; pairs that are chosen keep more."""


def refuse_start_grasp(table: ContactTable, held: tuple[Held, ...], margins: Margins) -> No | None:
    """Return the answer to start contacts ``held`` with these ``margins`` that do not hold; None where they do."""
    refusal, unmet = margins.refusal, find_unmet(margins.refusal)
    if unmet is Condition.STANDING and refusal is not None:
        cure = f"{unmet}, or choose other start contacts"
        return No(Status.BLOCKED, f"{refusal} at the start; {cure}", replace(refusal, cure=Cure(cure)))
    spare = compute_pair_angle_max(table.hand.friction) - table.pair_angle(held)
    if refusal is None and len(held) == 2 and spare < START_CLOSURE:
        words = "they are force closed with {} deg to spare, {} are kept".format(
            *spell_apart(np.degrees(spare), np.degrees(START_CLOSURE))
        )
        refusal = Refusal(RefusalKind.NOT_CLOSED, (), spare, START_CLOSURE, words=words)
    if refusal is None:
        return None
    if len(held) > 2 and not table.has_pair(held):
        # Two contacts have to hold alone; of three that do not, rolling may make two that do.
        return refuse_lifting(table, refusal)
    apart, cure = "", f"move them nearer to opposite, or {CURE}"
    if not table.has_pair(held):
        apart = f", and two contacts alone have to be {table.needed_angle()}"
    elif unmet not in (None, Condition.FRICTION):
        cure = f"choose other start contacts; what may help: {unmet}"
    reason = f"the start contacts do not hold the object: {refusal}{apart}; {cure}"
    return No(Status.START_INADMISSIBLE, reason, replace(refusal, cure=Cure(cure)))


def refuse_lifting(table: ContactTable, refusal: Refusal | None = None) -> No:
    """Return the answer where no two of the start contacts hold alone; ``refusal`` is what else is wrong with them."""
    known, cure = f" ({refusal})" if refusal else "", f"move two contacts apart, or {CURE}"
    apart = f"no two of the start contacts are {table.needed_angle()}"
    words = f"{apart}, so no finger can be lifted"
    reason = (
        f"{words}, and the goal lies beyond what this grasp can do alone{known}; the plan would have to begin with rolling; "
        f"{cure}"
    )
    return No(Status.NO_ADMISSIBLE_PAIR, reason, Refusal(RefusalKind.NOT_ALONE, cure=Cure(cure), words=words))
