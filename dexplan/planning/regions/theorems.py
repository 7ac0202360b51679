"""The paper's theorems on finger gaits as code: each answers with witnesses or with the reason in words.

*Theorem 1* [paper §2.2] is **necessary**: where it fails no gait is possible; where it holds, nothing is promised.
*Theory 3* [paper §3] is **sufficient** for a sphere: where it holds, rewinds exist; where it fails, they may exist all the same.
Neither is ever used the other way round, and the texts say so.  Theory 3 speaks of fingertips as points: it knows no thickness
of tips and no other clearance, so where it holds a rewind of real fingers may still find no room.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from dexplan.brief import brief_repr
from dexplan.errors import spell_apart
from dexplan.icosphere import measure_angle
from dexplan.planning.regions.regions import Regions
from dexplan.planning.regions.spherical import SphericalRegion
from dexplan.spatial import Array, lock_arrays, read_only

_CANDIDATES = 24
_NEARLY = float(np.radians(0.5))
"""Pairs whose angles differ by less are told apart by how deep they lie in their regions [rad]."""


@dataclass(frozen=True, eq=False)
class GaitCondition:
    """Answer to Theorem 1, the necessary condition for a gait.

    Where ``is_met``, finger ``k`` can hold with finger ``keeper`` where that one is, by touching at ``witness_O`` (3,), an
    outward normal in object axes; so the other holding finger may be lifted.  ``margin`` [rad]: how far ``witness_O`` and the
    keeper's contact are beyond the smallest closed angle, negative where it is not met.  ``reason`` says why not, "" otherwise.
    """

    is_met: bool
    fingers: tuple[int, int, int]
    margin: float
    reason: str
    keeper: int | None = None
    witness_O: Array | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def check_theorem_1(
    regions: Regions, i: int, j: int, k: int, x_i_O: ArrayLike, x_j_O: ArrayLike
) -> GaitCondition:
    """Check the paper's Theorem 1 for fingers i, j that hold at the normals ``x_i_O``, ``x_j_O`` (3,) and a free finger k.

    Necessary for using a gait to form a new grasp: f_i lies in CWS_i_jk or f_j in CWS_j_ik [paper §2.2].  Fingers i and j hold
    each other where they are (the theorem's premise), so what is asked is whether k can hold with one of them there: -x within
    2 theta of CWS_k, exactly.  A met condition promises no gait: postures, loads and clearances are for the planner to check.

    Raises ValueError where the premise does not hold: fingers that are not three, contacts of i and j not force closed.
    """
    if len({i, j, k}) < 3:
        raise ValueError(f"fingers are {i}, {j}, {k}; three different ones are accepted")
    x = np.stack([_unit(x_i_O), _unit(x_j_O)])
    held = measure_angle(x[0], x[1])
    if held < regions.phi_min - 1e-9:
        given, needed = spell_apart(float(np.degrees(held)), float(np.degrees(regions.phi_min)))
        raise ValueError(
            f"fingers {i + 1} and {j + 1} touch {given} deg apart and do not hold each other; {needed} deg or more are accepted"
        )
    region = regions.contactable[k]
    points, distance = region.level.measure_distance(-x @ region.R_GO.T, 2.0 * regions.theta)
    margins = 2.0 * regions.theta - distance
    best = int(np.argmax(margins))
    if margins[best] >= 0.0:
        witness = read_only(points[best] @ region.R_GO)
        return GaitCondition(True, (i, j, k), float(margins[best]), "", (i, j)[best], witness)
    reach = (
        f"finger {k + 1} can touch the object nowhere"
        if distance[best] > np.pi
        else f"it would have to touch {np.degrees(-margins[best]):.1f} deg beyond its region"
    )
    return GaitCondition(
        False,
        (i, j, k),
        float(margins[best]),
        f"Theorem 1: finger {k + 1} can form a force-closure grasp with neither finger {i + 1} nor finger {j + 1} "
        f"where they are ({reach}), so neither can be lifted; roll them first",
    )


@dataclass(frozen=True, eq=False)
class RewindCondition:
    """Answer to Theory 3, the sufficient condition for rewinds on a sphere.

    Where ``is_met``, ``x_O`` in CWS_i_jk and ``y_O`` in CWS_j_ik (3,), outward normals in object axes, are the pair with the
    largest ``margin`` [rad]: their central angle beyond the smallest closed one, the same as dist(x, y) > 2 r cos(theta).  Where
    it is not, ``reason`` says what is missing; rewinds may exist all the same.  A met condition speaks of tips that are points.
    """

    is_met: bool
    fingers: tuple[int, int, int]
    margin: float
    reason: str
    x_O: Array | None = None
    y_O: Array | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


_MAYBE = "; the condition is sufficient only, rewinds may exist all the same"


def check_theory_3(regions: Regions, i: int, j: int, k: int) -> RewindCondition:
    """Check the paper's Theory 3 for fingers i, j that hold a sphere and a free finger k.

    Sufficient for fingers i and j to be rewound: CWS_i_jk and CWS_j_ik are not empty and hold points x, y with
    dist(x, y) > 2 r cos(theta) [paper §3].  Whether the witnesses lie in their regions is settled exactly; regions smaller than
    the grid's triangles count as empty, which errs on the side of a sufficient condition.

    Tips count as points: their thickness and every other clearance (of links, the other fingers, obstacles), loads too, are for
    the planner to check, so where the condition holds a rewind may still find no room.
    """
    if len({i, j, k}) < 3:
        raise ValueError(f"fingers are {i}, {j}, {k}; three different ones are accepted")
    fingers = (i, j, k)
    one, two = regions.double(i, j, k), regions.double(j, i, k)
    for region, own, others in ((one, i, (j, k)), (two, j, (i, k))):
        if region.is_empty:
            return RewindCondition(
                False,
                fingers,
                -np.pi,
                f"Theory 3: {region.name} is empty, finger {own + 1} can nowhere hold with both finger {others[0] + 1} "
                f"and finger {others[1] + 1}{_MAYBE}",
            )
    widest = _find_widest(one, two)
    margin = widest.angle - regions.phi_min
    if margin <= 0.0:
        farthest, needed = spell_apart(np.degrees(widest.angle), np.degrees(regions.phi_min))
        return RewindCondition(
            False,
            fingers,
            margin,
            f"Theory 3: no point of {one.name} is farther than {farthest} deg from one of {two.name}, "
            f"more than {needed} deg are needed{_MAYBE}",
        )
    return RewindCondition(True, fingers, margin, "", widest.x, widest.y)


@dataclass(frozen=True, eq=False)
class _WidePair:
    """A point of each of two regions (3,), object axes, and the central ``angle`` [rad] between them; 0 where none was found."""

    x: Array
    y: Array
    angle: float

    def __post_init__(self) -> None:
        lock_arrays(self)


def _find_widest(one: SphericalRegion, two: SphericalRegion) -> _WidePair:
    """Return x in ``one`` and y in ``two``, both exactly inside, with the largest central angle.

    Where several are nearly as wide, the pair deepest inside.  The angle is 0 where no candidate proves to lie inside.
    """
    a, b = _sample(one), _sample(two)
    # The widest pair of two sets is the nearest pair of one set and the other's opposite.
    distance, partner = cKDTree(-b[0]).query(a[0])
    depth = np.minimum(a[1], b[1][partner])
    near = 2.0 * np.arcsin(np.minimum(0.5 * distance, 1.0))
    rank = np.round((near - near.min()) / _NEARLY)
    order = np.lexsort((-depth, rank))[:_CANDIDATES]
    # Borders lie between grid points: what counts is what proves to be inside.
    x, y = a[0][order], b[0][partner[order]]
    good = np.flatnonzero(one.contains(x) & two.contains(y))
    if not len(good):
        return _WidePair(x[0], y[0], 0.0)
    best = good[0]
    return _WidePair(x[best], y[best], float(measure_angle(x[best], y[best])))


def _sample(region: SphericalRegion) -> tuple[Array, Array]:
    """Return directions (N, 3) inside a region, in object axes, and their margins (N,): grid points, and points at its border."""
    level, grid = region.level, region.level.grid
    inside = region.mask
    ends = np.sort(grid.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends = ends[inside[ends[:, 0]] != inside[ends[:, 1]]]
    a, b = np.where(inside[ends[:, :1]], ends, ends[:, ::-1]).T
    # Nearly as far as the border, as interpolated.
    share = 0.97 * level.values[a] / (level.values[a] - level.values[b])
    edge = grid.vertices[a] + share[:, None] * (grid.vertices[b] - grid.vertices[a])
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    values = np.concatenate([level.values[inside], 0.03 * level.values[a]])
    return np.concatenate([grid.vertices[inside], edge]) @ region.R_GO, values


@dataclass(frozen=True, eq=False)
class RewindAlong:
    """Whether fingers i and j can be rewound all along a motion, by Theory 3's conclusion.

    ``margin`` (T, 2) [rad] says how far the contacts of i and j lie inside CWS_i_jk and CWS_j_ik at every sample.  Where not
    ``is_assured``, ``first`` is the sample at which the condition first fails and ``reason`` tells how; from there on rewinds
    may exist all the same.
    """

    is_assured: bool
    fingers: tuple[int, int, int]
    margin: Array
    reason: str
    first: int | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def check_rewind_along(
    regions_at: Callable[[Array], Regions],
    X_WO: Array,
    i: int,
    j: int,
    k: int,
    x_i_O: ArrayLike,
    x_j_O: ArrayLike,
) -> RewindAlong:
    """Check Theory 3's conclusion along a motion: fingers i, j stay in their double regions while the sphere moves [paper §3].

    ``X_WO`` (T, 4, 4) are the sphere's poses at the samples, ``x_i_O``, ``x_j_O`` (3,) or (T, 3) the outward contact normals in
    object axes; ``regions_at`` gives the regions at a pose, for example ``partial(compute_regions, hand)``.  Positions are told
    apart to 0.1 um; the regions of one position are asked about all its samples at once.
    """
    X_WO = np.asarray(X_WO, dtype=np.float64)
    count = len(X_WO)
    fingers, names = (i, j, k), (f"finger {i + 1}", f"finger {j + 1}")
    contacts = [np.broadcast_to(_unit(x), (count, 3)) for x in (x_i_O, x_j_O)]
    margin = np.full((count, 2), np.nan)
    lacks: dict[int, str] = {}
    _, first_of, place = np.unique(
        np.round(X_WO[:, :3, 3], 7), axis=0, return_inverse=True, return_index=True
    )
    for p, start in enumerate(first_of):
        rows = np.flatnonzero(place == p)
        regions = regions_at(X_WO[start])
        condition = check_theory_3(regions, i, j, k)
        if not condition.is_met:
            lacks[int(rows[0])] = condition.reason
        R_OW = X_WO[start, :3, :3].T
        turns = R_OW @ X_WO[rows, :3, :3]  # a contact at a sample, told in the axes of the first pose
        for f, region in enumerate((regions.double(i, j, k), regions.double(j, i, k))):
            margin[rows, f] = region.compute_margin(np.einsum("tab,tb->ta", turns, contacts[f][rows]))
    left = np.flatnonzero((margin < 0.0).any(axis=1))
    first = min([*lacks, *left[:1].tolist()], default=None)
    if first is None:
        return RewindAlong(True, fingers, read_only(margin), "")
    if first in lacks:
        return RewindAlong(False, fingers, read_only(margin), lacks[first], first)
    who = [n for n, m in zip(names, margin[first], strict=True) if m < 0.0]
    reason = (
        f"Theory 3: {' and '.join(who)} leave{'s' if len(who) == 1 else ''} the double force-closure region "
        f"at sample {first} of {count}{_MAYBE}"
    )
    return RewindAlong(False, fingers, read_only(margin), reason, first)


def _unit(x: ArrayLike) -> Array:
    """Return ``x`` (..., 3) with unit length.  Raises ValueError for a zero vector."""
    d = np.asarray(x, dtype=np.float64)
    length = np.linalg.norm(d, axis=-1, keepdims=True)
    if np.any(length == 0.0):
        raise ValueError("a contact direction is zero; an outward normal is accepted")
    return d / length
