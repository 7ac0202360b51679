"""The coat of a body: a mesh that lies on its surface and a picture on it, of pieces: one per face, one for what is round.

MuJoCo can stretch a picture over a box or an ellipsoid, but not over a capsule or a mesh so that it stays where it was painted;
a mesh that carries its own picture coordinates it draws as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody, Flat
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.names import name_flats
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import CapsuleBody, EllipsoidBody
from dexplan.spatial import Array, build_frame, lock_arrays
from dexplan.viz.pattern import paint_flat, paint_round, place_letter
from dexplan.viz.sketch import measure_text, paint_text

AROUND, ALONG = 64, 12
"""Corners of the mesh around what is round, and on a quarter of a circle along it."""
LARGEST, LEAST_CELL = 1024, 64
"""Side of the picture at most, and of a piece's square in it at least [texels]."""
FRINGE = 4
"""Texels of a piece's square beyond the piece on each side: seen from far, neighbouring texels run together."""
LETTER_SIZE = 80


@dataclass(frozen=True, eq=False)
class Coat:
    """The mesh of a body, or of a part of it: corners (V, 3) [m], outward ``normals`` (V, 3), ``triangles`` (T, 3), places (V, 2)
    in the unit square of its picture, from the upper left corner, and that picture (n, n, 3).
    """

    corners: Array
    normals: Array
    triangles: NDArray[np.intp]
    places: Array
    picture: NDArray[np.uint8]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def build_coat(body: ConvexBody) -> Coat:
    """Return the coat of a body that is no ball."""
    profiles = _list_profiles(body)
    outlines = [find_outline(body, k) for k in range(len(body.flats))]
    count = len(profiles) + len(outlines)
    columns = int(np.ceil(np.sqrt(count)))
    # Rows of pictures are read four bytes at a time.
    cell = max(LEAST_CELL, 4 * (LARGEST // (4 * max(columns, 2))))
    pieces = [_cover_round(body, profile, cell) for profile in profiles]
    letters = name_flats(body)
    pieces += [_cover_flat(body, k, outline, letters[k], cell) for k, outline in enumerate(outlines)]
    return _sew(pieces, columns, cell)


def _sew(pieces: Sequence[Coat], columns: int, cell: int) -> Coat:
    side = columns * cell
    picture = np.zeros((side, side, 3), dtype=np.uint8)
    places, triangles, first = [], [], 0
    for k, piece in enumerate(pieces):
        row, column = divmod(k, columns)
        picture[row * cell : (row + 1) * cell, column * cell : (column + 1) * cell] = piece.picture
        # The piece itself ends before its square does.
        inner = FRINGE + piece.places * (cell - 2 * FRINGE)
        places.append((inner + np.array([column * cell, row * cell])) / side)
        triangles.append(piece.triangles + first)
        first += len(piece.corners)
    return Coat(
        np.concatenate([piece.corners for piece in pieces]),
        np.concatenate([piece.normals for piece in pieces]),
        np.concatenate(triangles),
        np.concatenate(places),
        picture,
    )


def _list_texels(cell: int) -> tuple[Array, Array]:
    """Return where the texels of a square lie in the piece: 0 .. 1 across and down, a little beyond at its fringe."""
    at = (np.arange(cell) + 0.5 - FRINGE) / (cell - 2 * FRINGE)
    across, down = np.meshgrid(at, at)
    return across, down


# -- faces -------------------------------------------------------------------------------------------------------------------


def find_outline(body: ConvexBody, k: int) -> Array:
    """Return the corners (V, 3) [m] of plane part ``k``, counterclockwise seen from outside."""
    flat = body.flats[k]
    axes = build_frame(flat.normal)
    if isinstance(body, BoxBody):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        corners = signs * body.half_sizes
    elif isinstance(body, PolyhedronBody):
        corners = body.hull
    else:
        angles = np.arange(AROUND) * 2.0 * pi / AROUND
        corners = flat.center + flat.radius * (
            np.outer(np.cos(angles), axes[:, 0]) + np.outer(np.sin(angles), axes[:, 1])
        )
    height = (corners - flat.center) @ flat.normal
    corners = corners[np.abs(height) < 1e-6 * body.bound]
    flat_2d = (corners - flat.center) @ axes[:, :2]
    return np.asarray(corners[ConvexHull(flat_2d).vertices])


def _cover_flat(body: ConvexBody, k: int, outline: Array, text: str, cell: int) -> Coat:
    flat: Flat = body.flats[k]
    axes = build_frame(flat.normal)
    plane = (outline - flat.center) @ axes[:, :2]
    low = plane.min(axis=0)
    span = float((plane.max(axis=0) - low).max())
    across, down = _list_texels(cell)
    at = low + span * np.stack([across, down], axis=-1)
    points = flat.center + at @ axes[:, :2].T
    letter = place_letter(body, flat, text)
    colors = paint_flat(body, k, points, letter, _paint_letter(text))
    fan = np.arange(1, len(outline) - 1)
    triangles = np.stack([0 * fan, fan, fan + 1], axis=1)
    normals = np.broadcast_to(flat.normal, outline.shape)
    return Coat(outline, normals, triangles, (plane - low) / span, _as_texels(colors))


def _paint_letter(text: str) -> Array:
    """Return how much a letter covers each pixel of a picture (h, w) that is as high as the letter; one empty pixel for none."""
    if not text or measure_text(text, LETTER_SIZE) <= 0.0:
        return np.zeros((1, 1))
    ink = paint_text(text, LETTER_SIZE, True)
    rows = np.flatnonzero(ink.max(axis=1) > 0.5)
    columns = np.flatnonzero(ink.max(axis=0) > 0.5)
    return np.asarray(ink[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1], dtype=float)


# -- what is round -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Profile:
    """A surface around the z axis: (K, 2) distances from the axis and heights, upwards; circles stretched by ``a``, ``b``."""

    line: Array
    a: float = 1.0
    b: float = 1.0


def _list_profiles(body: ConvexBody) -> list[_Profile]:
    quarter = np.linspace(0.0, 0.5 * pi, ALONG + 1)
    arc = np.stack([np.cos(quarter), np.sin(quarter)], axis=1)
    if isinstance(body, EllipsoidBody):
        half = arc * [1.0, body.c]
        return [_Profile(np.vstack([half[:0:-1] * [1.0, -1.0], half]), body.a, body.b)]
    if isinstance(body, CapsuleBody):
        half = body.radius * arc + [0.0, body.half_length]
    elif isinstance(body, CylinderBody):
        core = np.array([body.radius - body.rim, body.half_length - body.rim])
        half = core + body.rim * arc if body.rim > 0.0 else core[None]
    else:
        return []
    return [_Profile(np.vstack([half[::-1] * [1.0, -1.0], half]))]


def _cover_round(body: ConvexBody, profile: _Profile, cell: int) -> Coat:
    line = profile.line
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    share = lengths / lengths[-1]

    def place(around: Array, upwards: Array) -> tuple[Array, Array]:
        """Return points (..., 3) and their azimuths for shares of a turn and of the profile."""
        angle = 2.0 * pi * around
        distance, z = (np.interp(upwards, share, line[:, k]) for k in (0, 1))
        x, y = profile.a * distance * np.cos(angle), profile.b * distance * np.sin(angle)
        return np.stack([x, y, z], axis=-1), angle

    across, down = _list_texels(cell)
    points, azimuth = place(across, (1.0 - down).clip(0.0, 1.0))
    colors = paint_round(body, points, azimuth)
    turns, levels = np.meshgrid(np.linspace(0.0, 1.0, AROUND + 1), share)
    corners = place(turns, levels)[0].reshape(-1, 3)
    n = AROUND + 1
    k, j = np.meshgrid(np.arange(len(share) - 1), np.arange(AROUND), indexing="ij")
    first = (k * n + j).ravel()
    triangles = np.concatenate(
        [
            np.stack([first, first + 1, first + n + 1], axis=1),
            np.stack([first, first + n + 1, first + n], axis=1),
        ]
    )
    # Where a profile ends on the axis a row of triangles has no area.
    area = np.linalg.norm(
        np.cross(
            corners[triangles[:, 1]] - corners[triangles[:, 0]],
            corners[triangles[:, 2]] - corners[triangles[:, 0]],
        ),
        axis=1,
    )
    triangles = triangles[area > 1e-9 * body.bound**2]
    # Half a hair inside the rows of a sharp rim, whose corners belong to two faces.
    normals = body.normal_at(corners * [1.0, 1.0, 1.0 - 1e-3])
    places = np.stack([turns.ravel(), 1.0 - levels.ravel()], axis=1)
    return Coat(corners, normals, triangles, places, _as_texels(colors))


def _as_texels(colors: Array) -> NDArray[np.uint8]:
    return np.asarray(colors.round().clip(0, 255), dtype=np.uint8)
