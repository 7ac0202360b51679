"""Can the object be held there, and come to from here?  Slow and simple answers that the planner's refusals are judged by.

Contacts stand on a grid of directions around a ball, or of sites on any other body, tips with their poles along the normals.
Nothing of the planner's search is used: postures come from the sampled workspace by Newton's method, clearance from the probe
with every finger where it is (free ones at home), forces from the margins of one state.  What is found is a way.  What is not
found may lie between the grid's places, or beyond the work allowed.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.sites import EDGE_BAND, Sites, build_sites
from dexplan.contact.bodies.smooth import BallBody
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.ways.detour import Surroundings
from dexplan.planning.ways.travel import find_way
from dexplan.spatial import Array, build_frame, make_pose

HOLDING = 1500
"""Directions tried for holding the object at one pose: about 5 deg apart."""
COMING = 300
"""Directions tried for coming from pose to pose: about 12 deg apart."""
SITES = 80
"""Sites on another body than a ball, for either: not more than that, and about as many."""
PAIRS, TRIPLES = 4000, 1500
"""Grasps of every two and every three fingers that are looked at, those that are most opposite first."""
STATES = 12_000
"""Grasps that are looked at on the way from pose to pose."""
JUMP = 0.6
"""A joint that turns by more than this from one pose to the next has changed its branch [rad]."""

Contact = tuple[int, int]
"""A finger and the number of a place."""


def spread_sites(body: ConvexBody, count: int) -> Sites:
    """Return places all over a body: so many directions around a ball, about ``SITES`` places away from edges elsewhere."""
    if isinstance(body, BallBody):
        directions = spread_directions(count)
        return Sites(body.radial(directions), directions)
    # As wide apart as leaves that many; the surface is looked at ever more finely.
    spacing = 2.0 * body.bound
    while len(build_sites(body, 0.94 * spacing, EDGE_BAND)) <= SITES:
        spacing *= 0.94
    return build_sites(body, spacing, EDGE_BAND)


@dataclass(eq=False)
class Touch:
    """How every finger touches at ``sites`` (D of them) of the object, which is at ``X_WO`` (4, 4).

    ``q`` (F, D, J) are the postures, with the last joint as the tip pose that goes along with the object asks for; ``ok`` (F, D)
    says which keep the planner's distance to the other joints' limits and to singular postures.
    """

    hand: HandModel
    X_WO: Array
    sites: Sites

    def __post_init__(self) -> None:
        hand, points, normals = self.hand, self.sites.points, self.sites.normals
        X_OC = np.stack([make_pose(build_frame(-n)) for n in normals])
        allowed = hand.object.allows(points / np.linalg.norm(points, axis=1, keepdims=True))
        self.q = np.zeros((len(hand.fingers), len(points), hand.fingers[0].chain.n_joints))
        self.ok = np.zeros(self.q.shape[:2], dtype=bool)
        for f, finger in enumerate(hand.fingers):
            X_OF = X_OC.copy()
            X_OF[:, :3, 3] = points + finger.tip_radius * normals
            if not len(hand.workspaces[f].postures):
                continue
            q, reached = hand.workspaces[f].solve(self.X_WO @ X_OF)
            room = np.minimum(q - finger.chain.lower, finger.chain.upper - q)[:, :-1].min(axis=1)
            self.q[f] = q
            self.ok[f] = (
                reached
                & (room >= hand.limits.joint_margin)
                & (compute_dexterity(finger.chain, q) >= hand.limits.dexterity)
                & allowed
            )

    def place(self, contacts: tuple[Contact, ...], is_centred: bool = True) -> Array:
        """Return the postures (F, J) with these contacts, all others at home; last joints in the middle of their range."""
        q = self.hand.q_home.copy()
        for f, d in contacts:
            q[f] = self.q[f, d]
            chain = self.hand.fingers[f].chain
            if is_centred and chain.has_tip_roll:
                q[f, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
        return q

    def measure_spare(self, a: NDArray[np.intp], b: NDArray[np.intp]) -> Array:
        """Return by how much [rad] the chords between sites ``a`` and ``b`` lie inside both cones, the planner's margin kept."""
        hand, both = self.hand, np.stack(np.broadcast_arrays(a, b), axis=-1)
        beta = np.arctan(hand.limits.cone_share * hand.friction.sliding) - hand.limits.closure_margin
        return np.asarray(beta - measure_chord_lean(self.sites.points[both], self.sites.normals[both]))

    def keeps_order(self, contacts: tuple[Contact, ...]) -> bool:
        """Return whether all tips, those at home too, stand around the object in the order of the fingers' bases."""
        tips = self.hand.p_WF_home - self.X_WO[:3, 3]
        for f, d in contacts:
            radius = self.hand.fingers[f].tip_radius
            tips[f] = self.X_WO[:3, :3] @ (self.sites.points[d] + radius * self.sites.normals[d])
        bases = [f.chain.offsets[0][:2, 3] - self.hand.object.X_WO_home[:2, 3] for f in self.hand.fingers]
        order = np.argsort([np.arctan2(y, x) for x, y in bases])
        azimuth = np.arctan2(tips[order, 1], tips[order, 0])
        steps = np.mod(np.roll(azimuth, -1) - azimuth, 2.0 * np.pi)
        return bool(abs(steps.sum() - 2.0 * np.pi) < 1e-6 and steps.min() > np.radians(4.0))

    def holds(self, judge: Admissibility, contacts: tuple[Contact, ...]) -> bool:
        """Return whether fingers hold the object with these contacts, all others at home."""
        q, fingers = self.place(contacts), tuple(f for f, _ in contacts)
        if not self.keeps_order(contacts):
            return False
        clearance, _ = self.hand.probe.compute_clearance(q, self.X_WO, fingers)
        return (
            clearance >= self.hand.limits.clearance
            and judge.compute_margins(q, self.X_WO, fingers).is_admissible
        )


def find_hold(
    hand: HandModel, X_WO: Array, judge: Admissibility, most: int = 3
) -> tuple[tuple[int, Array], ...] | None:
    """Return fingers with contact points (3,) in object axes, two or up to ``most``, that hold the object at ``X_WO`` (4, 4).

    None where none are found.
    """
    touch = Touch(hand, X_WO, spread_sites(hand.object.body, HOLDING))
    fingers = range(len(hand.fingers))
    for size in range(2, most + 1):
        for chosen in combinations(fingers, size):
            for contacts in _list_grasps(touch, chosen):
                if touch.holds(judge, contacts):
                    return tuple((f, touch.sites.points[d]) for f, d in contacts)
    return None


def _list_grasps(touch: Touch, fingers: tuple[int, ...]) -> Iterator[tuple[Contact, ...]]:
    """Yield grasps of these fingers that may be force closed, pairs the most opposite first, triples drawn at random."""
    reach = [np.flatnonzero(touch.ok[f]) for f in fingers]
    if not all(len(r) for r in reach):
        return
    if len(fingers) == 2:
        spare = touch.measure_spare(reach[0][:, None], reach[1][None])
        a, b = np.nonzero(spare > 0.0)
        for k in np.argsort(-spare[a, b], kind="stable")[:PAIRS].tolist():
            yield (fingers[0], int(reach[0][a[k]])), (fingers[1], int(reach[1][b[k]]))
        return
    rng = np.random.default_rng(0)
    for _ in range(TRIPLES):
        yield tuple((f, int(rng.choice(r))) for f, r in zip(fingers, reach, strict=True))


@dataclass(order=True)
class _Node:
    """A pair of contacts that has come to a pose; ``landed``: the poses at which the two landed."""

    priority: float
    done: int = field(compare=False)
    pair: tuple[Contact, Contact] = field(compare=False)
    landed: tuple[int, int] = field(compare=False)


class Journey:
    """Ways along poses ``X_WO`` (K, 4, 4) by gaits of two fingers at a time, from a pair or from any.

    Two things can be done: take the object on to the next pose, both contacts going along; or put a free finger down while both
    hold, and lift one of the two.

    ``start``: per finger the direction (3,) in W from the object's origin to where it touches, None for a free one;
    ``every``: fingers may be put elsewhere at each pose whose number this divides.
    """

    def __init__(
        self, hand: HandModel, X_WO: Array, start: tuple[Array | None, ...] | None, every: int = 3
    ) -> None:
        self.hand, self.judge, self.every = hand, Admissibility(hand), every
        body, self.first = hand.object.body, None
        sites = spread_sites(body, COMING)
        if start is not None:
            given = [(f, X_WO[0, :3, :3].T @ n) for f, n in enumerate(start) if n is not None]
            self.first = tuple((f, len(sites) + k) for k, (f, _) in enumerate(given))
            points = body.radial(np.stack([d for _, d in given]))
            sites = Sites(
                np.vstack([sites.points, points]), np.vstack([sites.normals, body.normal_at(points)])
            )
        self.touches = [Touch(hand, X, sites) for X in X_WO]
        self.looked_at = 0
        self._held: dict[tuple[int, tuple[Contact, ...]], bool] = {}
        self._ways: dict[tuple[int, Contact, tuple[Contact, ...]], bool] = {}
        self._detours = 0
        self._follow()

    def _follow(self) -> None:
        """Find how far the last joint goes with every contact (K, F, D) [rad], and where a finger changes its branch."""
        q = np.stack([t.q for t in self.touches])
        ok = np.stack([t.ok for t in self.touches])
        step = np.diff(q, axis=0)
        turn = np.mod(step[..., -1] + np.pi, 2.0 * np.pi) - np.pi
        self.goes_on = ok[1:] & ok[:-1] & (np.abs(step[..., :-1]).max(axis=-1) < JUMP)
        self.roll = np.concatenate([np.zeros((1, *turn.shape[1:])), np.cumsum(turn, axis=0)])
        self.room = [
            float(f.chain.upper[-1] - f.chain.lower[-1]) - 2.0 * self.hand.limits.joint_margin
            for f in self.hand.fingers
        ]

    @property
    def begins(self) -> bool:
        """Whether there is a pair that holds at the first pose."""
        return bool(self._list_first())

    def holds(self, k: int, contacts: tuple[Contact, ...]) -> bool:
        """Return whether fingers hold the object at a pose with these contacts."""
        key = (k, tuple(sorted(contacts)))
        if key not in self._held:
            self.looked_at += 1
            self._held[key] = self.touches[k].holds(self.judge, key[1])
        return self._held[key]

    def _may_go_on(self, node: _Node) -> bool:
        k = node.done
        for (f, d), landed in zip(node.pair, node.landed, strict=True):
            if not self.goes_on[k, f, d] or np.ptp(self.roll[landed : k + 2, f, d]) > self.room[f]:
                return False
        return self.holds(k + 1, node.pair)

    def _comes(self, k: int, mover: Contact, holding: tuple[Contact, ...]) -> bool:
        """Return whether a free finger gets between home and its contact while the others hold."""
        key = (k, mover, tuple(sorted(holding)))
        if key not in self._ways:
            touch, finger = self.touches[k], self.hand.fingers[mover[0]]
            q = touch.place((mover,))[mover[0]]
            X_OF = np.linalg.inv(touch.X_WO) @ finger.pose_at(q)
            normal_O = touch.sites.normals[mover[1]]
            hover = compute_hover(finger, touch.X_WO, X_OF, normal_O, q, self.hand.hover)
            arc = build_travel(finger, finger.q_home, hover, touch.X_WO[:3, 3])
            around = Surroundings(
                self.hand, touch.place(holding), touch.X_WO, mover[0], tuple(f for f, _ in holding)
            )
            inside = compute_joint_margin(finger.chain, arc).min() >= 0.0
            way = find_way(around, arc, self._detours < 20)
            self._detours += bool(way.around) or way.clearance < self.hand.limits.clearance
            self._ways[key] = bool(inside and way.clearance >= self.hand.limits.clearance)
        return self._ways[key]

    def _exchange(self, node: _Node) -> Iterator[tuple[Contact, Contact, tuple[int, int]]]:
        k, touch = node.done, self.touches[node.done]
        busy = {f for f, _ in node.pair}
        spots = np.arange(len(touch.sites))
        spare = {d: touch.measure_spare(np.array(d), spots) for _, d in node.pair}
        for f in sorted(set(range(len(self.hand.fingers))) - busy):
            for d in np.flatnonzero(self.touches[k].ok[f]).tolist():
                new = (f, int(d))
                for keep, lifted, landed in (
                    (node.pair[0], node.pair[1], node.landed[0]),
                    (node.pair[1], node.pair[0], node.landed[1]),
                ):
                    if spare[keep[1]][d] <= 0.0 or not self.holds(k, (keep, new)):
                        continue
                    if not self.holds(k, (*node.pair, new)):
                        continue
                    if self._comes(k, new, node.pair) and self._comes(k, lifted, (keep, new)):
                        yield keep, new, (landed, k)

    def run(self, states: int = STATES) -> tuple[bool, bool]:
        """Return whether a way to the last pose was found, and whether all there are were looked at."""
        heap: list[_Node] = []
        seen: set[tuple[object, ...]] = set()

        def push(node: _Node) -> None:
            key = (node.done, *sorted(zip(node.pair, node.landed, strict=True)))
            if key not in seen:
                seen.add(key)
                heapq.heappush(heap, node)

        for pair in self._list_first():
            push(_Node(0.0, 0, pair, (0, 0)))
        last = len(self.touches) - 1
        while heap and self.looked_at < states:
            node = heapq.heappop(heap)
            if node.done == last:
                return True, True
            if self._may_go_on(node):
                push(_Node(node.priority - 1.0, node.done + 1, node.pair, node.landed))
                if (node.done + 1) % self.every:
                    continue
            for keep, new, landed in self._exchange(node):
                push(_Node(node.priority + 0.5, node.done, (keep, new), landed))
        return False, not heap

    def _list_first(self) -> list[tuple[Contact, Contact]]:
        if self.first is not None:
            pair = (self.first[0], self.first[1])
            return [pair] if self.holds(0, pair) else []
        fingers = range(len(self.hand.fingers))
        found: list[tuple[Contact, Contact]] = []
        for chosen in combinations(fingers, 2):
            grasps = list(_list_grasps(self.touches[0], chosen))
            for a, b in grasps[:: max(1, len(grasps) // 60)]:
                if self.holds(0, (a, b)):
                    found.append((a, b))
        return found
