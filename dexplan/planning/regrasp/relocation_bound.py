"""How many placements bring a stand to the goal grasp at least?  An easier question whose answer tells a search where to go.

Left out are loads, links and ways: a finger can be where its tip reaches, two fingers hold where their contacts are force
closed with a margin, tips keep their distance, and one finger at a time is placed where it holds with one of the other two.
What is left is a graph of pairs of contacts on the object, the same for every pose but for what is within reach, and all
distances in it are products of a few matrices.  No stand can do with less; from where the answer is "never" there is no way
along these places at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from dexplan.planning.contacts.landings import build_landings, find_reach, list_sites
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.still import Stand
from dexplan.planning.regrasp.pairs import Bools, Pair, PlacePairs
from dexplan.spatial import Array

NEVER = np.inf


class RelocationBound:
    """Lower bounds on the way through ``layers`` into one of the stands ``roots`` in the last of them.

    ``roots``: per stand of three contacts the pairs of fingers whose third can go to its contact last; a stand of two is its own.
    None: any two contacts that hold are an end.  ``places`` has the places that are known, ``within`` per pose and finger those
    within reach by number.
    ``is_early``: contacts of the roots may be taken in earlier poses, too, and carried on.  ``movers``: the pair of fingers that
    alone takes the object on; None: any does.
    """

    def __init__(
        self,
        layers: Layers,
        roots: Mapping[Stand, list[Pair]] | None,
        is_early: bool = False,
        movers: Pair | None = None,
    ) -> None:
        self.layers, self._roots, self._is_early, self._movers = layers, roots, is_early, movers
        self._count = len(layers.hand.fingers)
        self.pairs = list(combinations(range(self._count), 2))
        self.places = PlacePairs(layers.hand, layers.poses[-1].lean_max)
        self.within: list[list[set[int]]] = [[set() for _ in range(self._count)] for _ in layers.poses]
        self._dead: set[tuple[int, Pair, int, int]] = set()
        self._distances: list[dict[Pair, Array]] = [{} for _ in layers.poses]
        self._stale = layers.last
        if layers.looks_ahead:
            self._note_reach()
        else:
            self._note_landings()
        self._ends = [self.number_stand(layers.last, stand) for stand in roots or ()]
        for end in self._ends:
            for finger, number in end.items():
                for within in self.within[0 if is_early else layers.last :]:
                    within[finger].add(number)

    def _note_reach(self) -> None:
        """Note the places that fingers reach in each pose: with whichever spin, which costs less than to find the best."""
        sites = list_sites(self.layers.hand)
        numbers = self.places.number_all(sites.points, sites.normals)
        for finger in range(self._count):
            poses = [still.X_WO for still in self.layers.poses]
            table = find_reach(self.layers.hand, poses, finger, self.layers.facing)
            for within, reached in zip(self.within, table, strict=True):
                within[finger].update(numbers[reached].tolist())

    def _note_landings(self) -> None:
        """Note the landings of each pose: what can be put down in one is still within reach in the next."""
        layers = self.layers
        for layer, still in enumerate(layers.poses):
            for finger in range(self._count):
                found = {self._number(layer, spot) for spot in still.landings(finger)}
                for pose in {layer, min(layer + 1, layers.last)}:
                    self.within[pose][finger] |= found

    def refuse(self, layer: int, stand: Stand) -> None:
        """Take into account that two contacts turned out not to hold by themselves."""
        numbers = self.number_stand(layer, stand)
        if len(numbers) == 2:
            (a, i), (b, j) = numbers.items()
            self._dead.add((layer, (a, b), i, j))
            if not self.layers.looks_ahead:
                # On long ways measuring again takes longer than looking at a few pairs like it.
                self._stale = max(self._stale, layer)

    def count_moves(self, layer: int, stand: Stand) -> float:
        """Return how many placements and lifts are missing at least; inf where there is no way."""
        self._note(layer, stand)
        numbers = self.number_stand(layer, stand)
        if (self._is_early or layer == self.layers.last) and numbers in self._ends:
            return 0.0
        if self._roots is None and layer == self.layers.last:
            return 0.0
        self._solve()
        found = self._distances[layer]
        placements = min(
            (float(found[a, b][numbers[a], numbers[b]]) for a, b in combinations(numbers, 2)), default=NEVER
        )
        # Every placement is followed by a lift, but the last one into a grasp of three; a stand of three begins with a lift.
        last = 1.0 if any(len(end) > 2 for end in self._ends) else 0.0
        return 2.0 * placements - last + (len(numbers) > 2)

    def count_pairs(self) -> int:
        """Return from how many pairs of places in the last pose there may be a way."""
        self._solve()
        return sum(int(np.isfinite(rows).sum()) for rows in self._distances[-1].values())

    def has_way(self, layer: int) -> bool:
        """Return whether there may be a way to the end from any pair of places in the pose ``layer``."""
        self._solve()
        return any(bool(np.isfinite(rows).any()) for rows in self._distances[layer].values())

    def _note(self, layer: int, stand: Stand) -> None:
        """Take contacts into account that are on no grid, there and in all later poses."""
        for finger, number in self.number_stand(layer, stand).items():
            if number not in self.within[layer][finger]:
                self._stale = self.layers.last
                for pose in range(layer, self.layers.last + 1):
                    if pose == layer or self._may_reach(pose, finger, number):
                        self.within[pose][finger].add(number)

    def _may_reach(self, pose: int, finger: int, number: int) -> bool:
        """Return whether a contact that is on no grid may be within reach at a later pose.

        On the way to a given grip, which is short, it may; on the way to any grip this decides how far one goes, and is asked.
        """
        if self._roots is not None:
            return True
        X_WO = self.layers.poses[pose].X_WO
        rows = self.places.normals[number][None], self.places.points[number][None]
        return build_landings(self.layers.hand, X_WO, finger, *rows)[0] is not None

    def number_stand(self, layer: int, stand: Stand) -> dict[int, int]:
        """Return per finger that touches the number of its contact's place."""
        return {f: self._number(layer, s) for f, s in enumerate(stand) if s is not None}

    def _number(self, layer: int, spot: int) -> int:
        contact = self.layers.poses[layer].spots[spot]
        known = len(self.places)
        number = self.places.number(contact.point_O, contact.normal_O)
        if len(self.places) > known:
            self._stale = self.layers.last
        return number

    def _solve(self) -> None:
        """Measure the distances that are out of date, in the last pose first."""
        if self._stale < 0:
            return
        layers = self.layers
        is_apart, holds = self.places.find_apart(), self.places.find_closed()
        if self._stale < layers.last:
            later = self._distances[self._stale + 1]
        else:
            # Any two that hold are an end, or none but the roots.
            later = {
                pair: np.where(rows & holds & (self._roots is None), 0.0, NEVER)
                for pair, rows in is_apart.items()
            }
            for end, pairs in zip(self._ends, (self._roots or {}).values(), strict=True):
                for a, b in pairs:
                    later[a, b][end[a], end[b]] = len(end) - 2.0
        for layer in range(self._stale, -1, -1):
            beside, bear = is_apart, holds
            if layers.looks_ahead:
                R_WO = layers.poses[layer].X_WO[:3, :3]
                beside, bear = self.places.keep_order(R_WO), self.places.find_bearing(R_WO)
            hold = {pair: is_apart[pair] & bear for pair in self.pairs}
            later = self._distances[layer] = self._spread(layer, later, beside, hold)
        self._stale = -1

    def _spread(
        self, layer: int, later: dict[Pair, Array], is_apart: dict[Pair, Bools], holds: dict[Pair, Bools]
    ) -> dict[Pair, Array]:
        """Return the distances in a pose, where ``later`` has those of the next, or of the goal itself."""
        within = [np.array(sorted(rows), dtype=np.intp) for rows in self.within[layer]]
        grid = {(a, b): np.ix_(within[a], within[b]) for a, b in self.pairs}
        apart = {pair: is_apart[pair][grid[pair]] for pair in self.pairs}
        alone = {pair: holds[pair].copy() for pair in self.pairs}
        for pose, pair, i, j in self._dead:
            if pose == layer:
                alone[pair][i, j] = False
        free = {pair: alone[pair][grid[pair]] for pair in self.pairs}
        # A pair that does not hold alone may be carried on with the third finger.
        goes_on = alone if layer == self.layers.last else holds
        before = {pair: np.where(goes_on[pair], later[pair], NEVER) for pair in self.pairs}
        if self._movers is not None and layer < self.layers.last:
            before |= {
                pair: np.full_like(rows, NEVER) for pair, rows in before.items() if pair != self._movers
            }
        if self._is_early and layer < self.layers.last:
            for end in self._ends:
                for a, b in combinations(end, 2):
                    before[a, b][end[a], end[b]] = min(before[a, b][end[a], end[b]], len(end) - 2.0)
        found = {pair: before[pair][grid[pair]] for pair in self.pairs}
        step = 0.0
        while any(np.any(np.isfinite(rows) & (rows >= step)) for rows in found.values()):
            for a, b in self.pairs:
                here = found[a, b] == step
                if not here.any():
                    continue
                for c in (f for f in range(self._count) if f not in (a, b)):
                    # The third tip has room beside both; then one of the two can go.
                    for stays, goes, rows in ((a, b, here), (b, a, here.T)):
                        new = _any_between(rows, _between(apart, goes, c)) & _between(apart, stays, c)
                        pair, new = ((stays, c), new) if stays < c else ((c, stays), new.T)
                        there = found[pair]
                        there[new & free[pair] & (there > step + 1.0)] = step + 1.0
            step += 1.0
        whole = {pair: np.full(holds[pair].shape, NEVER) for pair in self.pairs}
        for pair in self.pairs:
            whole[pair][grid[pair]] = found[pair]
        return whole


def _any_between(one: Bools, two: Bools) -> Bools:
    """Return the product of two tables of bools; in floats, for which there are fast products, and whose counts are exact."""
    return np.asarray(one.astype(np.float32) @ two.astype(np.float32) > 0.5)


def _between(table: dict[Pair, Bools], a: int, b: int) -> Bools:
    return table[a, b] if a < b else table[b, a].T
