"""Do the contacts that a problem gives make sense on its object?  Places on its surface, off its edges, not in one another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.sites import EDGE_BAND
from dexplan.contact.bodies.smooth import BallBody
from dexplan.errors import ProblemError
from dexplan.problems.rules import AZIMUTH, ELEVATION, spell
from dexplan.problems.sections import (
    ContactPoint,
    ContactSpec,
    ProblemFields,
    compute_contact_directions,
)
from dexplan.problems.shapes import build_shape
from dexplan.spatial import Array

SURFACE_TOLERANCE = 0.01
"""A ``point_m`` contact may miss the object's surface by this part of its radius, or of what corresponds to it."""


def check_contacts(problem: ProblemFields, contacts: tuple[ContactSpec, ...], key: str, source: str) -> None:
    """Check one entry per finger, two or more touching, each one a place on the object."""
    if len(contacts) != problem.hand.finger_count:
        accepted = f"accepted: {problem.hand.finger_count} entries, one per finger"
        raise ProblemError(source, key, f"has {len(contacts)} entries", accepted)
    touching = sum(contact != "free" for contact in contacts)
    if touching < 2:
        raise ProblemError(
            source, key, f"only {touching} finger(s) touch", "accepted: two or more that are not free"
        )
    body = build_shape(problem.object).as_body()
    for index, contact in enumerate(contacts):
        where = f"{key}[{index}]"
        if isinstance(contact, ContactPoint):
            _check_point(body, contact.point_m, f"{where}.point_m", source)
        elif contact != "free":
            _check_direction(contact, where, source)
    # On a ball there is no edge, and the planner says of contacts that are too near which would do.
    if not isinstance(body, BallBody):
        _check_edges(body, contacts, key, source)
        _check_tips(problem, body, key, source, contacts)


class _Touched(NamedTuple):
    """Where finger number ``finger`` touches the object: ``point`` (3,) [m] and outward ``normal`` (3,)."""

    finger: int
    point: Array
    normal: Array


def _find_touched(body: ConvexBody, contacts: tuple[ContactSpec, ...]) -> Iterator[_Touched]:
    for finger, direction in enumerate(compute_contact_directions(contacts)):
        if direction is not None:
            point = body.radial(direction)
            yield _Touched(finger, point, body.normal_at(point))


def _check_direction(contact: tuple[float, float], where: str, source: str) -> None:
    for place, value, bounds in (("azimuth", contact[0], AZIMUTH), ("elevation", contact[1], ELEVATION)):
        if not bounds.accepts(value):
            raise ProblemError(
                source, where, f"{place} {spell(value)} is out of range", f"accepted: {bounds}"
            )


def _check_point(body: ConvexBody, point: tuple[float, float, float], key: str, source: str) -> None:
    found = body.project(point)
    off = float(found.distance)
    if abs(off) <= SURFACE_TOLERANCE * body.bound:
        return
    if isinstance(body, BallBody):
        fact = f"{spell(list(point))} lies {math.hypot(*point):.6g} m from the object's centre"
        raise ProblemError(source, key, fact, f"accepted: a point of its surface, at {body.radius:g} m")
    fact = f"{spell(list(point))} lies {1e3 * abs(off):.3g} mm {'outside' if off > 0.0 else 'inside'} the object's surface"
    raise ProblemError(
        source, key, fact, f"accepted: a point of it, the nearest is {_spell_point(found.point)}"
    )


def _check_edges(body: ConvexBody, contacts: tuple[ContactSpec, ...], key: str, source: str) -> None:
    for touched in _find_touched(body, contacts):
        distance = float(body.measure_edge_distance(touched.point))
        if distance < EDGE_BAND:
            fact = f"{_spell_point(touched.point)} is {1e3 * distance:.2g} mm from an edge of the object"
            accepted = f"accepted: a contact {1e3 * EDGE_BAND:g} mm or more from every edge"
            raise ProblemError(source, f"{key}[{touched.finger}]", fact, accepted)


def _check_tips(
    problem: ProblemFields, body: ConvexBody, key: str, source: str, contacts: tuple[ContactSpec, ...]
) -> None:
    """Refuse tips that would stand in one another; how far apart more than that they have to be is the planner's to say."""
    radii = problem.hand.tip_radii_m
    touched = list(_find_touched(body, contacts))
    centers = [one.point + radii[one.finger] * one.normal for one in touched]
    for j in range(len(touched)):
        for i in range(j):
            a, b = touched[i].finger, touched[j].finger
            apart, least = math.dist(centers[i], centers[j]), radii[a] + radii[b]
            if apart < least:
                fact = f"the tips of fingers {a + 1} and {b + 1} would overlap: their centres are {1e3 * apart:.3g} mm apart"
                accepted = f"accepted: more than {1e3 * least:g} mm, the sum of their radii"
                raise ProblemError(source, key, fact, accepted)


def _spell_point(point: Array) -> str:
    return f"[{', '.join(f'{x:.4g}' for x in point)}]"
