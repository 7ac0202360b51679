"""The search: which finger lifts, where and with which spin it lands, how far the object turns in between.

Best first over grasps.  A node is a progress of the turn and the contacts that hold the object there; its children turn the
object with that grasp as far as it goes (or less), put a free finger down so that it holds with one of the two, and lift the
other: finger substitution [paper §2.2].  Everything a node promises is checked only when the search wants to go through it.
Nothing here knows how many fingers there are, where they stand, or what the axis is.
"""

from __future__ import annotations

import heapq
import re
from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.admissible import Admissibility, Margins, worst
from dexplan.planning.contacts import ContactTable, Held
from dexplan.planning.gaits import Step
from dexplan.planning.hand import HandModel
from dexplan.planning.plan import SOLVED
from dexplan.planning.travel import build_travel, compute_hover
from dexplan.spatial import Array, make_pose

TURNS = (1.0, 0.9, 0.8, 0.65, 0.5, 0.3)
"""Shares of the longest possible turn after which a substitution is tried."""
STRIDE = 4
"""A first look at a motion checks every so many stations."""
GREED = 3.0
"""How much more a turn still to be made counts than placements already spent.  One placement is taken to be worth half of what
a finger can carry a contact; above 1 the search looks for a good gait soon rather than for the best one at last."""
CURE = "raise the friction, lower friction.safety, or use a lighter object"


@dataclass(eq=False)
class Node:
    """Progress ``done`` [stations], the contacts that hold, and how the search came here.

    From ``parent`` the object was turned by ``moved`` stations, then ``placed`` came down and ``lifted`` went up.  ``limit`` is
    the limiting finger (None where it is no finger) and what ends the turn ``reach`` stations further on; the first ``checked``
    stations of the turn are known to be admissible, and the next one is not where ``refusal`` says why.
    """

    done: int
    held: tuple[Held, ...]
    placements: int
    parent: Node | None = None
    moved: int = 0
    placed: Held | None = None
    lifted: Held | None = None
    reach: int | None = None
    limit: tuple[int | None, str] = (None, "")
    checked: int = 0
    refusal: str = ""
    margins: dict[str, float] = field(default_factory=dict)
    place_margins: dict[str, float] = field(default_factory=dict)


@dataclass(order=True)
class _Entry:
    priority: float
    serial: int
    node: Node = field(compare=False)


class GaitSearch:
    """Searches a gait through the contacts of ``table``."""

    def __init__(self, table: ContactTable, node_budget: int) -> None:
        self._table, self._budget = table, node_budget
        self._hand: HandModel = table.hand
        self._admissibility = Admissibility(table.hand)
        self._memo: dict[tuple[tuple[int, int, int], ...], Margins] = {}
        self._ways: dict[tuple[int, int, int], Array] = {}
        self._refusals: dict[str, int] = {}
        self.expanded = 0

    @property
    def statistics(self) -> dict[str, float]:
        """Nodes opened and states checked."""
        return {"nodes": self.expanded, "states_checked": len(self._memo)}

    # -- checks ----------------------------------------------------------------------------------------------------------

    def margins(self, held: tuple[Held, ...]) -> Margins:
        """Return the margins of holding the object with ``held``, all other fingers at home."""
        key = tuple(sorted(_where(h) for h in held))
        if key not in self._memo:
            q = self._hand.q_home
            states = {h.finger: self._table.state(h) for h in held}
            for finger, state in states.items():
                q[finger] = state.q
            # A sphere is the same at any progress, so one check serves all.
            pose = make_pose(p=self._table.goal.X_WO_start[:3, 3])
            axis = self._table.sense * self._table.goal.axis_W
            self._memo[key] = self._admissibility.compute_margins_of(states, q, pose, axis_W=axis)
        return self._memo[key]

    def _walk(self, node: Node) -> int:
        """Return how many stations the node's grasp can turn the object (-1: it cannot hold it), and note what ends it.

        Every ``STRIDE``-th station is checked here, and the last; all of them once the search wants to go on from a turn.
        """
        limiter = min(node.held, key=lambda h: h.left)
        furthest = min(limiter.left, self._table.stations - node.done)
        last = -1
        for k in sorted({*range(0, furthest, STRIDE), furthest}):
            held = tuple(h.carried(k) for h in node.held)
            row = self.margins(held)
            if not row.is_admissible or not self._table.keeps_order(held):
                node.limit = (None, row.refusal or "the fingers would change their order")
                return last
            last = k
        to_goal = node.done + furthest >= self._table.stations
        node.limit = (None, "the goal") if to_goal else (limiter.finger, self._table.limit(limiter))
        return furthest

    def _check_turn(self, node: Node, turn: int) -> str:
        """Return why the node's grasp cannot turn the object by ``turn`` stations, each of them checked; "" if it can."""
        while node.checked <= turn and not node.refusal:
            row = self.margins(tuple(h.carried(node.checked) for h in node.held))
            node.refusal = row.refusal
            node.checked += not node.refusal
        return node.refusal if node.checked <= turn else ""

    def _note_margins(self, way: list[Node]) -> None:
        """Keep the worst margins of every turn of a finished way."""
        for here, turn in zip(way, self._turns(way), strict=True):
            rows = [self.margins(tuple(h.carried(k) for h in here.held)) for k in range(turn + 1)]
            here.margins = worst(rows)

    def _turns(self, way: list[Node]) -> list[int]:
        """Return the stations turned with the grasp of each node of a way, the last one turning to the goal."""
        return [*(n.moved for n in way[1:]), self._table.stations - way[-1].done]

    def _check_arrival(self, node: Node) -> str:
        """Return why the relocation that leads to ``node`` cannot be done, "" if it can."""
        assert node.lifted is not None
        assert node.parent is not None
        table = self._table
        if refusal := self._check_turn(node.parent, node.moved):
            return refusal
        before = (*(h for h in node.held if h is not node.placed), node.lifted)
        grasp = self.margins(node.held)
        if not grasp.is_admissible:
            return grasp.refusal
        q = self._hand.q_home
        for h in before:
            q[h.finger] = table.state(h).q
        X_WO = table.object_pose(node.done)
        clearances = []
        if node.placed is not None:
            clearances.append(self._check_way(q, X_WO, node.placed, before, node.done))
            q[node.placed.finger] = table.state(node.placed).q
            everyone = {h.finger: table.state(h) for h in (*before, node.placed)}
            together = self._admissibility.compute_margins_of(everyone, q, X_WO)
            if not together.is_admissible:
                return together.refusal
            clearances.append((together.clearance, "the fingers on the object"))
        clearances.append(self._check_way(q, X_WO, node.lifted, node.held, node.done))
        least, names = min(clearances)
        node.place_margins = {**grasp.as_dict(), "clearance_mm": 1e3 * min(least, grasp.clearance)}
        if least < self._hand.limits.clearance:
            return f"{names} come within {1e3 * least:.1f} mm on the way"
        return ""

    def _check_way(
        self, q: Array, X_WO: Array, held: Held, holding: tuple[Held, ...], done: int
    ) -> tuple[float, str]:
        """Return the clearance between a finger's home and its hover over ``held``; the rest of the way is along the normal."""
        path = self._ways.get(_where(held))
        if path is None:
            hand, finger = self._hand, self._hand.fingers[held.finger]
            placement = self._table.placement(held, done)
            hover = compute_hover(finger, X_WO, placement.X_OF, placement.normal_O, placement.q, hand.hover)
            path = build_travel(finger, finger.q_home, hover, X_WO[:3, 3])
            self._ways[_where(held)] = path
        fingers = tuple(h.finger for h in holding)
        return self._admissibility.compute_path_clearance(q, X_WO, held.finger, path, fingers)

    # -- search ----------------------------------------------------------------------------------------------------------

    def run(self, starts: list[tuple[Held, ...]]) -> tuple[Node | None, str, str]:
        """Search from the given grasps; return the goal node, or None with a status and why."""
        runs = [np.percentile(c.carry, 90) for c in self._table.candidates.values() if len(c.carry)]
        worth = max(1.0, 0.5 * float(np.mean(runs))) if runs else 1.0
        heap = [
            _Entry(self._rank(node, worth), k, node) for k, node in enumerate(Node(0, h, 0) for h in starts)
        ]
        heapq.heapify(heap)
        serial = len(heap)
        seen: set[tuple[object, ...]] = set()
        while heap and self.expanded < self._budget:
            node = heapq.heappop(heap).node
            key = self._key(node)
            if key in seen:
                continue
            if node.lifted is not None and (refusal := self._check_arrival(node)):
                self._refuse(refusal)
                continue
            seen.add(key)
            self.expanded += 1
            node.reach = self._walk(node)
            if node.reach < 0:
                self._refuse(node.limit[1])
                continue
            if node.done + node.reach >= self._table.stations:
                if refusal := self._check_turn(node, self._table.stations - node.done):
                    self._refuse(refusal)
                    continue
                self._note_margins(_trace_back(node))
                return node, SOLVED, ""
            for child in self._children(node, node.reach):
                heapq.heappush(heap, _Entry(self._rank(child, worth), serial, child))
                serial += 1
        common = sorted(self._refusals.items(), key=lambda item: (-item[1], item[0]))[:2]
        why = "; ".join(text for text, _ in common) or "no placement holds with a finger that holds already"
        if heap:
            return (
                None,
                "budget_exhausted",
                f"no gait within {self._budget} nodes ({why}); raise gait.node_budget",
            )
        return None, "no_gait", f"{why}; {CURE}"

    def _key(self, node: Node) -> tuple[object, ...]:
        """Return what makes two nodes the same to the search: neighbouring stations count as one."""
        sense = self._table.sense
        places = frozenset((h.finger, h.orbit, (h.landed + sense * h.steps) // 2) for h in node.held)
        return node.done // 2, places

    def _refuse(self, refusal: str) -> None:
        """Count a refusal; distances differ from state to state, so they are left out of the text."""
        text = re.sub(r" within -?[0-9.]+ mm", " too near", refusal)
        self._refusals[text] = self._refusals.get(text, 0) + 1

    def _rank(self, node: Node, worth: float) -> float:
        """Return the priority of a node; the smallest is opened first."""
        # A turn ends when one contact is used up; what the other has left then serves the next turn, about half of it.
        left = [h.left for h in node.held]
        ahead = self._table.stations - node.done
        missing = 0.0 if ahead <= min(left) else max(0.7, (ahead - float(np.mean(left))) / worth)
        # Between equals, prefer contacts near opposite: small forces and room for error.
        beta = self._table.pair_angle(node.held)
        hard = max(0.0, beta - self._table.beta_easy) / self._table.beta_easy
        return node.placements + GREED * missing + 0.6 * beta / self._table.beta_max + 6.0 * hard

    def _children(self, node: Node, reach: int) -> list[Node]:
        children = []
        for turn in sorted({round(share * reach) for share in TURNS}, reverse=True):
            held = tuple(h.carried(turn) for h in node.held)
            done = node.done + turn
            if len(held) > 2:
                for lifted in held:
                    rest = tuple(h for h in held if h is not lifted)
                    if self._table.has_pair(rest):
                        children.append(Node(done, rest, node.placements, node, turn, None, lifted))
                continue
            if refusal := self._table.check_theorem_1(held):
                self._refuse(refusal)
                continue
            taken = {h.finger for h in held}
            for finger in sorted(set(self._table.candidates) - taken):
                for keep, lifted in (held, held[::-1]):
                    for landing in self._table.landings(finger, keep, held, done):
                        children.append(
                            Node(done, (keep, landing), node.placements + 1, node, turn, landing, lifted)
                        )
        return children

    # -- answer ----------------------------------------------------------------------------------------------------------

    def steps(self, node: Node) -> list[Step]:
        """Return the way to ``node`` and on to the goal as symbolic steps."""
        table, way = self._table, _trace_back(node)
        steps = []
        for here, turn in zip(way, self._turns(way), strict=True):
            ended = (
                here.limit if turn == here.reach else (None, "a shorter turn leaves the better next grasp")
            )
            steps.append(
                Step(
                    contacts=tuple(table.placement(h, here.done) for h in here.held),
                    X_WO_start=table.object_pose(here.done),
                    X_WO_end=table.object_pose(here.done + turn),
                    angle=table.turned(here.done + turn) - table.turned(here.done),
                    placed=None if here.placed is None else table.placement(here.placed, here.done),
                    lifted=None if here.lifted is None else here.lifted.finger,
                    limit=ended,
                    margins=here.margins,
                    place_margins=here.place_margins,
                )
            )
        return steps


def _where(held: Held) -> tuple[int, int, int]:
    """Return what decides a contact's posture: its orbit, where it landed (hence its spin), and how far it came."""
    return held.orbit, held.landed, held.steps


def _trace_back(node: Node) -> list[Node]:
    """Return the nodes from the start to ``node``."""
    way = [node]
    while way[-1].parent is not None:
        way.append(way[-1].parent)
    return way[::-1]
