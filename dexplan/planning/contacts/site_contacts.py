"""The oracle for any way of the object: contacts at places all over it, sought anew at every one of the poses on its way."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.admissibility import Margins
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import sure_share
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.oracle import Landfall, Landing, Progress, Reach, Verdict
from dexplan.planning.contacts.still import Stand, change_stand
from dexplan.planning.contacts.stops import Stop, StopKind
from dexplan.planning.ways.travel import Way
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal
from dexplan.spatial import Array

SiteLandfall = Landfall[Stand, int]

LIKE_DIRECTIONS = 40
"""Contacts are much alike whose directions are nearest to the same one of so many."""


@dataclass(eq=False)
class SiteContacts:
    """Answers for the poses of ``layers``: one stretch, every pose a stop.  A grip is a stand, a touch a spot of the pose."""

    layers: Layers

    @property
    def hand(self) -> HandModel:
        """The hand whose fingers these are."""
        return self.layers.hand

    def count_stops(self, stretch: int) -> int:
        """Return the number of the last pose."""
        return self.layers.last

    def list_touching(self, grip: Stand) -> tuple[int, ...]:
        """Return the fingers that touch."""
        return tuple(f for f, spot in enumerate(grip) if spot is not None)

    def change(self, grip: Stand, finger: int, touch: int | None) -> Stand:
        """Return the stand with a finger on another spot, or, None, free."""
        return change_stand(grip, finger, touch)

    def land(self, stretch: int, asked: Sequence[SiteLandfall]) -> list[list[Landing[int]]]:
        """Return for each of ``asked`` the places all over the object that hold with one of those that hold already.

        A landing's load is that of the best pair it makes, now and with the object at its end.
        """
        return [self._land(one) for one in asked]

    def _land(self, one: SiteLandfall) -> list[Landing[int]]:
        partners = [s for s in one.held if s is not None] if one.keep is None else [one.keep]
        loads = np.minimum.reduce([self.layers.promise(one.done, one.finger, p) for p in partners])
        still = self.layers.poses[one.done]
        places = still.landings(one.finger)
        if self.layers.looks_ahead:
            # What the force program would have to search for is left out, as in the bound.
            now = np.minimum.reduce([still.loads(one.finger, p) for p in partners])
            is_sure = now <= sure_share(self.hand)
            loads = np.where(is_sure & still.find_room(one.finger, one.held), loads, np.inf)
        return [
            Landing(place, 0, float(load))
            for place, load in zip(places, loads, strict=True)
            if np.isfinite(load)
        ]

    def go(self, grip: Stand, at: Progress, most: int | None = None) -> Reach:
        """Return whether all contacts can be carried to the next pose, as far as each finger alone is concerned."""
        if at.stop == self.layers.last or most == 0:
            return Reach(0, Stop(StopKind.GOAL if at.stop == self.layers.last else StopKind.SHORTER))
        carried = [(f, self.layers.carry(at.stop, s)) for f, s in enumerate(grip) if s is not None]
        stuck = [(f, one.refusal) for f, one in carried if one.refusal is not None]
        if stuck:
            return Reach(0, stuck[0][1], stuck[0][0], tuple(refusal for _, refusal in stuck))
        return Reach(1, Stop(StopKind.GOAL if at.stop + 1 == self.layers.last else StopKind.LEG_END))

    def advance(self, grip: Stand, at: Progress, stops: int) -> Stand:
        """Return the stand at a later pose."""
        for layer in range(at.stop, at.stop + stops):
            grip = tuple(None if s is None else self.layers.carry(layer, s).there for s in grip)
        return grip

    def refuse_carry(self, grip: Stand, at: Progress, stops: int) -> Refusal | None:
        """Return why a stand cannot take the object on: half way to every next pose, and there, is looked at."""
        return self._judge_carry(grip, at, stops, is_thorough=False).refusal

    def judge_carry(self, grip: Stand, at: Progress, stops: int) -> Verdict:
        """Return the worst margins on the whole way, or the first refusal."""
        return self._judge_carry(grip, at, stops, is_thorough=True)

    def _judge_carry(self, grip: Stand, at: Progress, stops: int, is_thorough: bool) -> Verdict:
        verdict = Verdict({})
        for layer in range(at.stop, at.stop + stops):
            verdict = verdict.joined(self.layers.judge_carry(layer, grip, is_thorough))
            if verdict.refusal:
                break
            grip = self.advance(grip, Progress(at.stretch, layer), 1)
        return verdict

    def judge(self, grip: Stand, at: Progress) -> Margins:
        """Return the margins of holding the object with a stand, all other fingers at home."""
        return self.layers.poses[at.stop].judge(grip)

    def list_rests(self, grip: Stand, at: Progress) -> list[tuple[int, Stand]]:
        """Return which contacts can be lifted, each with the stand that is left: two of it hold alone."""
        still = self.layers.poses[at.stop]
        rests = [(s, change_stand(grip, f, None)) for f, s in enumerate(grip) if s is not None]
        return [(lifted, rest) for lifted, rest in rests if still.has_pair(rest)]

    def find_way(self, touch: int, holding: Stand, at: Progress, looks_around: bool) -> Way:
        """Return how a free finger goes between home and a contact while others hold; a detour only if it ``looks_around``."""
        return self.layers.poses[at.stop].find_way(holding, touch, looks_around)

    def class_of(self, grip: Stand, at: Progress) -> Hashable:
        """Return what stands much alike have in common: the pose, who touches, and roughly where."""
        still = self.layers.poses[at.stop]
        where = (
            None
            if s is None
            else "goal"
            if still.labels[s] is not None
            else int(np.argmax(self._kinds @ still.get_direction(s)))
            for s in grip
        )
        return (at.stop, *where)

    @cached_property
    def _kinds(self) -> Array:
        return spread_directions(LIKE_DIRECTIONS)

    def key_of(self, grip: Stand, at: Progress) -> Hashable:
        """Return what makes two stands the same to a search."""
        return at.stop, grip

    def place(self, touch: int, at: Progress) -> Placement:
        """Return a contact as a plan's value."""
        return self.layers.poses[at.stop].spots[touch]
