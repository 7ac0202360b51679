"""Grasp adjustment while the object stands still: a search over which finger is where [paper §1].

A node says for every finger where it touches, or that it is free.  Its children put a free finger down, at its goal contact or
somewhere between, or lift one of three; what a node promises is checked when the search wants to open it.  Where no two contacts
of the goal hold, so that nothing can be put down last, the goal grasp is rolled into: a pair of the goal grasp is rolled apart
until it holds alone, and the plan does that backwards.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import islice, permutations

import numpy as np

from dexplan.planning.admissible import Margins, worst
from dexplan.planning.hand import HandModel
from dexplan.planning.plan import Placement
from dexplan.planning.roll import Roll
from dexplan.planning.roll_gait import STEP, RollPlan, RollToPair, build_roll, end_placement, follow_roll
from dexplan.planning.states import without_numbers
from dexplan.planning.still import Stand, StillContacts
from dexplan.spatial import Array

GREED = 1.5
"""How much more moves still to be made count than those already made."""
OPTIONS = 6
"""Ways to roll into the goal grasp, and out of the start grasp, that the search may use."""
ROLL_REACH = float(np.radians(45.0))
"""Contacts farther than this from their goals [rad] are not rolled all the way."""


@dataclass(frozen=True, eq=False)
class Move:
    """One move of an adjustment: ``kind`` place, lift or roll; ``finger`` the one placed or lifted; ``contacts`` after it."""

    kind: str
    finger: int | None
    contacts: tuple[Placement | None, ...]
    margins: dict[str, float]
    rolls: tuple[Roll, ...] = ()
    why: str = ""


@dataclass(frozen=True, eq=False)
class Adjustment:
    """The answer of a search: the moves, or the most common refusals in ``reason``; ``opened`` counts nodes."""

    moves: tuple[Move, ...] | None
    reason: str
    opened: int = 0


@dataclass(eq=False)
class _Node:
    stand: Stand
    spent: int
    parent: _Node | None = None
    changed: int | None = None
    head: Move | None = None
    margins: dict[str, float] = field(default_factory=dict)


@dataclass(order=True)
class _Entry:
    priority: float
    serial: int
    node: _Node = field(compare=False)


def reverse_roll(roll: Roll) -> Roll:
    """Return the same way walked backwards."""
    return Roll(roll.finger, roll.X_OF[::-1], roll.normal_O[::-1])


@dataclass(eq=False)
class AdjustmentSearch:
    """Finds moves from ``start`` to the contacts ``goal`` (Placements at the object's present pose, None: free)."""

    still: StillContacts
    start: tuple[Placement | None, ...]
    goal: tuple[Placement | None, ...]
    opened: int = 0
    _heap: list[_Entry] = field(default_factory=list)
    _serial: int = 0
    _refusals: dict[str, int] = field(default_factory=dict)
    _targets: dict[Stand, RollPlan | None] = field(default_factory=dict)

    @property
    def _hand(self) -> HandModel:
        return self.still.hand

    def run(self, node_budget: int) -> Adjustment:
        """Return the moves, fewest first as far as the search's greed allows."""
        if _same(self.start, self.goal):
            return Adjustment((), "")
        if (rolled := self._roll_all_the_way()) is not None:
            return Adjustment(rolled, "")
        self._set_targets()
        self._begin()
        self._landings = {f: self.still.add_landings(f) for f in range(len(self.start))}
        seen: set[Stand] = set()
        while self._heap and self.opened < node_budget:
            node = heapq.heappop(self._heap).node
            if node.stand in seen:
                continue
            if refusal := self._check(node):
                self._refuse(refusal)
                continue
            seen.add(node.stand)
            self.opened += 1
            if node.stand in self._targets:
                return Adjustment(self._moves(node), "", self.opened)
            self._expand(node)
        common = sorted(self._refusals.items(), key=lambda item: (-item[1], item[0]))[:2]
        reason = "; ".join(text for text, _ in common) or "no place lets another finger go"
        if self._heap:
            reason = f"{self.opened} nodes were opened ({reason})"
        return Adjustment(None, reason, self.opened)

    # -- where it begins and ends ----------------------------------------------------------------------------------------

    def _set_targets(self) -> None:
        stand = tuple(None if c is None else self.still.add(c) for c in self.goal)
        self._goal_stand = stand
        self._targets[stand] = None
        if self.still.has_pair(stand) or sum(s is not None for s in stand) < 3:
            return
        for option in self._unroll(self.goal):
            before = tuple(
                stand[f] if c is self.goal[f] else (None if c is None else self.still.add(c))
                for f, c in enumerate(option.contacts)
            )
            self._targets[before] = option

    def _begin(self) -> None:
        stand = tuple(None if c is None else self.still.add(c) for c in self.start)
        self._push(_Node(stand, 0))
        if self.still.has_pair(stand) or sum(s is not None for s in stand) < 3:
            return
        for option in self._unroll(self.start):
            after = tuple(None if c is None else self.still.add(c) for c in option.contacts)
            i, j = (self._hand.fingers[f].name for f in option.pair)
            why = f"no two contacts are force closed; {i} and {j} roll apart until they are"
            self._push(
                _Node(after, 1, head=Move("roll", None, option.contacts, option.margins, option.rolls, why))
            )

    def _unroll(self, contacts: tuple[Placement | None, ...]) -> list[RollPlan]:
        search = RollToPair(self._hand, self.still.X_WO, contacts, self.still.admissibility)
        options = list(islice(search.options(), OPTIONS))
        if not options:
            self._refuse(f"no two contacts hold, and rolling cannot make two that do: {search.explain()}")
        return options

    def _roll_all_the_way(self) -> tuple[Move, ...] | None:
        """Return rolls that bring every finger to its goal, all together or one after another; None where that fails."""
        pairs = list(zip(self.start, self.goal, strict=True))
        if any((a is None) != (b is None) for a, b in pairs):
            return None
        way = {a.finger: _angle(a.normal_O, b.normal_O) for a, b in pairs if a is not None and b is not None}
        rolling = [f for f, angle in way.items() if angle > 1e-9]
        if not rolling or max(way.values()) > ROLL_REACH:
            return None
        together: list[tuple[int, ...]] = [tuple(rolling)]
        orders: list[list[tuple[int, ...]]] = [together, *([(f,) for f in order] for order in permutations(rolling))]
        for order in orders if len(rolling) > 1 else orders[:1]:
            contacts, moves = self.start, []
            for group in order:
                move = self._roll(contacts, group, way)
                if move is None:
                    break
                moves.append(move)
                contacts = move.contacts
            else:
                return tuple(moves)
        return None

    def _roll(
        self, contacts: tuple[Placement | None, ...], fingers: tuple[int, ...], way: dict[int, float]
    ) -> Move | None:
        """Return the roll of ``fingers`` to their goals along great circles while all hold; None where it is not admissible."""
        hand, X_WO = self._hand, self.still.X_WO
        count = max(9, int(np.ceil(max(way[f] for f in fingers) / STEP)) + 1)
        rolls, postures = (
            [],
            {c.finger: np.repeat(c.q[None], count, axis=0) for c in contacts if c is not None},
        )
        after = list(contacts)
        for f in fingers:
            here, there = contacts[f], self.goal[f]
            assert here is not None
            assert there is not None
            roll = build_roll(hand, here, there.normal_O, way[f], count)
            q, refusal = follow_roll(hand, X_WO, roll, here.q)
            if refusal:
                return None
            rolls.append(roll)
            postures[f] = q
            after[f] = end_placement(roll, here, q[-1])
        rows: list[Margins] = []
        for k in range(count):
            q_all = hand.q_home
            for f, q in postures.items():
                q_all[f] = q[k]
            row = self.still.admissibility.compute_margins(q_all, X_WO, tuple(sorted(postures)))
            if not row.is_admissible:
                return None
            rows.append(row)
        return Move("roll", None, tuple(after), worst(rows), tuple(rolls), "they roll to their goal contacts")

    # -- search ----------------------------------------------------------------------------------------------------------

    def _push(self, node: _Node) -> None:
        ahead = min(_count_moves(node.stand, target) for target in self._targets)
        heapq.heappush(self._heap, _Entry(node.spent + GREED * ahead, self._serial, node))
        self._serial += 1

    def _refuse(self, refusal: str) -> None:
        text = without_numbers(refusal)
        self._refusals[text] = self._refusals.get(text, 0) + 1

    def _check(self, node: _Node) -> str:
        """Return why the move that leads to ``node`` cannot be made; "" if it can."""
        row = self.still.judge(node.stand)
        if not row.is_admissible:
            return row.refusal
        node.margins = row.as_dict()
        if node.parent is None:
            return ""
        f = node.changed
        assert f is not None
        spot = node.stand[f] if node.stand[f] is not None else node.parent.stand[f]
        assert spot is not None
        fewer = tuple(None if k == f else s for k, s in enumerate(node.stand))
        clearance, names = self.still.clear_on_way(fewer, spot)
        node.margins["clearance_mm"] = min(node.margins["clearance_mm"], 1e3 * clearance)
        if clearance < self._hand.limits.clearance:
            return f"{names} come within {1e3 * clearance:.1f} mm on the way"
        return ""

    def _expand(self, node: _Node) -> None:
        stand, still = node.stand, self.still
        for f, spot in enumerate(stand):
            rest = [s for k, s in enumerate(stand) if s is not None and k != f]
            if spot is not None:
                if len(rest) >= 2 and any(
                    still.forms_pair(a, b) for i, a in enumerate(rest) for b in rest[i + 1 :]
                ):
                    self._push(_Node(_with(stand, f, None), node.spent + 1, node, f))
                continue
            wanted = {t[f] for t in self._targets} - {None}
            # A place between is of use only where it lets one of the others go.
            between = [s for s in self._landings[f] if any(still.forms_pair(s, r) for r in rest)]
            for place in (*sorted(s for s in wanted if s is not None), *between):
                self._push(_Node(_with(stand, f, place), node.spent + 1, node, f))

    # -- the answer ------------------------------------------------------------------------------------------------------

    def _moves(self, last: _Node) -> tuple[Move, ...]:
        way = [last]
        while way[-1].parent is not None:
            way.append(way[-1].parent)
        way.reverse()
        moves = [way[0].head] if way[0].head is not None else []
        goals = {s for t in self._targets for s in t if s is not None}
        for node in way[1:]:
            f = node.changed
            assert f is not None
            spot = node.stand[f]
            contacts = self.still.placements(node.stand)
            if spot is None:
                moves.append(Move("lift", f, contacts, node.margins, why="the others hold without it"))
                continue
            why = (
                "it comes to its goal contact"
                if spot in goals
                else "it stands in for a finger that has to move"
            )
            if spot in goals and spot not in self._goal_stand:
                why = "it comes near its goal contact, from where it is rolled there"
            moves.append(Move("place", f, contacts, node.margins, why=why))
        option = self._targets[last.stand]
        if option is not None:
            rolls = tuple(reverse_roll(r) for r in option.rolls)
            why = "no two of the goal contacts hold alone; they are rolled into"
            moves.append(Move("roll", None, self.goal, option.margins, rolls, why))
        return tuple(moves)


def _with(stand: Stand, finger: int, spot: int | None) -> Stand:
    return (*stand[:finger], spot, *stand[finger + 1 :])


def _count_moves(stand: Stand, target: Stand) -> int:
    """Return how many placements and lifts are missing at least."""
    return sum((a is not None) + (b is not None) for a, b in zip(stand, target, strict=True) if a != b)


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _same(a: tuple[Placement | None, ...], b: tuple[Placement | None, ...]) -> bool:
    """Return whether the fingers touch at the same places."""
    return all(
        (x is None) == (y is None) and (x is None or y is None or _angle(x.normal_O, y.normal_O) < 1e-6)
        for x, y in zip(a, b, strict=True)
    )
