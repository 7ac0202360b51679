"""Can fingers be exchanged?  One lands beside those that hold, and one of these leaves, each on its way from or to its home."""

from __future__ import annotations

from dataclasses import replace

from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.orbit_contacts import Holding, OrbitContacts
from dexplan.planning.search.moves import Lift, Place
from dexplan.planning.search.nodes import Arrival, Node
from dexplan.planning.search.problem import Judged, Refused
from dexplan.planning.ways.detour import NOBODY
from dexplan.planning.ways.travel import Way, choose_nearer, refuse_way
from dexplan.plans.refusal import Refusal, RefusalKind

GaitNode = Node[Holding]

DETOUR_COST = 2
"""A relocation by a detour counts as so many placements more: where arcs do, they are taken."""


def judge_exchange(contacts: OrbitContacts, node: GaitNode) -> Judged[Holding]:
    """Return whether the fingers can be exchanged that lead to ``node``.

    Where nothing but what is in the way of arcs keeps them from it, it is to be tried again, dearer, with detours.
    """
    at, clearance = node.at, contacts.hand.limits.clearance
    placed, lifted = read_exchange(node)
    before = (*(h for h in node.grip if h is not placed), lifted)
    found, ways, asked = [NOBODY], dict[int, Way](), list[tuple[Held, Holding]]()
    if placed is not None:
        found.append(contacts.find_nearest((*before, placed), at))
        if found[-1].distance >= clearance:
            if refusal := contacts.refuse_exchange(before, placed, node.grip, at):
                return Judged(refused=Refused(refusal))
            asked.append((placed, before))
    asked.append((lifted, node.grip))
    may_go_around = False
    for touch, holding in asked:
        # Once something is in the way, nobody asks about the next finger.
        if choose_nearer(*found).distance < clearance:
            break
        way = contacts.find_way(touch, holding, at, node.may_detour)
        found.append(way.nearest)
        if way.around:
            ways[touch.finger] = way
        may_go_around = contacts.may_go_around(way, touch, holding, at)
    nearest = choose_nearer(*found)
    if nearest.distance >= clearance:
        return Judged(replace(node, arrival=Arrival({"clearance_mm": 1e3 * nearest.distance}, ways)))
    refusal = refuse_way(contacts.hand, nearest)
    if node.may_detour:
        return Judged(refused=Refused(Refusal(RefusalKind.NO_WAY_AROUND, because=(refusal,))))
    around = replace(node, cost=node.cost + DETOUR_COST, may_detour=True) if may_go_around else None
    return Judged(refused=Refused(refusal), again=around)


def read_exchange(node: GaitNode) -> tuple[Held | None, Held]:
    """Return the contact that was placed, None where there was none, and the one lifted."""
    place, lift = node.find_move(Place), node.find_move(Lift)
    assert lift is not None
    assert isinstance(lift.touch, Held)
    if place is None:
        return None, lift.touch
    assert isinstance(place.touch, Held)
    return place.touch, lift.touch
