"""Ways into a goal grasp, found backwards: a search that leaves the goal contacts until none of them is held any more.

Placements and lifts can be undone by one another, so that what leads out of the goal grasp leads into it.  Near the goal there
are few ways, and most attitudes of the object in which there is none show it after very few nodes; from where the goal contacts
have been left behind, fingers stand where there is room, and a search from the other side meets them there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.adjustment_nodes import HELPERS, Labels, Node, trace_back
from dexplan.planning.admissible import Admissibility
from dexplan.planning.coordinated import ObjectMotion
from dexplan.planning.goal import VERTICAL
from dexplan.planning.hand import HandModel
from dexplan.planning.layers import Layers
from dexplan.planning.moves import Contacts
from dexplan.planning.roll_gait import RollPlan
from dexplan.planning.roll_to_goal import RollEveryPair
from dexplan.planning.stand_search import AbstractStandSearch
from dexplan.planning.still import Stand, StillContacts
from dexplan.spatial import Array

OPTIONS = 2
"""Ways to roll into the goal grasp, and out of the start grasp, that searches may use for every pair of fingers."""
NODES = 80
"""Nodes that the search for ways in may open."""
ENOUGH = 8
"""So many ways in are enough."""
MOST = 24
"""Where none was found so many grasps that lead into the goal are noted all the same."""


@dataclass(frozen=True, eq=False)
class Entrance:
    """A stand from which the goal grasp is come to: through ``stands``, this one first, and then by rolling as in ``option``."""

    stands: tuple[Stand, ...]
    option: RollPlan | None


@dataclass(eq=False)
class GoalSide:
    """The goal contacts with the object at ``X_WO`` (4, 4), and the ways into them; ``entrances`` has them by their labels.

    ``wanted``: per finger the spots of ``still`` that these ways use.  ``refusal``: why there is no way in at all, "" where there
    may be one.
    """

    hand: HandModel
    admissibility: Admissibility
    X_WO: Array
    goal: Contacts
    still: StillContacts = field(init=False)
    entrances: dict[Labels, Entrance] = field(default_factory=dict, init=False)
    wanted: dict[int, list[int]] = field(default_factory=dict, init=False)
    refusal: str = field(default="", init=False)
    opened: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self.still = StillContacts(self.hand, self.X_WO, self.admissibility)
        stand = tuple(None if c is None else self.still.add(c, 0) for c in self.goal)
        self.wanted = {f: [s] for f, s in enumerate(stand) if s is not None}
        self._note([stand], None)
        has_three, has_pair = len(self.wanted) > 2, self.still.has_pair(stand)
        if has_pair:
            self.refusal = self._look({stand: None})
        if has_three and (not has_pair or self.refusal):
            # No pair holds, or the one that does lets nobody in: another one that is rolled apart may.
            rolled, refusal = self._roll(stand)
            for before, option in rolled.items():
                self._note([before], option)
            self.refusal = self._look(rolled) if rolled else self.refusal or refusal

    def _roll(self, stand: Stand) -> tuple[dict[Stand, RollPlan | None], str]:
        """Return stands from which the goal grasp is rolled into, and why there is none ("" if there is)."""
        search = RollEveryPair(self.hand, self.X_WO, self.goal, self.admissibility)
        found: dict[Stand, RollPlan | None] = {}
        for number, option in enumerate(search.first_of_every_pair(OPTIONS), start=1):
            before = list(stand)
            for roll in option.rolls:
                contact = option.contacts[roll.finger]
                assert contact is not None
                before[roll.finger] = self.still.add(contact, number)
            found[tuple(before)] = option
        why = f"no two of the goal contacts hold, and rolling cannot make two that do: {search.explain()}"
        return found, "" if found else why

    def _look(self, roots: dict[Stand, RollPlan | None]) -> str:
        """Note ways in that end in one of ``roots``; return why there is none, "" if there may be one."""
        motion = ObjectMotion(self.X_WO, VERTICAL, 0.0, np.zeros(3))
        layers = Layers(self.hand, self.admissibility, motion)
        layers.poses = [self.still]
        search = _Leaving(layers)
        ways = search.run(tuple(roots))
        self.opened += search.opened
        for way in ways:
            stands = [node.stand for node in way[::-1]]
            for k in range(len(stands)):
                self._note(stands[k:], roots[stands[-1]])
        if ways and not any(search.is_out(way[-1]) for way in ways) and search.is_exhausted:
            return search.explain()
        return ""

    def _note(self, stands: list[Stand], option: RollPlan | None) -> None:
        """Note the way through ``stands``; their contacts get labels."""
        still = self.still
        for f, spot in enumerate(stands[0]):
            if spot is not None:
                if still.labels[spot] is None:
                    still.labels[spot] = HELPERS + spot
                if spot not in self.wanted.setdefault(f, []):
                    self.wanted[f].append(spot)
        self.entrances.setdefault(still.label(stands[0]), Entrance(tuple(stands), option))


class _Leaving(AbstractStandSearch):
    """Leaves goal contacts, those nearest to being left first."""

    def run(self, roots: tuple[Stand, ...]) -> list[list[Node]]:
        """Return ways from the ``roots`` on which all goal contacts are left, or those that come nearest to it."""
        for stand in roots:
            self._push(Node(0, stand, 0.0))
        out, others = list[list[Node]](), list[list[Node]]()
        while len(out) < ENOUGH and (node := self._open_next(NODES)) is not None:
            if self.is_out(node):
                out.append(trace_back(node))
                continue
            others.append(trace_back(node))
            self._expand(node)
        others.sort(key=lambda way: self._missing(way[-1]))
        return out or others[:MOST]

    def is_out(self, node: Node) -> bool:
        """Return whether no goal contact is held any more."""
        return not self._missing(node)

    def _missing(self, node: Node) -> int:
        labels = [label for label in self.layers.poses[0].label(node.stand) if label is not None]
        held = sum(0 <= label < HELPERS for label in labels)
        # The last one can be left where the two others hold.
        return 2 * held - (len(labels) > 2 and held > 0)

    def _goals(self, layer: int, finger: int) -> list[int]:
        return []
