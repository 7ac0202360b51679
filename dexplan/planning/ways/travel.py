"""How a free fingertip gets from one place to another: along an arc around the object, or around what is in that arc's way.

All ways come from here.  An arc needs no memory, it follows from its ends; a detour is kept in the plan as it was found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.kinematics.arcs import refine
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.planning.admissible.hand import compute_travel_margin
from dexplan.planning.ways.detour import Surroundings, bow_arc, find_detour
from dexplan.spatial import Array, read_only

DIP = 0.001
"""Ways whose postures are as near to what is not to be touched as this, on top of what is asked for [m], are looked at once more
between them.  Of 28 travels none came nearer by more than 0.2 mm there."""


@dataclass(frozen=True, eq=False)
class Way:
    """The ``postures`` (K, J) [rad] of a free finger's way, and its ``clearance`` [m], which is between ``names``.

    ``around`` names what was in the way of the arc where this is a detour; "" for the arc itself.
    """

    postures: Array
    clearance: float
    names: str
    around: str = ""

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "postures", read_only(self.postures))


def find_way(around: Surroundings, arc: Array, looks_around: bool = True) -> Way:
    """Return the ``arc`` (K, J) where it is clear in the surroundings, else the arc bowed, else a detour between its ends.

    Clear means: clear of all bodies, and of the finger's own joint limits, just as the controller goes through the arc.  Where
    there is no detour, or with ``looks_around`` False, it is the arc again, with too little clearance and who blocks it.
    """
    finger = around.hand.fingers[around.finger]
    needed = compute_travel_margin(around.hand, around.finger)
    if compute_joint_margin(finger.chain, arc[[0, -1]]).min() < needed:
        return Way(arc, -np.inf, f"{finger.name} and its joint limits")
    clearance, names = around.compute_way_clearance(arc)
    executed = refine(arc)
    if 0.0 <= clearance - around.hand.limits.clearance < DIP:
        clearance, names = around.compute_way_clearance(executed)
    if compute_joint_margin(finger.chain, executed).min() < needed:
        clearance, names = -np.inf, f"{finger.name} and its joint limits"
    if clearance >= around.hand.limits.clearance:
        return Way(arc, clearance, names)
    if (bowed := bow_arc(around, arc)) is not None and bowed.way is not None:
        return Way(bowed.way, bowed.clearance, bowed.names, names)
    if not looks_around:
        return Way(arc, clearance, names)
    found = find_detour((around,), arc[0], arc[-1])
    if found.way is None:
        return Way(arc, *min((clearance, names), (found.clearance, found.names)))
    return Way(found.way, found.clearance, found.names, names)


def spell_nearness(names: str, clearance: float) -> str:
    """Return in words who comes too near on a way; a ``clearance`` [m] of -inf is one of joint limits, which has no distance."""
    return f"{names} come{f' within {1e3 * clearance:.1f} mm' if np.isfinite(clearance) else ' too near'} on the way"


def describe_detour(way: Way | None) -> str:
    """Return what a detour is for, to be added to why a finger moves; "" for an arc."""
    return f"; a detour keeps {way.around} apart" if way is not None and way.around else ""
