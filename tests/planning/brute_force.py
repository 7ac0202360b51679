"""Is there a gait at all, and with how few placements?  The slow and simple answer that the planner is judged by.

Contacts stand on the object's equator, at world azimuths on a grid of ``GRID_DEG``.  A state is a pair of fingers with an
azimuth each, and how far the object has been turned.  Two things can be done: turn the object by one grid step, which takes
both contacts along, or let a free finger land and lift one of the two.  What may stand where is a callable's business, so the
same search serves the closed-form gait oracle and the real hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.admissible import Admissibility
from dexplan.planning.hand import HandModel
from dexplan.scene.chain import compute_dexterity
from dexplan.spatial import Array, build_frame, direction_from_angles, make_pose

GRID_DEG = 4
COUNT = 360 // GRID_DEG
"""Azimuths on the grid; one is given by its index, modulo this."""

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
        third = COUNT // 3
        for finger, k in contacts:
            if abs((k - finger * third + COUNT // 2) % COUNT - COUNT // 2) > self.half_width:
                return False
        if len(contacts) > 2:
            return True
        apart = (contacts[0][1] - contacts[1][1]) % COUNT
        return min(apart, COUNT - apart) >= self.pair_angle


@dataclass(eq=False)
class EquatorialHand:
    """What the hand can carry with contacts on the equator, azimuth 0 of the grid at ``offset_deg``.

    Every tip points at the centre of the object; how it is spun about its pole is left open (the middle of the last joint).
    """

    hand: HandModel
    offset_deg: float = 0.0
    sense: int = 1

    def __post_init__(self) -> None:
        self._admissibility = Admissibility(self.hand)
        self._X_WO = make_pose(p=self.hand.object.X_WO_home[:3, 3])
        self.azimuths = np.radians(self.offset_deg + GRID_DEG * np.arange(COUNT))

    @cached_property
    def _solved(self) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Postures (F, K, J), where each finger can stand (F, K), and whether the next azimuth continues the posture."""
        normals = direction_from_angles(np.degrees(self.azimuths), np.zeros(COUNT))
        postures, stands, joined = [], [], []
        for finger, workspace in zip(self.hand.fingers, self.hand.workspaces, strict=True):
            X = np.stack([make_pose(build_frame(-n)) for n in normals])
            X[:, :3, 3] = (
                self._X_WO[:3, 3] + self.hand.object.surface.closest(normals) + finger.tip_radius * normals
            )
            q, reached = workspace.solve(X)
            chain = finger.chain
            assert chain.has_tip_roll  # else the spin is not one joint's business, and this oracle does not apply
            q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
            room = np.minimum(q - chain.lower, chain.upper - q).min(axis=1)
            ok = reached & (room >= self.hand.limits.joint_margin)
            ok &= compute_dexterity(chain, q) >= self.hand.limits.dexterity
            step = np.abs(np.roll(q, -self.sense, axis=0) - q).max(axis=1)
            postures.append(q)
            stands.append(ok)
            joined.append(step < 0.6)
        return np.stack(postures), np.stack(stands), np.stack(joined)

    def follows(self, finger: int, azimuth: int) -> bool:
        """Return whether the posture goes on to the next azimuth without a jump."""
        return bool(self._solved[2][finger, azimuth])

    def stands(self, finger: int) -> NDArray[np.bool_]:
        """Return the azimuths (K,) at which the finger can hold a contact, for itself."""
        return self._solved[1][finger]

    def __call__(self, contacts: Contacts) -> bool:
        """Return whether the hand can carry the object so (two contacts), or stand so while it exchanges one (three)."""
        q, stands, _ = self._solved
        if not all(stands[f, k] for f, k in contacts):
            return False
        postures = self.hand.q_home
        for f, k in contacts:
            postures[f] = q[f, k]
        holding = tuple(f for f, _ in contacts)
        if len(contacts) > 2:
            clearance, _ = self.hand.probe.compute_clearance(postures, self._X_WO, holding)
            return clearance >= self.hand.limits.clearance and self._keeps_order(contacts)
        (_, a), (_, b) = contacts
        if np.pi - abs((self.azimuths[a] - self.azimuths[b]) % (2 * np.pi) - np.pi) <= (
            np.pi - 2.0 * np.arctan(self.hand.friction.sliding)
        ):
            return False
        axis = np.array([0.0, 0.0, float(self.sense)])
        return self._admissibility.compute_margins(
            postures, self._X_WO, holding, axis_W=axis
        ).is_admissible

    def _keeps_order(self, contacts: Contacts) -> bool:
        """Return whether the contacts follow one another around the vertical as the bases do."""
        center = self._X_WO[:2, 3]
        bases = [self.hand.fingers[f].chain.offsets[0][:2, 3] - center for f, _ in contacts]
        return winds_once([float(np.arctan2(b[1], b[0])) for b in bases]) == winds_once(
            [float(self.azimuths[k]) for _, k in contacts]
        )


def winds_once(azimuths: list[float]) -> bool:
    """Return whether three azimuths [rad] follow one another counter-clockwise."""
    first, second, third = azimuths
    return (second - first) % (2 * np.pi) < (third - first) % (2 * np.pi)
