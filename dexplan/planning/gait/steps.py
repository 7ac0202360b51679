"""What a search answers with: the links of a gait, not yet made into actions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.contacts.orbit_contacts import OrbitContacts
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.gait.exchange import GaitNode
from dexplan.planning.search.moves import Lift, Place
from dexplan.planning.ways.travel import Way
from dexplan.plans.contacts import Placement
from dexplan.spatial import Array, lock_arrays


@dataclass(frozen=True, eq=False)
class Step:
    """One link of the search's answer: perhaps a substitution, then a turn of the object with the new grasp.

    ``contacts`` hold during the motion from ``X_WO_start`` to ``X_WO_end``, a turn by ``angle`` [rad] about ``axis_W`` (None: the
    axis of the whole gait) or a straight shift; before it ``placed`` came down and finger ``lifted`` went up, as part of a finger
    rewind if ``is_rewind``.  ``limit`` is the limiting finger (or None) and what ended the motion.  ``ways`` holds by finger the
    ways between home and hover that are not the arc.
    """

    contacts: tuple[Placement, ...]
    X_WO_start: Array
    X_WO_end: Array
    angle: float
    placed: Placement | None
    lifted: int | None
    limit: tuple[int | None, str]
    margins: Mapping[str, float] = field(default_factory=dict)
    place_margins: Mapping[str, float] = field(default_factory=dict)
    axis_W: Array | None = None
    is_rewind: bool = False
    ways: Mapping[int, Way] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def is_still(self) -> bool:
        """Whether the object stays where it is."""
        return self.angle == 0.0 and np.array_equal(self.X_WO_start[:3, 3], self.X_WO_end[:3, 3])


@dataclass(frozen=True)
class Link:
    """A node on the way to a goal, for how many stations its grip ``moved`` the object, with the margins of that, and of the
    exchange that led to it.
    """

    node: GaitNode
    moved: int
    margins: Mapping[str, float]
    place_margins: Mapping[str, float]


def build_steps(contacts: OrbitContacts, links: list[Link]) -> list[Step]:
    """Return a way as symbolic steps."""
    return [_build_step(contacts, links, k) for k in range(len(links))]


def _build_step(contacts: OrbitContacts, links: list[Link], k: int) -> Step:
    node, moved = links[k].node, links[k].moved
    at, reach, leg = node.at, node.reach, contacts.tables[node.at.stretch].leg
    place, lift, end = node.find_move(Place), node.find_move(Lift), at.stop + moved
    assert reach is not None
    finger, ended = (reach.finger, reach.end) if moved == reach.stops else (None, Stop(StopKind.SHORTER))
    held = {h.finger: contacts.place(h, at) for h in node.grip}
    return Step(
        contacts=tuple(held.values()),
        X_WO_start=leg.pose(at.stop),
        X_WO_end=leg.pose(end),
        angle=leg.turned(end) - leg.turned(at.stop),
        axis_W=leg.axis_W,
        placed=None if place is None else held[place.finger],
        lifted=None if lift is None else lift.finger,
        limit=(finger, str(ended)),
        margins=links[k].margins,
        place_margins=links[k].place_margins,
        is_rewind=_is_rewind(links, k),
        ways=node.arrival.ways,
    )


def _is_rewind(links: list[Link], k: int) -> bool:
    """Return whether the relocation before step k belongs to a finger rewind: the same pair moves on as moved before."""
    if links[k].node.find_move(Lift) is None:
        return False
    before = next((i for i in range(k - 1, -1, -1) if links[i].moved), None)
    after = next((i for i in range(k, len(links)) if links[i].moved), None)
    if before is None or after is None or after == before + 1:
        return False
    one, other = ({h.finger for h in links[i].node.grip} for i in (before, after))
    return one == other
