"""A way around what is in the way: a free finger's motion planned in the free space of its joints [paper §2].

OMPL's RRT-Connect [Kuffner & LaValle 2000] plans it: two trees of clear postures, one from
each end of the way, grow towards each other.  What they find is shortened, rounded off, and looked at once more, finely.
Everything is seeded and counted, nothing is timed: the same question has the same answer on every run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dexplan.kinematics.arcs import interpolate
from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin, compute_tip_pose
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.order import keeps_order
from dexplan.scene.description import Nearness
from dexplan.spatial import Array, lock_arrays

SEED = 1
CHECKS = 1200
"""Postures that may be looked at before two ends count as not connected; finding a way mostly takes fewer than 300."""
SHORTCUTS = 40
"""Shortcuts that are tried on a way that was found."""
ROOM = 1.0
"""A detour may leave the range between its ends by this much in every joint [rad]."""
RANGE = 0.5
"""Longest branch of a tree [rad]."""
STEP = 0.05
"""Postures on a branch are looked at this far apart [rad]."""
FINE = 0.02
"""Postures of the finished way are looked at this far apart [rad]."""
SLACK = 0.0005
"""So much more clearance [m] is asked for while trees grow, for what lies between the postures that are looked at."""
SAMPLES = 33
"""Postures along a detour."""
BOWS, BENDS = (0.25, 0.5, 0.75), 2
"""How far an arc is bowed in one joint [rad], and in how many joints it is tried."""
KNOTS = (5, 7, 10, 16, SAMPLES)
"""A way is drawn smoothly through so few of its postures if it stays clear: the fewer, the gentler its bends."""
ROUNDS = 3
"""How often the corners of a way are rounded off."""
NOBODY = Nearness(np.inf, "")
"""Nothing was looked at, or nothing was in the way."""


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a free finger moves among: all fingers' postures ``q`` (F, J) [rad] and the object's pose ``X_WO`` (4, 4).

    ``touching`` are the fingers whose tips touch the object; ``finger`` is the one that moves, its own row of ``q`` does not
    matter.
    """

    hand: HandModel
    q: Array
    X_WO: Array
    finger: int
    touching: tuple[int, ...]

    def __post_init__(self) -> None:
        lock_arrays(self)

    @cached_property
    def _arms(self) -> dict[int, Array]:
        """Return the tips' centres as seen from the object's."""
        tips = (f.pose_at(q)[:3, 3] for f, q in zip(self.hand.fingers, self.q, strict=True))
        return {i: p - self.X_WO[:3, 3] for i, p in enumerate(tips)}

    def compute_clearance(self, posture: Array) -> tuple[float, str]:
        """Return the clearance [m] with the finger at ``posture`` (J,), and between whom it is that small."""
        nearest = self.find_nearest(posture)
        return nearest.distance, nearest.names

    def find_nearest(self, posture: Array) -> Nearness:
        """Return what is nearest to what with the finger at ``posture`` (J,)."""
        q = self.q.copy()
        q[self.finger] = posture
        return self.hand.probe.find_nearest(q, self.X_WO, self.touching)

    def compute_way_clearance(self, way: Array) -> tuple[float, str]:
        """Return the smallest clearance [m] along the postures ``way`` (K, J), and between whom."""
        nearest = self.find_nearest_on(way)
        return nearest.distance, nearest.names

    def find_nearest_on(self, way: Array) -> Nearness:
        """Return what is nearest to what along the postures ``way`` (K, J)."""
        return min((self.find_nearest(posture) for posture in way), key=lambda found: found.distance)

    def keeps_order(self, tip: Array) -> bool:
        """Return whether the fingers stand around the object as ever with the moving finger's tip at ``tip`` (3,) in W."""
        return keeps_order(self.hand, {**self._arms, self.finger: tip - self.X_WO[:3, 3]})


@dataclass(frozen=True, eq=False)
class Detour:
    """The answer: ``way`` (K, J) and what is ``nearest`` to what along it; None where none was found, and who blocks it.

    ``checks`` counts the postures looked at.
    """

    way: Array | None
    nearest: Nearness
    checks: int

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def clearance(self) -> float:
        """The least distance [m] along the way."""
        return self.nearest.distance

    @property
    def names(self) -> str:
        """Between whom it is that small."""
        return self.nearest.names


def find_detour(around: tuple[Surroundings, ...], q_start: Array, q_end: Array) -> Detour:
    """Return a way from ``q_start`` to ``q_end`` (J,) [rad] that is clear in all these surroundings of one moving finger.

    Clear means: the probe's clearance stays at ``limits.clearance`` or more, joints keep ``limits.joint_margin`` and the tip's
    Jacobian ``limits.dexterity`` (or what the ends have, where that is less), and the fingers keep their order.
    """
    room = _Room(around, q_start, q_end)
    if any(room.measure(end[None]) is None for end in (q_end, q_start)):
        return Detour(None, room.nearest, room.checks)
    straight = room.follow(np.stack([q_start, q_end]))
    if straight is not None:
        return straight
    for is_careful in (False, True):
        lines = room.grow(is_careful)
        for line in lines:
            for knots in KNOTS:
                if (found := room.follow(line, knots)) is not None:
                    return found
        if not lines:
            break
    return Detour(None, room.nearest, room.checks)


def bow_arc(around: Surroundings, arc: Array) -> Detour | None:
    """Return the ``arc`` (K, J) bowed in one joint so that it is clear; None where its ends are not, or no bow does.

    The joint and the sense are those that help most where the arc is worst.  The bow is half a sine of one of ``BOWS``, the
    smallest that does: both ends stay, all other joints go as in the arc, and what is returned keeps to the same limits as
    :func:`find_detour`.
    """
    room = _Room((around,), arc[0], arc[-1])
    clearances = [around.compute_clearance(posture)[0] for posture in arc]
    if min(clearances[0], clearances[-1]) < around.hand.limits.clearance:
        return None
    worst = arc[int(np.argmin(clearances))]
    bends = [sign * np.eye(len(worst))[j] for j in range(room.joints) for sign in (1.0, -1.0)]
    helped = [around.compute_clearance(worst + BOWS[0] * bend)[0] for bend in bends]
    shape = np.sin(np.linspace(0.0, np.pi, len(arc)))[:, None]
    for k in np.argsort(-np.array(helped), kind="stable")[:BENDS]:
        for size in BOWS:
            if (
                helped[k] > min(clearances)
                and (found := room.follow(arc + size * shape * bends[k])) is not None
            ):
                return found
    return None


class _Room:
    """The finger's joint space between two postures: which postures are free, and ways between the two.

    A tip that rolls about its own pole takes no room.  The trees leave that joint out; it turns evenly from one end to the other.
    """

    def __init__(self, around: tuple[Surroundings, ...], q_start: Array, q_end: Array) -> None:
        self._around, self._ends = around, np.stack([q_start, q_end])
        self._limits = around[0].hand.limits
        self._chain = around[0].hand.fingers[around[0].finger].chain
        self.joints = self._chain.n_joints - int(self._chain.has_tip_roll)
        self._joint = min(
            self._limits.joint_margin, float(compute_joint_margin(self._chain, self._ends).min())
        )
        self._dexterity = min(self._limits.dexterity, float(compute_dexterity(self._chain, self._ends).min()))
        self._blocks: Counter[str] = Counter()
        self._least: dict[str, Nearness] = {}
        self.checks = 0
        near = min(a.compute_clearance(q)[0] for a in around for q in self._ends)
        self._slack = float(np.clip(near - self._limits.clearance, 0.0, SLACK))

    @property
    def nearest(self) -> Nearness:
        """The pair that was in the way most often, as near as it came; inf and nobody where none was."""
        if not self._blocks:
            return NOBODY
        return self._least[min(self._blocks, key=lambda n: (-self._blocks[n], n))]

    def measure(self, way: Array, slack: float = 0.0, is_careful: bool = True) -> Nearness | None:
        """Return what is nearest to what along the postures ``way`` (K, J); None if one of them is not free.

        ``is_careful`` False leaves out what is seldom wrong and takes long to say: dexterity and the fingers' order.
        """
        nearest = NOBODY
        if compute_joint_margin(self._chain, way).min() < self._joint - 1e-9:
            return None
        # The middle first, then the middles of what is left: what is in the way is found sooner.
        for posture in way[sorted(range(len(way)), key=_halving)]:
            self.checks += 1
            for around in self._around:
                found = around.find_nearest(posture)
                if found.distance < self._limits.clearance + slack:
                    self._blocks[found.names] += 1
                    if found.distance < self._least.get(found.names, NOBODY).distance:
                        self._least[found.names] = found
                    return None
                if found.distance < nearest.distance:
                    nearest = found
        if not is_careful:
            return nearest
        if compute_dexterity(self._chain, way).min() < self._dexterity - 1e-9:
            return None
        tips = compute_tip_pose(self._chain, way)[:, :3, 3]
        return nearest if all(a.keeps_order(t) for a in self._around for t in tips) else None

    def connect(self, start: Array, end: Array, is_careful: bool) -> bool:
        """Return whether the straight way between two postures is free, its beginning taken for granted."""
        count = max(1, int(np.ceil(np.abs(end - start).max() / STEP)))
        share = np.arange(1, count + 1) / count
        way = start + share[:, None] * (end - start)
        return self.measure(way, self._slack, is_careful) is not None

    def follow(self, line: Array, knots: int = SAMPLES) -> Detour | None:
        """Return the broken line (K, J) as a way, if all of it is free just as the finger will go through it; else None."""
        if knots < SAMPLES:
            line = interpolate(sample_evenly(line, knots), np.linspace(0.0, 1.0, 4 * SAMPLES))
        way = sample_evenly(line)
        way[0], way[-1] = self._ends
        longest = np.abs(np.diff(way, axis=0)).max()
        share = np.linspace(0.0, 1.0, (SAMPLES - 1) * max(2, int(np.ceil(longest / FINE))) + 1)
        found = self.measure(interpolate(way, share))
        return None if found is None else Detour(way, found, self.checks)

    def complete(self, short: Array) -> Array:
        """Return postures (K, J) from those of the joints that the trees know, with an evenly turning tip roll."""
        if self.joints == self._chain.n_joints:
            return short
        length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(short, axis=0)).max(axis=1))])
        roll = np.interp(length, length[[0, -1]], self._ends[:, -1])
        return np.column_stack([short, roll])

    def grow(self, is_careful: bool) -> tuple[Array, ...]:
        """Return ways (K, J) that trees from both ends find, the best one first; none where they do not meet."""
        ends = self._ends[:, : self.joints]
        lower = np.maximum(ends.min(axis=0) - ROOM, self._chain.lower[: self.joints] + self._joint - 1e-9)
        upper = np.minimum(ends.max(axis=0) + ROOM, self._chain.upper[: self.joints] - self._joint + 1e-9)
        limit = self.checks + CHECKS
        roll = self._ends[:, self.joints :].mean(axis=0)
        lines = connect_trees(
            ends,
            np.stack([lower, upper]),
            lambda a, b: self.connect(np.concatenate([a, roll]), np.concatenate([b, roll]), is_careful),
            lambda: self.checks >= limit,
        )
        return tuple(self.complete(line) for line in lines)


def connect_trees(
    ends: Array, bounds: Array, is_free: Callable[[Array, Array], bool], is_over: Callable[[], bool]
) -> tuple[Array, ...]:
    """Return broken lines (K, N) between two points ``ends`` (2, N) within ``bounds`` (2, N): rounded off, shortened, as found.

    ``is_free`` answers for the straight line from one point to another; ``is_over`` says when to give up.  None where the trees
    do not meet.
    """
    # Loaded only where a detour is really asked for.
    from ompl import base, geometric, util

    util.noOutputHandler()  # it warns of every new seed
    util.RNG.setSeed(SEED)
    count = ends.shape[1]
    space = base.RealVectorStateSpace(count)
    box = base.RealVectorBounds(count)
    for j in range(count):
        box.setLow(j, float(bounds[0, j]))
        box.setHigh(j, float(bounds[1, j]))
    space.setBounds(box)
    information = base.SpaceInformation(space)

    def read(state: Any) -> Array:
        return np.array([state[j] for j in range(count)])

    class Straight(base.MotionValidator):
        def checkMotion(self, a: Any, b: Any) -> bool:  # OMPL's name
            return bool(is_free(read(a), read(b)))

    validator = Straight(information)
    information.setMotionValidator(validator)
    information.setStateValidityChecker(lambda state: True)  # whatever matters is asked of motions
    information.setup()
    problem = base.ProblemDefinition(information)
    states = [space.allocState() for _ in ends]
    for state, end in zip(states, ends, strict=True):
        for j in range(count):
            state[j] = float(end[j])
    problem.setStartAndGoalStates(*states)
    planner = geometric.RRTConnect(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(base.PlannerTerminationCondition(is_over))
    if not problem.hasExactSolution():
        return ()
    path = problem.getSolutionPath()
    lines = [np.stack([read(s) for s in path.getStates()])]
    simplifier = geometric.PathSimplifier(information)
    simplifier.partialShortcutPath(path, SHORTCUTS, SHORTCUTS)
    lines.append(np.stack([read(s) for s in path.getStates()]))
    simplifier.smoothBSpline(path, ROUNDS)
    lines.append(np.stack([read(s) for s in path.getStates()]))
    return tuple(lines[::-1])


def sample_evenly(line: Array, count: int = SAMPLES) -> Array:
    """Return ``count`` postures along the broken line (K, J), even in what the fastest joint has to do."""
    length = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(line, axis=0)).max(axis=1))])
    even = np.linspace(0.0, length[-1], count)
    return np.stack([np.interp(even, length, column) for column in line.T], axis=1)


def _halving(k: int) -> tuple[int, int]:
    """Return the key that sorts 0, 1, 2, 3.. so that multiples of high powers of two come first."""
    return -(k & -k), k
