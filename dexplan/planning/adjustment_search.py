"""Grasp adjustment: a search over which finger is where while the object stands, or goes from pose to pose [paper §1].

A node says where the object is, and for every finger where it touches or that it is free.  Its children put a free finger
down, at its goal contact or somewhere between, lift one of three, or carry the object to the next pose; what a node promises is
checked when the search wants to open it.  Where no two contacts of the goal hold, so that nothing can be put down last, the goal
grasp is rolled into: a pair of the goal grasp is rolled apart until it holds alone, and the plan does that backwards.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.adjustment_nodes import (
    Entry,
    Labels,
    Node,
    build_moves,
    change_stand,
    count_moves,
    trace_back,
)
from dexplan.planning.admissible import Admissibility
from dexplan.planning.coordinated import ObjectMotion
from dexplan.planning.hand import HandModel
from dexplan.planning.layers import Layers
from dexplan.planning.moves import Adjustment, Contacts, Move, is_same
from dexplan.planning.plan import Placement
from dexplan.planning.roll_gait import RollPlan
from dexplan.planning.roll_to_goal import RollEveryPair, measure_angle, roll_all_the_way
from dexplan.planning.states import without_numbers
from dexplan.planning.still import Stand, StillContacts, land_again
from dexplan.scene.workspace import spread_directions

GREED = 2.5
"""How much more moves still to be made count than those already made."""
CARRY_COST, START_COST = 0.3, 0.4
"""What a carry from pose to pose counts, and the first one after a relocation in addition; a placement or a lift counts 1."""
HIDDEN = 0.45
"""What a lift before a carry, or a placement after one, counts less where the finger travels meanwhile."""
LOAD_COST = 0.4
"""What a landing counts in addition whose pair uses all of the believed cone."""
PATIENCE = 30
"""After the first way is found as many nodes as it took are opened again, and so many more, to find a better one."""
OPTIONS = 2
"""Ways to roll into the goal grasp, and out of the start grasp, that the search may use for every pair of fingers."""
SAME = 0.5
"""How much later a grasp is opened for every one like it that has been."""
KINDS = spread_directions(40)
"""Contacts are alike whose directions are nearest to the same one of these."""


@dataclass(eq=False)
class AdjustmentSearch:
    """Finds moves from one of the grasps ``starts`` to the contacts ``goal``; ``chosen`` is the number of that one.

    The object goes through ``motion`` meanwhile; ``starts`` have the postures of its beginning, ``goal`` those of its end.  None
    is a finger that is free.  ``is_simultaneous``: goal contacts may be taken before the object is at its end, and relocations
    next to a motion of the object are cheaper, for it will hide the finger's travel.  ``known_rolls``: ways to roll into or out
    of a grasp that an earlier search found; what this one finds is added.
    """

    hand: HandModel
    admissibility: Admissibility
    starts: tuple[Contacts, ...]
    goal: Contacts
    motion: ObjectMotion
    is_simultaneous: bool = False
    known_rolls: dict[bytes, tuple[list[RollPlan], str]] = field(default_factory=dict)
    opened: int = 0
    chosen: int = 0
    _heap: list[Entry] = field(default_factory=list)
    _serial: int = 0
    _refusals: dict[int, dict[str, int]] = field(default_factory=dict)
    _targets: dict[Labels, RollPlan | None] = field(default_factory=dict)
    _early: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._layers = Layers(self.hand, self.admissibility, self.motion)
        self._count, self.layers = self._layers.last, self._layers.poses

    def run(self, node_budget: int) -> Adjustment:
        """Return the moves, fewest first as far as the search's greed allows."""
        for number, start in enumerate(self.starts if not self._count else ()):
            self.chosen = number
            if is_same(start, self.goal):
                return Adjustment((), "")
            X_WO = self.motion.X_WO_start
            rolled = roll_all_the_way(self.hand, self.admissibility, X_WO, start, self.goal)
            if rolled is not None:
                why = "they roll to their goal contacts"
                moves = [Move("roll", None, r.contacts, X_WO, r.margins, r.rolls, why) for r in rolled]
                return Adjustment(tuple(moves), "")
        refusal = self._set_targets()
        refused = [refusal or self._begin(number, start) for number, start in enumerate(self.starts)]
        if all(refused) and not any(is_same(start, self.goal) for start in self.starts):
            return Adjustment(None, refused[0], is_exhausted=True)
        seen: set[tuple[int, Stand]] = set()
        likes: dict[tuple[object, ...], int] = {}
        best: Node | None = None
        until = 0
        while self._heap and self.opened < node_budget:
            if best is not None and self.opened >= until:
                break
            node = heapq.heappop(self._heap).node
            if (node.layer, node.stand) in seen or (best is not None and self._bound(node) >= best.spent):
                continue
            # Grasps like those that led nowhere come later: small variations of one idea must not use up the budget.
            kind = self._kind(node)
            if node.waited < (count := likes.get(kind, 0)):
                node.waited = count
                self._push(node, SAME * count)
                continue
            if refusal := self._check(node):
                self._refuse(refusal, node)
                continue
            seen.add((node.layer, node.stand))
            likes[kind] = count + 1
            self.opened += 1
            if node.layer == self._count and self.layers[-1].label(node.stand) in self._targets:
                if refusal := self._check_carries(node):
                    self._refuse(refusal, node)
                    continue
                until = until or 2 * self.opened + PATIENCE
                best = node
                if not self.is_simultaneous:
                    break
                continue
            self._expand(node)
        if best is not None:
            self.chosen = trace_back(best)[0].start
            option = self._targets[self.layers[-1].label(best.stand)]
            return Adjustment(build_moves(self._layers, best, self.goal, option), "", self.opened)
        reason = self._explain()
        if self._heap:
            reason = f"{reason} ({self.opened} nodes were opened)"
        return Adjustment(None, reason, self.opened, is_exhausted=not self._heap)

    def _explain(self) -> str:
        """Return what stopped the search nearest to the goal."""
        if not self._refusals:
            return "no place lets another finger go"
        nearest = self._refusals[min(self._refusals)]
        return min(nearest, key=lambda text: (-nearest[text], text))

    # -- where it begins and ends ----------------------------------------------------------------------------------------

    def _set_targets(self) -> str:
        """Note the goal contacts, and where no two of them hold those from which they are rolled into, in the last layer.

        Return why there is no way into them, "" if there may be.
        """
        last = self.layers[-1]
        stand = tuple(None if c is None else last.add(c, 0) for c in self.goal)
        self._wanted = {f: [s] for f, s in enumerate(stand) if s is not None}
        self._targets[last.label(stand)] = None
        if last.has_pair(stand) or len(self._wanted) < 3:
            return ""
        options, refusal = self._unroll(last, self.goal, "of the goal")
        for number, option in enumerate(options, start=1):
            before: list[int | None] = list(stand)
            for roll in option.rolls:
                contact = option.contacts[roll.finger]
                assert contact is not None
                before[roll.finger] = last.add(contact, number)
                self._wanted[roll.finger].append(len(last.spots) - 1)
            self._targets[last.label(tuple(before))] = option
        return refusal

    def _begin(self, number: int, start: Contacts) -> str:
        """Begin with a grasp; return why no finger of it can ever be lifted, "" if one can."""
        first = self.layers[0]
        stand = tuple(None if c is None else first.add(c, self._name(c)) for c in start)
        self._push(Node(0, stand, 0.0, start=number))
        if first.has_pair(stand) or sum(s is not None for s in stand) < 3:
            return ""
        options, refusal = self._unroll(first, start, "of the start")
        for option in options:
            after = tuple(None if c is None else first.add(c, self._name(c)) for c in option.contacts)
            i, j = (self.hand.fingers[f].name for f in option.pair)
            why = f"no two contacts are force closed; {i} and {j} roll apart until they are"
            head = Move("roll", None, option.contacts, first.X_WO, option.margins, option.rolls, why)
            self._push(Node(0, after, 1.0, head=head, start=number))
        return refusal

    def _name(self, contact: Placement) -> int | None:
        """Return the label of a contact: a finger may stand at its goal contact already."""
        goal = self.goal[contact.finger]
        is_there = goal is not None and measure_angle(goal.normal_O, contact.normal_O) < 1e-6
        return 0 if is_there else None

    def _unroll(self, still: StillContacts, contacts: Contacts, whose: str) -> tuple[list[RollPlan], str]:
        """Return ways to roll contacts apart until two of them hold, and why there is none ("" if there is one)."""
        key = b"".join(
            [np.round(still.X_WO, 9).tobytes(), *(np.round(c.X_OF, 9).tobytes() for c in contacts if c)]
        )
        if key not in self.known_rolls:
            search = RollEveryPair(self.hand, still.X_WO, contacts, self.admissibility)
            options = search.first_of_every_pair(OPTIONS)
            self.known_rolls[key] = options, "" if options else search.explain()
        options, refusal = self.known_rolls[key]
        if refusal:
            refusal = f"no two {whose} contacts hold, and rolling cannot make two that do: {refusal}"
        return options, refusal

    # -- search ----------------------------------------------------------------------------------------------------------

    def _kind(self, node: Node) -> tuple[object, ...]:
        """Return what is alike for small variations of a grasp: the pose, who touches, and roughly where."""
        still = self.layers[node.layer]
        where = (
            None
            if s is None
            else "goal"
            if still.labels[s] is not None
            else int(np.argmax(KINDS @ still.normal(s)))
            for s in node.stand
        )
        return (node.layer, *where)

    def _missing(self, node: Node) -> int:
        """Return how many placements and lifts are missing at least."""
        labels = self.layers[node.layer].label(node.stand)
        return min(count_moves(labels, target) for target in self._targets)

    def _bound(self, node: Node) -> float:
        """Return what a way through the node counts at least."""
        return node.spent + (1.0 - HIDDEN) * self._missing(node) + CARRY_COST * (self._count - node.layer)

    def _push(self, node: Node, delay: float = 0.0) -> None:
        ahead = self._missing(node) + CARRY_COST * (self._count - node.layer)
        heapq.heappush(
            self._heap, Entry(node.spent + GREED * ahead + node.drawback + delay, self._serial, node)
        )
        self._serial += 1

    def _refuse(self, refusal: str, node: Node) -> None:
        """Count why ``node`` is no way on, among those that come as near to the goal."""
        text = without_numbers(refusal)
        if node.changed is not None:
            name, spot = self.hand.fingers[node.changed].name, node.stand[node.changed]
            is_goal = spot is not None and self.layers[node.layer].labels[spot] is not None
            text = f"{name} cannot {'take its goal contact' if is_goal else 'be relocated'}, {text}"
        else:
            text = f"the object cannot be carried on, {text}"
        counts = self._refusals.setdefault(self._missing(node), {})
        counts[text] = counts.get(text, 0) + 1

    def _check_carries(self, node: Node) -> str:
        """Look closely at every carry on the way to ``node`` and note its margins; return why one of them cannot be made."""
        while node.parent is not None:
            if node.parent.layer != node.layer and not node.margins:
                node.margins, refusal = self._layers.judge_carry(node.parent.layer, node.parent.stand)
                if refusal:
                    node.margins = {}
                    return refusal
            node = node.parent
        return ""

    def _check(self, node: Node) -> str:
        """Return why the move that leads to ``node`` cannot be made; "" if it can."""
        still = self.layers[node.layer]
        row = still.judge(node.stand)
        if not row.is_admissible:
            return row.refusal
        if node.parent is not None and node.parent.layer != node.layer:
            _, refusal = self._layers.judge_carry(node.parent.layer, node.parent.stand, is_thorough=False)
            return refusal
        node.margins = row.as_dict()
        if node.parent is None:
            return ""
        f = node.changed
        assert f is not None
        spot = node.stand[f] if node.stand[f] is not None else node.parent.stand[f]
        assert spot is not None
        fewer = tuple(None if k == f else s for k, s in enumerate(node.stand))
        way = still.find_way(fewer, spot)
        node.way, clearance, names = way if way.around else None, way.clearance, way.names
        node.margins["clearance_mm"] = min(node.margins["clearance_mm"], 1e3 * clearance)
        if clearance < self.hand.limits.clearance:
            return f"{names} come within {1e3 * clearance:.1f} mm on the way"
        return ""

    def _expand(self, node: Node) -> None:
        stand, still = node.stand, self.layers[node.layer]
        if node.layer < self._count:
            carried = [None if s is None else self._layers.carry(node.layer, s) for s in stand]
            for c in carried:
                if c is not None and c[2]:
                    self._refuse(c[2], Node(node.layer, stand, 0.0))
            if not any(c is not None and c[2] for c in carried):
                there = tuple(None if c is None else c[0] for c in carried)
                hidden = HIDDEN * (self.is_simultaneous and node.was("lift"))
                start = START_COST * (node.parent is not None and not node.was("carry"))
                self._push(Node(node.layer + 1, there, node.spent + CARRY_COST + start - hidden, node))
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
            promise = np.minimum.reduce([self._layers.promise(node.layer, f, r) for r in rest])
            for place, load in zip(still.landings(f), promise, strict=True):
                if np.isfinite(load):
                    child = Node(node.layer, change_stand(stand, f, place), spent, node, f)
                    child.drawback = LOAD_COST * float(load)
                    self._push(child)

    def _goals(self, layer: int, finger: int) -> list[int]:
        """Return the goal contacts that a finger may take in a layer."""
        if layer == self._count:
            return self._wanted.get(finger, [])
        if not self.is_simultaneous:
            return []
        key = layer, finger
        if key not in self._early:
            still, last = self.layers[layer], self.layers[-1]
            self._early[key] = []
            for spot in self._wanted.get(finger, []):
                found = land_again(self.hand, still.X_WO, last.spots[spot])
                if found is not None:
                    self._early[key].append(still.add(found, last.labels[spot]))
        return self._early[key]
