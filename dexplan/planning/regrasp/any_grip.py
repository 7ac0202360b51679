"""A gait on sites: the object goes its way, whichever grip it ends in; no symmetry of the object is made use of.

Slower than a gait on orbits, which serves bodies that look the same all around an axis; what that finds is held against this.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.still import Stand, StillContacts
from dexplan.planning.regrasp.build import build_moves
from dexplan.planning.regrasp.moves import Adjustment
from dexplan.planning.regrasp.problem import RegraspProblem
from dexplan.planning.regrasp.relocation_bound import Pair
from dexplan.planning.regrasp.search import PATIENCE
from dexplan.planning.search.engine import Engine
from dexplan.planning.search.nodes import Node
from dexplan.plans.contacts import Contacts
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.refusal import Refusal, RefusalKind

START = Progress(0, 0)


@dataclass(frozen=True, eq=False)
class AnyGrip:
    """The end of a way on which any grip will do; ``still`` are the contacts there."""

    still: StillContacts
    roots: Mapping[Stand, list[Pair]] | None = None
    wanted: Mapping[int, list[int]] = field(default_factory=dict)

    def is_end(self, stand: Stand) -> bool:
        """Return that it is one."""
        return True


def find_gait(
    hand: HandModel, admissibility: Admissibility, motion: ObjectMotion, start: Contacts, nodes: int
) -> Adjustment:
    """Return the moves that take the object through ``motion`` from the contacts ``start``, or what stopped the search."""
    layers = Layers(hand, admissibility, motion)
    contacts = SiteContacts(layers)
    engine = Engine(RegraspProblem(contacts, AnyGrip(layers.poses[-1])), PATIENCE)
    stand = tuple(None if c is None else layers.poses[0].add(c) for c in start)
    engine.push(Node(START, stand))
    last = engine.run(nodes)
    if last is not None:
        nothing: Contacts = (None,) * len(hand.fingers)
        return Adjustment(build_moves(contacts, last, nothing, None), opened=engine.opened)
    refusal = next(iter(engine.list_refusals(1)), Refusal(RefusalKind.NO_PLACE))
    return Adjustment(None, refusal, engine.opened, engine.is_exhausted)
