"""How a free fingertip gets from one place to another: along an arc around the object, or around what is in that arc's way.

All ways come from here.  An arc needs no memory, it follows from its ends; a detour is kept in the plan as it was found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from dexplan.brief import brief_repr
from dexplan.planning.detour import Surroundings, bow_arc, find_detour, interpolate
from dexplan.planning.hand import HandModel
from dexplan.planning.spherical_wrist import solve_near
from dexplan.scene.chain import compute_joint_margin, compute_tip_pose, wrap_near
from dexplan.scene.finger import FingerDescription
from dexplan.spatial import Array, build_frame, read_only

SAMPLES = 17
"""Postures along one path."""
BETWEEN = 4
"""Postures looked at for each posture of a way: the controller goes through them along a spline."""

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


def compute_travel_margin(hand: HandModel, finger: int) -> float:
    """Return how far [rad] a free finger's joints stay off their limits; what home has, where that is less."""
    who = hand.fingers[finger]
    return min(hand.limits.travel_margin, float(compute_joint_margin(who.chain, who.q_home)))


def refine(way: Array) -> Array:
    """Return the postures (N, J) of a way (K, J) as the controller goes through them, ``BETWEEN`` for each that is given."""
    return interpolate(way, np.linspace(0.0, 1.0, BETWEEN * (len(way) - 1) + 1))


def build_travel(finger: FingerDescription, q_start: Array, q_end: Array, center: Array) -> Array:
    """Return postures (K, J) from ``q_start`` to ``q_end`` (J,) [rad] whose tip swings around ``center`` (3,) [m].

    The tip's direction from the centre turns along a great circle while its distance grows or shrinks evenly, so that a tip
    that starts and ends clear of a round object stays clear of it.  The pole turns with it.  Where the last joint is the
    tip's own roll it goes straight from one angle to the other: the shortest turn in space may lie beyond its limit.

    One end should be the finger's home, as in every plan: between two far contacts the arc may leave the workspace, and the
    straight way between postures that takes its place may cut across the object.
    """
    share = np.linspace(0.0, 1.0, SAMPLES)
    straight = q_start + share[:, None] * (q_end - q_start)
    ends = compute_tip_pose(finger.chain, np.stack([q_start, q_end]))
    arms = ends[:, :3, 3] - center
    distances = np.linalg.norm(arms, axis=1)
    directions = arms / distances[:, None]
    X = np.zeros((SAMPLES, 4, 4))
    X[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(ends[:, :3, :3]))(share).as_matrix()
    turn = np.cross(directions[0], directions[1])
    angle = np.arctan2(np.linalg.norm(turn), directions[0] @ directions[1])
    if angle > 1e-9:
        size = np.linalg.norm(turn)
        # Between opposite places every great circle is the shortest.
        axis = turn / size if size > 1e-9 else build_frame(directions[0])[:, 0]
        swung = Rotation.from_rotvec(share[:, None] * angle * axis).apply(directions[0])
    else:
        swung = np.broadcast_to(directions[0], (SAMPLES, 3))
    X[:, :3, 3] = center + (distances[0] + share[:, None] * (distances[1] - distances[0])) * swung
    X[:, 3, 3] = 1.0
    path, reached = solve_near(finger.chain, X, straight, tolerance=1e-5)
    path = wrap_near(path, straight)
    if finger.chain.has_tip_roll:
        path[:, -1] = straight[:, -1]
    path[0], path[-1] = q_start, q_end
    # Where the arc leaves the workspace or would flip the wrist, the straight line between the postures has to do.
    flips = np.abs(np.diff(path, axis=0)).max() > 0.15 + 3.0 * np.abs(q_end - q_start).max() / (SAMPLES - 1)
    if not reached.all() or flips or compute_joint_margin(finger.chain, path).min() < 0.0:
        return straight
    # Even in what the fastest joint has to do, so that the way can be walked at a steady pace.
    length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path, axis=0)).max(axis=1))])
    even = np.linspace(0.0, length[-1], SAMPLES)
    return (
        np.stack([np.interp(even, length, column) for column in path.T], axis=1) if length[-1] > 0.0 else path
    )


def compute_hover(
    finger: FingerDescription, X_WO: Array, X_OF: Array, normal_O: Array, q: Array, gap: float
) -> Array:
    """Return the posture (J,) near ``q`` with the tip at its contact pose ``X_OF``, lifted ``gap`` [m] along the normal."""
    X = X_OF.copy()
    X[:3, 3] += gap * normal_O
    solved, _ = solve_near(finger.chain, (X_WO @ X)[None], q[None])
    return wrap_near(solved[0], q)


def describe_detour(way: Way | None) -> str:
    """Return what a detour is for, to be added to why a finger moves; "" for an arc."""
    return f"; a detour keeps {way.around} apart" if way is not None and way.around else ""
