"""Pairs of contacts with which an object can be held where it stands: where a plan may begin if the planner may choose."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from dexplan.planning.contacts.still import Stand, StillContacts

MOST = 48
"""So many pairs of two fingers are proposed."""


def list_pairs(still: StillContacts) -> list[Stand]:
    """Return pairs of landings that hold as far as chord and load say, spread over the object; the least strained first.

    Whether the hand can really be there is for :meth:`StillContacts.judge` to say.
    """
    count = len(still.hand.fingers)
    found: list[tuple[float, Stand]] = []
    for a, b in combinations(range(count), 2):
        one, two = still.landings(a), still.landings(b)
        if not one or not two:
            continue
        loads = still.list_loads(a, b)
        rows, columns = np.nonzero(loads <= still.hand.limits.cone_share)
        order = np.argsort(loads[rows, columns], kind="stable")
        # The best of all, and a spread of the others: what holds best may lie at the end of every finger's way.
        order = np.concatenate([order[: MOST // 4], order[MOST // 4 :: max(1, len(order) // MOST)]])
        for k in order.tolist():
            stand: list[int | None] = [None] * count
            stand[a], stand[b] = one[rows[k]], two[columns[k]]
            found.append((float(loads[rows[k], columns[k]]), tuple(stand)))
    return [stand for _, stand in sorted(found, key=lambda pair: pair[0])]
