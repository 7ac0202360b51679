"""A gait as a problem posed to the engine: any grip will do, if the object comes to the end of its way.

A node's children take the object on with its grip as far as that goes (or less), put a free finger down so that it holds with one
of the two, and lift the other: finger substitution, or a step of a finger rewind [paper §2.2].  At the end of a leg the contacts
that hold begin the next one.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.oracle import Landfall, Progress, Purpose, Reach
from dexplan.planning.contacts.orbit_contacts import Holding, OrbitContacts
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.gait.exchange import GaitNode, judge_exchange
from dexplan.planning.gait.ranking import Ranking
from dexplan.planning.gait.theorem_1 import refuse_gait
from dexplan.planning.search.cost import CostWeights
from dexplan.planning.search.moves import Go, Lift, Move, Place
from dexplan.planning.search.nodes import Arrival, Node, trace_back
from dexplan.planning.search.problem import Expansion, Judged, Likes, Refused
from dexplan.plans.refusal import Refusal

TURNS = (1.0, 0.85, 0.7, 0.5, 0.3, 0.0)
"""Shares of the longest possible motion after which a finger is exchanged."""
GAIN = 0.5
"""A plan that costs less than the one in hand by no more than this share of a placement is not worth looking for."""


@dataclass(eq=False)
class GaitProblem:
    """What nodes of a gait are worth, and what they lead to, on the legs that ``contacts`` answer for.

    ``rewinds_only``: the object is only ever moved by one pair of fingers.  What costs no less than ``cost_limit``, counted with
    ``weights``, is left out.
    """

    contacts: OrbitContacts
    rewinds_only: bool
    cost_limit: float = np.inf
    weights: CostWeights = field(default_factory=CostWeights)

    def __post_init__(self) -> None:
        self.ranking = Ranking(self.contacts.tables, self.rewinds_only)

    # -- what nodes are worth --------------------------------------------------------------------------------------------

    def estimate(self, node: GaitNode) -> GaitNode:
        """Return a node with what seems to be missing from it to the goal; nothing that is learnt changes that."""
        if node.bound is not None:
            return node
        return replace(node, bound=self.ranking.estimate_missing(node))

    def rank(self, node: GaitNode) -> float:
        """Return the priority of a node, the smallest first."""
        return self.ranking.rank(node)

    def key_of(self, node: GaitNode) -> Hashable:
        """Return what makes two nodes the same; in rewinds, whose turn it is to move the object, too."""
        return self.contacts.key_of(node.grip, node.at), node.movers if self.rewinds_only else ()

    def list_likes(self, node: GaitNode) -> Likes:
        """Return what makes two nodes much alike; they fail alike, too."""
        like = self.contacts.class_of(node.grip, node.at)
        return Likes(like, like)

    def costs_too_much(self, node: GaitNode) -> bool:
        """Return whether a way through ``node`` is no improvement on the plan in hand."""
        if self.cost_limit == np.inf:
            return False
        gain = GAIN * self.weights.placement
        return self.ranking.foresee_cost(node, self.weights) > self.cost_limit - gain

    # -- whether the moves to a node can be made -------------------------------------------------------------------------

    def judge(self, node: GaitNode) -> Judged[Holding]:
        """Return whether the object can be taken to where fingers are exchanged, and whether they can be."""
        lift, parent = node.find_move(Lift), node.parent
        if lift is None or parent is None:
            return Judged(node)
        if refusal := self.contacts.refuse_carry(parent.grip, parent.at, node.at.stop - parent.at.stop):
            return Judged(refused=Refused(refusal))
        return judge_exchange(self.contacts, node)

    def learn(self, node: GaitNode) -> None:
        """Nothing: one refusal says nothing of what is missing elsewhere."""

    # -- what comes next -------------------------------------------------------------------------------------------------

    def expand(self, node: GaitNode) -> Expansion[Holding]:
        """Return what can be done after going on with the node's grip, to the end of its reach or less."""
        reach = self._find_reach(node)
        if reach.stops < 0:
            return Expansion(refused=tuple(Refused(r) for r in reach.refusals))
        node = replace(node, reach=reach)
        children, refused = list[GaitNode](), list[Refused]()
        if self._ends_leg(node, reach):
            after = self._enter_next_leg(node)
            if isinstance(after, Refusal):
                refused.append(Refused(after))
            elif after is not None:
                children.append(after)
            elif refusal := self._verify(node):
                refused.append(Refused(refusal))
            else:
                return Expansion(goal=node)
        exchanges, stuck = self._exchange(node, reach)
        return Expansion((*children, *exchanges), (*refused, *stuck))

    def _may_move(self, node: GaitNode) -> bool:
        """Return whether the node's grip is one that may move the object."""
        fingers = tuple(sorted(self.contacts.list_touching(node.grip)))
        return not (self.rewinds_only and node.movers and fingers != node.movers)

    def _find_reach(self, node: GaitNode) -> Reach:
        if self._may_move(node):
            return self.contacts.go(node.grip, node.at)
        reach = self.contacts.go(node.grip, node.at, most=0)
        is_stuck = isinstance(reach.end, Stop) and reach.end.kind not in (StopKind.GOAL, StopKind.LEG_END)
        return replace(reach, end=Stop(StopKind.ONE_PAIR), finger=None) if is_stuck else reach

    def _ends_leg(self, node: GaitNode, reach: Reach) -> bool:
        """Return whether the node's grip takes the object to the end of its leg, all stations looked at."""
        missing = self.contacts.count_stops(node.at.stretch) - node.at.stop
        return reach.stops >= missing and not self.contacts.refuse_carry(node.grip, node.at, missing)

    def _enter_next_leg(self, node: GaitNode) -> GaitNode | Refusal | None:
        """Return the node with which the contacts that hold at the end of a leg begin the next one; None after the last."""
        stretch = node.at.stretch
        if stretch + 1 == len(self.contacts.tables):
            return None
        moved = self.contacts.count_stops(stretch) - node.at.stop
        held = self.contacts.enter(node.grip, node.at, moved)
        if isinstance(held, Refusal):
            return held
        return replace(
            node,
            at=Progress(stretch + 1, 0),
            grip=held,
            parent=node,
            moves=(Go(moved),),
            promise=min(h.left for h in held),
            bound=None,
            may_detour=False,
            arrival=Arrival(),
            reach=None,
        )

    def _verify(self, last: GaitNode) -> Refusal | None:
        """Judge every state of a finished way; return the first refusal."""
        way = trace_back(last)
        for node, moved in zip(way, self.list_motions(way), strict=True):
            if refusal := self.contacts.judge_carry(node.grip, node.at, moved).refusal:
                return refusal
        return None

    def list_motions(self, way: list[GaitNode]) -> list[int]:
        """Return the stations moved with the grip of each node of a way, the last one moving to the goal."""
        gone = [0 if (go := node.find_move(Go)) is None else go.stops for node in way[1:]]
        return [*gone, self.contacts.count_stops(-1) - way[-1].at.stop]

    def _exchange(self, node: GaitNode, reach: Reach) -> tuple[list[GaitNode], list[Refused]]:
        """Return the nodes in which fingers have been exchanged, at the end of the node's reach or before, and refusals."""
        stretch, contacts = node.at.stretch, self.contacts
        table, children, refused = contacts.tables[stretch], list[GaitNode](), list[Refused]()
        asked: list[tuple[int, Held, Landfall[Holding, Held]]] = []
        for turn in sorted({round(share * reach.stops) for share in TURNS}, reverse=True):
            held, at = contacts.advance(node.grip, node.at, turn), Progress(stretch, node.at.stop + turn)
            if at.stop >= contacts.count_stops(stretch):
                continue  # the leg ends here; what comes next is the next leg's business
            if len(held) > 2:
                children += [
                    self._after(node, rest, (Go(turn), Lift(lifted.finger, lifted)))
                    for lifted, rest in contacts.list_rests(held, at)
                ]
            elif table.has_pair(held) and (refusal := refuse_gait(table, (held[0], held[1]), at.stop)):
                refused.append(Refused(refusal))
            else:
                for finger in sorted(set(table.candidates) - set(contacts.list_touching(held))):
                    purpose = self._choose_purpose(node, finger, turn)
                    for keep, lifted in (held, held[::-1]):
                        asked.append((turn, lifted, Landfall(finger, keep, held, at.stop, purpose)))
        found = contacts.land(stretch, [one for _, _, one in asked])
        for (turn, lifted, one), landings in zip(asked, found, strict=True):
            for landing in landings:
                assert one.keep is not None
                moves = (Go(turn), Place(one.finger, landing.held), Lift(lifted.finger, lifted))
                children.append(
                    self._after(node, (one.keep, landing.held), moves, landing.promise, landing.load)
                )
        return children, refused

    def _after(
        self,
        node: GaitNode,
        held: Holding,
        moves: tuple[Move, ...],
        promise: int | None = None,
        load: float = 0.0,
    ) -> GaitNode:
        """Return the node that comes after going on and exchanging fingers."""
        turn = sum(move.stops for move in moves if isinstance(move, Go))
        placed = any(isinstance(move, Place) for move in moves)
        movers = tuple(sorted(self.contacts.list_touching(node.grip))) if turn else node.movers
        return Node(
            Progress(node.at.stretch, node.at.stop + turn),
            held,
            node.cost + placed,
            parent=node,
            moves=moves,
            strain=load,
            promise=min(h.left for h in held) if promise is None else promise,
            movers=movers,
        )

    def _choose_purpose(self, node: GaitNode, finger: int, turn: int) -> Purpose:
        """Return what a finger lands for: in a rewind the pair gets ready to move on, the others stand in meanwhile."""
        pair = set(self.contacts.list_touching(node.grip)) if turn else set(node.movers)
        if not self.rewinds_only or not pair:
            return Purpose.CARRY
        return Purpose.ADVANCE if finger in pair else Purpose.STAND_IN
