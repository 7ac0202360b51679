"""Is there a gait of two fingers at a time along given poses?  A slow and plain answer, that the planner's is held against.

Two things can be done: carry the object on to the next pose with both contacts, or put the third finger down while two hold and
lift one of the two.  Which pairs there are, and how many exchanges are missing from each, is found backwards from the last pose
by tables of pairs (:mod:`.grasp_grid`) that know nothing of clearance; forwards every grasp and every free finger's way is then
really looked at, nearest to the end first, until there is nothing left.

What is found is a gait.  What is not found may still lie between the places of the grid, or beyond the work allowed.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, invert_pose
from dexplan.witness.grasp_grid import Bools, Grid, Pair
from dexplan.witness.pair_judge import Contact, PairJudge

NEVER = 10_000
"""Exchanges that are missing where no number of them does."""
Counts = NDArray[np.int16]


class Outcome(StrEnum):
    """What a search came to."""

    FOUND = "a gait"
    NOTHING_AT_END = "no two contacts hold at the last pose"
    NO_CHAIN = "no chain of pairs leads from the start to the last pose, whatever is in the way"
    BLOCKED = "every chain of pairs is blocked"
    UNFINISHED = "not all was looked at"


@dataclass(order=True)
class _Node:
    """A pair at a pose; ``landed``: the poses at which the two landed; ``via``: the contact that was lifted, and the new one."""

    priority: tuple[int, int]
    pose: int = field(compare=False)
    pair: tuple[Contact, Contact] = field(compare=False)
    landed: tuple[int, int] = field(compare=False)
    exchanges: int = field(compare=False, default=0)
    via: tuple[Contact, Contact] | None = field(compare=False, default=None)


class PairSearch:
    """Searches gaits along poses ``X_WO`` (K, 4, 4) over the contacts of ``grid``.

    ``start``: the two contacts at the first pose; ``every``: fingers are exchanged at each pose whose number this divides.
    """

    def __init__(
        self, hand: HandModel, X_WO: Array, grid: Grid, start: tuple[Contact, Contact], every: int = 2
    ) -> None:
        self.start, self.every, self.last = start, every, len(X_WO) - 1
        self.hand, self.grid, self.judge = hand, grid, PairJudge(hand, X_WO, grid)
        self.postures, self.tables = self.judge.postures, self.judge.tables
        self._room = [
            float(f.chain.upper[-1] - f.chain.lower[-1]) - 2.0 * hand.limits.joint_margin
            for f in hand.fingers
        ]
        self._missing = self._count_exchanges()

    def run(self, most: int) -> Outcome:
        """Return what was found with ``most`` grasps and ways looked at."""
        if not any((rows < NEVER).any() for rows in self._missing[-1].values()):
            return Outcome.NOTHING_AT_END
        heap: list[_Node] = []
        first = _Node((0, 0), 0, self.start, (0, 0))
        self._push(heap, first)
        if not heap:
            return Outcome.NO_CHAIN
        seen: dict[tuple[int, tuple[Contact, Contact]], list[tuple[int, int]]] = {}
        while heap:
            if self.judge.looked_at >= most:
                return Outcome.UNFINISHED
            node = heapq.heappop(heap)
            landings = seen.setdefault((node.pose, node.pair), [])
            # Whoever landed later can be carried wherever one that landed before can.
            if any(a >= node.landed[0] and b >= node.landed[1] for a, b in landings):
                continue
            if not self.judge.holds(node.pose, node.pair) or (node.via and not self._may_exchange(node)):
                continue
            landings.append(node.landed)
            if node.pose == self.last:
                return Outcome.FOUND
            for child in self._list_children(node):
                self._push(heap, child)
        return Outcome.BLOCKED

    def _push(self, heap: list[_Node], node: _Node) -> None:
        (f, a), (g, b) = node.pair
        missing = int(self._missing[node.pose][f, g][a, b])
        if missing < NEVER:
            node.priority = (node.exchanges + missing, -node.pose)
            heapq.heappush(heap, node)

    def _list_children(self, node: _Node) -> Iterator[_Node]:
        k, ((f, a), (g, b)) = node.pose, node.pair
        if self._goes_on(node):
            yield _Node((0, 0), k + 1, node.pair, node.landed, node.exchanges)
        if k % self.every:
            return
        for h in set(range(len(self.hand.fingers))) - {f, g}:
            for keep, lifted, landed in (
                ((f, a), (g, b), node.landed[0]),
                ((g, b), (f, a), node.landed[1]),
            ):
                i, j = sorted((keep[0], h))
                rows = self._missing[k][i, j]
                can = (rows[keep[1]] if i == keep[0] else rows[:, keep[1]]) < NEVER
                can &= self._get_apart(h, lifted[0])[:, self.grid.site[lifted[1]]]
                for c in np.flatnonzero(can).tolist():
                    both = sorted(((keep, landed), ((h, c), k)))
                    pair, times = (both[0][0], both[1][0]), (both[0][1], both[1][1])
                    yield _Node((0, 0), k, pair, times, node.exchanges + 1, (lifted, (h, c)))

    def _get_apart(self, f: int, g: int) -> Bools:
        """Return which contacts of ``f`` (N) have room beside which sites of ``g`` (S)."""
        rows = self.tables.apart[f, g] if f < g else self.tables.apart[g, f].T
        return rows[self.grid.site]

    def _goes_on(self, node: _Node) -> bool:
        k, postures = node.pose, self.postures
        return all(
            postures.goes_on[k, f, c] and np.ptp(postures.roll[landed : k + 2, f, c]) <= self._room[f]
            for (f, c), landed in zip(node.pair, node.landed, strict=True)
        )

    def _may_exchange(self, node: _Node) -> bool:
        """Return whether the new finger gets to its contact while the old two hold, and the lifted one home again."""
        assert node.via is not None
        lifted, new = node.via
        keep = node.pair[0] if node.pair[1] == new else node.pair[1]
        k, before = node.pose, tuple(sorted((keep, lifted)))
        return (
            self.judge.holds(k, (*before, new))
            and self.judge.comes(k, new, before)
            and self.judge.comes(k, lifted, node.pair)
        )

    def _count_exchanges(self) -> list[dict[Pair, Counts]]:
        """Return per pose and two fingers how many exchanges (N, N) are missing to the last pose at least."""
        pairs, missing = self.tables.pairs, list[dict[Pair, Counts]]()
        for k in range(self.last, -1, -1):
            holds = self.tables.at(k)
            if k == self.last:
                found = {p: np.where(holds[p], 0, NEVER).astype(np.int16) for p in pairs}
            else:
                goes, later = self.postures.goes_on[k], missing[-1]
                found = {
                    (f, g): np.where(
                        holds[f, g] & goes[f][:, None] & goes[g][None], later[f, g], NEVER
                    ).astype(np.int16)
                    for f, g in pairs
                }
                if k % self.every == 0:
                    self._spread(found, holds)
            missing.append(found)
        return missing[::-1]

    def _spread(self, found: dict[Pair, Counts], holds: dict[Pair, Bools]) -> None:
        """Lower the numbers of one pose by what an exchange there leads to."""
        step = 0
        while any(((rows >= step) & (rows < NEVER)).any() for rows in found.values()):
            for (i, j), rows in tuple(found.items()):
                here = rows == step
                if not here.any():
                    continue
                for keep, h, table in ((i, j, here), (j, i, here.T)):
                    for lifted in set(range(len(self.hand.fingers))) - {keep, h}:
                        # keep and lifted become keep and h wherever a contact of h stands apart from the lifted one.
                        sites = self._get_apart(h, lifted)
                        can = (table.astype(np.float32) @ sites.astype(np.float32) > 0.5)[:, self.grid.site]
                        pair, can = ((keep, lifted), can) if keep < lifted else ((lifted, keep), can.T)
                        there = found[pair]
                        there[can & holds[pair] & (there > step + 1)] = step + 1
            step += 1


def find_axes(X_WO: Array) -> Array:
    """Return the axes (A, 3), in the object's axes, about which it turns on its way ``X_WO`` (K, 4, 4): one for every leg."""
    axes: list[Array] = []
    for before, after in pairwise(X_WO):
        R = (invert_pose(before) @ after)[:3, :3]
        v = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        if (size := float(np.linalg.norm(v))) < 1e-9:
            continue
        if not any(abs(axis @ v) > (1.0 - 1e-6) * size for axis in axes):
            axes.append(v / size)
    return np.array(axes).reshape(-1, 3)
