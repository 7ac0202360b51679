"""A gait on sites: the object goes its way, whichever grip it ends in; no symmetry of the object is made use of.

Slower than a gait on orbits, which serves bodies that look the same all around an axis; what that finds is held against this.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import FACING
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.start_pairs import list_pairs
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.build import build_moves
from dexplan.planning.regrasp.ends import AnyEnd
from dexplan.planning.regrasp.missing_chain import explain_missing_chain, refuse_goal_pose
from dexplan.planning.regrasp.moves import Move
from dexplan.planning.regrasp.pairs import Pair
from dexplan.planning.regrasp.relocation_bound import RelocationBound
from dexplan.planning.regrasp.search import PATIENCE
from dexplan.planning.search.engine import Engine
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.planning.search.stepwise import StepProblem
from dexplan.plans.contacts import Contacts
from dexplan.plans.refusal import Refusal

START = Progress(0, 0)


@dataclass(frozen=True, eq=False)
class FoundGait:
    """The ``moves`` that take the object along its track, from the contacts ``start``."""

    start: Contacts
    moves: tuple[Move, ...]


class SiteGait:
    """Searches moves that take the object along a ``track`` from the contacts ``start``; can be asked to go on.

    ``start`` None: from any pair that holds the object where it is.  ``movers``: the pair of fingers that alone moves the object,
    its contacts rewound while another finger stands in [paper §2.2]; None: any fingers that hold it.
    ``facing``: which places fingers try, as in :func:`.landings.find_facing`.
    """

    def __init__(
        self,
        hand: HandModel,
        admissibility: Admissibility,
        track: Track,
        start: Contacts | None,
        movers: Pair | None = None,
        *,
        facing: float = FACING,
    ) -> None:
        layers = Layers(hand, admissibility, track, looks_ahead=True, facing=facing)
        self._contacts, first, self._is_rewind = SiteContacts(layers), layers.poses[0], movers is not None
        self._bound = RelocationBound(layers, None, movers=movers)
        self._engine = Engine(StepProblem(self._contacts, AnyEnd(), self._bound, movers=movers), PATIENCE)
        self._starts = (
            [stand for stand in list_pairs(first) if movers in (None, self._contacts.list_touching(stand))]
            if start is None
            else [tuple(None if c is None else first.add(c) for c in start)]
        )
        self.has_start = bool(self._starts)
        for number, stand in enumerate(self._starts):
            self._engine.push(Node(START, stand, origin=number))

    @property
    def opened(self) -> int:
        """Number of nodes opened."""
        return self._engine.opened

    @property
    def is_exhausted(self) -> bool:
        """Whether there is nothing left to open."""
        return self._engine.is_exhausted

    def run(self, nodes: int) -> FoundGait | None:
        """Open up to ``nodes`` more nodes; return the moves to the end of the track, None where that was not come to."""
        last = self._engine.run(nodes)
        if last is None:
            return None
        nothing: Contacts = (None,) * len(self._contacts.hand.fingers)
        start = self._contacts.layers.poses[0].placements(trace_back(last)[0].grip)
        moves = build_moves(self._contacts, last, nothing, None)
        return FoundGait(start, _name_rewinds(moves) if self._is_rewind else moves)

    def refuse_goal(self) -> Refusal | None:
        """Return why no two fingers hold the object at the end of the track; None where two may."""
        return refuse_goal_pose(self._bound)

    def explain(self) -> Refusal:
        """Return what stopped the search nearest to the end, or why it could not begin."""
        refusals = self._engine.list_refusals(1)
        return refusals[0] if refusals else explain_missing_chain(self._bound, self._starts)


def _name_rewinds(moves: tuple[Move, ...]) -> tuple[Move, ...]:
    """Return the moves; relocations between motions of the object by the same pair of fingers say that they are rewinds."""
    carries = [k for k, move in enumerate(moves) if move.kind == "carry"]
    if not carries:
        return moves
    between = range(carries[0], carries[-1])
    return tuple(
        replace(move, why=f"finger rewind: {move.why}") if k in between and move.kind != "carry" else move
        for k, move in enumerate(moves)
    )
