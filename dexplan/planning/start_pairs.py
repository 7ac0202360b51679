"""The pair to start from where the problem leaves it to the planner, and why there is none."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from dexplan.planning.contacts import APART, ContactTable
from dexplan.planning.hand import HandModel
from dexplan.planning.held import Held
from dexplan.planning.regions import compute_opposition
from dexplan.spatial import Array


def find_start_pairs(table: ContactTable, count: int = 24) -> list[tuple[tuple[Held, ...], int, float]]:
    """Return pairs to start from where the problem leaves it to the planner, with promise and load, best first."""
    found: list[tuple[float, tuple[Held, ...], int, float]] = []
    chosen = {}
    for finger, rows in table.candidates.items():
        usable = np.flatnonzero(
            table.allows(rows.normals, 0) & ((rows.station == 0) | (not table.leg.is_shift))
        )
        chosen[finger] = usable[:: max(1, len(usable) // 200)]
    for a, b in combinations(sorted(table.candidates), 2):
        one, two = table.candidates[a], table.candidates[b]
        i, j = (m.ravel() for m in np.meshgrid(chosen[a], chosen[b], indexing="ij"))
        cosine = -(one.normals[i] * two.normals[j]).sum(1)
        promise = np.minimum(np.minimum(one.carry[i], two.carry[j]), max(table.stations, 1))
        ok = (cosine > compute_opposition(table.beta_max)) & (promise >= min(1, table.stations))
        ok &= table.keep_order(table.with_free({a: one.normals[i], b: two.normals[j]}))
        i, j, cosine, promise = i[ok], j[ok], cosine[ok], promise[ok]
        quick = promise - 8.0 * np.arccos(np.clip(cosine, -1.0, 1.0)) / (2.0 * table.beta_max)
        best = np.argsort(-quick, kind="stable")[:400]
        i, j = i[best], j[best]
        asked = promise[best] if table.stations else np.zeros(len(best), dtype=np.intp)
        lasting, load = table.estimate(one.normals[i], two.normals[j], asked)
        for k in np.flatnonzero(lasting >= 0):
            both = (one.pick(a, int(i[k])), two.pick(b, int(j[k])))
            found.append((float(lasting[k] - 8.0 * load[k]), both, int(lasting[k]), float(load[k])))
    found.sort(key=lambda item: -item[0])
    chosen_pairs: list[tuple[tuple[Held, ...], int, float]] = []
    taken: list[dict[int, Array]] = []
    for _, pair, lasting_one, load_one in found:
        normals = {h.finger: table.normal(h) for h in pair}
        # Pairs like one that was chosen say nothing new.
        if any(o.keys() == normals.keys() and min(o[f] @ normals[f] for f in o) > APART for o in taken):
            continue
        taken.append(normals)
        chosen_pairs.append((pair, lasting_one, load_one))
        if len(chosen_pairs) == count:
            break
    return chosen_pairs


def explain_no_start(table: ContactTable) -> tuple[str, str]:
    """Return the status and the reason where :func:`find_start_pairs` finds nothing: who cannot reach, or what does not hold."""
    hand = table.hand
    reach = {finger: table.explain_reach(finger) for finger in range(len(hand.fingers))}
    idle = [finger for finger, (reaches, _) in reach.items() if not reaches]
    if len(hand.fingers) - len(idle) < 2:
        why = "; ".join(
            explain_locked_joint(hand, f) or f"{hand.fingers[f].name}: {reach[f][1]}" for f in idle
        )
        names = _join([hand.fingers[f].name for f in idle])
        return (
            "start_unreachable",
            f"two fingers have to hold the object, and {names} can touch it nowhere where it stands ({why}); {REACH_CURE}",
        )
    widest = _measure_widest(table)
    needed = table.needed_angle()
    if compute_opposition(table.beta_max) < np.inf and -np.cos(widest) <= compute_opposition(table.beta_max):
        return (
            "no_force_closure_pair",
            f"no two fingers reach contacts {needed}: {np.degrees(widest):.1f} deg is the most they come to; "
            f"raise the friction, lower friction.safety, or {REACH_CURE}",
        )
    return (
        "no_force_closure_pair",
        f"no two fingers reach contacts {needed}, and carry the object with them; "
        "raise the friction, lower friction.safety, or use a lighter object",
    )


REACH_CURE = "use a smaller object, widen hand.joint_ranges_deg, or move the fingers' bases"


def explain_locked_joint(hand: HandModel, finger: int) -> str:
    """Return which joint of a finger has no room between its limits for holding anything, in words; "" where all have."""
    description, margin = hand.fingers[finger], hand.limits.joint_margin
    ranges = description.chain.upper - description.chain.lower
    if ranges.min() > 2.0 * margin + 1e-9:
        return ""
    name = description.joint_names[int(ranges.argmin())].replace("/", ".")
    return (
        f"{name} has a range of {np.degrees(ranges.min()):.1f} deg, and a finger that holds keeps {np.degrees(margin):.0f} deg "
        "to either end"
    )


def _measure_widest(table: ContactTable) -> float:
    """Return the largest angle [rad] between places where two fingers can land."""
    best = 0.0
    for a, b in combinations(sorted(table.candidates), 2):
        one, two = (
            _thin(table.candidates[f].normals[table.allows(table.candidates[f].normals, 0)]) for f in (a, b)
        )
        if len(one) and len(two):
            best = max(best, float(np.arccos(np.clip((one @ two.T).min(), -1.0, 1.0))))
    return best


def _thin(normals: Array) -> Array:
    return normals[:: max(1, len(normals) // 400)]


def _join(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
