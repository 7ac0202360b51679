"""Patterns on bodies other than balls: faces with tints and letters, lines on what is round, and the arrow that every object has.

Numpy alone; a pattern is a colour for every point of the surface.  The arrow runs in the plane y = 0 from where the z axis leaves
the body down its +x side, its head in the middle of that side: it looks the same after a whole turn only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.contact.bodies.body import ConvexBody, Flat
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.sites import EDGE_BAND
from dexplan.contact.bodies.smooth import BallBody
from dexplan.icosphere import build_icosphere
from dexplan.spatial import Array, rotate_about
from dexplan.viz.skins import GRID, IVORY, SHADE, STRIPE

TINTS = (IVORY, SHADE, (190, 213, 236), (150, 180, 210), (206, 226, 178), (170, 194, 138))
"""Of faces, in the order of ``body.flats``: opposite faces of a box have a light and a dark tint of one hue, no finger's."""
EDGE_INK = (96, 90, 78)
"""Of edges."""
BAND_INK = (196, 92, 60)
"""Of the line so far from edges as contacts keep from them."""
THIN = 0.014
"""Half width of a thin line, as a share of the body's :func:`measure_slenderness`, as all that follows."""
BAND, HEAD_TIP, HEAD_END, HEAD_WIDTH = 0.08, -0.24, 0.21, 0.27
"""Half width of the arrow; height of its head's point and of its broad end, half width there."""
LETTER = 0.8
"""Height of a letter as a share of how far its middle is from the face's nearest edge."""
LEAST_LETTER = 0.22
"""A smaller letter is left out."""
RING_STEP = 0.5
"""Between rings around what is round."""
SPAN = np.radians(86.0)
"""The ghost of the arrow begins so far from the middle of the +x side, seen from the centre with the body stretched to a ball."""


@dataclass(frozen=True)
class Letter:
    """A letter on a face: where its middle is (3,) [m], what is right and up for its reader (3,), and how tall it is [m]."""

    text: str
    middle: Array
    right: Array
    up: Array
    height: float


def measure_slenderness(body: ConvexBody) -> float:
    """Return how far [m] the surface is from the origin along the nearest of the body's axes: the scale of its pattern."""
    axes = np.vstack([np.eye(3), -np.eye(3)])
    return float(np.linalg.norm(body.radial(axes), axis=1).min())


def place_letter(body: ConvexBody, flat: Flat, text: str) -> Letter | None:
    """Return the letter of a face beside the arrow, if that runs over the face; None where there is no room for one."""
    up = np.array([0.0, 0.0, 1.0]) if abs(flat.normal[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    up = up - (up @ flat.normal) * flat.normal
    up /= np.linalg.norm(up)
    right, scale = np.cross(up, flat.normal), measure_slenderness(body)
    middle = flat.center
    room = min(float(body.measure_edge_distance(middle)), flat.radius)
    above = (trace_arrow(body, 0.0)[0] - flat.center) @ flat.normal
    if np.any(np.abs(above) < 1e-6 * body.bound):
        aside = np.array([0.0, 1.0, 0.0]) - flat.normal[1] * flat.normal
        aside /= np.linalg.norm(aside)
        middle = middle + (0.5 * (room + HEAD_WIDTH * scale) - float(middle[1])) * aside
        room = 0.5 * (room - HEAD_WIDTH * scale)
    height = min(2.0 * LETTER * room, scale)
    return Letter(text, middle, right, up, height) if text and height >= LEAST_LETTER * scale else None


def paint_flat(body: ConvexBody, k: int, points: Array, letter: Letter | None, ink: Array) -> Array:
    """Return the colours (..., 3) [0 .. 255] of points (..., 3) [m] on plane part ``k``.

    ``ink`` (h, w) says how much of each pixel of a picture as high as the letter the letter covers [0 .. 1].
    """
    color = np.broadcast_to(np.array(TINTS[k % len(TINTS)], dtype=float), points.shape).copy()
    if letter is not None:
        away = points - letter.middle
        size = letter.height / ink.shape[0]
        column = np.round(away @ letter.right / size + 0.5 * ink.shape[1] - 0.5).astype(int)
        row = np.round(-(away @ letter.up) / size + 0.5 * ink.shape[0] - 0.5).astype(int)
        is_on = (row >= 0) & (row < ink.shape[0]) & (column >= 0) & (column < ink.shape[1])
        share = np.where(is_on, ink[row * is_on, column * is_on], 0.0)[..., None]
        color += share * (np.array(STRIPE) - color)
    _mark_edges(body, points, color)
    color[is_on_arrow(body, points)] = STRIPE
    return color


def paint_round(body: ConvexBody, points: Array, azimuth: Array) -> Array:
    """Return the colours (..., 3) [0 .. 255] of points (..., 3) [m] on what is round; ``azimuth`` (...) [rad] about z."""
    scale, z = measure_slenderness(body), points[..., 2]
    color = np.where((z > 0.0)[..., None], np.array(IVORY, dtype=float), np.array(SHADE, dtype=float))
    step = np.radians(30.0)
    off = np.abs((azimuth + 0.5 * step) % step - 0.5 * step) * np.linalg.norm(points[..., :2], axis=-1)
    between = RING_STEP * scale
    rings = np.abs((z + 0.5 * between) % between - 0.5 * between)
    color[(off < THIN * scale) | (rings < THIN * scale)] = GRID
    _mark_edges(body, points, color)
    color[is_on_arrow(body, points)] = STRIPE
    return color


def has_edges(body: ConvexBody | None) -> bool:
    """Return whether a body has sharp edges."""
    if body is None:
        return False
    return bool(np.isfinite(body.measure_edge_distance(body.radial(build_icosphere(2).vertices))).any())


def _mark_edges(body: ConvexBody, points: Array, color: Array) -> None:
    """Paint edges, and the line beyond which the planner makes no contacts, over the ``color`` of points (..., 3) [m]."""
    away, half = body.measure_edge_distance(points), THIN * measure_slenderness(body)
    color[np.abs(away - EDGE_BAND) < 0.7 * half] = BAND_INK
    color[away < 1.6 * half] = EDGE_INK


def is_on_arrow(body: ConvexBody, points: Array) -> Array:
    """Return which points (...,) of the surface (..., 3) [m] the arrow covers."""
    x, y, z = np.moveaxis(points, -1, 0) / measure_slenderness(body)
    beside = np.abs(y)
    head = HEAD_WIDTH * (z - HEAD_TIP) / (HEAD_END - HEAD_TIP)
    is_head = (z > HEAD_TIP) & (z < HEAD_END) & (beside < head)
    is_shaft = (z >= HEAD_END) & (beside < BAND)
    return np.asarray((x > -BAND) & (is_head | is_shaft))


def trace_arrow(body: ConvexBody, raised: float) -> tuple[Array, ...]:
    """Return the arrow as lines (N, 3) [m]: its shaft, then both sides of its head.

    They are ``raised`` [m] above the surface, on a polyhedron a little less.
    """
    if isinstance(body, BallBody):
        return _trace_on_ball(body.radius + raised)
    scale = measure_slenderness(body)
    stretch = np.linalg.norm(body.radial([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), axis=1)
    angles = np.linspace(SPAN, np.radians(-40.0), 120)
    directions = np.stack([stretch[0] * np.cos(angles), 0.0 * angles, stretch[1] * np.sin(angles)], axis=1)
    shaft = _raise(body, body.radial(directions), raised)
    shaft = shaft[shaft[:, 2] > HEAD_TIP * scale]
    wings = []
    for side in (-1.0, 1.0):
        end = shaft[-1] + scale * np.array([0.0, side * HEAD_WIDTH, HEAD_END - HEAD_TIP])
        wings.append(np.stack([shaft[-1], _raise(body, body.project(end).point[None], raised)[0]]))
    return (shaft, *wings)


def _trace_on_ball(reach: float) -> tuple[Array, ...]:
    elevations = np.linspace(SPAN, np.radians(-14.0), 14)
    arc = reach * np.stack([np.cos(elevations), 0.0 * elevations, np.sin(elevations)], axis=1)
    wings = []
    for side in (-1.0, 1.0):
        wing = arc[-1] @ rotate_about([0.0, 0.0, 1.0], side * np.radians(14.0)).T
        wing[2] += reach * np.sin(np.radians(16.0))
        wings.append(np.stack([arc[-1], wing * (reach / np.linalg.norm(wing))]))
    return (arc, *wings)


def _raise(body: ConvexBody, points: Array, raised: float) -> Array:
    if isinstance(body, PolyhedronBody):
        # From face to face normals jump, and a line over many faces would, too.
        return np.asarray(points * (1.0 + raised / np.linalg.norm(points, axis=-1, keepdims=True)))
    return np.asarray(points + raised * body.normal_at(points))
