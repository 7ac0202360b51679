"""Searching which finger is where while the object stands, or goes from pose to pose: what such searches share.

A node says where the object is, and for every finger where it touches or that it is free.  Its children put a free finger down,
lift one of three, or carry the object to the next pose; what a node promises is checked when the search wants to open it.
"""

from __future__ import annotations

import heapq
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.still import Stand
from dexplan.planning.regrasp.nodes import Entry, Node, change_stand
from dexplan.planning.regrasp.relocation_bound import RelocationBound
from dexplan.planning.ways.travel import refuse_way
from dexplan.plans.refusal import Refusal, RefusalCount, RefusalKind

HEURISTIC_WEIGHT = 2.5
"""How much more moves still to be made count than those already made."""
CARRY_COST, START_COST = 0.3, 0.4
"""What a carry from pose to pose counts, and the first one after a relocation in addition; a placement or a lift counts 1."""
HIDDEN = 0.45
"""What a lift before a carry, or a placement after one, counts less where the finger travels meanwhile."""
LOAD_COST = 0.4
"""What a landing counts in addition whose pair uses all of the believed cone."""
COST_OF_LIKES = 0.5
"""How much later a grasp is opened for every one like it that has been."""
KINDS = spread_directions(40)
"""Contacts are alike whose directions are nearest to the same one of these."""


@dataclass(eq=False)
class AbstractStandSearch(ABC):
    """Best first over the stands of ``layers``; ``opened`` counts nodes.

    ``is_simultaneous``: relocations next to a motion of the object are cheaper, for it will hide the finger's travel.
    """

    layers: Layers
    is_simultaneous: bool = False
    bound: RelocationBound = field(init=False)
    opened: int = field(default=0, init=False)
    _heap: list[Entry] = field(default_factory=list, init=False)
    _serial: int = field(default=0, init=False)
    _refusals: dict[float, RefusalCount] = field(default_factory=dict, init=False)
    _seen: set[tuple[int, Stand]] = field(default_factory=set, init=False)
    _refused_places: dict[tuple[int, int | None, int | None], int] = field(default_factory=dict, init=False)
    _likes: dict[tuple[object, ...], int] = field(default_factory=dict, init=False)

    @abstractmethod
    def _goals(self, layer: int, finger: int) -> list[int]:
        """Return the spots that a finger may take in a layer beside its landings."""

    @property
    def is_exhausted(self) -> bool:
        """Whether there is no move left that could be tried."""
        return not self._heap

    def explain(self) -> Refusal:
        """Return what stopped the search nearest to the goal."""
        if not self._refusals:
            return Refusal(RefusalKind.NO_PLACE)
        return self._refusals[min(self._refusals)].list_common(1)[0]

    def _open_next(self, node_budget: int, cost_limit: float = np.inf) -> Node | None:
        """Return the next node whose move can be made; None where nothing, or no budget, is left.

        ``cost_limit``: a way that counts so much is known.
        """
        while self._heap and self.opened < node_budget:
            entry = heapq.heappop(self._heap)
            node = entry.node
            if (node.layer, node.stand) in self._seen or self._bound(node) >= cost_limit:
                continue
            # Grasps like those that led nowhere come later: small variations of one idea must not use up the budget.
            kind = self._kind(node)
            count = self._likes.get(kind, 0)
            node.waited = count + self._refused_places.get(self._place(node), 0)
            if self._rank(node) > entry.priority:
                self._push(node)
                continue
            if refusal := self._check(node):
                self._refuse(refusal, node)
                if not self.layers.poses[node.layer].judge(node.stand).is_admissible:
                    self.bound.refuse(node.layer, node.stand)
                continue
            self._seen.add((node.layer, node.stand))
            self._likes[kind] = count + 1
            self.opened += 1
            return node
        return None

    def _kind(self, node: Node) -> tuple[object, ...]:
        """Return what is alike for small variations of a grasp: the pose, who touches, and roughly where."""
        still = self.layers.poses[node.layer]
        where = (
            None
            if s is None
            else "goal"
            if still.labels[s] is not None
            else int(np.argmax(KINDS @ still.normal(s)))
            for s in node.stand
        )
        return (node.layer, *where)

    def _place(self, node: Node) -> tuple[int, int | None, int | None]:
        """Return the pose, and where a finger was put down there."""
        return node.layer, node.changed, None if node.changed is None else node.stand[node.changed]

    def _bound(self, node: Node) -> float:
        """Return what a way through the node counts at least."""
        left = self.layers.last - node.layer
        return node.spent + (1.0 - HIDDEN) * self._missing(node) + CARRY_COST * left

    def _missing(self, node: Node) -> float:
        """Return how many placements and lifts are missing at least; inf where no way leads on."""
        return self.bound.count_moves(node.layer, node.stand)

    def _rank(self, node: Node) -> float:
        ahead = self._missing(node) + CARRY_COST * (self.layers.last - node.layer)
        return node.spent + HEURISTIC_WEIGHT * ahead + node.drawback + COST_OF_LIKES * node.waited

    def _push(self, node: Node) -> None:
        rank = self._rank(node)
        if np.isfinite(rank):
            heapq.heappush(self._heap, Entry(rank, self._serial, node))
            self._serial += 1

    def _refuse(self, refusal: Refusal, node: Node) -> None:
        """Count why ``node`` is no way on, among those that come as near to the goal."""
        place = self._place(node)
        if place[-1] is not None:
            self._refused_places[place] = self._refused_places.get(place, 0) + 1
        because = (refusal,)
        if node.changed is not None:
            name, spot = self.layers.hand.fingers[node.changed].name, node.stand[node.changed]
            label = None if spot is None else self.layers.poses[node.layer].labels[spot]
            kind = RefusalKind.CANNOT_RELOCATE if label is None else RefusalKind.CANNOT_TAKE_GOAL
            refusal = Refusal(kind, (name,), because=because)
        else:
            refusal = Refusal(RefusalKind.CANNOT_CARRY_ON, because=because)
        self._refusals.setdefault(self._missing(node), RefusalCount()).add(refusal)

    def _check(self, node: Node) -> Refusal | None:
        """Return why the move that leads to ``node`` cannot be made; None if it can."""
        still = self.layers.poses[node.layer]
        row = still.judge(node.stand)
        if not row.is_admissible:
            return row.refusal
        if node.parent is not None and node.parent.layer != node.layer:
            _, refusal = self.layers.judge_carry(node.parent.layer, node.parent.stand, is_thorough=False)
            return refusal
        node.margins = row.as_dict()
        if node.parent is None:
            return None
        way = still.find_change(node.parent.stand, node.stand)
        node.way = way if way.around else None
        node.margins["clearance_mm"] = min(node.margins["clearance_mm"], 1e3 * way.clearance)
        if way.clearance < self.layers.hand.limits.clearance:
            return refuse_way(self.layers.hand, way.nearest)
        return None

    def _expand(self, node: Node) -> None:
        stand, still = node.stand, self.layers.poses[node.layer]
        if node.layer < self.layers.last:
            self._carry_on(node)
        for f, spot in enumerate(stand):
            rest = [s for k, s in enumerate(stand) if s is not None and k != f]
            if spot is not None:
                if len(rest) >= 2 and any(
                    still.forms_pair(a, b) for i, a in enumerate(rest) for b in rest[i + 1 :]
                ):
                    self._push(Node(node.layer, change_stand(stand, f, None), node.spent + 1.0, node, f))
                continue
            spent = node.spent + 1.0 - HIDDEN * (self.is_simultaneous and node.was("carry"))
            for place in self._goals(node.layer, f):
                self._push(Node(node.layer, change_stand(stand, f, place), spent, node, f))
            # A place between is of use only where it holds with one of the others, so that the third can go.
            promise = np.minimum.reduce([self.layers.promise(node.layer, f, r) for r in rest])
            for place, load in zip(still.landings(f), promise, strict=True):
                if np.isfinite(load):
                    child = Node(node.layer, change_stand(stand, f, place), spent, node, f)
                    child.drawback = LOAD_COST * float(load)
                    self._push(child)

    def _carry_on(self, node: Node) -> None:
        """Push the stand of ``node`` at the next pose, if its contacts can be carried there."""
        carried = [None if s is None else self.layers.carry(node.layer, s) for s in node.stand]
        stuck = [c[2] for c in carried if c is not None and c[2]]
        for refusal in stuck:
            self._refuse(refusal, Node(node.layer, node.stand, 0.0))
        if not stuck:
            there = tuple(None if c is None else c[0] for c in carried)
            hidden = HIDDEN * (self.is_simultaneous and node.was("lift"))
            start = START_COST * (node.parent is not None and not node.was("carry"))
            self._push(Node(node.layer + 1, there, node.spent + CARRY_COST + start - hidden, node))
