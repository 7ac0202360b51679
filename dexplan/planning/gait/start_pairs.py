"""Pairs to start from where the problem leaves it to the planner, and who is missing where fewer than two fingers reach."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from dexplan.planning.admissible.conditions import refuse_locked_joint
from dexplan.planning.admissible.separation import compute_opposition
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.orbit_landfalls import APART, estimate_carries
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.spatial import Array

COUNT = 24
"""Pairs offered."""
SAMPLES = 200
"""Landing places of every finger that are tried, spread over all."""
BEST = 400
"""Pairs of two fingers whose loads are computed."""
REFUSED = 60
"""Pairs of two fingers that may be refused before no more of the same two are asked about."""


@dataclass(frozen=True)
class StartPair:
    """Two contacts, for how many stations they ``promise`` to carry the object, and the share of the cone in use."""

    held: tuple[Held, ...]
    promise: int
    load: float


def find_start_pairs(table: ContactTable, holds: Callable[[tuple[Held, ...]], bool]) -> list[StartPair]:
    """Return pairs of contacts with which the leg of ``table`` may begin, best first.

    ``holds`` says of a pair whether the hand can be there at all: which finger is where, others at home, is known only now.
    """
    chosen: list[StartPair] = []
    taken: list[dict[int, Array]] = []
    refused = Counter[tuple[int, ...]]()
    for pair in sorted(_propose(table), key=lambda pair: 8.0 * pair.load - pair.promise):
        fingers, normals = tuple(h.finger for h in pair.held), {h.finger: table.normal(h) for h in pair.held}
        # Pairs like one that was chosen say nothing new.
        if any(o.keys() == normals.keys() and min(o[f] @ normals[f] for f in o) > APART for o in taken):
            continue
        if refused[fingers] >= REFUSED:
            continue
        if not holds(pair.held):
            refused[fingers] += 1
            continue
        taken.append(normals)
        chosen.append(pair)
        if len(chosen) == COUNT:
            break
    return chosen


def _propose(table: ContactTable) -> list[StartPair]:
    """Return pairs that are far enough apart, in order, and carry the load."""
    found: list[StartPair] = []
    chosen, leg = {}, table.leg
    for finger, rows in table.candidates.items():
        usable = np.flatnonzero(table.allows(rows.normals, 0) & ((rows.station == 0) | (not leg.is_shift)))
        chosen[finger] = usable[:: max(1, len(usable) // SAMPLES)]
    for a, b in combinations(sorted(table.candidates), 2):
        one, two = table.candidates[a], table.candidates[b]
        i, j = (m.ravel() for m in np.meshgrid(chosen[a], chosen[b], indexing="ij"))
        cosine = -(one.normals[i] * two.normals[j]).sum(1)
        promise = np.minimum(np.minimum(one.carry[i], two.carry[j]), max(table.stations, 1))
        ok = (cosine > compute_opposition(table.beta_max)) & (promise >= min(1, table.stations))
        ok &= table.keep_order(table.with_free({a: one.normals[i], b: two.normals[j]}))
        i, j, cosine, promise = i[ok], j[ok], cosine[ok], promise[ok]
        quick = promise - 8.0 * np.arccos(np.clip(cosine, -1.0, 1.0)) / (2.0 * table.beta_max)
        best = np.argsort(-quick, kind="stable")[:BEST]
        i, j = i[best], j[best]
        asked = promise[best] if table.stations else np.zeros(len(best), dtype=np.intp)
        lasting, load = estimate_carries(table, one.normals[i], two.normals[j], asked)
        found += [
            StartPair((one.pick(a, int(i[k])), two.pick(b, int(j[k]))), int(lasting[k]), float(load[k]))
            for k in np.flatnonzero(lasting >= 0)
        ]
    return found


REACH_CURE = "use a smaller object, widen hand.joint_ranges_deg, or move the fingers' bases"


def refuse_unreachable(table: ContactTable) -> Refusal | None:
    """Return who can touch the object nowhere, where fewer than two fingers can, and what would help; None where two can."""
    hand = table.hand
    reach = {finger: table.explain_reach(finger) for finger in range(len(hand.fingers))}
    idle = [finger for finger, (reaches, _) in reach.items() if not reaches]
    if len(hand.fingers) - len(idle) >= 2:
        return None
    because = tuple(
        refuse_locked_joint(hand, f)
        or Refusal(
            RefusalKind.OUT_OF_REACH, (hand.fingers[f].name,), words=f"{hand.fingers[f].name}: {reach[f][1]}"
        )
        for f in idle
    )
    names = tuple(hand.fingers[f].name for f in idle)
    why = "; ".join(map(str, because))
    words = f"two fingers have to hold the object, and {_join(list(names))} can touch it nowhere where it stands ({why})"
    return Refusal(RefusalKind.OUT_OF_REACH, names, cure=Cure(REACH_CURE), because=because, words=words)


def _join(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
