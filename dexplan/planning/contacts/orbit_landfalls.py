"""Where can a free finger land so that it holds with one that holds already?  The most promising places on a leg's orbits.

Geometry first, then the loads of the pairs that are left: what is chosen is a spread of places, most of them for how long the
pair lasts, some for how far the landing finger itself could go on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.admissible.loads import compute_pair_loads
from dexplan.planning.admissible.separation import compute_opposition
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.oracle import Landfall, Landing, Purpose
from dexplan.plans.motion import STEP
from dexplan.spatial import Array

SPREAD = 6
"""Placements tried per finger and partner."""
ADVANCED = 2
"""How many of these are chosen for how far the landing finger itself could go on."""
LOOKED_AT = 40
"""Placements whose loads are computed to choose these."""
APART = float(np.cos(np.radians(8.0)))
"""Placements nearer to one another than this count as the same one."""
CARRIES = 4
"""Samples of a carry at which a placement's load is computed."""

OrbitLandfall = Landfall[tuple[Held, ...], Held]


def find_landings_on(table: ContactTable, asked: Sequence[OrbitLandfall]) -> list[list[Landing[Held]]]:
    """Return for each of ``asked`` the most promising places to land that hold with the finger kept and clear all others."""
    surveys = [_survey(table, one) for one in asked]
    counts = [len(near) for near, _ in surveys]
    if not sum(counts):
        return [[] for _ in asked]
    kept = np.repeat([table.normal(_keep(one)) for one in asked], counts, axis=0)
    landed = np.concatenate(
        [table.candidates[one.finger].normals[near] for one, (near, _) in zip(asked, surveys, strict=True)]
    )
    stations = np.concatenate([promise for _, promise in surveys])
    # A finger that only stands in, or gets ready, need not carry the object anywhere yet.
    still = np.repeat([one.purpose is not Purpose.CARRY for one in asked], counts)
    lasting, load = estimate_carries(table, kept, landed, np.where(still, 0, stations))
    lasting = np.where(still & (lasting >= 0), stations, lasting).astype(np.intp)
    chosen, first = [], 0
    for one, (near, _), count in zip(asked, surveys, counts, strict=True):
        part = slice(first, first + count)
        chosen.append(_choose(table, one, near, lasting[part], load[part]))
        first += count
    return chosen


def _keep(one: OrbitLandfall) -> Held:
    """Return the contact with which a landing has to hold."""
    if one.keep is None:
        raise ValueError("landings on orbits hold with one contact, which has to be named")
    return one.keep


def _survey(table: ContactTable, one: OrbitLandfall) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of candidates worth a look, by geometry alone, and for how many stations they might carry."""
    finger, rows, nothing = one.finger, table.candidates[one.finger], np.zeros(0, dtype=np.intp)
    if not len(rows.orbit):
        return nothing, nothing
    keep = _keep(one)
    cosine = rows.normals @ -table.normal(keep)
    ok = cosine > compute_opposition(table.beta_max)
    if table.hand.object.allowed_regions:
        ok &= table.allows(rows.normals, one.done)
    if table.leg.is_shift:
        ok &= rows.station == one.done
    promise = np.minimum(np.minimum(rows.carry, keep.left), table.stations - one.done)
    if one.purpose is Purpose.CARRY:
        ok &= promise > 0
    found = np.flatnonzero(ok)
    if not len(found):
        return nothing, nothing
    normals = rows.normals[found]
    held = {h.finger: table.normal(h) for h in one.held}
    fits = table.keep_order({**held, finger: normals}) & table.are_apart(finger, normals, held)
    found = found[fits]
    if not len(found):
        return nothing, nothing
    beta = 0.5 * np.arccos(np.clip(cosine[found], -1.0, 1.0)) / table.beta_max
    gain = _gain(table, one, promise[found], rows.carry[found], 0.1)
    score = gain / max(1.0, gain.max()) - 0.4 * beta
    near = found[_spread(rows.normals[found], score, LOOKED_AT)]
    return near, promise[near]


def _gain(
    table: ContactTable, one: OrbitLandfall, lasting: NDArray[np.intp], carry: NDArray[np.intp], share: float
) -> Array:
    """Return what landings are worth (N,): how long the pair lasts, and how long the finger itself could go on."""
    if one.purpose is Purpose.STAND_IN:
        return np.zeros(len(carry))
    own = np.minimum(carry, table.stations - one.done)
    # The finger kept may soon be used up; what the other then has left serves the next grasp.
    return own.astype(np.float64) if one.purpose is Purpose.ADVANCE else lasting + share * own


def _choose(
    table: ContactTable, one: OrbitLandfall, near: NDArray[np.intp], lasting: NDArray[np.intp], load: Array
) -> list[Landing[Held]]:
    """Return the best of the rows ``near``, which carry for ``lasting`` stations (-1: not at all) with ``load``."""
    rows = table.candidates[one.finger]
    best: list[int] = []
    # Most for how long the pair lasts; some for how far the finger itself could go, as the other may soon be used up.
    for share, count in ((0.0, SPREAD - ADVANCED), (1.0, SPREAD)):
        gain = _gain(table, one, lasting, rows.carry[near], share)
        score = gain / max(1.0, gain.max(initial=1.0)) - 0.5 * load
        order = [int(k) for k in np.argsort(-score, kind="stable") if lasting[k] >= 0 and k not in best]
        best += order[: count - len(best)]
    return [Landing(rows.pick(one.finger, int(near[k])), int(lasting[k]), float(load[k])) for k in best]


def estimate_carries(
    table: ContactTable, first: Array, second: Array, stations: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array]:
    """Return for how many stations pairs with these normals (N, 3) carry the object, and their load at first (N,).

    Looks at ``CARRIES`` samples of the ``stations`` (N,) asked for.
    """
    share = np.linspace(0.0, 1.0, CARRIES)
    if table.leg.is_shift:  # nothing turns
        loads = compute_pair_loads(table.hand, first, second, table.wrench).utilisation[None]
    else:
        # Both contacts at every sample, all in one go.
        turn = (table.leg.sense * STEP * share[:, None] * stations).ravel()
        a, b = (_turn(table.leg.axis_W, turn, np.tile(n, (CARRIES, 1))) for n in (first, second))
        loads = compute_pair_loads(table.hand, a, b, table.wrench).utilisation.reshape(CARRIES, -1)
    holds = loads <= table.hand.limits.cone_share
    last = np.where(holds.all(0), CARRIES, holds.argmin(0)) - 1
    carried = np.where(last < 0, -1, np.floor(share[np.maximum(last, 0)] * stations))
    return carried.astype(np.intp), loads[0]


def _spread(normals: Array, score: Array, count: int) -> list[int]:
    """Return up to ``count`` rows of ``normals`` (N, 3), best ``score`` (N,) first, none too near another."""
    chosen: list[int] = []
    free = np.ones(len(normals), dtype=bool)
    for row in np.argsort(-score, kind="stable"):
        if free[row]:
            chosen.append(int(row))
            if len(chosen) == count:
                break
            free &= normals @ normals[row] <= APART
    return chosen


def _turn(axis: Array, angle: Array, vectors: Array) -> Array:
    """Return ``vectors`` (N, 3) turned about the unit ``axis`` (3,) by ``angle`` (N,) [rad] (Rodrigues' formula)."""
    along = vectors @ axis
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return vectors * cosine + np.cross(axis, vectors) * sine + (along * (1.0 - cosine[:, 0]))[:, None] * axis
