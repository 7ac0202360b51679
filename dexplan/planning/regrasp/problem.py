"""A regrasp as a problem posed to the engine: a given grip at the last pose, or one from which it is rolled into.

A node's children put a free finger down, lift one where the others hold alone, or carry the object to the next pose.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from dexplan.planning.contacts.oracle import Landfall, Progress
from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.still import Stand, StillContacts, change_stand, land_again
from dexplan.planning.regrasp.relocation_bound import Pair, RelocationBound
from dexplan.planning.search.moves import Go, Lift, Move, Place
from dexplan.planning.search.nodes import Arrival, Node, known_bound, trace_back
from dexplan.planning.search.problem import Expansion, Judged, Likes, Refused
from dexplan.planning.ways.travel import refuse_way
from dexplan.plans.refusal import Refusal, RefusalKind

StandNode = Node[Stand]

HEURISTIC_WEIGHT = 2.5
"""How much more moves still to be made count than those already made."""
CARRY_COST, START_COST = 0.3, 0.4
"""What a carry from pose to pose counts, and the first one after a relocation in addition; a placement or a lift counts 1."""
HIDDEN = 0.45
"""What a lift before a carry, or a placement after one, counts less where the finger travels meanwhile."""
LOAD_COST = 0.4
"""What a landing counts in addition whose pair uses all of the believed cone."""


class End(Protocol):
    """Which grips at the last pose are the goal.

    ``still``: the contacts there.  ``roots``: the stands that are ends, each with the pairs of fingers whose third may come last;
    None where any two contacts that hold are one.  ``wanted``: per finger the spots that ends use and a grid need not have.
    """

    @property
    def still(self) -> StillContacts:
        """The contacts at the last pose."""
        ...

    @property
    def roots(self) -> Mapping[Stand, list[Pair]] | None:
        """The stands that are ends."""
        ...

    @property
    def wanted(self) -> Mapping[int, list[int]]:
        """Spots that ends use."""
        ...

    def is_end(self, stand: Stand) -> bool:
        """Return whether a stand at the last pose is an end."""
        ...


@dataclass(eq=False)
class RegraspProblem:
    """What stands are worth, and what they lead to, on the way of ``contacts`` into a grip that ``side`` takes for an end.

    ``is_simultaneous``: relocations next to a motion of the object are cheaper, for it will hide the finger's travel, and goal
    contacts may be taken before the object is at its end.  What counts as much as ``cost_limit`` is left out.
    """

    contacts: SiteContacts
    side: End
    is_simultaneous: bool = False
    cost_limit: float = np.inf
    bound: RelocationBound = field(init=False)
    _early: dict[tuple[int, int], list[int]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self._layers, self._last = self.contacts.layers, self.contacts.layers.last
        self.bound = RelocationBound(self._layers, self.side.roots, self.is_simultaneous)

    # -- what nodes are worth --------------------------------------------------------------------------------------------

    def estimate(self, node: StandNode) -> StandNode:
        """Return a node with how many placements and lifts are missing at least; inf where no way leads on."""
        missing = self.bound.count_moves(node.at.stop, node.grip)
        return node if missing == node.bound else replace(node, bound=missing)

    def rank(self, node: StandNode) -> float:
        """Return the priority of a node, the smallest first."""
        ahead = known_bound(node) + CARRY_COST * (self._last - node.at.stop)
        return node.cost + HEURISTIC_WEIGHT * ahead + node.strain

    def costs_too_much(self, node: StandNode) -> bool:
        """Return whether a way through the node counts at least as much as one that is known."""
        ahead = (1.0 - HIDDEN) * known_bound(node) + CARRY_COST * (self._last - node.at.stop)
        return node.cost + ahead >= self.cost_limit

    def key_of(self, node: StandNode) -> Hashable:
        """Return what makes two nodes the same: the pose and the stand."""
        return self.contacts.key_of(node.grip, node.at)

    def list_likes(self, node: StandNode) -> Likes:
        """Return what makes two nodes much alike; those fail alike that put the same finger down in the same place."""
        place = node.find_move(Place)
        failing = None if place is None else (node.at.stop, place.finger, place.touch)
        return Likes(self.contacts.class_of(node.grip, node.at), failing)

    # -- whether the move to a node can be made --------------------------------------------------------------------------

    def judge(self, node: StandNode) -> Judged[Stand]:
        """Return whether the move that leads to ``node`` can be made."""
        contacts, parent = self.contacts, node.parent
        row = contacts.judge(node.grip, node.at)
        if row.refusal is not None:
            return self._refuse(node, row.refusal)
        if parent is not None and (go := node.find_move(Go)) is not None:
            refusal = contacts.refuse_carry(parent.grip, parent.at, go.stops)
            return self._refuse(node, refusal) if refusal else Judged(node)
        margins = row.as_dict()
        change = node.find_move(Place) or node.find_move(Lift)
        if change is None:
            return Judged(replace(node, arrival=Arrival(margins)))
        assert isinstance(change.touch, int)
        away = change_stand(node.grip, change.finger, None)
        way = contacts.find_way(change.touch, away, node.at, looks_around=True)
        if way.clearance < contacts.hand.limits.clearance:
            return self._refuse(node, refuse_way(contacts.hand, way.nearest))
        margins["clearance_mm"] = min(margins["clearance_mm"], 1e3 * way.clearance)
        return Judged(replace(node, arrival=Arrival(margins, {change.finger: way} if way.around else {})))

    def _refuse(self, node: StandNode, refusal: Refusal) -> Judged[Stand]:
        return Judged(refused=self._explain(node, refusal))

    def _explain(self, node: StandNode, refusal: Refusal) -> Refused:
        """Return why ``node`` is no way on, to be counted among those that come as near to the goal."""
        because, change = (refusal,), node.find_move(Place) or node.find_move(Lift)
        if change is None:
            return Refused(Refusal(RefusalKind.CANNOT_CARRY_ON, because=because), known_bound(node))
        label = None
        if isinstance(change, Place):
            assert isinstance(change.touch, int)
            label = self._layers.poses[node.at.stop].labels[change.touch]
        kind = RefusalKind.CANNOT_RELOCATE if label is None else RefusalKind.CANNOT_TAKE_GOAL
        name = self.contacts.hand.fingers[change.finger].name
        return Refused(Refusal(kind, (name,), because=because), known_bound(node))

    def learn(self, node: StandNode) -> None:
        """Take into account that two contacts turned out not to hold by themselves."""
        if not self.contacts.judge(node.grip, node.at).is_admissible:
            self.bound.refuse(node.at.stop, node.grip)

    # -- what comes next -------------------------------------------------------------------------------------------------

    def expand(self, node: StandNode) -> Expansion[Stand]:
        """Return the moves that can be made from a node, or that it is the goal."""
        if self.is_goal(node):
            refusal = self._check_carries(node)
            if refusal is None:
                return Expansion(goal=node)
            return Expansion(refused=(self._explain(node, refusal),), is_failure=True)
        children, refused = list[StandNode](), list[Refused]()
        if node.at.stop < self._last:
            reach = self.contacts.go(node.grip, node.at)
            carry_on = replace(node, moves=())
            refused += [self._explain(carry_on, refusal) for refusal in reach.refusals]
            if reach.stops:
                children.append(self._go_on(node))
        rests = dict(self.contacts.list_rests(node.grip, node.at))
        for finger, spot in enumerate(node.grip):
            if spot is None:
                children += self._place(node, finger)
            elif spot in rests:
                children.append(self._after(node, rests[spot], Lift(finger, spot)))
        return Expansion(tuple(children), tuple(refused))

    def is_goal(self, node: StandNode) -> bool:
        """Return whether the node's stand is a goal grasp, or one from which that is rolled into."""
        return node.at.stop == self._last and self.side.is_end(node.grip)

    def _check_carries(self, node: StandNode) -> Refusal | None:
        """Return why an object motion on the way to ``node`` cannot be, looked at closely."""
        way = trace_back(node)
        for before, after in reversed(list(pairwise(way))):
            if (go := after.find_move(Go)) is not None:
                refusal = self.contacts.judge_carry(before.grip, before.at, go.stops).refusal
                if refusal:
                    return refusal
        return None

    def _go_on(self, node: StandNode) -> StandNode:
        """Return the stand of ``node`` at the next pose."""
        hidden = HIDDEN * (self.is_simultaneous and node.find_move(Lift) is not None)
        start = START_COST * (node.parent is not None and node.find_move(Go) is None)
        return replace(
            self._after(node, self.contacts.advance(node.grip, node.at, 1), Go(1)),
            at=Progress(node.at.stretch, node.at.stop + 1),
            cost=node.cost + CARRY_COST + start - hidden,
        )

    def _place(self, node: StandNode, finger: int) -> list[StandNode]:
        """Return the stands in which a free finger has come down: at contacts on ways into the goal, or in between."""
        cost = node.cost + 1.0 - HIDDEN * (self.is_simultaneous and node.find_move(Go) is not None)
        found = [(spot, 0.0) for spot in self._list_goals(node.at.stop, finger)]
        # A place between is of use only where it holds with one of the others, so that the third can go.
        landings = self.contacts.land(node.at.stretch, [Landfall(finger, None, node.grip, node.at.stop)])[0]
        found += [(landing.held, LOAD_COST * landing.load) for landing in landings]
        return [
            replace(
                self._after(node, change_stand(node.grip, finger, spot), Place(finger, spot)),
                cost=cost,
                strain=strain,
            )
            for spot, strain in found
        ]

    def _after(self, node: StandNode, stand: Stand, move: Move) -> StandNode:
        return Node(node.at, stand, node.cost + 1.0, parent=node, moves=(move,), origin=node.origin)

    def _list_goals(self, layer: int, finger: int) -> list[int]:
        """Return the contacts on ways into the goal that a finger may take in a layer."""
        if layer == self._last:
            return self.side.wanted.get(finger, [])
        if not self.is_simultaneous:
            return []
        key = layer, finger
        if key not in self._early:
            still, last = self._layers.poses[layer], self.side.still
            self._early[key] = []
            for spot in self.side.wanted.get(finger, []):
                found = land_again(self.contacts.hand, still.X_WO, last.spots[spot])
                if found is not None:
                    self._early[key].append(still.add(found, last.labels[spot]))
        return self._early[key]
