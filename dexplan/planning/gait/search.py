"""The search: which finger lifts, where and with which spin it lands, how far the object goes in between.

Best first over grasps.  A node is a progress along the legs of a route and the contacts that hold the object there; its children
take the object on with that grasp as far as it goes (or less), put a free finger down so that it holds with one of the two, and
lift the other: finger substitution, or a step of a finger rewind [paper §2.2].  At the end of a leg the contacts that hold begin
the next one.  Everything a node promises is checked only when the search wants to go through it, and a finished way once more
by the judge itself.  Nothing here knows how many fingers there are, where they stand, or what the axis is.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, Margins, worst
from dexplan.planning.admissible.conditions import Condition, find_unmet
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held, Landfall
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.states import DETOUR_COST, StateChecks
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.gait.cost import CostWeights, compute_cost
from dexplan.planning.gait.nodes import Node, build_steps, trace_back
from dexplan.planning.gait.ranking import Ranking
from dexplan.planning.gait.start_pairs import find_start_pairs
from dexplan.planning.gait.steps import Step
from dexplan.planning.ways.detour import NOBODY
from dexplan.planning.ways.travel import choose_nearer, refuse_way
from dexplan.plans.refusal import Refusal, RefusalCount, RefusalKind

TURNS = (1.0, 0.85, 0.7, 0.5, 0.3, 0.0)
"""Shares of the longest possible motion after which a finger is exchanged."""
STRIDE = 4
"""A first look at a motion checks every so many stations."""
GAIN = 0.5
"""A plan that costs less than the one in hand by no more than this share of a placement is not worth looking for."""
COST_OF_OPENED_LIKES, COST_OF_FAILED_LIKES = 1.0, 0.25
"""What a node's priority loses for every one like it that was opened, or tried in vain, before: else the search would spend its
nodes on variations of one idea."""
OUT_OF_ORDER = Refusal(RefusalKind.ORDER)
CURE = "raise the friction, lower friction.safety, or use a lighter object"


@dataclass(order=True)
class _Entry:
    priority: float
    serial: int
    node: Node = field(compare=False)
    crowd: float = field(compare=False, default=0.0)


class GaitSearch:
    """Searches a gait along the legs of a route; can be asked to go on where it stopped.

    ``primitives``: "substitution", "rewind", or both.  With "rewind" alone the object is only ever moved by one pair of fingers.
    """

    def __init__(
        self,
        hand: HandModel,
        route: tuple[Leg, ...],
        admissibility: Admissibility,
        primitives: tuple[str, ...] = ("substitution",),
        first: ContactTable | None = None,
    ) -> None:
        self._hand, self.route = hand, route
        self.tables = [first or ContactTable(hand, route[0]), *(ContactTable(hand, leg) for leg in route[1:])]
        self._checks = [StateChecks(table, admissibility) for table in self.tables]
        self._rewinds_only = "substitution" not in primitives
        self._heap: list[_Entry] = []
        self._serial = 0
        self._seen: set[tuple[object, ...]] = set()
        self._crowds: dict[tuple[object, ...], float] = {}
        self._refusals = RefusalCount()
        self._ranking = Ranking(self.tables, self._rewinds_only)
        self._weights, self._cost_limit = CostWeights(), np.inf
        self.opened = 0

    @property
    def states_checked(self) -> int:
        """Number of states looked at."""
        return sum(checks.count for checks in self._checks)

    @property
    def is_exhausted(self) -> bool:
        """Whether there is nothing left to open."""
        return not self._heap

    @property
    def promise(self) -> float:
        """The estimated cost of the best way to the goal that is left, as :meth:`run` ranks them; inf where none is."""
        return self._heap[0].priority if self._heap else np.inf

    @property
    def reason(self) -> str:
        """The most common refusals, in words."""
        return "; ".join(map(str, self.refusals))

    @property
    def refusals(self) -> list[Refusal]:
        """The most common refusals, numbers left out."""
        return self._refusals.list_common(2) or [Refusal(RefusalKind.NO_LANDING)]

    @property
    def unmet(self) -> list[Condition]:
        """Which conditions the most common refusals are about, where they are about some."""
        return [condition for r in self.refusals if (condition := find_unmet(r)) is not None]

    def judge_start(self, held: tuple[Held, ...]) -> Margins:
        """Return the margins of the first grasp."""
        return self._checks[0].judge(held)

    def begin_anywhere(self) -> int:
        """Add pairs to start from where the problem leaves it to the planner; return how many."""
        pairs = find_start_pairs(self.tables[0], lambda held: self._checks[0].refuse(held) is None)
        for pair in pairs:
            self.begin(pair.held, pair.promise, pair.load)
        return len(pairs)

    def begin(self, held: tuple[Held, ...], promise: int | None = None, load: float = 0.5) -> None:
        """Add a grasp to start from."""
        lasts = min(h.left for h in held) if promise is None else promise
        # Rewinds go on with the pair they begin with: an exchange before the first motion would be a substitution.
        pair = tuple(sorted(h.finger for h in held)) if self._rewinds_only and len(held) == 2 else ()
        self._push(Node(0, 0, held, 0, pair=pair, promise=lasts, load=load))

    def seek_cheaper(self, cost: float, weights: CostWeights) -> None:
        """Go on without what will hardly cost less than ``cost``."""
        self._cost_limit, self._weights = cost, weights

    def run(self, nodes: int) -> Node | None:
        """Open up to ``nodes`` more nodes; return the one from which the goal is reached, None if there was none."""
        limit = self.opened + nodes
        while self._heap and self.opened < limit:
            entry = heapq.heappop(self._heap)
            node, key = entry.node, self._key(entry.node)
            if key in self._seen or self._costs_too_much(node):
                continue
            cell = self._cell(node)
            crowd = self._crowds.get(cell, 0.0)
            if crowd > entry.crowd:
                self._push(node, crowd)
                continue
            if node.lifted is not None and (refusal := self._check_arrival(node)):
                self._refusals.add(refusal)
                self._crowds[cell] = crowd + COST_OF_FAILED_LIKES
                continue
            self._seen.add(key)
            self._crowds[cell] = crowd + COST_OF_OPENED_LIKES
            self.opened += 1
            refusal = self._walk(node)
            if refusal:
                self._refusals.add(refusal)
                continue
            if self._ends_leg(node):
                if node.leg + 1 < len(self.route):
                    self._enter_next_leg(node)
                elif not (refusal := self._verify(trace_back(node))):
                    return node
                else:
                    self._refusals.add(refusal)
            for child in self._children(node):
                self._push(child)
        return None

    # -- checks ----------------------------------------------------------------------------------------------------------

    def _may_move(self, node: Node) -> bool:
        """Return whether the node's grasp is one that may move the object."""
        fingers = tuple(sorted(h.finger for h in node.held))
        return not (self._rewinds_only and node.pair and fingers != node.pair)

    def _walk(self, node: Node) -> Refusal | None:
        """Find how many stations the node's grasp can take the object, and what ends it; return why it cannot hold it at all.

        Every ``STRIDE``-th station is checked here, and the last; all of them once the search wants to go on from there.
        """
        table, checks = self.tables[node.leg], self._checks[node.leg]
        limiter = min(node.held, key=lambda h: h.left)
        furthest = min(limiter.left, table.stations - node.done)
        if not self._may_move(node):
            node.limit, furthest = (None, Stop(StopKind.ONE_PAIR)), 0
        last = -1
        for k in sorted({*range(0, furthest, STRIDE), furthest}):
            held = tuple(h.carried(k) for h in node.held)
            refusal = checks.refuse(held) or self._check_order(table, held)
            if refusal:
                node.limit = (None, refusal)
                node.reach = last
                return None if last >= 0 else refusal
            last = k
        node.reach = furthest
        if node.done + furthest >= table.stations:
            is_last = node.leg + 1 == len(self.route)
            node.limit = (None, Stop(StopKind.GOAL if is_last else StopKind.LEG_END))
        elif furthest or self._may_move(node):
            node.limit = (limiter.finger, table.limit(limiter))
        return None

    def _check_order(self, table: ContactTable, held: tuple[Held, ...]) -> Refusal | None:
        normals = table.with_free({h.finger: table.normal(h) for h in held})
        return None if table.keep_order(normals) else OUT_OF_ORDER

    def _check_motion(self, node: Node, stations: int) -> Refusal | None:
        """Return why the node's grasp cannot take the object ``stations`` on, each of them checked; None if it can."""
        checks = self._checks[node.leg]
        for k in range(stations + 1):
            if refusal := checks.refuse(tuple(h.carried(k) for h in node.held)):
                return refusal
        return None

    def _check_arrival(self, node: Node) -> Refusal | None:
        """Return why the relocation that leads to ``node`` cannot be done, None if it can."""
        assert node.lifted is not None
        assert node.parent is not None
        checks, limits = self._checks[node.leg], self._hand.limits
        if refusal := self._check_motion(node.parent, node.moved):
            return refusal
        before = (*(h for h in node.held if h is not node.placed), node.lifted)
        found = [NOBODY]
        if node.placed is not None:
            found.append(checks.clear_of((*before, node.placed), node.done))
            if found[-1].distance >= limits.clearance:
                if refusal := checks.refuse_together((*before, node.placed)) or checks.refuse(node.held):
                    return refusal
                found.append(checks.clear_on_way(node.placed, before, node.done, node))
        if choose_nearer(*found).distance >= limits.clearance:
            found.append(checks.clear_on_way(node.lifted, node.held, node.done, node))
        nearest = choose_nearer(*found)
        node.place_margins = {"clearance_mm": 1e3 * nearest.distance}
        if nearest.distance >= limits.clearance:
            return None
        refusal = refuse_way(self._hand, nearest)
        if checks.has_looked_around(node):
            return Refusal(RefusalKind.NO_WAY_AROUND, because=(refusal,))
        if checks.put_off(node):
            # Where arcs do not lead to the goal it is asked again, and may take a detour.
            node.placements += DETOUR_COST
            self._push(node)
        return refusal

    def _ends_leg(self, node: Node) -> bool:
        """Return whether the node's grasp takes the object to the end of its leg, all stations checked."""
        missing = self.tables[node.leg].stations - node.done
        return node.reach >= missing and not self._check_motion(node, missing)

    def _verify(self, way: list[Node]) -> Refusal | None:
        """Ask the judge about every state of a finished way; note the margins, and return the first refusal."""
        for here, moved in zip(way, self._motions(way), strict=True):
            checks = self._checks[here.leg]
            rows = [checks.judge(tuple(h.carried(k) for h in here.held)) for k in range(moved + 1)]
            for row in rows:
                if not row.is_admissible:
                    return row.refusal
            here.margins = worst(rows)
            if here.lifted is not None:
                least = here.place_margins["clearance_mm"]
                grasp = rows[0].as_dict()
                here.place_margins = {**grasp, "clearance_mm": min(least, grasp["clearance_mm"])}
        return None

    def _motions(self, way: list[Node]) -> list[int]:
        """Return the stations moved with the grasp of each node of a way, the last one moving to the goal."""
        return [*(n.moved for n in way[1:]), self.tables[-1].stations - way[-1].done]

    # -- search ----------------------------------------------------------------------------------------------------------

    def _push(self, node: Node, crowd: float = 0.0) -> None:
        heapq.heappush(self._heap, _Entry(self._ranking.rank(node) + crowd, self._serial, node, crowd))
        self._serial += 1

    def _key(self, node: Node) -> tuple[object, ...]:
        """Return what makes two nodes the same to the search: neighbouring stations count as one."""
        table = self.tables[node.leg]
        places = frozenset((h.finger, h.orbit, table.station(h) // 2) for h in node.held)
        return node.leg, node.done // 2, places, node.pair if self._rewinds_only else ()

    def _cell(self, node: Node) -> tuple[object, ...]:
        """Return what makes two nodes much alike: progress within ten degrees or so, contacts within ten degrees or so."""
        table = self.tables[node.leg]
        places = frozenset(
            (h.finger, *np.rint(6.0 * table.normal(h)).astype(int).tolist()) for h in node.held
        )
        return node.leg, node.done // 5, places

    def _costs_too_much(self, node: Node) -> bool:
        """Return whether a way through ``node`` is no improvement on the plan in hand."""
        if self._cost_limit == np.inf:
            return False
        gain = GAIN * self._weights.placement
        return self._ranking.foresee_cost(node, self._weights) > self._cost_limit - gain

    def _children(self, node: Node) -> list[Node]:
        """Return what can be done after going on with the node's grasp, to the end of its reach or less."""
        table, children = self.tables[node.leg], []
        asked: list[tuple[int, Held, Landfall]] = []
        for turn in sorted({round(share * node.reach) for share in TURNS}, reverse=True):
            held, done = tuple(h.carried(turn) for h in node.held), node.done + turn
            if done >= table.stations:
                continue  # the leg ends here; what comes next is the next leg's business
            if len(held) > 2:
                children += self._lift_one(node, held, turn)
            elif self.tables[node.leg].has_pair(held) and (
                refusal := table.check_theorem_1((held[0], held[1]), done)
            ):
                self._refusals.add(refusal)
            else:
                for finger in sorted(set(table.candidates) - {h.finger for h in held}):
                    purpose = self._purpose(node, finger, turn)
                    for keep, lifted in (held, held[::-1]):
                        asked.append((turn, lifted, Landfall(finger, keep, held, done, purpose)))
        found = table.landings([one for _, _, one in asked])
        for (turn, lifted, one), landings in zip(asked, found, strict=True):
            for landing in landings:
                child = self._after(node, (one.keep, landing.held), turn, landing.held, lifted)
                child.promise, child.load = landing.promise, landing.load
                children.append(child)
        return children

    def _after(
        self, node: Node, held: tuple[Held, ...], turn: int, placed: Held | None, lifted: Held | None
    ) -> Node:
        """Return the node that comes after going on by ``turn`` stations and exchanging fingers."""
        pair = tuple(sorted(h.finger for h in node.held)) if turn else node.pair
        spent, lasts = node.placements + (placed is not None), min(h.left for h in held)
        return Node(node.leg, node.done + turn, held, spent, node, turn, placed, lifted, pair, lasts)

    def _lift_one(self, node: Node, held: tuple[Held, ...], turn: int) -> list[Node]:
        """Return the nodes in which one of three or more fingers has been lifted."""
        rests = [(lifted, tuple(h for h in held if h is not lifted)) for lifted in held]
        return [
            self._after(node, rest, turn, None, lifted)
            for lifted, rest in rests
            if self.tables[node.leg].has_pair(rest)
        ]

    def _purpose(self, node: Node, finger: int, turn: int) -> str:
        """Return what a finger lands for: in a rewind the pair gets ready to move on, the others stand in meanwhile."""
        pair = {h.finger for h in node.held} if turn else set(node.pair)
        if not self._rewinds_only or not pair:
            return "carry"
        return "advance" if finger in pair else "stand_in"

    def _enter_next_leg(self, node: Node) -> None:
        """Let the contacts that hold at the end of a leg begin the next one."""
        table, after = self.tables[node.leg], self.tables[node.leg + 1]
        moved = table.stations - node.done
        X_WO = table.leg.X_WO_end
        held = []
        for h in node.held:
            landed, end = table.placement(h, node.done), table.state(h.carried(moved))
            contact = after.start_at(h.finger, X_WO @ landed.X_OF, end.q)
            if contact is None:
                self._refusals.add(Refusal(RefusalKind.LEG_END, (self._hand.fingers[h.finger].name,)))
                return
            held.append(contact)
        lasts = min(h.left for h in held)
        child = Node(
            node.leg + 1,
            0,
            tuple(held),
            node.placements,
            node,
            moved,
            pair=node.pair,
            promise=lasts,
            load=node.load,
        )
        self._push(child)

    def compute_cost(self, node: Node, weights: CostWeights) -> float:
        """Return what the way to ``node`` and on to the goal costs, a way that :meth:`run` has returned."""
        way = trace_back(node)
        legs = zip((self.route[n.leg] for n in way), way, self._motions(way), strict=True)
        turned = sum(abs(leg.turned(n.done + moved) - leg.turned(n.done)) for leg, n, moved in legs)
        shifted = sum(float(np.linalg.norm(leg.shift_W)) for leg in self.route)
        margins = [m for n in way for m in (n.margins, n.place_margins)]
        return compute_cost(weights, node.placements, turned, shifted, margins)

    # -- answer ----------------------------------------------------------------------------------------------------------

    def steps(self, node: Node) -> list[Step]:
        """Return the way to ``node`` and on to the goal as symbolic steps."""
        way = trace_back(node)
        steps = build_steps(self.tables, way, self._motions(way))
        return [
            replace(s, ways=self._checks[n.leg].detours.get(n, {})) for s, n in zip(steps, way, strict=True)
        ]
