"""Grasp adjustment: a search for moves from one of several grasps into the goal grasp [paper §1].

It is led by how many placements are missing at least, and ends in a stand that the goal's own side has found: the goal grasp, or
one from which it is rolled into.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.still import Stand
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.build import build_moves
from dexplan.planning.regrasp.ends import GoalEnd
from dexplan.planning.regrasp.goal_side import OPTIONS, GoalSide
from dexplan.planning.regrasp.moves import Adjustment, Move, is_same, is_same_place
from dexplan.planning.regrasp.relocation_bound import RelocationBound
from dexplan.planning.rolling.roll_gait import RollPlan
from dexplan.planning.rolling.roll_to_goal import RollEveryPair, roll_all_the_way
from dexplan.planning.search.engine import Engine, Patience
from dexplan.planning.search.moves import RollTo
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.planning.search.stepwise import StepProblem
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array

NODES_TO_IMPROVE = 30
"""After the first way is found as many nodes as it took are opened again, and so many more, to find a better one."""
PATIENCE = Patience(opened=0.5, failed=0.5)
"""What a grasp's priority loses, in moves, for every one like it that was opened, or that failed in the same place."""
START = Progress(0, 0)


@dataclass(eq=False)
class AdjustmentSearch:
    """Finds moves from grasps that it is given to the goal contacts of ``side``; ``chosen`` is the number of the one it found.

    The object goes through the layers' motion meanwhile and ends where ``side`` has it; the grasps have the postures of its
    beginning, None is a finger that is free.  It can be asked to go on where it stopped, with further grasps.

    ``is_simultaneous``: goal contacts may be taken before the object is at its end, too.  ``known_rolls``: ways to roll out of a
    grasp that an earlier search found; what this one finds is added.
    """

    layers: Layers
    is_simultaneous: bool = False
    side: GoalSide = field(kw_only=True)
    known_rolls: dict[bytes, tuple[list[RollPlan], Refusal | None]] = field(default_factory=dict)
    chosen: int = field(default=0, init=False)
    _starts: int = field(default=0, init=False)
    _dead_end: Refusal | None = field(default=None, init=False)

    @classmethod
    def along(
        cls,
        motion: ObjectMotion,
        side: GoalSide,
        known_rolls: dict[bytes, tuple[list[RollPlan], Refusal | None]],
        is_simultaneous: bool = False,
        looks_ahead: bool = False,
    ) -> AdjustmentSearch:
        """Return a search along the ``motion`` that leads to the goal's pose; on long ways it ``looks_ahead``."""
        layers = Layers(side.hand, side.admissibility, Track((motion,)), looks_ahead)
        layers.poses[-1] = side.still
        return cls(layers, is_simultaneous, side=side, known_rolls=known_rolls)

    def __post_init__(self) -> None:
        self._hand, self._contacts = self.side.hand, SiteContacts(self.layers)
        self.bound = RelocationBound(self.layers, self.side.roots, self.is_simultaneous)
        end = GoalEnd(self.layers, self.side, self.is_simultaneous)
        self._problem = StepProblem(self._contacts, end, self.bound, self.is_simultaneous)
        self._engine = Engine(self._problem, PATIENCE)

    @property
    def opened(self) -> int:
        """Number of nodes opened."""
        return self._engine.opened

    def begin(self, start: Contacts) -> Adjustment | None:
        """Add a grasp to start from; return the moves where they are so simple that no search is needed."""
        number = self._starts
        self._starts += 1
        if not self.layers.last:
            self.chosen = number
            if is_same(start, self.side.goal):
                return Adjustment(())
            X_WO = self.side.X_WO
            rolled = roll_all_the_way(self._hand, self.side.admissibility, X_WO, start, self.side.goal)
            if rolled is not None:
                why = "they roll to their goal contacts"
                moves = [Move("roll", None, r.contacts, X_WO, r.margins, r.rolls, why) for r in rolled]
                return Adjustment(tuple(moves))
        self._dead_end = self._begin(number, start)
        return None

    def count_moves(self, start: Contacts) -> float:
        """Return how many placements and lifts it takes at least from a grasp that has not been added."""
        first = self.layers.poses[0]
        return self.bound.count_moves(0, tuple(None if c is None else first.add(c) for c in start))

    def run(self, node_budget: int) -> Adjustment:
        """Return the moves, fewest first as far as the search's greed allows; at most so many nodes are opened in all."""
        before, until = self.opened, node_budget
        best: Node[Stand] | None = None
        while (node := self._engine.run(until - self.opened)) is not None:
            if best is None:
                until = min(until, 2 * self.opened + NODES_TO_IMPROVE)
            if best is None or node.cost < best.cost:
                best, self._problem.cost_limit = node, node.cost
            if not self.is_simultaneous:
                break
        # What is asked for next may begin elsewhere.
        self._problem.cost_limit = np.inf
        opened = self.opened - before
        if best is not None:
            self.chosen = trace_back(best)[0].origin
            moves = build_moves(self._contacts, best, self.side.goal, self.side.find_option(best.grip))
            return Adjustment(moves, opened=opened)
        refusal = self._dead_end or self.side.refusal or self._explain()
        if not self._engine.is_exhausted:
            refusal = replace(refusal, words=f"{refusal} ({self.opened} nodes were opened)")
        return Adjustment(None, refusal, opened, is_exhausted=self._engine.is_exhausted)

    def _explain(self) -> Refusal:
        """Return what stopped the search nearest to the goal."""
        return next(iter(self._engine.list_refusals(1)), Refusal(RefusalKind.NO_PLACE))

    # -- where it begins and ends ----------------------------------------------------------------------------------------

    def _begin(self, number: int, start: Contacts) -> Refusal | None:
        """Begin with a grasp; return why no finger of it can ever be lifted, None if one can."""
        first = self.layers.poses[0]
        stand = tuple(None if c is None else first.add(c, self._name(c)) for c in start)
        self._engine.push(Node(START, stand, origin=number))
        if first.has_pair(stand) or sum(s is not None for s in stand) < 3:
            return None
        options, refusal = self._unroll(first.X_WO, start)
        for option in options:
            after = tuple(None if c is None else first.add(c, self._name(c)) for c in option.contacts)
            i, j = (self._hand.fingers[f].name for f in option.pair)
            why = f"no two contacts are force closed; {i} and {j} roll apart until they are"
            roll = RollTo(option.rolls, option.contacts, option.margins, why)
            self._engine.push(Node(START, after, 1.0, moves=(roll,), origin=number))
        return refusal

    def _name(self, contact: Placement) -> int | None:
        """Return the label of a contact: a finger may stand at its goal contact already."""
        goal = self.side.goal[contact.finger]
        is_there = goal is not None and is_same_place(goal, contact)
        return 0 if is_there else None

    def _unroll(self, X_WO: Array, start: Contacts) -> tuple[list[RollPlan], Refusal | None]:
        """Return ways to roll contacts apart until two of them hold, and why there is none (None if there is one)."""
        key = b"".join([np.round(X_WO, 9).tobytes(), *(np.round(c.X_OF, 9).tobytes() for c in start if c)])
        if key not in self.known_rolls:
            search = RollEveryPair(self._hand, X_WO, start, self.side.admissibility)
            options = search.first_of_every_pair(OPTIONS)
            refusal = None
            if not options:
                refusal = Refusal(RefusalKind.CANNOT_ROLL_APART, ("start",), because=search.explain())
            self.known_rolls[key] = options, refusal
        return self.known_rolls[key]
