"""What `inspect` asks about a hand around any body: on which sites each finger can land, and which pairs of them hold.

On a ball regions have closed forms (``reach``); elsewhere they are sets of sites, with the object at home.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.sites import Sites
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.contacts.landings import build_landings, list_sites
from dexplan.spatial import Array, lock_arrays
from dexplan.viz.reach import judge_placements

Flags = NDArray[np.bool_]

ASIDE = 20.0
"""Views are turned by so much, so that a box does not show one face alone [deg]."""
PLACEMENTS = 120
"""At most so many placements per pair are asked about, spread over how far their lines lean."""
BEYOND = np.radians(4.0)
"""Pairs whose line leans so much too far are still asked about, to show where force closure gives out [rad]."""


@dataclass(frozen=True, eq=False)
class SitePair:
    """Two fingers holding the object at home: ``holds`` (2, S), on which sites the first, and the second, holds with the other.

    The rows of ``lean`` (N,) [rad], ``load``, ``torque`` and ``is_admissible`` are placements, the others at home: how far the
    line between the contacts leans off their normals, share of the believed cone left, largest share of a torque limit (NaN where
    nothing carries the load).  ``count`` pairs of sites are force closed; ``refusals`` counts by reason what is not admissible.
    """

    fingers: tuple[int, int]
    holds: Flags
    count: int
    lean: Array
    load: Array
    torque: Array
    is_admissible: Flags
    refusals: dict[str, int]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class SiteReach:
    """All that the picture and the text of a hand around a body are made from.

    ``face`` (S,) is the plane part that each site is on, -1 for none; ``lands`` (F, S) which fingers can land there;
    ``lean_max`` [rad] how far the line between two contacts may lean off their normals, ``lean_kept`` with the planner's margin.
    """

    sites: Sites
    face: NDArray[np.intp]
    lands: Flags
    lean_max: float
    lean_kept: float
    pairs: tuple[SitePair, ...]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def holds(self, finger: int, partners: tuple[int, ...]) -> Flags:
        """Return on which sites (S,) a finger can land and hold with each of ``partners`` alone."""
        found = np.array(self.lands[finger])
        for pair in self.pairs:
            for own, other in (pair.fingers, pair.fingers[::-1]):
                if own == finger and other in partners:
                    found &= pair.holds[pair.fingers.index(finger)]
        return found


@lru_cache(maxsize=1)
def compute_site_reach(hand: HandModel) -> SiteReach:
    """Return landings and pairs of ``hand`` with the object at home; the last hand's are kept."""
    body, limits = hand.object.body, hand.limits
    sites, home = list_sites(hand), hand.object.X_WO_home
    landings = [find_landings(hand, finger, sites, home) for finger in range(len(hand.fingers))]
    lean_max = compute_pair_angle_max(hand.friction)
    kept = compute_pair_angle_max(hand.friction.scaled(limits.cone_share)) - limits.closure_margin
    judge = Admissibility(hand)
    return SiteReach(
        sites=sites,
        face=find_faces(body, sites.points),
        lands=np.stack([found for found, _ in landings]),
        lean_max=lean_max,
        lean_kept=kept,
        pairs=tuple(
            _compute_pair(hand, judge, sites, pair, landings, kept)
            for pair in combinations(range(len(hand.fingers)), 2)
        ),
    )


def find_faces(body: ConvexBody, points: Array) -> NDArray[np.intp]:
    """Return which plane part (S,) points (S, 3) of the surface are on; -1 for none."""
    face = np.full(len(points), -1)
    for k, flat in enumerate(body.flats):
        away = points - flat.center
        on = np.abs(away @ flat.normal) < 1e-6 * body.bound
        face[on & (np.linalg.norm(away, axis=1) <= flat.radius * (1.0 + 1e-9))] = k
    return face


def find_landings(hand: HandModel, finger: int, sites: Sites, X_WO: Array) -> tuple[Flags, Array]:
    """Return on which sites (S,) a finger can land with its tip's pole along the normal, and its postures there (S, J).

    ``X_WO`` (4, 4) is the pose of the object; no contact is made where none is allowed.
    """
    found = build_landings(hand, X_WO, finger, sites.normals, sites.points)
    lands = np.array([placement is not None for placement in found], dtype=bool)
    q = np.zeros((len(sites), hand.fingers[finger].chain.n_joints))
    for row, placement in enumerate(found):
        if placement is not None:
            q[row] = placement.q
    return lands & hand.object.allows(sites.normals), q


def _compute_pair(
    hand: HandModel,
    judge: Admissibility,
    sites: Sites,
    pair: tuple[int, int],
    landings: list[tuple[Flags, Array]],
    kept: float,
) -> SitePair:
    (lands_i, q_i), (lands_j, q_j) = (landings[f] for f in pair)
    own, others = np.flatnonzero(lands_i), np.flatnonzero(lands_j)
    lean = np.full((len(sites), len(sites)), np.inf)
    both = np.stack(np.meshgrid(own, others, indexing="ij"), axis=-1)
    lean[np.ix_(own, others)] = measure_chord_lean(sites.points[both], sites.normals[both])
    is_held = lean < kept
    rows = np.argwhere(lean < kept + BEYOND)
    rows = rows[np.argsort(lean[tuple(rows.T)], kind="stable")]
    if len(rows) > PLACEMENTS:
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, PLACEMENTS).round().astype(int))]
    judged = judge_placements(hand, judge, pair, np.stack([q_i[rows[:, 0]], q_j[rows[:, 1]]], axis=1))
    return SitePair(
        fingers=pair,
        holds=np.stack([is_held.any(axis=1), is_held.any(axis=0)]),
        count=int(is_held.sum()),
        lean=lean[tuple(rows.T)],
        load=judged.load,
        torque=judged.torque,
        is_admissible=judged.is_admissible,
        refusals=judged.refusals,
    )
