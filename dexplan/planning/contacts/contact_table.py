"""The contacts that a search may use on one leg: where each finger can land, how far it can carry, which pairs hold.

Contacts live on the orbits of ``orbits.py``; what pairs of them carry is asked of ``loads.py``, for many at once.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dexplan.planning.admissible.admissibility import FingerState, compute_finger_states
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import compute_object_wrench
from dexplan.planning.admissible.order import ORDER_GAP
from dexplan.planning.admissible.separation import compute_pair_angle_max, describe_separation
from dexplan.planning.contacts.candidates import Landings, find_landings
from dexplan.planning.contacts.held import Candidates, Held
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.orbits import Orbit, build_fixed_orbit, build_orbits
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.plans.contacts import Placement
from dexplan.spatial import Array, invert_pose

NEAR = float(np.radians(6.0))
"""A contact this near to a landing place is about as good as that [rad]."""


@dataclass(eq=False)
class ContactTable:
    """All contacts for one hand and one leg; what takes time is computed when first asked for."""

    hand: HandModel
    leg: Leg
    orbits: list[Orbit] = field(default_factory=list)
    _runs: dict[tuple[int, int], list[FingerState]] = field(default_factory=dict)
    _trees: dict[int, cKDTree] = field(default_factory=dict)

    @property
    def stations(self) -> int:
        """Stations of the whole leg."""
        return self.leg.stations

    @cached_property
    def wrench(self) -> Array:
        """The wrench (6,) [N, N m] that the contacts exert while they take the object along."""
        return compute_object_wrench(self.hand, self.axis_W)

    @property
    def axis_W(self) -> Array | None:
        """The axis about which the object is accelerated, with its sense; None for a shift."""
        return None if self.leg.is_shift else self.leg.sense * self.leg.axis_W

    @cached_property
    def beta_max(self) -> float:
        """Largest angle [rad] between normals and chord of a pair: force closed with the believed friction, and a margin."""
        limits = self.hand.limits
        return compute_pair_angle_max(self.hand.friction.scaled(limits.cone_share)) - limits.closure_margin

    @cached_property
    def _landings(self) -> tuple[Landings, ...]:
        return find_landings(self.hand, self.leg)

    @cached_property
    def candidates(self) -> dict[int, Candidates]:
        """Landing places of every finger."""
        found = {}
        for finger, landings in enumerate(self._landings):
            found[finger] = landings.numbered_from(len(self.orbits))
            self.orbits += landings.orbits
        return found

    def explain_reach(self, finger: int) -> tuple[bool, Stop | None]:
        """Return whether a finger can touch the object anywhere, and what stops it at most places where it cannot."""
        landings, limits = self._landings[finger], Counter[Stop]()
        for orbit in landings.orbits:
            limits.update(orbit.limit[k] for k in np.flatnonzero(~orbit.is_reached))
        # Far around the object every finger's workspace ends: that says something only where nothing else does.
        ranked = sorted(
            limits, key=lambda stop: (stop.kind is StopKind.WORKSPACE, -limits[stop], stop.kind, stop.who)
        )
        return bool(len(landings.stand.orbit)), ranked[0] if ranked else None

    def foresee_carry(self, finger: int, normal: Array) -> int:
        """Return for how many stations the finger could about carry a contact along ``normal`` (3,) in W from the leg's start.

        It is taken to stand there already: whether it could land there does not matter.
        """
        rows = self._landings[finger].stand
        if not len(rows.carry):
            return 0
        if finger not in self._trees:
            self._trees[finger] = cKDTree(rows.normals)
        distance, nearest = self._trees[finger].query(normal)
        return int(rows.carry[nearest]) if distance < NEAR else 0

    def start_along(self, finger: int, normal: Array) -> Held | None:
        """Return a start contact with the outward ``normal`` (3,) in W, the pole along it; None where it is out of reach."""
        X = build_aligned(self.hand, finger, self.leg.center, normal[None])
        return self._start(finger, build_orbits(self.hand, self.leg, finger, X, normal[None], np.pi)[0])

    def start_at(self, finger: int, X_WF: Array, q: Array | None = None) -> Held | None:
        """Return a start contact with the tip at ``X_WF`` (4, 4), in the posture ``q`` if given; None where it cannot be held."""
        arm = X_WF[:3, 3] - self.leg.center
        normal = arm / np.linalg.norm(arm)
        return self._start(finger, build_fixed_orbit(self.hand, self.leg, finger, X_WF, normal, q))

    def _start(self, finger: int, orbit: Orbit) -> Held | None:
        self.orbits.append(orbit)
        if not orbit.is_reached[0]:
            return None
        return Held(finger, len(self.orbits) - 1, 0, 0, int(orbit.carry[0]))

    # -- one contact -----------------------------------------------------------------------------------------------------

    def station(self, held: Held) -> int:
        """Return the station at which a contact is now."""
        return (held.landed + self.leg.sense * held.steps) % len(self.orbits[held.orbit].q)

    def normal(self, held: Held) -> Array:
        """Return the outward normal (3,) in W of a contact where it is now."""
        return self.orbits[held.orbit].normals[self.station(held)]

    def state(self, held: Held) -> FingerState:
        """Return the finger's state where the contact is now."""
        run = self._runs.get((held.orbit, held.landed))
        if run is None:
            q = self.orbits[held.orbit].run(self.hand, self.leg, held.landed)
            run = self._runs[held.orbit, held.landed] = compute_finger_states(self.hand, held.finger, q)
        return run[held.steps]

    def normals_ahead(self, held: Held, count: int) -> Array:
        """Return the outward normals (count, 3) in W of a contact from where it is on."""
        orbit = self.orbits[held.orbit]
        stations = self.station(held) + self.leg.sense * np.arange(count)
        return orbit.normals[stations % len(orbit.q)]

    def states_ahead(self, held: Held, count: int) -> list[FingerState]:
        """Return the finger's states from where the contact is on."""
        self.state(held)
        return self._runs[held.orbit, held.landed][held.steps : held.steps + count]

    def limit(self, held: Held) -> Stop:
        """Return what ends the contact's run."""
        return self.orbits[held.orbit].limit[held.landed]

    def center(self, held: Held) -> Array:
        """Return the object's centre (3,) [m] where the contact is now."""
        return (
            self.leg.center + self.leg.motions[1][self.station(held)]
            if self.leg.is_shift
            else self.leg.center
        )

    def placement(self, held: Held, done: int) -> Placement:
        """Return the contact as a plan's value, with the object at progress ``done``."""
        X_WO, state = self.leg.pose(done), self.state(held)
        normal_O = X_WO[:3, :3].T @ self.normal(held)
        point_O = self.hand.object.surface.radial(normal_O)
        return Placement(held.finger, point_O, normal_O, invert_pose(X_WO) @ state.X_WF, state.q)

    # -- several contacts ------------------------------------------------------------------------------------------------

    def pair_angle(self, held: tuple[Held, ...]) -> float:
        """Return the smallest angle [rad] between normals and chord over the pairs of contacts."""
        if len(held) < 2:
            return 0.5 * np.pi
        opposite = max(-self.normal(a) @ self.normal(b) for a, b in combinations(held, 2))
        return 0.5 * float(np.arccos(np.clip(opposite, -1.0, 1.0)))

    def has_pair(self, held: tuple[Held, ...]) -> bool:
        """Return whether two of the contacts are force closed with the believed friction."""
        return self.pair_angle(held) < self.beta_max

    @cached_property
    def _bases(self) -> list[int]:
        """The fingers in the order in which their bases stand around the vertical."""
        center = self.leg.center[:2]
        bases = [f.chain.offsets[0][:2, 3] - center for f in self.hand.fingers]
        return sorted(range(len(bases)), key=lambda i: np.arctan2(bases[i][1], bases[i][0]))

    def keep_order(self, normals: dict[int, Array]) -> NDArray[np.bool_]:
        """Return whether fingers touching along ``normals`` (..., 3) stand around the vertical in the order of their bases (...).

        The paper's fingers never change their relative (clockwise) positions [paper §4].
        """
        order = [i for i in self._bases if i in normals]
        azimuths = [np.arctan2(normals[i][..., 1], normals[i][..., 0]) for i in order]
        if len(order) < 3:
            return np.ones(np.broadcast_shapes(*(a.shape for a in azimuths)), dtype=bool)
        # In order, the steps from finger to finger are all positive and make one turn.
        steps = [
            np.mod(b - a, 2.0 * np.pi) for a, b in zip(azimuths, azimuths[1:] + azimuths[:1], strict=True)
        ]
        near = np.minimum.reduce(np.broadcast_arrays(*steps))
        return np.asarray((near >= ORDER_GAP) & (np.abs(sum(steps) - 2.0 * np.pi) < 1e-6))

    def with_free(self, normals: dict[int, Array]) -> dict[int, Array]:
        """Return ``normals`` with the directions of the free fingers, at home, added."""
        homes = {i: home - self.leg.center for i, home in enumerate(self.hand.p_WF_home)}
        return {**homes, **normals}

    def needed_angle(self) -> str:
        """Return in words what two contacts need for force closure."""
        return describe_separation(self.beta_max, self.hand.friction.sliding)

    def allows(self, normals: Array, done: int) -> NDArray[np.bool_]:
        """Return whether contacts along ``normals`` (..., 3) in W may be made (...) when the leg has come to ``done``."""
        return self.hand.object.allows(normals @ self.leg.pose(done)[:3, :3])

    def are_apart(self, finger: int, normals: Array, held: dict[int, Array]) -> NDArray[np.bool_]:
        """Return whether the finger's tip at contacts along ``normals`` (N, 3) keeps clear of the tips of those ``held`` (N,)."""
        tips, apart = self._tip(finger, normals), np.ones(len(normals), dtype=bool)
        for other, normal in held.items():
            radii = self.hand.fingers[finger].tip_radius + self.hand.fingers[other].tip_radius
            gaps = np.linalg.norm(tips - self._tip(other, normal), axis=1) - radii
            apart &= gaps > self.hand.limits.clearance
        return apart

    def _tip(self, finger: int, normals: Array) -> Array:
        radius = self.hand.fingers[finger].tip_radius
        return self.hand.object.surface.radial(normals) + radius * normals
