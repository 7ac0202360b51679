"""What a body and its faces are called, in words that people read: one place, so that every page says the same."""

from __future__ import annotations

from string import ascii_uppercase

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import BallBody, CapsuleBody, EllipsoidBody

_NAMES: tuple[tuple[type[ConvexBody], str], ...] = (
    (BallBody, "ball"),
    (EllipsoidBody, "ellipsoid"),
    (CapsuleBody, "capsule"),
    (CylinderBody, "cylinder"),
    (BoxBody, "box"),
    (PolyhedronBody, "polyhedron"),
)

_ON_FACE = 1e-6
"""A point this near to a plane part, in units of the body's size, is on it."""


def name_body(body: ConvexBody | None) -> str:
    """Return what a body is called: ``ball``, ``box``; ``object`` for one of unknown shape."""
    return next((name for kind, name in _NAMES if isinstance(body, kind)), "object")


def name_place(body: ConvexBody, point: ArrayLike) -> str:
    """Return the letter of the plane part that a point (3,) [m] of the surface is on; empty where there is no letter."""
    away = np.asarray(point, dtype=np.float64)
    for flat, letter in zip(body.flats, name_flats(body), strict=True):
        offset = away - flat.center
        is_on = abs(offset @ flat.normal) < _ON_FACE * body.bound
        if is_on and np.linalg.norm(offset) <= flat.radius * (1.0 + _ON_FACE):
            return letter
    return ""


def name_flats(body: ConvexBody) -> tuple[str, ...]:
    """Return the letters of a body's plane parts, in the order of ``body.flats``; of more than the alphabet has, none."""
    count = len(body.flats)
    return tuple(ascii_uppercase[:count]) if count <= len(ascii_uppercase) else ("",) * count
