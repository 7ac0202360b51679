"""Rolling all the way: fingers that touch already roll to their goal contacts while all of them hold [paper §3]."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, worst
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.rolling.roll_gait import STEP, RollPlan, RollToPair, follow_roll, judge_ways
from dexplan.planning.rolling.rolls import build_roll, end_placement, get_direction
from dexplan.plans.contacts import Contacts
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array

ROLL_REACH = float(np.radians(45.0))
"""Contacts farther than this from their goals [rad] are not rolled all the way."""

WIDER = np.radians((0.5, 3.0, 8.0))
"""How much wider than needed a pair is rolled apart [rad]."""


@dataclass(frozen=True, eq=False)
class Rolled:
    """Rolls of some fingers at the same time, the contacts of all fingers afterwards, and the worst margins on the way."""

    rolls: tuple[TipRoll, ...]
    contacts: Contacts
    margins: dict[str, float]


def measure_angle(a: Array, b: Array) -> float:
    """Return the angle [rad] between two vectors (3,)."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def roll_all_the_way(
    hand: HandModel, admissibility: Admissibility, X_WO: Array, start: Contacts, goal: Contacts
) -> tuple[Rolled, ...] | None:
    """Return rolls along great circles that bring every finger of ``start`` to its contact in ``goal``.

    All of them together, or, where that is not admissible at every instant, one after another in the first order that is; None
    where that fails too, or where other fingers touch than in the goal.
    """
    if not hand.object.body.is_smooth:
        return None
    pairs = list(zip(start, goal, strict=True))
    if any((a is None) != (b is None) for a, b in pairs):
        return None
    way = {
        a.finger: measure_angle(get_direction(hand, a), get_direction(hand, b))
        for a, b in pairs
        if a is not None and b is not None
    }
    rolling = tuple(f for f, angle in way.items() if angle > 1e-9)
    if not rolling or max(way.values()) > ROLL_REACH:
        return None
    orders: list[list[tuple[int, ...]]] = [[rolling]]
    if len(rolling) > 1:
        orders += [[(f,) for f in order] for order in permutations(rolling)]
    for order in orders:
        contacts, rolled = start, []
        for group in order:
            one = _roll(hand, admissibility, X_WO, contacts, goal, {f: way[f] for f in group})
            if one is None:
                break
            rolled.append(one)
            contacts = one.contacts
        else:
            return tuple(rolled)
    return None


def _roll(
    hand: HandModel,
    admissibility: Admissibility,
    X_WO: Array,
    contacts: Contacts,
    goal: Contacts,
    way: dict[int, float],
) -> Rolled | None:
    """Return the roll of the fingers in ``way`` by these angles [rad] while all hold; None where it is not admissible."""
    count = max(9, int(np.ceil(max(way.values()) / STEP)) + 1)
    postures = {c.finger: np.repeat(c.q[None], count, axis=0) for c in contacts if c is not None}
    rolls, after = [], list(contacts)
    for f, angle in way.items():
        here, there = contacts[f], goal[f]
        assert here is not None
        assert there is not None
        roll = build_roll(hand, here, get_direction(hand, there), angle, count)
        q, refusal = follow_roll(hand, X_WO, roll, here.q)
        if refusal:
            return None
        rolls.append(roll)
        postures[f] = q
        after[f] = end_placement(hand, roll, here, q[-1])
    rows, refusal = judge_ways(hand, admissibility, X_WO, postures)
    if refusal:
        return None
    return Rolled(tuple(rolls), tuple(after), worst(rows))


class RollEveryPair(RollToPair):
    """Rolls of every pair of three fingers, not only of those that are farthest apart, in a few steps only."""

    def first_of_every_pair(self, count: int) -> list[RollPlan]:
        """Return up to ``count`` ways for every pair."""
        found: list[RollPlan] = []
        touching = [c for c in self.contacts if c is not None]
        for third in touching:
            a, b = (c for c in touching if c is not third)
            now = measure_angle(get_direction(self.hand, a), get_direction(self.hand, b))
            first, ways = self.find_first_opening(a, b, now), 0
            for wider in WIDER:
                if ways < count and first + wider < np.pi - now:
                    way = self.open_pair(a, b, third, float(first + wider))
                    if way is not None:
                        found.append(way)
                        ways += 1
        return found
