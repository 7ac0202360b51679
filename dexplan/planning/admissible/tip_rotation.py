"""How far a fingertip rolls round: the paper's rotation limit gamma, as planned ways have to keep it [paper §3, figure 2].

The place on the tip where a contact set out is the pole of the paper's longitudes, for "any two great circles that are
perpendicular to each other can be made into a longitude and an equator".  Seen from there, the azimuth of the contact may change
by gamma while it is away.  In the manoeuvre A-B-C-D that is the equator leg B-C, in a rolling triangle its apex; a straight way
changes nothing, and is bounded by the tip's polar limit alone.  A contact that comes by the tip's own pole, from where every
way is open again, sets out anew.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dexplan.errors import spell_apart
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.actions import Action
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array

NEAR = float(np.radians(5.0))
"""Nearer than this to where it set out a contact's azimuth says nothing [rad]: a triangle that small gets nowhere."""
ROUNDING = 1e-6
"""A way that was built for the limit may exceed it by this [rad]."""


def trace_on_tip(roll: TipRoll) -> Array:
    """Return where the contact is on the tip along a roll: directions (K, 3) from the tip's centre in tip axes."""
    return -np.einsum("kji,kj->ki", roll.X_OF[:, :3, :3], roll.normal_O)


def measure_rotation(places: Array) -> Array:
    """Return how far a contact that goes through ``places`` (K, 3) on the tip went round up to each of them (K,) [rad]."""
    swept, first = np.zeros(len(places)), 0
    from_pole = _measure_angles(places, np.array([0.0, 0.0, 1.0]))
    while True:
        about = places[first]
        swept[first:] = np.maximum(swept[first:], _measure_sweep(places[first:], about))
        if from_pole[first] < NEAR:
            return swept
        passed = np.flatnonzero(from_pole[first:] < NEAR)
        if not len(passed):
            return swept
        start = first + int(passed[0])
        beyond = np.flatnonzero(from_pole[start:] >= NEAR)
        stop = start + int(beyond[0]) if len(beyond) else len(places)
        first = start + int(from_pole[start:stop].argmin())
        # What comes after the pole is not seen from where the contact was before.
        swept[first:] = swept[first]


def refuse_rotation(hand: HandModel, actions: Iterable[Action]) -> Refusal | None:
    """Return which tip would roll too far round between a touch and the next lift; None where none does."""
    on_tip: dict[int, list[Array]] = {}
    for action in actions:
        for roll in action.rolls:
            on_tip.setdefault(roll.finger, []).append(trace_on_tip(roll))
        for finger, contact in enumerate(action.contacts_end):
            if contact is None:
                on_tip.pop(finger, None)
        for roll in action.rolls:
            swept = (
                float(measure_rotation(np.concatenate(on_tip[roll.finger]))[-1])
                if roll.finger in on_tip
                else 0.0
            )
            if swept > hand.tip_rotation_limit + ROUNDING:
                return refuse_sweep(hand, roll.finger, swept)
    return None


def refuse_sweep(hand: HandModel, finger: int, swept: float) -> Refusal:
    """Return the refusal because a tip would go round by ``swept`` [rad], which is too far."""
    far, limit = spell_apart(np.degrees(swept), np.degrees(hand.tip_rotation_limit))
    name = hand.fingers[finger].name
    words = f"{name} would roll {far} deg round on its tip, and hand.tip_rotation_limit_deg is {limit}"
    return Refusal(RefusalKind.TIP_ROTATION, (name,), swept, hand.tip_rotation_limit, words=words)


def _measure_angles(places: Array, about: Array) -> Array:
    return np.arctan2(np.linalg.norm(np.cross(places, about), axis=1), places @ about)


def _measure_sweep(places: Array, about: Array) -> Array:
    """Return the largest change of azimuth about a place (3,) so far (K,) [rad], of each stay away from it."""
    aside = np.cross(about, np.eye(3)[int(np.abs(about).argmin())])
    aside /= np.linalg.norm(aside)
    azimuth = np.arctan2(places @ np.cross(about, aside), places @ aside)
    swept = np.zeros(len(places))
    away = np.flatnonzero(_measure_angles(places, about) > NEAR)
    for stay in np.split(away, np.flatnonzero(np.diff(away) > 1) + 1):
        if len(stay):
            seen = np.unwrap(azimuth[stay])
            swept[stay] = np.maximum.accumulate(seen) - np.minimum.accumulate(seen)
    return np.maximum.accumulate(swept)
