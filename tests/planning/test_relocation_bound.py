"""The bound on missing moves against plain breadth-first search over the same places, and against ways that were found."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations, product

import numpy as np
import pytest

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.still import Stand
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.goal_side import GoalSide
from dexplan.planning.regrasp.relocation_bound import RelocationBound
from dexplan.planning.regrasp.search import AdjustmentSearch
from dexplan.plans.contacts import Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.spatial import VERTICAL, Array, direction_from_angles

GOAL = tuple(direction_from_angles(azimuth, 0.0) for azimuth in (-35.0, 120.0, 200.0))
START = tuple(direction_from_angles(azimuth, 0.0) for azimuth in (-20.0, 100.0, 245.0))
PLACES = 12


def build_layers(hand: HandModel, angle: float) -> tuple[Layers, GoalSide]:
    """Return poses of a turn about the vertical that ends at home, and the goal there."""
    X_WO = hand.object.X_WO_home
    before = ObjectMotion(X_WO, VERTICAL, -angle, np.zeros(3)).X_WO_end
    side = GoalSide(hand, Admissibility(hand), X_WO, land(hand, X_WO, GOAL))
    layers = Layers(hand, side.admissibility, Track((ObjectMotion(before, VERTICAL, angle, np.zeros(3)),)))
    layers.poses[-1] = side.still
    return layers, side


def land(hand: HandModel, X_WO: Array, normals: Iterable[Array]) -> tuple[Placement, ...]:
    """Return contacts of all fingers."""
    found = (build_landings(hand, X_WO, f, n[None])[0] for f, n in enumerate(normals))
    return tuple(placement for placement in found if placement is not None)


def begin(hand: HandModel, layers: Layers) -> tuple[tuple[Placement, ...], Stand]:
    """Return the start's contacts, given in the world, and its stand in the first pose."""
    X_WO = layers.poses[0].X_WO
    contacts = land(hand, X_WO, (n @ X_WO[:3, :3] for n in START))
    return contacts, tuple(layers.poses[0].add(c) for c in contacts)


def measure_ways(layers: Layers, root: Stand) -> dict[Stand, int]:
    """Return the moves between ``root`` and every stand of a pose, by placements and lifts one after another."""
    still, hand = layers.poses[-1], layers.hand
    radii = [f.tip_radius for f in hand.fingers]
    places = [[*still.landings(f), root[f]] for f in range(3)]

    def is_allowed(stand: Stand) -> bool:
        touching = [(f, s) for f, s in enumerate(stand) if s is not None]
        centers = {
            f: hand.object.surface.radial(n := still.spots[s].normal_O) + radii[f] * n for f, s in touching
        }
        apart = all(
            np.linalg.norm(centers[a] - centers[b]) >= radii[a] + radii[b] + hand.limits.clearance
            for a, b in combinations(centers, 2)
        )
        return len(touching) >= 2 and apart and still.has_pair(stand)

    known, wave = {root: 0}, [root]
    while wave:
        following: list[Stand] = []
        for stand, f in product(wave, range(3)):
            for place in places[f] if stand[f] is None else [None]:
                child = (*stand[:f], place, *stand[f + 1 :])
                if child not in known and is_allowed(child):
                    known[child] = known[stand] + 1
                    following.append(child)
        wave = following
    return known


def test_bound_is_the_length_of_the_shortest_way_over_the_same_places(hand: HandModel) -> None:
    layers, side = build_layers(hand, 0.0)
    still, rng = side.still, np.random.default_rng(3)
    for f in range(3):
        still._landings[f] = sorted(rng.choice(still.landings(f), PLACES, replace=False).tolist())
    root = next(stand for stand, option in side.options.items() if option is None)
    pairs = [(a, b) for a, b in combinations(range(3), 2) if still.forms_pair(root[a], root[b])]  # type: ignore[arg-type]
    bound, ways = RelocationBound(layers, {root: pairs}), measure_ways(layers, root)
    assert len(ways) > 200
    for stand, moves in ways.items():
        assert bound.count_moves(0, stand) == moves
    for a, b in combinations(range(3), 2):
        for i, j in product(still.landings(a), still.landings(b)):
            stand = tuple({a: i, b: j}.get(f) for f in range(3))
            assert np.isfinite(bound.count_moves(0, stand)) == (stand in ways)


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_no_way_that_is_found_is_shorter(hand: HandModel, angle: float) -> None:
    layers, side = build_layers(hand, angle)
    search = AdjustmentSearch(layers, side=side)
    start, stand = begin(hand, layers)
    assert search.begin(start) is None
    found = search.run(200)
    assert found.moves is not None
    made = sum(move.kind in ("place", "lift") for move in found.moves)
    assert 0 < search.bound.count_moves(0, stand) <= made


def test_where_the_last_pair_does_not_hold_there_is_no_way(hand: HandModel) -> None:
    layers, side = build_layers(hand, 0.0)
    root, pairs = next(iter(side.roots.items()))
    bound = RelocationBound(layers, {root: pairs})
    stand = next(
        s
        for s in ((i, j, None) for i in side.still.landings(0) for j in side.still.landings(1))
        if np.isfinite(bound.count_moves(0, s))
    )
    for a, b in pairs:
        bound.refuse(0, tuple(root[f] if f in (a, b) else None for f in range(3)))
    assert not np.isfinite(bound.count_moves(0, stand))
    assert bound.count_moves(0, root) == 0.0


def test_contacts_off_the_grid_are_taken_into_account_as_they_come(hand: HandModel) -> None:
    layers, side = build_layers(hand, 0.6)
    bound = RelocationBound(layers, side.roots)
    _, stand = begin(hand, layers)
    before = bound.count_moves(layers.last, next(iter(side.roots)))
    assert 0.0 < bound.count_moves(0, stand) < np.inf
    assert bound.count_moves(layers.last, next(iter(side.roots))) == before
