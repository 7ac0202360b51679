"""A gait on sites: the object goes its way, whichever grip it ends in; no symmetry of the object is made use of.

Slower than a gait on orbits, which serves bodies that look the same all around an axis; what that finds is held against this.
"""

from __future__ import annotations

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.build import build_moves
from dexplan.planning.regrasp.ends import AnyEnd
from dexplan.planning.regrasp.moves import Move
from dexplan.planning.regrasp.relocation_bound import RelocationBound
from dexplan.planning.regrasp.search import PATIENCE
from dexplan.planning.search.engine import Engine
from dexplan.planning.search.nodes import Node
from dexplan.planning.search.stepwise import StepProblem
from dexplan.plans.contacts import Contacts
from dexplan.plans.refusal import Refusal, RefusalKind

START = Progress(0, 0)


class SiteGait:
    """Searches moves that take the object along a ``track`` from the contacts ``start``; can be asked to go on."""

    def __init__(self, hand: HandModel, admissibility: Admissibility, track: Track, start: Contacts) -> None:
        layers = Layers(hand, admissibility, track)
        self.start, self._contacts = start, SiteContacts(layers)
        self._engine = Engine(StepProblem(self._contacts, AnyEnd(), RelocationBound(layers, None)), PATIENCE)
        stand = tuple(None if c is None else layers.poses[0].add(c) for c in start)
        self._engine.push(Node(START, stand))

    @property
    def opened(self) -> int:
        """Number of nodes opened."""
        return self._engine.opened

    @property
    def is_exhausted(self) -> bool:
        """Whether there is nothing left to open."""
        return self._engine.is_exhausted

    def run(self, nodes: int) -> tuple[Move, ...] | None:
        """Open up to ``nodes`` more nodes; return the moves to the end of the track, None where that was not come to."""
        last = self._engine.run(nodes)
        if last is None:
            return None
        nothing: Contacts = (None,) * len(self._contacts.hand.fingers)
        return build_moves(self._contacts, last, nothing, None)

    def explain(self) -> Refusal:
        """Return what stopped the search nearest to the end."""
        return next(iter(self._engine.list_refusals(1)), Refusal(RefusalKind.NO_PLACE))
