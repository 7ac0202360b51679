"""What is wrong with a start grasp whose fingers all reach their contacts, and what would help."""

from __future__ import annotations

import numpy as np

from dexplan.errors import spell_apart
from dexplan.plan.status import Status
from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.conditions import Condition
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.gait.contacts import ContactTable
from dexplan.planning.gait.held import Held
from dexplan.planning.gait.search import CURE

START_CLOSURE = float(np.radians(1.0))
"""Angle that a pair to start from keeps to the border of the believed friction cones [rad]; pairs that are chosen keep more."""


def refuse_start_grasp(
    table: ContactTable, held: tuple[Held, ...], margins: Margins
) -> tuple[Status, str] | None:
    """Return the status and the reason that refuse the contacts ``held`` with these ``margins``; None where nothing does."""
    refusal = margins.refusal
    if margins.unmet is Condition.STANDING:
        return Status.BLOCKED, f"{refusal} at the start; {margins.unmet}, or choose other start contacts"
    spare = compute_pair_angle_max(table.hand.friction) - table.pair_angle(held)
    if not refusal and len(held) == 2 and spare < START_CLOSURE:
        refusal = "they are force closed with {} deg to spare, {} are kept".format(
            *spell_apart(np.degrees(spare), np.degrees(START_CLOSURE))
        )
    if not refusal:
        return None
    if len(held) > 2 and not table.has_pair(held):
        # Two contacts have to hold alone; of three that do not, rolling may make two that do.
        return Status.NO_ADMISSIBLE_PAIR, explain_no_start_pair(table, refusal)
    apart, cure = "", f"move them nearer to opposite, or {CURE}"
    if not table.has_pair(held):
        apart = f", and two contacts alone have to be {table.needed_angle()}"
    elif margins.unmet not in (None, Condition.FRICTION):
        cure = f"choose other start contacts; what may help: {margins.unmet}"
    return Status.START_INADMISSIBLE, f"the start contacts do not hold the object: {refusal}{apart}; {cure}"


def explain_no_start_pair(table: ContactTable, refusal: str) -> str:
    """Return in words that no two of the start contacts hold alone; ``refusal`` is what else is wrong with them, or ""."""
    known = f" ({refusal})" if refusal else ""
    return (
        f"no two of the start contacts are {table.needed_angle()}, so no finger can be lifted, and the goal lies beyond "
        f"what this grasp can do alone{known}; the plan would have to begin with rolling; "
        f"move two contacts apart, or {CURE}"
    )
