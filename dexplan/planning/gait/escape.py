"""Where must a pair take the object before a third finger finds room beside it?

A pair may hold the object well and yet leave no place from which another finger could take over: a grasp from which no gait
starts.  "If the points are out of reach, first move the object so that they come into the workspaces" [paper §1] says what to do:
the pair turns the object about some other axis first.  All axes are tried at once, by geometry and loads alone; the search then
checks the ways it likes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.icosphere import build_icosphere
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_tip_pose
from dexplan.planning.admissible.loads import compute_pair_loads
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.regions.regions import compute_regions
from dexplan.spatial import Array, lock_arrays, rotate_about

AXES = 1
"""Level of the icosphere whose vertices are the axes tried: 42 of them."""
SPACING, FURTHEST = float(np.radians(5.0)), float(np.radians(80.0))
"""Turns tried about every axis [rad]."""
EVERY = 12
"""One direction in so many of the regions' fine grid is tried as a place to land: about 4 deg apart."""
MOST_PLACES_COUNTED = 24
"""Places to land beyond this many make an escape no better."""
LONGEST_TURN_COST = 0.5
"""What an escape's score loses for the longest turn tried; room for ``MOST_PLACES_COUNTED`` places counts 1."""
COUNT = 4
"""Escapes offered."""
ALIKE = float(np.cos(np.radians(30.0)))
"""Escapes about axes nearer to one another than this count as one."""


@dataclass(frozen=True, eq=False)
class Escape:
    """Turn the object by ``angle`` [rad] about the unit world axis ``axis_W`` (3,); ``room`` places to land are then in sight."""

    axis_W: Array
    angle: float
    room: int

    def __post_init__(self) -> None:
        lock_arrays(self)


def find_escapes(table: ContactTable, held: tuple[Held, Held]) -> list[Escape]:
    """Return turns of the object by the pair ``held`` after which a free finger can land, the best first; none where none does.

    ``table`` is that of a leg that begins where the pair holds now; the axes do not depend on the leg.
    """
    axes = build_icosphere(AXES).vertices
    angles = np.arange(SPACING, FURTHEST + 1e-9, SPACING)
    turns = np.stack([rotate_about(axis, angles) for axis in axes])
    carried = _carry(table, held, turns)
    room = np.zeros(carried.shape, dtype=np.intp)
    normals = [np.einsum("akij,j->aki", turns, table.normal(h)) for h in held]
    places = find_places(table, {h.finger for h in held})
    for a, k in np.argwhere(carried).tolist():
        here = {h.finger: n[a, k] for h, n in zip(held, normals, strict=True)}
        room[a, k] = _count_room(table, here, places, turns[a, k])
    score = (
        np.minimum(room, MOST_PLACES_COUNTED) / MOST_PLACES_COUNTED - LONGEST_TURN_COST * angles / FURTHEST
    )
    score[room == 0] = -np.inf
    best = score.argmax(axis=1)
    chosen: list[int] = []
    for a in np.argsort(-score.max(axis=1), kind="stable"):
        if room[a, best[a]] and all(axes[a] @ axes[b] < ALIKE for b in chosen):
            chosen.append(int(a))
    return [Escape(axes[a], float(angles[best[a]]), int(room[a, best[a]])) for a in chosen[:COUNT]]


def count_room(table: ContactTable, held: tuple[Held, Held]) -> int:
    """Return at how many places, about 4 deg apart, a free finger could land beside the pair ``held`` as it stands."""
    normals = {h.finger: table.normal(h) for h in held}
    return count_room_at(table, normals, find_places(table, set(normals)))


def count_room_at(table: ContactTable, held: dict[int, Array], places: dict[int, Array]) -> int:
    """Return the same beside contacts along the normals ``held`` (3,) in W, at the ``places`` of :func:`find_places`."""
    return _count_room(table, held, places, np.eye(3))


def _count_room(table: ContactTable, held: dict[int, Array], places: dict[int, Array], turn: Array) -> int:
    R_WO, found = turn @ table.leg.X_WO_start[:3, :3], 0
    for finger, free in places.items():
        found += _count_landings(table, held, finger, free[table.hand.object.allows(free @ R_WO)])
    return found


def _carry(table: ContactTable, held: tuple[Held, Held], turns: Array) -> NDArray[np.bool_]:
    """Return through which of the ``turns`` (A, K, 3, 3), growing along K, the pair can take the object (A, K)."""
    hand, flat = table.hand, turns.reshape(-1, 3, 3)
    ok = np.ones(len(flat), dtype=bool)
    for h in held:
        chain = hand.fingers[h.finger].chain
        X = table.state(h).X_WF
        poses = np.repeat(X[None], len(flat), axis=0)
        poses[:, :3, :3] = flat @ X[:3, :3]
        poses[:, :3, 3] = table.leg.center + flat @ (X[:3, 3] - table.leg.center)
        q, reached = solve_tip_pose(hand.workspaces[h.finger], poses)
        # The last joint only spins the tip: where it starts is chosen later, for the whole way.
        stop = chain.n_joints - int(chain.has_tip_roll)
        room = np.minimum(q - chain.lower, chain.upper - q)[:, :stop].min(axis=1)
        ok &= reached & (room >= hand.limits.joint_margin)
        ok[ok] = estimate_dexterity(chain, q[ok]) >= hand.limits.dexterity
    first, second = (np.einsum("nij,j->ni", flat, table.normal(h)) for h in held)
    loads = compute_pair_loads(hand, first, second, table.wrench)
    ok &= loads.utilisation <= hand.limits.cone_share
    return np.logical_and.accumulate(ok.reshape(turns.shape[:2]), axis=1)


def find_places(table: ContactTable, holding: set[int]) -> dict[int, Array]:
    """Return directions (N, 3) in W along which each free finger can touch the object where it is."""
    regions = compute_regions(table.hand, table.leg.center, theta=table.beta_max)
    free = sorted(set(range(len(table.hand.fingers))) - holding)
    return {
        f: regions.contactable[f].directions[regions.contactable[f].level.values > 0.0][::EVERY] for f in free
    }


def _count_landings(table: ContactTable, held: dict[int, Array], finger: int, places: Array) -> int:
    """Return at how many of ``places`` (N, 3) ``finger`` can land beside the contacts ``held`` and carry with one of them."""
    hand = table.hand
    if not len(places):
        return 0
    closed = [places @ -normal > np.cos(2.0 * table.beta_max) for normal in held.values()]
    rows = np.logical_or(*closed)
    if not rows.any():
        return 0
    rows &= table.are_apart(finger, places, held) & table.keep_order({**held, finger: places})
    holds = np.zeros(len(places), dtype=bool)
    for normal, near in zip(held.values(), closed, strict=True):
        asked = np.flatnonzero(rows & near)
        if len(asked):
            kept = np.repeat(normal[None], len(asked), axis=0)
            loads = compute_pair_loads(hand, kept, places[asked], table.wrench)
            holds[asked] |= loads.utilisation <= hand.limits.cone_share
    return int(holds.sum())
