"""What a search for an adjustment is made of: its nodes, and the moves that a way through them stands for."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.still import Stand
from dexplan.planning.regrasp.moves import Move, reverse_roll
from dexplan.planning.rolling.roll_gait import RollPlan
from dexplan.planning.ways.travel import Way, describe_detour
from dexplan.plans.contacts import Contacts

Labels = tuple[int | None, ...]
"""Per finger what its contact is to the goal, as :meth:`StillContacts.label` says."""


@dataclass(eq=False)
class Node:
    """A pose of the object, numbered ``layer``, and a ``stand`` of the fingers there.

    ``spent`` is what the way there counts, ``drawback`` what makes it dear to go on; ``changed`` is the finger that was put down
    or lifted, on its ``way`` where that is not the arc; ``head`` is a roll before everything else, ``start`` the number of the
    grasp from which the way begins, ``margins`` those of the move that leads here, once they are known.
    """

    layer: int
    stand: Stand
    spent: float
    parent: Node | None = None
    changed: int | None = None
    head: Move | None = None
    start: int = 0
    margins: dict[str, float] = field(default_factory=dict)
    drawback: float = 0.0
    waited: int = 0
    way: Way | None = None

    def was(self, kind: str) -> bool:
        """Return whether the move that led here was a "carry", or a "lift"."""
        if self.parent is None:
            return False
        if self.parent.layer != self.layer:
            return kind == "carry"
        return kind == "lift" and self.changed is not None and self.stand[self.changed] is None


@dataclass(order=True)
class Entry:
    """A node in the heap."""

    priority: float
    serial: int
    node: Node = field(compare=False)


def change_stand(stand: Stand, finger: int, spot: int | None) -> Stand:
    """Return the stand with one finger elsewhere."""
    return (*stand[:finger], spot, *stand[finger + 1 :])


def trace_back(last: Node) -> list[Node]:
    """Return the nodes on the way to ``last``, the first first."""
    way = [last]
    while way[-1].parent is not None:
        way.append(way[-1].parent)
    return way[::-1]


def build_moves(layers: Layers, last: Node, goal: Contacts, option: RollPlan | None) -> tuple[Move, ...]:
    """Return the moves on the way to ``last``, and the roll into the ``goal`` contacts from there if there is an ``option``."""
    way, poses = trace_back(last), layers.poses
    moves = [] if way[0].head is None else [way[0].head]
    for before, node in pairwise(way):
        still = poses[node.layer]
        contacts = still.placements(node.stand)
        if node.layer != before.layer:
            motion = layers.step(before.layer)
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
        why = f"{_explain_place(still.labels[spot])}{describe_detour(node.way)}"
        there = node.way.postures if node.way else None
        moves.append(Move("place", f, contacts, still.X_WO, node.margins, why=why, way=there))
    if option is not None:
        after = list(poses[-1].placements(last.stand))
        for roll in option.rolls:
            after[roll.finger] = goal[roll.finger]
        rolls = tuple(reverse_roll(r) for r in option.rolls)
        why = "no two of the goal contacts hold alone; they are rolled into"
        moves.append(Move("roll", None, tuple(after), poses[-1].X_WO, option.margins, rolls, why))
    return tuple(moves)


def _explain_place(label: int | None) -> str:
    if label is None:
        return "it stands in for a finger that has to move"
    return (
        "it comes near its goal contact, from where it is rolled there"
        if label
        else "it comes to its goal contact"
    )
