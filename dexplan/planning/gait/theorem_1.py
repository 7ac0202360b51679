"""The paper's Theorem 1, asked before a gait is tried: may any free finger take part in it?"""

from __future__ import annotations

from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.regions.regions import compute_regions
from dexplan.planning.regions.theorems import check_theorem_1
from dexplan.plans.refusal import Refusal, RefusalKind


def refuse_gait(table: ContactTable, held: tuple[Held, Held], done: int) -> Refusal | None:
    """Return why no free finger can take part in a gait with the pair ``held`` at progress ``done``; None if one may.

    The paper's Theorem 1, a necessary condition: some free finger can hold with one of the pair where it is.
    """
    i, j = held
    X_WO = table.leg.pose(done)
    regions = compute_regions(table.hand, X_WO, theta=table.beta_max)
    x_i, x_j = (X_WO[:3, :3].T @ table.normal(h) for h in held)
    refusal = None
    for k in sorted(set(range(len(table.hand.fingers))) - {i.finger, j.finger}):
        answer = check_theorem_1(regions, i.finger, j.finger, k, x_i, x_j)
        if answer.is_met:
            return None
        if refusal is None:
            subject = tuple(table.hand.fingers[f].name for f in (k, i.finger, j.finger))
            refusal = Refusal(RefusalKind.THEOREM_1, subject, answer.margin, 0.0, words=answer.reason)
    return refusal or Refusal(RefusalKind.NO_FREE_FINGER)
