"""One move at a time: a problem posed to the engine over any contacts, to come to a grip that counts as an end.

A node's children put a free finger down, lift one where the others hold alone, or go on with the object to the next stop.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Generic, Protocol, TypeVar, cast

import numpy as np

from dexplan.planning.contacts.oracle import Contacts, Grip, Landfall, Progress, Touch
from dexplan.planning.search.moves import Go, Lift, Move, Place
from dexplan.planning.search.nodes import Arrival, Node, known_bound, trace_back
from dexplan.planning.search.problem import Expansion, Judged, Likes, Refused
from dexplan.planning.ways.travel import refuse_way
from dexplan.plans.refusal import Refusal, RefusalKind

HEURISTIC_WEIGHT = 2.5
"""How much more moves still to be made count than those already made."""
CARRY_COST, START_COST = 0.3, 0.4
"""What a carry from stop to stop counts, and the first one after a relocation in addition; a placement or a lift counts 1."""
HIDDEN = 0.45
"""What a lift before a carry, or a placement after one, counts less where the finger travels meanwhile."""
LOAD_COST = 0.4
"""What a landing counts in addition whose pair uses all of the believed cone."""


GripAsked = TypeVar("GripAsked", contravariant=True)


class End(Protocol[GripAsked, Touch]):
    """Which grips at the last stop are the goal."""

    def is_end(self, grip: GripAsked) -> bool:
        """Return whether a grip at the last stop is an end."""
        ...

    def list_goals(self, at: Progress, finger: int) -> Sequence[Touch]:
        """Return the contacts on ways into an end that a finger may take, beside its landings."""
        ...

    def is_goal(self, touch: Touch, at: Progress) -> bool:
        """Return whether a contact is one of those."""
        ...


class Bound(Protocol[GripAsked]):
    """How many moves are missing at least, as far as is known."""

    def count_moves(self, stop: int, grip: GripAsked) -> float:
        """Return how many placements and lifts are missing at least; inf where no way leads on."""
        ...

    def refuse(self, stop: int, grip: GripAsked) -> None:
        """Take into account that a grip turned out not to hold."""
        ...


@dataclass(eq=False)
class StepProblem(Generic[Grip, Touch]):
    """What grips are worth, and what they lead to, on the one stretch that ``contacts`` answer for, on to an ``end``.

    ``is_simultaneous``: relocations next to a motion of the object are cheaper, for it will hide the finger's travel, and goal
    contacts may be taken before the object is at its end.  What counts as much as ``cost_limit`` is left out.  ``shares``:
    after which shares of what a grip can do at most something else is done; ``stop_cost``: what going on by a stop counts.
    """

    contacts: Contacts[Grip, Touch]
    end: End[Grip, Touch]
    bound: Bound[Grip]
    is_simultaneous: bool = False
    cost_limit: float = np.inf
    shares: tuple[float, ...] = (1.0,)
    stop_cost: float = CARRY_COST
    is_one_go: bool = False
    """Whether no motion of the object directly follows another: what is bounded per motion is then bounded per grip."""
    movers: tuple[int, ...] | None = None
    """The fingers that alone may move the object, as one pair does where contacts are rewound; None: any that hold it."""

    def __post_init__(self) -> None:
        self._last = self.contacts.count_stops(0)

    # -- what nodes are worth --------------------------------------------------------------------------------------------

    def estimate(self, node: Node[Grip]) -> Node[Grip]:
        """Return a node with how many placements and lifts are missing at least; inf where no way leads on."""
        missing = self.bound.count_moves(node.at.stop, node.grip)
        return node if missing == node.bound else replace(node, bound=missing)

    def rank(self, node: Node[Grip]) -> float:
        """Return the priority of a node, the smallest first."""
        ahead = known_bound(node) + self.stop_cost * (self._last - node.at.stop)
        return node.cost + HEURISTIC_WEIGHT * ahead + node.strain

    def costs_too_much(self, node: Node[Grip]) -> bool:
        """Return whether a way through the node counts at least as much as one that is known."""
        ahead = (1.0 - HIDDEN) * known_bound(node) + self.stop_cost * (self._last - node.at.stop)
        return node.cost + ahead >= self.cost_limit

    def key_of(self, node: Node[Grip]) -> Hashable:
        """Return what makes two nodes the same: the stop and the grip."""
        return self.contacts.key_of(node.grip, node.at)

    def list_likes(self, node: Node[Grip]) -> Likes:
        """Return what makes two nodes much alike; those fail alike that put the same finger down in the same place."""
        place = node.find_move(Place)
        failing = None if place is None else (node.at.stop, place.finger, place.touch)
        return Likes(self.contacts.class_of(node.grip, node.at), failing)

    # -- whether the move to a node can be made --------------------------------------------------------------------------

    def judge(self, node: Node[Grip]) -> Judged[Grip]:
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
        away = contacts.change(node.grip, change.finger, None)
        way = contacts.find_way(_read_touch(contacts, change), away, node.at, looks_around=True)
        if way.clearance < contacts.hand.limits.clearance:
            return self._refuse(node, refuse_way(contacts.hand, way.nearest))
        margins["clearance_mm"] = min(margins["clearance_mm"], 1e3 * way.clearance)
        return Judged(replace(node, arrival=Arrival(margins, {change.finger: way} if way.around else {})))

    def _refuse(self, node: Node[Grip], refusal: Refusal) -> Judged[Grip]:
        return Judged(refused=self._explain(node, refusal))

    def _explain(self, node: Node[Grip], refusal: Refusal) -> Refused:
        """Return why ``node`` is no way on, to be counted among those that come as near to the goal."""
        because, change = (refusal,), node.find_move(Place) or node.find_move(Lift)
        if change is None:
            return Refused(Refusal(RefusalKind.CANNOT_CARRY_ON, because=because), known_bound(node))
        takes_goal = isinstance(change, Place) and self.end.is_goal(
            _read_touch(self.contacts, change), node.at
        )
        kind = RefusalKind.CANNOT_TAKE_GOAL if takes_goal else RefusalKind.CANNOT_RELOCATE
        name = self.contacts.hand.fingers[change.finger].name
        return Refused(Refusal(kind, (name,), because=because), known_bound(node))

    def learn(self, node: Node[Grip]) -> None:
        """Take into account that two contacts turned out not to hold by themselves."""
        if not self.contacts.judge(node.grip, node.at).is_admissible:
            self.bound.refuse(node.at.stop, node.grip)

    # -- what comes next -------------------------------------------------------------------------------------------------

    def expand(self, node: Node[Grip]) -> Expansion[Grip]:
        """Return the moves that can be made from a node, or that it is the goal."""
        if self.is_goal(node):
            refusal = self._check_carries(node)
            if refusal is None:
                return Expansion(goal=node)
            return Expansion(refused=(self._explain(node, refusal),), is_failure=True)
        children, refused = list[Node[Grip]](), list[Refused]()
        may_go = not (self.is_one_go and node.find_move(Go) is not None)
        may_go &= self.movers is None or self.contacts.list_touching(node.grip) == self.movers
        if node.at.stop < self._last and may_go:
            reach = self.contacts.go(node.grip, node.at)
            carry_on = replace(node, moves=())
            refused += [self._explain(carry_on, refusal) for refusal in reach.refusals]
            stops = {round(share * max(0, reach.stops)) for share in self.shares} - {0}
            children += [self._go_on(node, count) for count in sorted(stops, reverse=True)]
        contacts, rests = self.contacts, dict[int, tuple[Touch, Grip]]()
        for touch, rest in contacts.list_rests(node.grip, node.at):
            rests[contacts.place(touch, node.at).finger] = touch, rest
        touching = contacts.list_touching(node.grip)
        for finger in range(len(contacts.hand.fingers)):
            if finger not in touching:
                children += self._place(node, finger)
            elif finger in rests:
                lifted, rest = rests[finger]
                children.append(self._after(node, rest, Lift(finger, lifted)))
        return Expansion(tuple(children), tuple(refused))

    def is_goal(self, node: Node[Grip]) -> bool:
        """Return whether the node's grip is an end."""
        return node.at.stop == self._last and self.end.is_end(node.grip)

    def _check_carries(self, node: Node[Grip]) -> Refusal | None:
        """Return why an object motion on the way to ``node`` cannot be, looked at closely."""
        way = trace_back(node)
        for before, after in reversed(list(pairwise(way))):
            if (go := after.find_move(Go)) is not None:
                refusal = self.contacts.judge_carry(before.grip, before.at, go.stops).refusal
                if refusal:
                    return refusal
        return None

    def _go_on(self, node: Node[Grip], stops: int) -> Node[Grip]:
        """Return the grip of ``node`` so many stops further on."""
        hidden = HIDDEN * (self.is_simultaneous and node.find_move(Lift) is not None)
        start = START_COST * (node.parent is not None and node.find_move(Go) is None)
        return replace(
            self._after(node, self.contacts.advance(node.grip, node.at, stops), Go(stops)),
            at=Progress(node.at.stretch, node.at.stop + stops),
            cost=node.cost + self.stop_cost * stops + start - hidden,
        )

    def _place(self, node: Node[Grip], finger: int) -> list[Node[Grip]]:
        """Return the grips in which a free finger has come down: at contacts on ways into an end, or in between."""
        cost = node.cost + 1.0 - HIDDEN * (self.is_simultaneous and node.find_move(Go) is not None)
        found = [(touch, 0.0) for touch in self.end.list_goals(node.at, finger)]
        # A place between is of use only where it holds with one of the others, so that the third can go.
        landings = self.contacts.land(node.at.stretch, [Landfall(finger, None, node.grip, node.at.stop)])[0]
        found += [(landing.held, LOAD_COST * landing.load) for landing in landings]
        return [
            replace(
                self._after(node, self.contacts.change(node.grip, finger, touch), Place(finger, touch)),
                cost=cost,
                strain=strain,
            )
            for touch, strain in found
        ]

    def _after(self, node: Node[Grip], grip: Grip, move: Move) -> Node[Grip]:
        return Node(node.at, grip, node.cost + 1.0, parent=node, moves=(move,), origin=node.origin)


def _read_touch(contacts: Contacts[Grip, Touch], move: Place | Lift) -> Touch:
    """Return the contact of a move, which is one of these contacts' own."""
    return cast("Touch", move.touch)
