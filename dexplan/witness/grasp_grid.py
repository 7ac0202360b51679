"""A coarse grid of contacts on a body, and which of them fingers can make and carry along poses: what brute force looks through.

Of the planner nothing is used but what the hand is: chains, sampled workspaces, limits, and the probe that says what is near.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.sites import EDGE_BAND, Sites, build_sites
from dexplan.grasp.wrench import compute_wrench
from dexplan.kinematics.chain import compute_dexterity
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, lock_arrays, make_pose, rotate_about
from dexplan.witness.two_contacts import PairLimits, build_frames_into, is_closed, measure_spare

SITES = 90
"""Sites on a body: not more than that, and about as many."""
TILT = float(np.radians(25.0))
"""Poles stand along normals, and so far to either side of them, about the axes of the object's way [rad]."""
JUMP = 0.6
"""A joint that turns by more than this from one pose to the next has changed its branch [rad]."""
ORDER_GAP = float(np.radians(4.0))
"""Azimuth between neighbouring tips at least [rad]."""

Bools = NDArray[np.bool_]
Pair = tuple[int, int]


def spread_sites(body: ConvexBody, count: int = SITES) -> Sites:
    """Return at most ``count`` sites all over a body, none near an edge, as wide apart as gives about so many."""
    spacing, best = 2.0 * body.bound, build_sites(body, 2.0 * body.bound, EDGE_BAND)
    # Not even in the spacing, for candidates come from ever finer grids: looked on until there are far too many.
    while len(sites := build_sites(body, spacing, EDGE_BAND)) <= 2 * count:
        if len(best) < len(sites) <= count:
            best = sites
        spacing *= 0.94
    return best


def get_pair_limits(hand: HandModel) -> PairLimits:
    """Return friction and normal forces that plans may count on."""
    limits = hand.limits
    return PairLimits(hand.friction.scaled(limits.cone_share), limits.normal_floor, limits.normal_ceiling)


@dataclass(frozen=True, eq=False)
class Grid:
    """Contacts fixed on the body that every finger may make.

    ``sites`` (S of them) where; ``site`` (N,) the site of each contact; ``frames`` (N, 3, 3) the tip's axes in O, z its pole.
    """

    sites: Sites
    site: NDArray[np.intp]
    frames: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def __len__(self) -> int:
        return len(self.site)

    def pose_tips(self, tip_radius: float) -> Array:
        """Return the tip poses X_OF (N, 4, 4) of a finger."""
        X = np.tile(make_pose(), (len(self), 1, 1))
        X[:, :3, :3] = self.frames
        X[:, :3, 3] = (self.sites.points + tip_radius * self.sites.normals)[self.site]
        return X


def build_grid(sites: Sites, axes_O: Array | None = None) -> Grid:
    """Return contacts at ``sites`` with the poles along the normals, and tilted about the unit ``axes_O`` (A, 3) either way."""
    upright = build_frames_into(sites.normals)
    frames = [upright]
    for axis in np.zeros((0, 3)) if axes_O is None else axes_O:
        frames += [rotate_about(axis, tilt) @ upright for tilt in (TILT, -TILT)]
    site = np.tile(np.arange(len(sites)), len(frames))
    return Grid(sites, site, np.concatenate(frames))


@dataclass(frozen=True, eq=False)
class Postures:
    """How F fingers make the contacts of a grid at K poses of the object.

    ``q`` (K, F, N, J) [rad]; ``ok`` (K, F, N): within reach, away from the limits of all joints but the tip's own, and from
    singular postures; ``goes_on`` (K - 1, F, N): carried to the next pose on the same branch; ``roll`` (K, F, N) [rad]: how far
    the tip's own joint has turned since the first pose.
    """

    q: Array
    ok: Bools
    goes_on: Bools
    roll: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def solve_postures(hand: HandModel, X_WO: Array, grid: Grid) -> Postures:
    """Return how fingers make the contacts at object poses ``X_WO`` (K, 4, 4): Newton's method from the sampled workspace."""
    count, fingers = len(X_WO), len(hand.fingers)
    q = np.zeros((count, fingers, len(grid), hand.fingers[0].chain.n_joints))
    ok = np.zeros(q.shape[:3], dtype=bool)
    points = grid.sites.points
    allowed = hand.object.allows(points / np.linalg.norm(points, axis=1, keepdims=True))[grid.site]
    for f, finger in enumerate(hand.fingers):
        X_OF = grid.pose_tips(finger.tip_radius)
        if not len(hand.workspaces[f].postures):
            continue
        X_WF = (X_WO[:, None] @ X_OF).reshape(-1, 4, 4)
        found, reached = hand.workspaces[f].solve(X_WF)
        room = np.minimum(found - finger.chain.lower, finger.chain.upper - found)[:, :-1].min(axis=1)
        good = reached & (room >= hand.limits.joint_margin)
        good[good] = compute_dexterity(finger.chain, found[good]) >= hand.limits.dexterity
        q[:, f], ok[:, f] = found.reshape(q[:, f].shape), good.reshape(count, -1) & allowed
    step = np.diff(q, axis=0)
    turn = np.mod(step[..., -1] + np.pi, 2.0 * np.pi) - np.pi
    goes_on = ok[1:] & ok[:-1] & (np.abs(step[..., :-1]).max(axis=-1, initial=0.0) < JUMP)
    roll = np.concatenate([np.zeros((1, *turn.shape[1:])), np.cumsum(turn, axis=0)])
    return Postures(q, ok, goes_on, roll)


class Statics:
    """Which pairs of sites hold the object, whatever the fingers; asked attitude by attitude."""

    def __init__(self, hand: HandModel, sites: Sites) -> None:
        limits = hand.limits
        self._hand, self._limits, count = hand, get_pair_limits(hand), len(sites)
        self._i, self._j = np.triu_indices(count, 1)
        both = np.stack([self._i, self._j], axis=1)
        angle = float(np.arctan(self._limits.friction.sliding)) - limits.closure_margin
        closed = is_closed(sites.points[both], sites.normals[both], angle)
        self._i, self._j = self._i[closed], self._j[closed]
        both = both[closed]
        self._arms, self._count = sites.points[both], count
        self._frames = build_frames_into(sites.normals[both].reshape(-1, 3)).reshape(-1, 2, 3, 3)

    def find_holding(self, R_WO: Array) -> Bools:
        """Return which pairs of sites (S, S) are closed and bear the object's weight in an attitude (3, 3)."""
        wrench = compute_wrench(self._hand.object.mass_properties, R_WO)
        # In the object's own axes: frames and arms stay, the weight turns.
        wrench_O = np.concatenate([R_WO.T @ wrench[:3], R_WO.T @ wrench[3:]])
        spare = measure_spare(self._arms, self._frames, wrench_O, self._limits)
        holds = np.zeros((self._count, self._count), dtype=bool)
        good = spare >= 0.0
        holds[self._i[good], self._j[good]] = True
        return holds | holds.T


class PairTables:
    """Which pairs of contacts of two fingers hold at each pose, as far as statics, reach, room and order go: no clearance yet."""

    def __init__(self, hand: HandModel, X_WO: Array, grid: Grid, postures: Postures) -> None:
        self.hand, self.X_WO, self.grid, self._ok = hand, X_WO, grid, postures.ok
        self.pairs = tuple(combinations(range(len(hand.fingers)), 2))
        self._statics = Statics(hand, grid.sites)
        sites = grid.sites
        self.centers_O = [sites.points + f.tip_radius * sites.normals for f in hand.fingers]
        self.apart = {(f, g): self._measure_apart(f, g) for f, g in self.pairs}
        self._kept: dict[int, dict[Pair, Bools]] = {}

    def at(self, k: int) -> dict[Pair, Bools]:
        """Return per two fingers which of their contacts (N, N) hold together at pose ``k``."""
        if k not in self._kept:
            holds, site = self._statics.find_holding(self.X_WO[k, :3, :3]), self.grid.site
            found = {}
            for f, g in self.pairs:
                rows = holds & self.apart[f, g] & self._keep_order(k, f, g)
                ok = self._ok[k]
                found[f, g] = rows[np.ix_(site, site)] & ok[f][:, None] & ok[g][None]
            self._kept[k] = found
        return self._kept[k]

    def is_in_order(self, k: int, contacts: tuple[tuple[int, int], ...]) -> bool:
        """Return whether all tips, those at home too, stand around the object in the order of the fingers' bases."""
        X = self.X_WO[k]
        tips = self.hand.p_WF_home - X[:3, 3]
        for f, c in contacts:
            tips[f] = X[:3, :3] @ self.centers_O[f][self.grid.site[c]]
        return bool(self._is_one_turn(np.arctan2(tips[:, 1], tips[:, 0])))

    def _measure_apart(self, f: int, g: int) -> Bools:
        room = self.hand.limits.clearance + self.hand.fingers[f].tip_radius + self.hand.fingers[g].tip_radius
        gaps = np.linalg.norm(self.centers_O[f][:, None] - self.centers_O[g][None], axis=2)
        return np.asarray(gaps >= room)

    def _keep_order(self, k: int, f: int, g: int) -> Bools:
        X = self.X_WO[k]
        home = self.hand.p_WF_home - X[:3, 3]
        count = len(self.grid.sites)
        azimuth = np.empty((len(home), count, count))
        azimuth[:] = np.arctan2(home[:, 1], home[:, 0])[:, None, None]
        for finger, shape in ((f, (count, 1)), (g, (1, count))):
            tips = self.centers_O[finger] @ X[:3, :3].T
            azimuth[finger] = np.arctan2(tips[:, 1], tips[:, 0]).reshape(shape)
        return self._is_one_turn(azimuth)

    def _is_one_turn(self, azimuth: Array) -> Bools:
        """Return whether azimuths (F, ...) of the tips go once around in the order of the fingers' bases."""
        center = self.hand.object.X_WO_home[:2, 3]
        bases = [f.chain.offsets[0][:2, 3] - center for f in self.hand.fingers]
        order = np.argsort([np.arctan2(y, x) for x, y in bases])
        if len(order) < 3:
            return np.ones(azimuth.shape[1:], dtype=bool)
        steps = np.mod(np.roll(azimuth[order], -1, axis=0) - azimuth[order], 2.0 * np.pi)
        return np.asarray((np.abs(steps.sum(axis=0) - 2.0 * np.pi) < 1e-6) & (steps.min(axis=0) >= ORDER_GAP))
