"""Why no chain of pairs leads along a way: no pair holds somewhere, Theorem 1 forbids the change of sides, or hand and way do.

Asked where :class:`.RelocationBound` says "never" before a node is opened, so it speaks of what that bound knows: where tips
reach, which two contacts are force closed, which of these bear the weight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from dexplan.contact.bodies.names import name_flats
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.contacts.still import Stand
from dexplan.planning.regrasp.pairs import Bools
from dexplan.planning.regrasp.relocation_bound import RelocationBound
from dexplan.plans.refusal import Cure, Refusal, RefusalKind
from dexplan.spatial import Array, lock_arrays

ON_PLANE = 1e-6
"""Normals that differ by less than this, as one minus their cosine, are of one plane."""
AUTO = 'set start.contacts_deg = "auto"'
Numbers = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class PairTables:
    """Tables (N, M) of the places ``one`` (N,) and ``other`` (M,) of two fingers."""

    one: Numbers
    other: Numbers
    closed: Bools
    apart: Bools
    hold: Bools

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True)
class Counts:
    """Of pairs of places that two fingers reach in a pose: how many are ``closed``, have room ``apart``, and ``hold``."""

    closed: int
    apart: int
    hold: int


def refuse_goal_pose(bound: RelocationBound) -> Refusal | None:
    """Return why no two fingers hold the object where its way ends; None where two may."""
    counts = _count_pairs(bound, bound.layers.last)
    return None if counts.hold else _refuse_pose(bound, bound.layers.last, counts)


def explain_missing_chain(bound: RelocationBound, starts: Sequence[Stand]) -> Refusal:
    """Return why there is no way from any of the stands ``starts`` in the first pose, as far as ``bound`` can tell."""
    last = bound.layers.last
    for layer in range(last + 1):
        if not (counts := _count_pairs(bound, layer)).hold:
            return _refuse_pose(bound, layer, counts)
    sides = label_sides(bound.places.normals, compute_pair_angle_max(bound.layers.hand.friction))
    begun = {int(sides[n]) for stand in starts for n in bound.number_stand(0, stand).values()}
    there = [_list_sides(bound, layer, sides) for layer in range(last + 1)]
    if begun and all(any(side not in on for on in there) for side in begun):
        return _refuse_change_of_sides(bound, sides, begun, there)
    return _refuse_exchange(bound)


def _tabulate(bound: RelocationBound, layer: int) -> Iterator[PairTables]:
    """Yield for every two fingers which places that both reach are force closed, apart besides, and hold besides."""
    places, R_WO = bound.places, bound.layers.poses[layer].X_WO[:3, :3]
    apart, closed, bearing = places.find_apart(), places.find_closed(), places.find_bearing(R_WO)
    for a, b in bound.pairs:
        one, other = (np.array(sorted(bound.within[layer][f]), dtype=np.intp) for f in (a, b))
        grid = np.ix_(one, other)
        has_room = closed[grid] & apart[a, b][grid]
        yield PairTables(one, other, closed[grid], has_room, has_room & bearing[grid])


def _count_pairs(bound: RelocationBound, layer: int) -> Counts:
    tables = list(_tabulate(bound, layer))
    return Counts(*(sum(int(getattr(t, name).sum()) for t in tables) for name in ("closed", "apart", "hold")))


def _list_sides(bound: RelocationBound, layer: int, sides: Numbers) -> set[int]:
    """Return on which sides two fingers hold the object in a pose."""
    return {
        int(side) for table in _tabulate(bound, layer) for side in sides[table.one[table.hold.any(axis=1)]]
    }


def label_sides(normals: Array, angle_max: float) -> Numbers:
    """Return which side (N,) of the body each of N contacts with outward ``normals`` (N, 3) is on.

    Two soft contacts are force closed where the line between them lies within ``angle_max`` [rad] of both normals
    (Nguyen 1988), so the normal of one lies within twice that of the opposite of the other's.  An exchange of fingers keeps one
    of two contacts that hold, and the new one holds with it [paper, Theorem 1]: pairs that follow from one another all lie on
    one side as it is meant here, which is two opposite faces of a cube, and all of a ball.
    """
    may_hold = -normals @ normals.T >= np.cos(min(2.0 * angle_max, np.pi))
    return np.asarray(connected_components(may_hold, directed=False)[1], dtype=np.intp)


def _refuse_pose(bound: RelocationBound, layer: int, counts: Counts) -> Refusal:
    """Return that no two fingers hold the object at a pose, and which of the conditions none of their pairs meets."""
    hand, where, lean = bound.layers.hand, _name_stop(bound, layer), np.degrees(bound.places.lean_max)
    regions = "widen object.allowed_regions, " if hand.object.allowed_regions else ""
    who = tuple(hand.fingers[f].name for f, rows in enumerate(bound.within[layer]) if not rows)
    if len(who) > len(hand.fingers) - 2:
        words = f"{where} {' and '.join(who)} reach no place on the object"
        return Refusal(RefusalKind.NO_PAIR, who, words=words)
    if not counts.closed:
        words = f"{where} no line between places that two fingers reach lies within {lean:.1f} deg of both normals"
        return Refusal(
            RefusalKind.NO_PAIR, words=words, cure=Cure(f"{regions}raise the friction, or move the object")
        )
    if not counts.apart:
        words = f"{where} the tips of two fingers on opposite places have no room beside each other"
        return Refusal(RefusalKind.NO_PAIR, words=words, cure=Cure("use smaller tips"))
    words = f"{where} none of {counts.apart} pairs of opposite places bears the object's weight within its friction cones"
    cure = Cure("raise the friction, lower friction.safety, or use a lighter object")
    return Refusal(RefusalKind.NO_PAIR, words=words, cure=cure)


def _refuse_change_of_sides(
    bound: RelocationBound, sides: Numbers, begun: set[int], there: list[set[int]]
) -> Refusal:
    """Return that fingers would have to change to another side of the body than the one they hold, which Theorem 1 excludes."""
    # The side that comes farthest is the one to tell of.
    ends = {side: next(k for k, on in enumerate(there) if side not in on) for side in begun}
    side = max(ends, key=lambda one: ends[one])
    where, own = _name_stop(bound, ends[side]), _name_sides(bound, sides, {side})
    others = _name_sides(bound, sides, there[ends[side]])
    lasting = set.intersection(*there) - begun
    words = (
        f"Theorem 1: a third finger that can hold with one of two contacts on {own} stands on {own} itself, "
        f"but {where} fingers can hold the object on {others} only"
    )
    if lasting:
        cure = Cure(f"begin on {_name_sides(bound, sides, lasting)}: {AUTO}")
    else:
        cure = Cure(
            "there are no sides that fingers hold all the way: raise the friction, or turn the object less"
        )
    return Refusal(RefusalKind.THEOREM_1, words=words, cure=cure)


def _refuse_exchange(bound: RelocationBound) -> Refusal:
    """Return that the exchanges of fingers that are missing cannot be made where the fingers reach."""
    lost = max((layer for layer in range(bound.layers.last + 1) if not bound.has_way(layer)), default=None)
    if lost is None:
        words = "from the start contacts no exchange of fingers leads on to the goal, whatever is in the way"
        return Refusal(RefusalKind.NO_CHAIN, words=words, cure=Cure(AUTO))
    words = f"{_name_stop(bound, lost)} no third finger has room where it would hold with one of two that must be let go later"
    cure = Cure("use smaller tips, raise the friction, or turn the object less")
    return Refusal(RefusalKind.NO_CHAIN, words=words, cure=cure)


def _name_stop(bound: RelocationBound, layer: int) -> str:
    """Return where on the way a pose is, in words."""
    if layer in (0, bound.layers.last):
        return "at the goal" if layer else "at the start"
    return f"after {100.0 * layer / bound.layers.last:.0f} % of the way"


def _name_sides(bound: RelocationBound, sides: Numbers, wanted: set[int]) -> str:
    """Return in words which plane parts of the body the ``wanted`` sides are; what is curved has no letter."""
    body, told = bound.layers.hand.object.body, []
    named = list(zip(name_flats(body), (flat.normal for flat in body.flats), strict=True))
    for side in sorted(wanted):
        normals = bound.places.normals[sides == side]
        on = [(letter, n) for letter, n in named if letter and (normals @ n).max() > 1.0 - ON_PLANE]
        is_flat = bool(on) and max(np.min([1.0 - normals @ n for _, n in on], axis=0)) <= ON_PLANE
        told.append(
            "faces " + " and ".join(letter + _name_axis(n) for letter, n in on)
            if is_flat
            else "the curved sides"
        )
    return ", or ".join(told)


def _name_axis(normal: Array) -> str:
    """Return the axis of the object that a normal (3,) is along, in brackets; nothing where it is along none."""
    axis = int(np.argmax(np.abs(normal)))
    return f" ({'-' if normal[axis] < 0 else '+'}{'xyz'[axis]})" if abs(normal[axis]) > 1.0 - ON_PLANE else ""
