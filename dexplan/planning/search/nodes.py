"""The search tree's nodes: values that nobody changes; what is learnt of one makes another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from dexplan.planning.contacts.oracle import Grip, Progress, Reach
from dexplan.planning.search.moves import Move
from dexplan.planning.ways.travel import Way

MoveKind = TypeVar("MoveKind", bound=Move)


@dataclass(frozen=True)
class Arrival:
    """What was found when the moves that lead to a node were judged: margins, and by finger the ways that are no arcs."""

    margins: Mapping[str, float] = field(default_factory=dict)
    ways: Mapping[int, Way] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Node(Generic[Grip]):
    """A ``grip`` that holds the object at some progress ``at``, and how the search came there: from ``parent`` by ``moves``.

    ``cost`` is what the way there counts, ``bound`` how many moves seem to be missing, None while nobody asked; ``strain`` is
    what makes it dear to go on with the grip, though it costs nothing: its share of the cone.  ``promise``: for how many stops
    the grip should last; ``movers``: the fingers that moved the object last; ``origin``: the number of the start that it comes
    from.

    ``may_detour``: arcs were in the way of something, so that its fingers may go around.  Known once the node is opened:
    ``arrival`` and ``reach``.
    """

    at: Progress
    grip: Grip
    cost: float = 0.0
    bound: float | None = None
    parent: Node[Grip] | None = None
    moves: tuple[Move, ...] = ()
    strain: float = 0.0
    promise: int = 0
    movers: tuple[int, ...] = ()
    origin: int = 0
    may_detour: bool = False
    arrival: Arrival = Arrival()
    reach: Reach | None = None

    def find_move(self, kind: type[MoveKind]) -> MoveKind | None:
        """Return the move of this kind among those that led here, None where there was none."""
        return next((move for move in self.moves if isinstance(move, kind)), None)


def trace_back(node: Node[Grip]) -> list[Node[Grip]]:
    """Return the nodes from the start to ``node``."""
    way = [node]
    while (parent := way[-1].parent) is not None:
        way.append(parent)
    return way[::-1]


def known_bound(node: Node[Grip]) -> float:
    """Return how many moves seem to be missing from a node for which that was asked."""
    assert node.bound is not None
    return node.bound
