"""How a free fingertip gets from one place to another: along an arc around the object, or around what is in that arc's way.

All ways come from here.  An arc needs no memory, it follows from its ends; a detour is kept in the plan as it was found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.kinematics.arcs import refine
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel, compute_travel_margin
from dexplan.planning.ways.detour import Surroundings, bow_arc, find_detour
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.scene.description import Nearness
from dexplan.spatial import Array, read_only

DIP = 0.001
"""Ways whose postures are as near to what is not to be touched as this, on top of what is asked for [m], are looked at once more
between them.  Of 28 travels none came nearer by more than 0.2 mm there."""


@dataclass(frozen=True, eq=False)
class Way:
    """The ``postures`` (K, J) [rad] of a free finger's way, and what is ``nearest`` to what along it.

    A distance of -inf is one of the finger's joints to their limits, which has no length.  ``around`` names what was in the way
    of the arc where this is a detour; "" for the arc itself.
    """

    postures: Array
    nearest: Nearness
    around: str = ""

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "postures", read_only(self.postures))

    @property
    def clearance(self) -> float:
        """The least distance [m] along the way."""
        return self.nearest.distance

    @property
    def names(self) -> str:
        """Between whom it is that small."""
        return self.nearest.names


def find_way(around: Surroundings, arc: Array, looks_around: bool = True) -> Way:
    """Return the ``arc`` (K, J) where it is clear in the surroundings, else the arc bowed, else a detour between its ends.

    Clear means: clear of all bodies, and of the finger's own joint limits, just as the controller goes through the arc.  Where
    there is no detour, or with ``looks_around`` False, it is the arc again, with too little clearance and who blocks it.
    """
    finger, limit = around.hand.fingers[around.finger], around.hand.limits.clearance
    at_limits = Nearness(-np.inf, f"{finger.name} and its joint limits", (around.finger,), (finger.name,))
    needed = compute_travel_margin(around.hand, around.finger)
    if compute_joint_margin(finger.chain, arc[[0, -1]]).min() < needed:
        return Way(arc, at_limits)
    nearest = around.find_nearest_on(arc)
    executed = refine(arc)
    if 0.0 <= nearest.distance - limit < DIP:
        nearest = around.find_nearest_on(executed)
    if compute_joint_margin(finger.chain, executed).min() < needed:
        nearest = at_limits
    if nearest.distance >= limit:
        return Way(arc, nearest)
    if (bowed := bow_arc(around, arc)) is not None and bowed.way is not None:
        return Way(bowed.way, bowed.nearest, nearest.names)
    if not looks_around:
        return Way(arc, nearest)
    found = find_detour((around,), arc[0], arc[-1])
    if found.way is None:
        return Way(arc, choose_nearer(nearest, found.nearest))
    return Way(found.way, found.nearest, nearest.names)


def choose_nearer(*found: Nearness) -> Nearness:
    """Return the least of these; where two are the same, the one that comes first by name."""
    return min(found, key=lambda nearest: (nearest.distance, nearest.names))


def refuse_way(hand: HandModel, nearest: Nearness) -> Refusal:
    """Return the refusal of a way on which these come too near; at -inf it is a finger's joints that come to their limits."""
    if np.isfinite(nearest.distance):
        cause = refuse_nearness(nearest, hand.limits.clearance)
    else:
        cause = Refusal(RefusalKind.JOINT_LIMIT, nearest.bodies)
    return Refusal(RefusalKind.ON_WAY, because=(cause,))


def describe_detour(way: Way | None) -> str:
    """Return what a detour is for, to be added to why a finger moves; "" for an arc."""
    return f"; a detour keeps {way.around} apart" if way is not None and way.around else ""
