"""Bodies that tremble on pyramidal cones: contacts reach their borders in turn, and yet the body only creeps.

Friction drags a corner out of its contact, the corner falls back, and for some milliseconds every contact is at its border,
each against the other.  Over a longer time the forces show what holds: friction could carry more than their sum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_matrix

from dexplan.spatial import Array
from dexplan.testing.episodes import Episode
from dexplan.testing.measurement import Measurement
from dexplan.testing.parties import Indices
from dexplan.testing.rows import AT_BORDER, ContactRows

STEADY = 0.95
"""Mean share of the normal force that contacts inside their cones carry, below which a body trembles: in the many that were
tried it is above 0.99 without trembling and below 0.8 with it."""
MOST_INSTANTS = 100
"""Instants of one window that are looked at, evenly spread."""
FRICTIONS = 3
"""Directions of friction that are counted: along t1 and t2, and about n."""


def is_trembling(measured: Measurement, episode: Episode, counts: NDArray[np.bool_]) -> bool:
    """Return whether the pair trembles in those rows of the episode that count."""
    held = episode.pairs.held[episode.rows][counts]
    return measured.physics.cone == "pyramidal" and bool(held.mean() < STEADY)


def find_border(measured: Measurement, episode: Episode, window: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return in which rows (K,) of an episode the pair is at the border of its cone.

    Several pyramids are only where they also are on average over the row's ``window`` (K,); of others each moment shows all
    there is.
    """
    pairs, rows, contacts = episode.pairs, episode.rows, measured.contacts
    out = pairs.utilisation[rows] >= AT_BORDER
    if measured.physics.cone != "pyramidal" or pairs.count[rows].max() < 2:
        return out
    own = np.flatnonzero(
        (contacts.on == episode.on) & (contacts.by == episode.by) & (contacts.force[:, 2] > 0.0)
    )
    samples = pairs.sample[rows]
    for number in np.unique(window[out]):
        here = np.flatnonzero(window == number)
        looked_at = samples[here][:: 1 + len(here) // (MOST_INSTANTS + 1)]
        inside = own[np.isin(contacts.sample[own], looked_at)]
        where = rows[np.searchsorted(samples, contacts.sample[inside])]
        arm = contacts.point_W[inside] - pairs.point_W[where]
        if _find_reserve(contacts, inside, arm) > 1.0 / AT_BORDER:
            out[here] = False
    return out


def _find_reserve(contacts: ContactRows, which: Indices, arm: Array) -> float:
    """Return how many times the friction that contacts gave together they could have given, 10 at most.

    Theorem of limit analysis: that is the largest x for which forces within the cones, at the normal forces that were there,
    add up to x times the sum of those that were, as forces along the surface and as moment about its normal.
    """
    K = len(which)
    R_WC = contacts.rotation_W[which]
    normal = R_WC[:, :, 2].mean(axis=0)
    normal /= np.linalg.norm(normal)
    along = R_WC[0, :, 0] - normal * (R_WC[0, :, 0] @ normal)
    axes = np.stack([along, np.cross(normal, along)])
    # What a unit of friction in each direction adds (3, K, 3): two forces and one moment.
    units = np.zeros((3, K, FRICTIONS))
    units[:2, :, :2] = np.einsum("ai,nij->anj", axes, R_WC[:, :, :2])
    units[2, :, :2] = np.einsum(
        "i,nij->nj", normal, np.cross(arm[:, None], R_WC[:, :, :2].transpose(0, 2, 1)).transpose(0, 2, 1)
    )
    units[2, :, 2] = R_WC[:, :, 2] @ normal
    has = np.arange(1, 1 + FRICTIONS) < contacts.dim[which, None]
    units *= np.where(has, contacts.friction[which, :FRICTIONS], 0.0)
    given = np.column_stack([contacts.force[which, :2], contacts.moment[which, 2]])
    mu = np.where(
        has & (contacts.friction[which, :FRICTIONS] > 0.0), contacts.friction[which, :FRICTIONS], np.inf
    )
    total = np.einsum("akj,kj->a", units, given / mu)
    length = max(float(np.abs(arm).max()), 1e-9)
    units[2], total[2] = units[2] / length, total[2] / length
    flat = units.reshape(3, -1)
    # Each direction both ways, and the share x of what was given.
    equal = np.hstack([flat, -flat, -total[:, None]])
    owner = np.tile(np.repeat(np.arange(K), FRICTIONS), 2)
    below = csr_matrix((np.ones(len(owner)), (owner, np.arange(len(owner)))), shape=(K, equal.shape[1]))
    cost = np.zeros(equal.shape[1])
    cost[-1] = -1.0
    found = linprog(
        cost,
        A_ub=below,
        b_ub=contacts.force[which, 2],
        A_eq=equal,
        b_eq=np.zeros(3),
        bounds=[(0.0, None)] * len(owner) + [(0.0, 10.0)],
        method="highs",
    )
    return float(found.x[-1]) if found.status == 0 else 1.0
