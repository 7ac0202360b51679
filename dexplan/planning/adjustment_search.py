"""Grasp adjustment: a search over which finger is where while the object stands, or goes from pose to pose [paper §1].

A node says where the object is, and for every finger where it touches or that it is free.  Its children put a free finger
down, at its goal contact or somewhere between, lift one of three, or carry the object to the next pose; what a node promises is
checked when the search wants to open it.  Where no two contacts of the goal hold, so that nothing can be put down last, the goal
grasp is rolled into: a pair of the goal grasp is rolled apart until it holds alone, and the plan does that backwards.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from dexplan.planning.admissible import Admissibility
from dexplan.planning.coordinated import ObjectMotion
from dexplan.planning.gaits import describe_detour
from dexplan.planning.hand import HandModel
from dexplan.planning.layers import Layers
from dexplan.planning.moves import Adjustment, Contacts, Move, is_same, reverse_roll
from dexplan.planning.plan import Placement
from dexplan.planning.roll_gait import RollPlan
from dexplan.planning.roll_to_goal import RollEveryPair, measure_angle, roll_all_the_way
from dexplan.planning.states import without_numbers
from dexplan.planning.still import Stand, StillContacts, land_again
from dexplan.planning.travel import Way
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

Labels = tuple[int | None, ...]


@dataclass(eq=False)
class _Node:
    layer: int
    stand: Stand
    spent: float
    parent: _Node | None = None
    changed: int | None = None
    head: Move | None = None
    margins: dict[str, float] = field(default_factory=dict)
    drawback: float = 0.0
    waited: int = 0
    way: Way | None = None


@dataclass(order=True)
class _Entry:
    priority: float
    serial: int
    node: _Node = field(compare=False)


@dataclass(eq=False)
class AdjustmentSearch:
    """Finds moves from the contacts ``start`` to the contacts ``goal``.

    The object goes through ``motion`` meanwhile; ``start`` has the postures of its beginning, ``goal`` those of its end.  None
    is a finger that is free.  ``is_simultaneous``: goal contacts may be taken before the object is at its end, and relocations
    next to a motion of the object are cheaper, for it will hide the finger's travel.  ``known_rolls``: ways to roll into or out
    of a grasp that an earlier search found; what this one finds is added.
    """

    hand: HandModel
    admissibility: Admissibility
    start: Contacts
    goal: Contacts
    motion: ObjectMotion
    is_simultaneous: bool = False
    known_rolls: dict[bytes, tuple[list[RollPlan], str]] = field(default_factory=dict)
    opened: int = 0
    _heap: list[_Entry] = field(default_factory=list)
    _serial: int = 0
    _refusals: dict[int, dict[str, int]] = field(default_factory=dict)
    _dead_end: str = ""
    _targets: dict[Labels, RollPlan | None] = field(default_factory=dict)
    _early: dict[tuple[int, int], list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._layers = Layers(self.hand, self.admissibility, self.motion)
        self._count, self.layers = self._layers.last, self._layers.poses

    def run(self, node_budget: int) -> Adjustment:
        """Return the moves, fewest first as far as the search's greed allows."""
        if not self._count:
            if is_same(self.start, self.goal):
                return Adjustment((), "")
            rolled = roll_all_the_way(
                self.hand, self.admissibility, self.motion.X_WO_start, self.start, self.goal
            )
            if rolled is not None:
                why = "they roll to their goal contacts"
                moves = [
                    Move("roll", None, r.contacts, self.motion.X_WO_start, r.margins, r.rolls, why)
                    for r in rolled
                ]
                return Adjustment(tuple(moves), "")
        self._set_targets()
        self._begin()
        if self._dead_end and not is_same(self.start, self.goal):
            return Adjustment(None, self._dead_end)
        seen: set[tuple[int, Stand]] = set()
        likes: dict[tuple[object, ...], int] = {}
        best: _Node | None = None
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
            return Adjustment(self._moves(best), "", self.opened)
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

    def _set_targets(self) -> None:
        """Note the goal contacts, and where no two of them hold those from which they are rolled into, in the last layer."""
        last = self.layers[-1]
        stand = tuple(None if c is None else last.add(c, 0) for c in self.goal)
        self._wanted = {f: [s] for f, s in enumerate(stand) if s is not None}
        self._targets[last.label(stand)] = None
        if last.has_pair(stand) or len(self._wanted) < 3:
            return
        for number, option in enumerate(self._unroll(last, self.goal, "of the goal"), start=1):
            before: list[int | None] = list(stand)
            for roll in option.rolls:
                contact = option.contacts[roll.finger]
                assert contact is not None
                before[roll.finger] = last.add(contact, number)
                self._wanted[roll.finger].append(len(last.spots) - 1)
            self._targets[last.label(tuple(before))] = option

    def _begin(self) -> None:
        first = self.layers[0]
        stand = tuple(None if c is None else first.add(c, self._name(c)) for c in self.start)
        self._push(_Node(0, stand, 0.0))
        if first.has_pair(stand) or sum(s is not None for s in stand) < 3:
            return
        for option in self._unroll(first, self.start, "of the start"):
            after = tuple(None if c is None else first.add(c, self._name(c)) for c in option.contacts)
            i, j = (self.hand.fingers[f].name for f in option.pair)
            why = f"no two contacts are force closed; {i} and {j} roll apart until they are"
            head = Move("roll", None, option.contacts, first.X_WO, option.margins, option.rolls, why)
            self._push(_Node(0, after, 1.0, head=head))

    def _name(self, contact: Placement) -> int | None:
        """Return the label of a contact: a finger may stand at its goal contact already."""
        goal = self.goal[contact.finger]
        is_there = goal is not None and measure_angle(goal.normal_O, contact.normal_O) < 1e-6
        return 0 if is_there else None

    def _unroll(self, still: StillContacts, contacts: Contacts, whose: str) -> list[RollPlan]:
        key = b"".join(
            [np.round(still.X_WO, 9).tobytes(), *(np.round(c.X_OF, 9).tobytes() for c in contacts if c)]
        )
        if key not in self.known_rolls:
            search = RollEveryPair(self.hand, still.X_WO, contacts, self.admissibility)
            options = search.first_of_every_pair(OPTIONS)
            self.known_rolls[key] = options, "" if options else search.explain()
        options, refusal = self.known_rolls[key]
        if refusal:
            self._dead_end = f"no two {whose} contacts hold, and rolling cannot make two that do: {refusal}"
        return options

    # -- search ----------------------------------------------------------------------------------------------------------

    def _kind(self, node: _Node) -> tuple[object, ...]:
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

    def _missing(self, node: _Node) -> int:
        """Return how many placements and lifts are missing at least."""
        labels = self.layers[node.layer].label(node.stand)
        return min(_count_moves(labels, target) for target in self._targets)

    def _bound(self, node: _Node) -> float:
        """Return what a way through the node counts at least."""
        return node.spent + (1.0 - HIDDEN) * self._missing(node) + CARRY_COST * (self._count - node.layer)

    def _push(self, node: _Node, delay: float = 0.0) -> None:
        ahead = self._missing(node) + CARRY_COST * (self._count - node.layer)
        heapq.heappush(
            self._heap, _Entry(node.spent + GREED * ahead + node.drawback + delay, self._serial, node)
        )
        self._serial += 1

    def _refuse(self, refusal: str, node: _Node) -> None:
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

    def _check_carries(self, node: _Node) -> str:
        """Look closely at every carry on the way to ``node`` and note its margins; return why one of them cannot be made."""
        while node.parent is not None:
            if node.parent.layer != node.layer and not node.margins:
                node.margins, refusal = self._layers.judge_carry(node.parent.layer, node.parent.stand)
                if refusal:
                    node.margins = {}
                    return refusal
            node = node.parent
        return ""

    def _check(self, node: _Node) -> str:
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

    def _expand(self, node: _Node) -> None:
        stand, still = node.stand, self.layers[node.layer]
        if node.layer < self._count:
            carried = [None if s is None else self._layers.carry(node.layer, s) for s in stand]
            for c in carried:
                if c is not None and c[2]:
                    self._refuse(c[2], _Node(node.layer, stand, 0.0))
            if not any(c is not None and c[2] for c in carried):
                there = tuple(None if c is None else c[0] for c in carried)
                hidden = HIDDEN * (self.is_simultaneous and _was(node, "lift"))
                start = START_COST * (node.parent is not None and not _was(node, "carry"))
                self._push(_Node(node.layer + 1, there, node.spent + CARRY_COST + start - hidden, node))
        for f, spot in enumerate(stand):
            rest = [s for k, s in enumerate(stand) if s is not None and k != f]
            if spot is not None:
                if len(rest) >= 2 and any(
                    still.forms_pair(a, b) for i, a in enumerate(rest) for b in rest[i + 1 :]
                ):
                    self._push(_Node(node.layer, _with(stand, f, None), node.spent + 1.0, node, f))
                continue
            spent = node.spent + 1.0 - HIDDEN * (self.is_simultaneous and _was(node, "carry"))
            for place in self._goals(node.layer, f):
                self._push(_Node(node.layer, _with(stand, f, place), spent, node, f))
            # A place between is of use only where it holds with one of the others, so that the third can go.
            promise = np.minimum.reduce([self._layers.promise(node.layer, f, r) for r in rest])
            for place, load in zip(still.landings(f), promise, strict=True):
                if np.isfinite(load):
                    child = _Node(node.layer, _with(stand, f, place), spent, node, f)
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

    # -- the answer ------------------------------------------------------------------------------------------------------

    def _moves(self, last: _Node) -> tuple[Move, ...]:
        way = [last]
        while way[-1].parent is not None:
            way.append(way[-1].parent)
        way.reverse()
        moves = [] if way[0].head is None else [way[0].head]
        for before, node in pairwise(way):
            still = self.layers[node.layer]
            contacts = still.placements(node.stand)
            if node.layer != before.layer:
                motion = self._layers.step(before.layer)
                moves.append(Move("carry", None, contacts, motion.X_WO_end, node.margins, motion=motion))
                continue
            f = node.changed
            assert f is not None
            spot = node.stand[f]
            if spot is None:
                why = f"the others hold without it{describe_detour(node.way)}"
                back = node.way.postures[::-1] if node.way else None
                moves.append(Move("lift", f, contacts, still.X_WO, node.margins, why=why, way=back))
                continue
            why = {None: "it stands in for a finger that has to move", 0: "it comes to its goal contact"}.get(
                still.labels[spot], "it comes near its goal contact, from where it is rolled there"
            )
            why += describe_detour(node.way)
            there = node.way.postures if node.way else None
            moves.append(Move("place", f, contacts, still.X_WO, node.margins, why=why, way=there))
        option = self._targets[self.layers[-1].label(last.stand)]
        if option is not None:
            after = list(self.layers[-1].placements(last.stand))
            for roll in option.rolls:
                after[roll.finger] = self.goal[roll.finger]
            rolls = tuple(reverse_roll(r) for r in option.rolls)
            why = "no two of the goal contacts hold alone; they are rolled into"
            moves.append(Move("roll", None, tuple(after), self.layers[-1].X_WO, option.margins, rolls, why))
        return tuple(moves)


def _was(node: _Node, kind: str) -> bool:
    """Return whether the move that led to a node was a carry, or a lift."""
    if node.parent is None:
        return False
    if node.parent.layer != node.layer:
        return kind == "carry"
    return kind == "lift" and node.changed is not None and node.stand[node.changed] is None


def _with(stand: Stand, finger: int, spot: int | None) -> Stand:
    return (*stand[:finger], spot, *stand[finger + 1 :])


def _count_moves(labels: Labels, target: Labels) -> int:
    """Return how many placements and lifts are missing at least."""
    return sum((a is not None) + (b is not None) for a, b in zip(labels, target, strict=True) if a != b)
