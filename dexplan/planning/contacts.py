"""The contacts that a search may use: where each finger can land, how far it can carry, which pairs hold.

Geometry only: nothing here knows loads, clearances or the search.  Contacts live on the orbits of ``orbits.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dexplan.grasp.sphere import required_pair_preload
from dexplan.planning.admissible import FingerState, compute_finger_states
from dexplan.planning.goal import RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.orbits import STATIONS, STEP, Orbit, build_orbits, carried_posture
from dexplan.planning.plan import Placement
from dexplan.planning.regions import compute_pair_angle_max, keeps_order
from dexplan.spatial import Array, build_frame, invert_pose, rotate_about

POLAR_SPACING = float(np.radians(5.0))
SPREAD = 6
"""Placements tried per finger and partner."""
APART = float(np.cos(np.radians(8.0)))
"""Placements nearer to one another than this count as the same one."""


@dataclass(frozen=True)
class Held:
    """A contact as the search knows it: a finger on an orbit, where it landed, how far it came, how far it can still go."""

    finger: int
    orbit: int
    landed: int
    steps: int
    left: int

    def carried(self, steps: int) -> Held:
        """Return the contact ``steps`` stations further on."""
        return replace(self, steps=self.steps + steps, left=self.left - steps)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Landing places of one finger: rows of orbit index, station, outward normal in W (N, 3) and carry."""

    orbit: NDArray[np.intp]
    station: NDArray[np.intp]
    normals: Array
    carry: NDArray[np.intp]


@dataclass(eq=False)
class ContactTable:
    """All contacts for one hand and one turn; postures along a run are computed when first asked for."""

    hand: HandModel
    goal: RotationGoal
    orbits: list[Orbit] = field(default_factory=list)
    candidates: dict[int, Candidates] = field(default_factory=dict)
    _runs: dict[tuple[int, int], list[FingerState]] = field(default_factory=dict)

    @property
    def sense(self) -> int:
        """+1 or -1: which way the object turns about the goal's axis."""
        return 1 if self.goal.angle >= 0.0 else -1

    @property
    def stations(self) -> int:
        """Stations of the whole turn; the last may be a short one."""
        return int(np.ceil(abs(self.goal.angle) / STEP - 1e-9))

    @property
    def beta_max(self) -> float:
        """Largest angle [rad] between normals and chord of a pair: force closed with the believed friction, and a margin."""
        limits = self.hand.limits
        return compute_pair_angle_max(self.hand.friction.scaled(limits.cone_share)) - limits.closure_margin

    @cached_property
    def beta_easy(self) -> float:
        """Angle [rad] up to which a pair with a level chord carries the object with half the greatest normal force.

        Solves ``required_pair_preload`` for the angle.  Other chords differ, so this only ranks placements, never refuses them.
        """
        friction, hand = self.hand.friction, self.hand
        radius = float(np.linalg.norm(hand.object.surface.closest(np.array([1.0, 0.0, 0.0]))))
        share, target = friction.facet_inradius, 0.5 * hand.limits.normal_ceiling
        for beta in np.linspace(self.beta_max, 0.0, 60):
            needed = required_pair_preload(
                friction.sliding, friction.torsional, hand.object.mass, radius, np.pi - 2.0 * beta, share
            )
            if needed <= target:
                return float(max(beta, 1e-3))
        return 1e-3

    def prepare(self, start: tuple[Array | None, ...]) -> list[Held | None]:
        """Build the orbits; return each start contact (outward normal (3,) in W, or None), None where it is out of reach."""
        count = len(self.hand.fingers)
        polars = np.arange(POLAR_SPACING, np.pi - 1e-6, POLAR_SPACING)
        wanted = [(f, float(p), 0.0) for f in range(count) for p in polars]
        frame = build_frame(self.goal.axis_W)
        for finger, normal in enumerate(start):
            if normal is not None:
                x, y, z = frame.T @ normal
                wanted.append((finger, float(np.arccos(np.clip(z, -1.0, 1.0))), float(np.arctan2(y, x))))
        center = self.goal.X_WO_start[:3, 3]
        self.orbits = build_orbits(self.hand, self.goal.axis_W, center, self.sense, wanted)
        held: list[Held | None] = [None] * count
        for finger in range(count):
            own = [k for k, orbit in enumerate(self.orbits) if orbit.finger == finger]
            if start[finger] is not None:
                first = own.pop()  # the start's own orbit comes last, and is nobody's landing place
                if self.orbits[first].is_reached[0]:
                    held[finger] = Held(finger, first, 0, 0, int(self.orbits[first].carry[0]))
            self.candidates[finger] = self._collect(own)
        return held

    def _collect(self, orbits: list[int]) -> Candidates:
        rows = [(i, int(k)) for i in orbits for k in np.flatnonzero(self.orbits[i].is_reached)]
        return Candidates(
            orbit=np.array([i for i, _ in rows], dtype=np.intp),
            station=np.array([k for _, k in rows], dtype=np.intp),
            normals=np.array([self.orbits[i].normals[k] for i, k in rows]).reshape(-1, 3),
            carry=np.array([self.orbits[i].carry[k] for i, k in rows], dtype=np.intp),
        )

    # -- one contact -----------------------------------------------------------------------------------------------------

    def normal(self, held: Held) -> Array:
        """Return the outward normal (3,) in W of a contact where it is now."""
        return self.orbits[held.orbit].normals[(held.landed + self.sense * held.steps) % STATIONS]

    def state(self, held: Held) -> FingerState:
        """Return the finger's state where the contact is now."""
        run = self._runs.get((held.orbit, held.landed))
        if run is None:
            orbit = self.orbits[held.orbit]
            stations = range(int(orbit.carry[held.landed]) + 1)
            q = np.stack([carried_posture(self.hand, orbit, held.landed, k, self.sense) for k in stations])
            run = self._runs[held.orbit, held.landed] = compute_finger_states(self.hand, held.finger, q)
        return run[held.steps]

    def limit(self, held: Held) -> str:
        """Return what ends the contact's run."""
        return self.orbits[held.orbit].limit[held.landed]

    def turned(self, done: int) -> float:
        """Return the signed turn [rad] at progress ``done``; the last station ends at the goal exactly."""
        return self.sense * min(done * STEP, abs(self.goal.angle))

    def object_pose(self, done: int) -> Array:
        """Return the object's pose (4, 4) at progress ``done``."""
        X = self.goal.X_WO_start.copy()
        X[:3, :3] = rotate_about(self.goal.axis_W, self.turned(done)) @ X[:3, :3]
        return X

    def placement(self, held: Held, done: int) -> Placement:
        """Return the contact as a plan's value, with the object at progress ``done``."""
        X_WO, state = self.object_pose(done), self.state(held)
        normal_O = X_WO[:3, :3].T @ self.normal(held)
        point_O = self.hand.object.surface.closest(normal_O)
        return Placement(held.finger, point_O, normal_O, invert_pose(X_WO) @ state.X_WF, state.q)

    # -- several contacts ------------------------------------------------------------------------------------------------

    def pair_angle(self, held: tuple[Held, ...]) -> float:
        """Return the smallest angle [rad] between normals and chord over the pairs of contacts."""
        if len(held) < 2:
            return 0.5 * np.pi
        normals = np.stack([self.normal(h) for h in held])
        opposite = -(normals @ normals.T)[np.triu_indices(len(held), 1)]
        return 0.5 * float(np.arccos(np.clip(opposite.max(), -1.0, 1.0)))

    def has_pair(self, held: tuple[Held, ...]) -> bool:
        """Return whether two of the contacts are force closed with the believed friction."""
        return self.pair_angle(held) < self.beta_max

    def check_theorem_1(self, held: tuple[Held, ...]) -> str:
        """Check the paper's Theorem 1, which every gait needs: some free finger can hold with one of ``held`` where they are.

        Two fingers i, j that hold can only be relocated if f_i lies in CWS_i_jk or f_j in CWS_j_ik for a free finger k
        [paper §2.2].  Returns "" where that is so, else the refusal.
        """
        reach = float(np.cos(2.0 * self.beta_max))
        for finger in set(self.candidates) - {h.finger for h in held}:
            normals = self.candidates[finger].normals
            if any((normals @ -self.normal(h)).max(initial=-1.0) > reach for h in held):
                return ""
        return "Theorem 1: no free finger can form a force-closure grasp with a holding finger where it is, so none can be lifted"

    def keeps_order(self, held: tuple[Held, ...]) -> bool:
        """Return whether the fingers stand in the order of their bases, the free ones at home."""
        center = self.goal.X_WO_start[:3, 3]
        normals = {i: home - center for i, home in enumerate(self.hand.p_WF_home)}
        normals.update({h.finger: self.normal(h) for h in held})
        return keeps_order(self.hand, normals)

    def needed_angle(self) -> str:
        """Return in words what two contacts need for force closure."""
        angle = np.degrees(np.pi - 2.0 * self.beta_max)
        return (
            f"{angle:.1f} deg or more apart, as force closure with the believed friction and a margin needs"
        )

    def allows(self, normals: Array, done: int) -> NDArray[np.bool_]:
        """Return whether contacts along ``normals`` (..., 3) in W may be made (...) when the turn has come to ``done``."""
        return self.hand.object.allows(normals @ self.object_pose(done)[:3, :3])

    def landings(self, finger: int, keep: Held, held: tuple[Held, ...], done: int) -> list[Held]:
        """Return the most promising places for a free ``finger`` to land that hold with ``keep`` and clear all of ``held``.

        Promising: the pair can be carried far, and its contacts are nearly opposite (small forces, room for error).
        ``done`` is the progress of the turn [stations], which decides what part of the object is where.
        """
        rows = self.candidates[finger]
        if not len(rows.orbit):
            return []
        beta = 0.5 * np.arccos(np.clip(rows.normals @ -self.normal(keep), -1.0, 1.0))
        ok = (beta < self.beta_max) & self.allows(rows.normals, done)
        tips = self._tip(finger, rows.normals)
        for h in held:
            radii = self.hand.fingers[finger].tip_radius + self.hand.fingers[h.finger].tip_radius
            gaps = np.linalg.norm(tips - self._tip(h.finger, self.normal(h)), axis=1) - radii
            ok &= gaps > self.hand.limits.clearance
        promise = np.minimum(rows.carry, keep.left)
        ok &= promise > 0
        found = np.flatnonzero(ok)
        if not len(found):
            return []
        hard = np.maximum(0.0, beta[found] - self.beta_easy) / self.beta_easy
        score = promise[found] / int(promise[found].max()) - 0.3 * beta[found] / self.beta_max - 2.0 * hard
        chosen: list[Held] = []
        near: list[Array] = []
        standing = {h.finger: self.normal(h) for h in held}
        for row in found[np.argsort(-score, kind="stable")]:
            normal = rows.normals[row]
            if any(normal @ other > APART for other in near):
                continue
            if not keeps_order(self.hand, {**standing, finger: normal}):
                continue
            near.append(normal)
            chosen.append(Held(finger, int(rows.orbit[row]), int(rows.station[row]), 0, int(rows.carry[row])))
            if len(chosen) == SPREAD:
                break
        return chosen

    def _tip(self, finger: int, normals: Array) -> Array:
        radius = self.hand.fingers[finger].tip_radius
        return self.hand.object.surface.closest(normals) + radius * normals

    def start_pairs(self, count: int = 24) -> list[tuple[Held, ...]]:
        """Return pairs to start from where the problem leaves it to the planner: long runs, nearly opposite contacts."""
        found: list[tuple[float, tuple[Held, ...]]] = []
        fingers = sorted(self.candidates)
        for a, first in enumerate(fingers):
            rows = self.candidates[first]
            usable = np.flatnonzero(self.allows(rows.normals, 0))
            for row in usable[:: max(1, len(usable) // 160)]:
                h = Held(first, int(rows.orbit[row]), int(rows.station[row]), 0, int(rows.carry[row]))
                for second in fingers[a + 1 :]:
                    for other in self.landings(second, h, (h,), 0)[:2]:
                        promise = min(h.left, other.left, max(self.stations, 1))
                        found.append(
                            (promise - 8.0 * self.pair_angle((h, other)) / self.beta_max, (h, other))
                        )
        found.sort(key=lambda item: -item[0])
        return [pair for _, pair in found[:count]]
