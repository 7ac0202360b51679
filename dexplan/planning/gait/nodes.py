"""The search tree's nodes, and the way through them as symbolic steps."""

from __future__ import annotations

from dataclasses import dataclass, field

from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.gait.steps import Step
from dexplan.plans.refusal import Refusal

Limit = tuple[int | None, Stop | Refusal]
"""The limiting finger, None where it is no finger, and what ends the motion."""


@dataclass(eq=False)
class Node:
    """Progress ``done`` [stations] along leg number ``leg``, the contacts that hold, and how the search came here.

    From ``parent`` the object moved by ``moved`` stations, then ``placed`` came down and ``lifted`` went up; neither where a new
    leg begins.  ``pair`` are the fingers that moved the object last, ``promise`` the stations for which the grasp should last,
    ``load`` its share of the cone.  Set when the node is opened: ``limit``, the limiting finger (None where it is no finger) and
    what ends the motion ``reach`` stations further on.
    """

    leg: int
    done: int
    held: tuple[Held, ...]
    placements: int
    parent: Node | None = None
    moved: int = 0
    placed: Held | None = None
    lifted: Held | None = None
    pair: tuple[int, ...] = ()
    promise: int = 0
    load: float = 0.0
    reach: int = 0
    limit: Limit = (None, Stop(StopKind.GOAL))
    margins: dict[str, float] = field(default_factory=dict)
    place_margins: dict[str, float] = field(default_factory=dict)


def trace_back(node: Node) -> list[Node]:
    """Return the nodes from the start to ``node``."""
    way = [node]
    while way[-1].parent is not None:
        way.append(way[-1].parent)
    return way[::-1]


def build_steps(tables: list[ContactTable], way: list[Node], motions: list[int]) -> list[Step]:
    """Return a way as symbolic steps; ``motions`` are the stations moved with the grasp of each of its nodes."""
    return [_build_step(tables[node.leg], way, motions, k) for k, node in enumerate(way)]


def _build_step(table: ContactTable, way: list[Node], motions: list[int], k: int) -> Step:
    here, moved = way[k], motions[k]
    leg, end = table.leg, here.done + moved
    finger, ended = here.limit if moved == here.reach else (None, Stop(StopKind.SHORTER))
    return Step(
        contacts=tuple(table.placement(h, here.done) for h in here.held),
        X_WO_start=leg.pose(here.done),
        X_WO_end=leg.pose(end),
        angle=leg.turned(end) - leg.turned(here.done),
        axis_W=leg.axis_W,
        placed=None if here.placed is None else table.placement(here.placed, here.done),
        lifted=None if here.lifted is None else here.lifted.finger,
        limit=(finger, str(ended)),
        margins=here.margins,
        place_margins=here.place_margins,
        is_rewind=_is_rewind(way, motions, k),
    )


def _is_rewind(way: list[Node], motions: list[int], k: int) -> bool:
    """Return whether the relocation before step k belongs to a finger rewind: the same pair moves on as moved before."""
    if way[k].lifted is None:
        return False
    before = next((i for i in range(k - 1, -1, -1) if motions[i]), None)
    after = next((i for i in range(k, len(way)) if motions[i]), None)
    if before is None or after is None or after == before + 1:
        return False
    return {h.finger for h in way[before].held} == {h.finger for h in way[after].held}
