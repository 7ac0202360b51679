"""From the way that a search found to the moves that it stands for."""

from __future__ import annotations

from itertools import pairwise

from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.still import Stand
from dexplan.planning.regrasp.moves import Move, reverse_roll
from dexplan.planning.rolling.roll_gait import RollPlan
from dexplan.planning.search.moves import Go, Lift, Place, RollTo
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.planning.ways.travel import describe_detour
from dexplan.plans.contacts import Contacts


def build_moves(
    contacts: SiteContacts, last: Node[Stand], goal: Contacts, option: RollPlan | None
) -> tuple[Move, ...]:
    """Return the moves on the way to ``last``, and the roll into the ``goal`` contacts from there if there is an ``option``."""
    way, poses = trace_back(last), contacts.layers.poses
    moves = []
    if (head := way[0].find_move(RollTo)) is not None:
        X_WO = poses[way[0].at.stop].X_WO
        moves.append(Move("roll", None, head.contacts, X_WO, head.margins, head.rolls, head.why))
    moves += [_build_move(contacts, before, node) for before, node in pairwise(way)]
    if option is not None:
        after = list(poses[-1].placements(last.grip))
        for roll in option.rolls:
            after[roll.finger] = goal[roll.finger]
        rolls = tuple(reverse_roll(r) for r in option.rolls)
        why = "no two of the goal contacts hold alone; they are rolled into"
        moves.append(Move("roll", None, tuple(after), poses[-1].X_WO, option.margins, rolls, why))
    return tuple(moves)


def _build_move(contacts: SiteContacts, before: Node[Stand], node: Node[Stand]) -> Move:
    """Return the one move by which ``node`` was come to."""
    still = contacts.layers.poses[node.at.stop]
    after, margins = still.placements(node.grip), node.arrival.margins
    if (go := node.find_move(Go)) is not None:
        motion = contacts.layers.step(before.at.stop)
        carried = contacts.judge_carry(before.grip, before.at, go.stops).margins
        return Move("carry", None, after, motion.X_WO_end, carried, motion=motion)
    if (place := node.find_move(Place)) is not None:
        way = node.arrival.ways.get(place.finger)
        assert isinstance(place.touch, int)
        why = f"{_explain_place(still.labels[place.touch])}{describe_detour(way)}"
        there = way.postures if way else None
        return Move("place", place.finger, after, still.X_WO, margins, why=why, way=there)
    lift = node.find_move(Lift)
    assert lift is not None
    way = node.arrival.ways.get(lift.finger)
    why = f"the others hold without it{describe_detour(way)}"
    back = way.postures[::-1] if way else None
    return Move("lift", lift.finger, after, still.X_WO, margins, why=why, way=back)


def _explain_place(label: int | None) -> str:
    if label is None:
        return "it stands in for a finger that has to move"
    return (
        "it comes near its goal contact, from where it is rolled there"
        if label
        else "it comes to its goal contact"
    )
