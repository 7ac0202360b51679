"""Why can no two fingers hold the object where it should go?  Tells what is in the way from what is out of reach."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np

from dexplan.planning.admissible import Admissibility
from dexplan.planning.hand import HandModel
from dexplan.planning.states import without_numbers
from dexplan.planning.still import StillContacts
from dexplan.spatial import Array

PAIRS = 40
"""So many pairs of contacts that fingers reach are asked what is wrong with them."""


def explain_no_pair(hand: HandModel, X_WO: Array, admissibility: Admissibility) -> str:
    """Return why no two fingers hold the object at ``X_WO`` (4, 4), and the cure; "" where it is out of their reach.

    First the object itself, and the fingers at home beside it; then what refuses most of the pairs that are within reach.
    """
    everyone = tuple(range(len(hand.fingers)))
    clearance, names = hand.probe.compute_clearance(hand.q_home, X_WO, everyone)
    if clearance < hand.limits.clearance:
        return (
            f"{names} would come within {1e3 * clearance:.1f} mm there, and {1e3 * hand.limits.clearance:.1f} mm have to be "
            "left; shorten goal.translation_m, or move what is in the way"
        )
    still, refusals = StillContacts(hand, X_WO, admissibility), Counter[str]()
    for i, j in combinations(everyone, 2):
        pairs = [(a, b) for a in still.landings(i) for b in still.landings(j) if still.forms_pair(a, b)]
        for k in np.unique(np.linspace(0, len(pairs) - 1, PAIRS).astype(int)) if pairs else ():
            a, b = pairs[k]
            stand = tuple(a if f == i else b if f == j else None for f in everyone)
            refusals[without_numbers(still.judge(stand).refusal)] += 1
    if not refusals:
        return ""
    ranked = sorted((-count, text) for text, count in refusals.items() if text)
    if not ranked:
        return ""
    return (
        f"fingers reach it there, but {ranked[0][1]}; shorten goal.translation_m, or move what is in the way"
    )
