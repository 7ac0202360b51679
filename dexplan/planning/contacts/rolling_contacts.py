"""The oracle for fingers whose contacts roll: stops are poses along the way, a touch is where and when a finger landed."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.rolling_hold import RollingHold
from dexplan.planning.contacts.oracle import Landfall, Landing, Progress, Reach, Verdict
from dexplan.planning.contacts.rolling_stations import RollingGrip, RollingStations
from dexplan.planning.contacts.rolling_touches import RollingTouches
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.ways.detour import Surroundings
from dexplan.planning.ways.travel import Way, find_way
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal, RefusalKind

MOST = 40
"""So many sites are tried for each contact that a landing could hold with, those first that take the least of the cone."""
LIKE_DIRECTIONS = 40
"""Contacts are much alike whose directions in the world are nearest to the same one of so many."""


@dataclass(eq=False)
class RollingContacts:
    """Answers along the way of the ``stations``: one stretch.  A grip has numbers of touches, and stays as it is when carried."""

    stations: RollingStations
    _estimates: dict[tuple[int, int, int], float] = field(default_factory=dict, init=False)
    _ways: dict[tuple[int, RollingGrip, int, bool], Way] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        self._kinds = spread_directions(LIKE_DIRECTIONS)

    @property
    def touches(self) -> RollingTouches:
        """All touches along the way."""
        return self.stations.touches

    @property
    def hold(self) -> RollingHold:
        """What judges a station."""
        return self.stations.hold

    @property
    def hand(self) -> HandModel:
        """The hand whose fingers these are."""
        return self.touches.hand

    def count_stops(self, stretch: int) -> int:
        """Return the number of the last stop."""
        return self.touches.last

    def list_touching(self, grip: RollingGrip) -> tuple[int, ...]:
        """Return the fingers that touch."""
        return tuple(f for f, touch in enumerate(grip) if touch is not None)

    def change(self, grip: RollingGrip, finger: int, touch: int | None) -> RollingGrip:
        """Return the grip with a finger's other touch, or, None, with the finger free."""
        return (*grip[:finger], touch, *grip[finger + 1 :])

    def land(self, stretch: int, asked: Sequence[Landfall[RollingGrip, int]]) -> list[list[Landing[int]]]:
        """Return for each of ``asked`` the places that seem to hold with one of those that hold already, now and later.

        A landing's load is the mean of the shares of the cone it takes now and where the first of the two contacts is used up.
        """
        return [self._land(one) for one in asked]

    def _land(self, one: Landfall[RollingGrip, int]) -> list[Landing[int]]:
        known, stop = self.touches, one.done
        station, sites = int(known.stops[stop]), known.sites
        X_WO = known.stations[station]
        partners = [t for t in one.held if t is not None] if one.keep is None else [one.keep]
        best: dict[int, Landing[int]] = {}
        for partner in partners:
            state = known.touches[partner].at(station)
            loads = self.hold.estimate_pairs(X_WO, state, sites.points, sites.normals)
            loads = np.where(self.hand.object.allows(sites.normals), loads, np.inf)
            order = np.argsort(loads, kind="stable")[:MOST]
            for number in known.land(one.finger, stop, [int(k) for k in order if np.isfinite(loads[k])]):
                load = self._estimate(partner, number, stop)
                until = min(known.touches[number].until, known.touches[partner].until)
                later = self._estimate(partner, number, until)
                landing = Landing(number, known.touches[number].until - stop, 0.5 * (load + min(later, 2.0)))
                if number not in best or landing.load < best[number].load:
                    best[number] = landing
        return sorted(best.values(), key=lambda landing: (-landing.promise, landing.load))

    def _estimate(self, a: int, b: int, stop: int) -> float:
        """Return about which share of the cone two touches take at a stop."""
        key = a, b, stop
        if key not in self._estimates:
            station = int(self.touches.stops[stop])
            one, other = (self.touches.touches[t].at(station) for t in (a, b))
            X_WO = self.touches.stations[station]
            found = self.hold.estimate_pairs(X_WO, one, other.p_O[None], other.n_O[None])
            self._estimates[key] = float(found[0])
        return self._estimates[key]

    def go(self, grip: RollingGrip, at: Progress, most: int | None = None) -> Reach:
        """Return how far all contacts can be carried, each finger by itself, if the grip decides the motion."""
        known = self.touches
        if at.stop == known.last or most == 0:
            return Reach(0, Stop(StopKind.GOAL if at.stop == known.last else StopKind.SHORTER))
        station = int(known.stops[at.stop])
        states = self.stations.list_states(grip, station)
        steering = self.hold.steer(states, known.stations[station], known.compute_twist(station))
        if not steering.may_carry:
            names = tuple(self.hand.fingers[f].name for f in self.list_touching(grip))
            refusal = Refusal(RefusalKind.LEFT_TO_TORSION, names)
            return Reach(0, refusal, refusals=(refusal,))
        until, finger = min((known.touches[t].until, f) for f, t in enumerate(grip) if t is not None)
        stops = until - at.stop if most is None else min(most, until - at.stop)
        if until == known.last:
            return Reach(stops, Stop(StopKind.GOAL))
        touch = grip[finger]
        assert touch is not None
        refusal = known.touches[touch].refuse(self.hand.fingers[finger].name)
        return Reach(stops, refusal, finger, (refusal,))

    def advance(self, grip: RollingGrip, at: Progress, stops: int) -> RollingGrip:
        """Return the same grip: touches are carried along."""
        return grip

    def refuse_carry(self, grip: RollingGrip, at: Progress, stops: int) -> Refusal | None:
        """Return why a grip cannot take the object so many stops on: the stops are looked at, and the slip between them."""
        return self.stations.judge_carry(grip, at, stops, is_thorough=False).refusal

    def judge_carry(self, grip: RollingGrip, at: Progress, stops: int) -> Verdict:
        """Return the worst margins at all stations of the way, or the first refusal."""
        return self.stations.judge_carry(grip, at, stops, is_thorough=True)

    def judge(self, grip: RollingGrip, at: Progress) -> Margins:
        """Return the margins of holding the object still with a grip, all other fingers at home."""
        return self.stations.judge(grip, int(self.touches.stops[at.stop]), is_moving=False).margins

    def list_rests(self, grip: RollingGrip, at: Progress) -> list[tuple[int, RollingGrip]]:
        """Return which contacts can be lifted, each with the grip that is left: two of it seem to hold alone."""
        rests = []
        for f, touch in enumerate(grip):
            if touch is None:
                continue
            rest = self.change(grip, f, None)
            if self.seems_to_hold(rest, at.stop):
                rests.append((touch, rest))
        return rests

    def seems_to_hold(self, grip: RollingGrip, stop: int) -> bool:
        """Return whether two contacts of a grip seem to hold alone at a stop, as far as is quickly known."""
        touching = [t for t in grip if t is not None]
        return any(np.isfinite(self._estimate(*pair, stop)) for pair in combinations(touching, 2))

    def find_way(self, touch: int, holding: RollingGrip, at: Progress, looks_around: bool) -> Way:
        """Return how a free finger goes between home and a contact while others hold; a detour only if it ``looks_around``."""
        key = touch, holding, at.stop, looks_around
        if key not in self._ways:
            station = int(self.touches.stops[at.stop])
            X_WO, state = self.touches.stations[station], self.touches.touches[touch].at(station)
            finger = self.hand.fingers[state.finger]
            hover = compute_hover(finger, X_WO, state.X_OF, state.n_O, state.q, self.hand.hover)
            arc = build_travel(finger, finger.q_home, hover, X_WO[:3, 3])
            q = self.hand.q_home.copy()
            for other in self.stations.list_states(holding, station):
                q[other.finger] = other.q
            around = Surroundings(self.hand, q, X_WO, state.finger, self.list_touching(holding))
            self._ways[key] = find_way(around, arc, looks_around)
        return self._ways[key]

    def class_of(self, grip: RollingGrip, at: Progress) -> Hashable:
        """Return what grips much alike have in common: the stop, who touches, and roughly where."""
        station = int(self.touches.stops[at.stop])
        R = self.touches.stations[station][:3, :3]
        where: list[int | None] = [None] * len(grip)
        for state in self.stations.list_states(grip, station):
            where[state.finger] = int(np.argmax(self._kinds @ (R @ state.n_O)))
        return (at.stop, *where)

    def key_of(self, grip: RollingGrip, at: Progress) -> Hashable:
        """Return what makes two grips the same to a search."""
        return at.stop, grip

    def place(self, touch: int, at: Progress) -> Placement:
        """Return a contact as a plan's value."""
        state = self.touches.touches[touch].at(int(self.touches.stops[at.stop]))
        return Placement(state.finger, state.p_O, state.n_O, state.X_OF, state.q)
