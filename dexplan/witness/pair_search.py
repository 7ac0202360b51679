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

from dexplan.grasp.wrench import compute_wrench
from dexplan.kinematics.chain import compute_joint_margin, solve_ik, wrap_near
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, invert_pose
from dexplan.witness.grasp_grid import Bools, Grid, Pair, PairTables, get_pair_limits, solve_postures
from dexplan.witness.two_contacts import PairTorques, build_frames_into, map_to_joints, measure_spare

NEVER = 10_000
"""Exchanges that are missing where no number of them does."""
LIFTS = (0.025, 0.05)
"""Where the straight way between home and above a contact is blocked, a free finger goes over places so far off it [m]."""
SAMPLES = 13
"""Postures looked at on a piece of such a way."""

Counts = NDArray[np.int16]
Contact = tuple[int, int]
"""A finger and the number of a contact on the grid."""


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
        self.hand, self.X_WO, self.grid, self.start, self.every = hand, X_WO, grid, start, every
        self.postures = solve_postures(hand, X_WO, grid)
        self.tables = PairTables(hand, X_WO, grid, self.postures)
        self.last = len(X_WO) - 1
        self.looked_at = 0
        self._held: dict[tuple[int, tuple[Contact, ...]], bool] = {}
        self._ways: dict[tuple[int, Contact, tuple[Contact, ...]], bool] = {}
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
            if self.looked_at >= most:
                return Outcome.UNFINISHED
            node = heapq.heappop(heap)
            landings = seen.setdefault((node.pose, node.pair), [])
            # Whoever landed later can be carried wherever one that landed before can.
            if any(a >= node.landed[0] and b >= node.landed[1] for a, b in landings):
                continue
            if not self.holds(node.pose, node.pair) or (node.via and not self._may_exchange(node)):
                continue
            landings.append(node.landed)
            if node.pose == self.last:
                return Outcome.FOUND
            for child in self._list_children(node):
                self._push(heap, child)
        return Outcome.BLOCKED

    def holds(self, k: int, contacts: tuple[Contact, ...]) -> bool:
        """Return whether fingers can be at these contacts at pose ``k``, all others at home.

        Two have to hold the object, with joint torques looked at.  Three are only asked for room: any mean of the forces of two
        of their pairs is inside all cones and bears the weight.
        """
        key = (k, tuple(sorted(contacts)))
        if key not in self._held:
            self.looked_at += 1
            self._held[key] = (
                self.tables.is_in_order(k, contacts)
                and self._is_clear(k, contacts)
                and (len(contacts) > 2 or self.measure_pair(k, contacts) >= 0.0)
            )
        return self._held[key]

    def measure_pair(self, k: int, contacts: tuple[Contact, ...]) -> float:
        """Return the force [N] that two contacts have to spare, torques of the joints included."""
        hand, X = self.hand, self.X_WO[k]
        sites, site, q = self.grid.sites, self.grid.site, self._place(k, contacts)
        rows = [site[c] for _, c in contacts]
        arms = sites.points[rows] @ X[:3, :3].T
        frames = build_frames_into(sites.normals[rows] @ X[:3, :3].T)
        maps = [
            map_to_joints(hand.fingers[f], q[f], hand.fingers[f].pose_at(q[f]), X[:3, 3] + arm, frame)
            for (f, _), arm, frame in zip(contacts, arms, frames, strict=True)
        ]
        fingers = [f for f, _ in contacts]
        bias = hand.probe.compute_gravity_torque(q)[fingers]
        most = hand.limits.torque_share * np.stack([hand.fingers[f].torque_limit for f in fingers])
        torques = PairTorques(np.stack(maps)[None], bias[None], most)
        wrench = compute_wrench(hand.object.mass_properties, X[:3, :3])
        return float(measure_spare(arms[None], frames[None], wrench, get_pair_limits(hand), torques)[0])

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
            self.holds(k, (*before, new))
            and self._comes(k, new, before)
            and self._comes(k, lifted, node.pair)
        )

    def _place(self, k: int, contacts: tuple[Contact, ...]) -> Array:
        """Return the postures (F, J) with these contacts, all others at home; the tips' own joints amid their ranges."""
        q = self.hand.q_home.copy()
        for f, c in contacts:
            q[f] = self.postures.q[k, f, c]
            chain = self.hand.fingers[f].chain
            if chain.has_tip_roll:
                q[f, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
        return q

    def _is_clear(self, k: int, contacts: tuple[Contact, ...]) -> bool:
        fingers = tuple(f for f, _ in contacts)
        nearest = self.hand.probe.find_nearest(self._place(k, contacts), self.X_WO[k], fingers)
        return bool(nearest.distance >= self.hand.limits.clearance)

    def _comes(self, k: int, mover: Contact, holding: tuple[Contact, ...]) -> bool:
        """Return whether a free finger gets between home and its contact while the others hold.

        The joints go evenly from home to where the tip hovers over its contact, or over a place farther off it.
        """
        key = (k, mover, tuple(sorted(holding)))
        if key not in self._ways:
            self.looked_at += 1
            f, c = mover
            finger, q = self.hand.fingers[f], self._place(k, holding)
            at = self._place(k, (mover,))[f]
            normal = self.X_WO[k, :3, :3] @ self.grid.sites.normals[self.grid.site[c]]
            touching = tuple(g for g, _ in holding)
            share = np.linspace(0.0, 1.0, SAMPLES)[:, None]

            def is_open(start: Array, end: Array) -> bool:
                way = start + share * (end - start)
                if compute_joint_margin(finger.chain, way).min() < 0.0:
                    return False
                for posture in way:
                    q[f] = posture
                    nearest = self.hand.probe.find_nearest(q, self.X_WO[k], touching)
                    if nearest.distance < self.hand.limits.clearance:
                        return False
                return True

            hover = self._lift(f, at, normal, self.hand.hover)
            self._ways[key] = hover is not None and (
                is_open(finger.q_home, hover)
                or any(
                    is_open(via, hover) and is_open(finger.q_home, via)
                    for gap in LIFTS
                    if (via := self._lift(f, at, normal, gap)) is not None
                )
            )
        return self._ways[key]

    def _lift(self, finger: int, q: Array, normal: Array, gap: float) -> Array | None:
        """Return the posture (J,) with the tip ``gap`` [m] off along ``normal`` (3,) in W; None out of reach."""
        chain = self.hand.fingers[finger].chain
        X = self.hand.fingers[finger].pose_at(q)[None].copy()
        X[:, :3, 3] += gap * normal
        solved, reached = solve_ik(chain, X, q[None])
        return wrap_near(solved[0], q) if reached[0] else None

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
