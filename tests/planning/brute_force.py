"""Is there a gait at all, and with how few placements?  The slow and simple answer that the planner is judged by.

Contacts stand on the object's equator, at world azimuths on a grid of ``GRID_DEG``.  A state is a pair of fingers with an
azimuth each, and how far the object has been turned.  Two things can be done: turn the object by one grid step, which takes
both contacts along, or let a free finger land and lift one of the two.  What may stand where is a callable's business, so the
same search serves the closed-form gait oracle and the real hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, FingerState, compute_finger_states
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, build_frame, direction_from_angles, make_pose

GRID_DEG = 4
COUNT = 360 // GRID_DEG
"""Azimuths on the grid; one is given by its index, modulo this."""
JUMP = 0.6
"""A joint that turns by more than this from one azimuth to the next has changed its branch [rad]."""

Contact = tuple[int, int]
"""Finger and azimuth index."""
Contacts = tuple[Contact, ...]
"""Everyone who touches, in finger order."""
State = tuple[Contacts, int]
"""A grasp, and how many grid steps the object has been turned."""
Allowed = Callable[[Contacts], bool]
"""Whether two contacts may carry the object, or three may stand there during an exchange."""


@dataclass(frozen=True)
class Gait:
    """A gait with the fewest placements, and its states: where each grasp begins and where it ends."""

    placements: int
    way: tuple[State, ...]


def find_gait(
    spots: Sequence[Contact],
    steps: int,
    allowed: Allowed,
    *,
    starts: Iterable[Contacts] | None = None,
    follows: Callable[[Contact], bool] = lambda contact: True,
    sense: int = 1,
) -> Gait | None:
    """Return a gait with the fewest placements that turns the object by ``steps`` grid steps, None where there is none.

    Breadth first by placements.  All that matters of the ways to a grasp with so many placements is the longest turn made, for
    what can be done from there does not depend on it.

    Args:
        spots: where each finger can stand, for itself.
        steps: turn to make, in grid steps.
        allowed: which pairs can carry the object, and which triples can stand there during an exchange.
        starts: pairs to begin with; every allowed pair where None.
        follows: whether a finger can carry its contact from one azimuth to the next in the sense of the turn.
        sense: +1 or -1.
    """
    allowed = lru_cache(maxsize=None)(allowed)
    if starts is None:
        starts = [(a, b) for a in spots for b in spots if a[0] < b[0]]
    turned: dict[Contacts, int] = {}  # how far the object has been turned at most when these hold it
    links: dict[State, State | None] = {}
    fresh: dict[Contacts, int] = {grasp: 0 for grasp in starts if allowed(grasp)}
    links.update(dict.fromkeys(fresh.items()))
    placements = 0
    while fresh:
        # Turn with every grasp that is new, or came further than before, as far as it goes.
        improved: dict[Contacts, int] = {}
        for landed in fresh.items():
            here, done = landed
            while turned.get(here, -1) < done:
                turned[here] = improved[here] = done
                if (here, done) != landed:
                    links[here, done] = landed
                if done == steps:
                    return Gait(placements, _trace_back(links, (here, done)))
                ahead = tuple((finger, (k + sense) % COUNT) for finger, k in here)
                if not all(follows(contact) for contact in here) or not allowed(ahead):
                    break
                here, done = ahead, done + 1
        # Then exchange one finger.
        fresh, placements = {}, placements + 1
        for grasp, done in improved.items():
            for keep in grasp:
                for landing in spots:
                    if any(finger == landing[0] for finger, _ in grasp):
                        continue
                    after = _in_order(keep, landing)
                    if done <= max(turned.get(after, -1), fresh.get(after, -1)):
                        continue
                    if allowed(after) and allowed(_in_order(*grasp, landing)):
                        fresh[after], links[after, done] = done, (grasp, done)
    return None


def _in_order(*contacts: Contact) -> Contacts:
    return tuple(sorted(contacts))


def _trace_back(links: dict[State, State | None], end: State) -> tuple[State, ...]:
    way = [end]
    while (previous := links[way[-1]]) is not None:
        way.append(previous)
    return tuple(reversed(way))


@dataclass(frozen=True)
class Ring:
    """A three-fold ring: contacts within ``half_width`` of home, pairs at least ``pair_angle`` apart (grid steps)."""

    half_width: int
    pair_angle: int

    def __call__(self, contacts: Contacts) -> bool:
        """Return whether the contacts may stand: three of them only have to be in reach."""
        if not all(self._is_home(finger, k) for finger, k in contacts):
            return False
        apart = (contacts[0][1] - contacts[1][1]) % COUNT
        return len(contacts) > 2 or min(apart, COUNT - apart) >= self.pair_angle

    @property
    def spots(self) -> list[Contact]:
        """Where each finger can stand."""
        return [(f, k) for f in range(3) for k in range(COUNT) if self._is_home(f, k)]

    def _is_home(self, finger: int, azimuth: int) -> bool:
        away = (azimuth - finger * COUNT // 3) % COUNT
        return min(away, COUNT - away) <= self.half_width


@dataclass(eq=False)
class EquatorialHand:
    """What the hand can carry with contacts on the equator, azimuth 0 of the grid at ``offset_deg``.

    Every tip points at the centre of the object; how it is spun about its pole is left open (the middle of the last joint).
    """

    hand: HandModel
    offset_deg: float = 0.0
    sense: int = 1

    def __post_init__(self) -> None:
        self.azimuths_deg = self.offset_deg + GRID_DEG * np.arange(COUNT)
        self._admissibility = Admissibility(self.hand)
        self._X_WO = self.hand.object.X_WO_home
        self._states: dict[Contact, FingerState] = {}
        self._jumps: set[Contact] = set()
        normals = direction_from_angles(self.azimuths_deg, np.zeros(COUNT))
        for f in range(len(self.hand.fingers)):
            self._solve(f, normals)

    def _solve(self, f: int, normals: Array) -> None:
        """Find the finger's postures around the equator, and where its branch of the inverse kinematics breaks off."""
        finger, limits = self.hand.fingers[f], self.hand.limits
        assert (
            finger.chain.has_tip_roll
        )  # else the spin is not one joint's business, and this oracle does not apply
        X = np.stack([make_pose(build_frame(-n)) for n in normals])
        points = self.hand.object.surface.radial(normals) + finger.tip_radius * normals
        X[:, :3, 3] = self._X_WO[:3, 3] + points
        q, reached = self.hand.workspaces[f].solve(X)
        q[:, -1] = 0.5 * (finger.chain.lower[-1] + finger.chain.upper[-1])
        for k, state in enumerate(compute_finger_states(self.hand, f, q)):
            if reached[k] and state.joint >= limits.joint_margin and state.dexterity >= limits.dexterity:
                self._states[f, k] = state
            if np.abs(q[(k + self.sense) % COUNT] - q[k]).max() > JUMP:
                self._jumps.add((f, k))

    @property
    def spots(self) -> list[Contact]:
        """Where each finger can hold a contact, for itself."""
        return sorted(self._states)

    def index(self, azimuth_deg: float) -> int:
        """Return the grid index of an azimuth that lies on the grid."""
        k = (azimuth_deg - self.offset_deg) / GRID_DEG
        assert abs(k - round(k)) < 1e-9
        return round(k) % COUNT

    def follows(self, contact: Contact) -> bool:
        """Return whether the posture goes on to the next azimuth without a jump."""
        return contact not in self._jumps

    def __call__(self, contacts: Contacts) -> bool:
        """Return whether the hand can carry the object so (two contacts), or stand so while it exchanges one (three)."""
        if any(contact not in self._states for contact in contacts):
            return False
        states = {contact[0]: self._states[contact] for contact in contacts}
        q = self.hand.q_home.copy()
        for finger, state in states.items():
            q[finger] = state.q
        if len(contacts) > 2:
            clearance, _ = self.hand.probe.compute_clearance(q, self._X_WO, tuple(states))
            return clearance >= self.hand.limits.clearance and self._keeps_order(contacts)
        apart = GRID_DEG * ((contacts[0][1] - contacts[1][1]) % COUNT)
        limits = self.hand.limits
        beta_max = np.arctan(limits.cone_share * self.hand.friction.sliding) - limits.closure_margin
        if min(apart, 360 - apart) <= 180.0 - 2.0 * np.degrees(beta_max):
            return False
        axis_W = np.array([0.0, 0.0, float(self.sense)])
        return self._admissibility.compute_margins_of(states, q, self._X_WO, axis_W=axis_W).is_admissible

    def _keeps_order(self, contacts: Contacts) -> bool:
        """Return whether three contacts follow one another around the vertical as the bases do."""
        bases = [self.hand.fingers[f].chain.offsets[0][:2, 3] - self._X_WO[:2, 3] for f, _ in contacts]
        return winds_forward([float(np.degrees(np.arctan2(y, x))) for x, y in bases]) == winds_forward(
            [float(self.azimuths_deg[k]) for _, k in contacts]
        )


def winds_forward(azimuths_deg: list[float]) -> bool:
    """Return whether three azimuths follow one another counter-clockwise."""
    first, second, third = azimuths_deg
    return (second - first) % 360.0 < (third - first) % 360.0
