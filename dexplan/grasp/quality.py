"""How good a grasp is: numbers that rank grasps which hold, and the paper's preference for those close to a pair.

A planner trades these off; :func:`compute_quality` gathers them in one value.  What the hand knows (distance to the
borders of its joints and workspaces) comes in as plain numbers: statics does not look at hands.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.friction import NORMAL
from dexplan.grasp.closure import check_antipodal, check_force_closure, compute_load_margin
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.spatial import Array

_SAMPLES = 2048  # directions that are looked at, with their opposites, before the lowest are followed
_APART = float(np.cos(np.radians(20.0)))  # directions to follow are at least this far from one another
_ROUNDING = 0.1 ** np.arange(1.0, 9.5)  # radii, relative to the largest gain, that round the kinks off
_STEPS = 5  # of Newton's method per radius
_SHARES = 0.5 ** np.arange(10)
_LONGEST = 0.3  # step [rad]


@dataclass(frozen=True)
class GraspQuality:
    """Quality terms of one grasp; more is better but for ``pair_lack``.

    closure_margin: normal force to spare per newton of squeeze [N/N]; positive for a force-closed grasp.
    load_margin: the same while the load is carried at the stated squeeze [N/N].
    ferrari_canny: radius [N] of the ball of wrenches that unit normal forces resist; 0 without force closure.
    singular_value_min: smallest singular value of G, torques over the length [-].
    pair_lack: friction angle [rad] that the best pair lacks to hold the object alone; 0 where one can.
    joint_margin: least distance of any joint to its limit [rad]; NaN if not given.
    workspace_margin: least distance of any finger to the border of its workspace, in the caller's unit; NaN if not given.
    """

    closure_margin: float
    load_margin: float
    ferrari_canny: float
    singular_value_min: float
    pair_lack: float
    joint_margin: float = float("nan")
    workspace_margin: float = float("nan")


def compute_quality(
    grasp: Grasp,
    length: float,
    wrench: ArrayLike,
    mean_normal: float,
    joint_margin: ArrayLike | None = None,
    workspace_margin: ArrayLike | None = None,
) -> GraspQuality:
    """Compute all quality terms of a grasp.

    Args:
        grasp: the contacts.
        length: length [m] by which torques are divided: the radius of a sphere.
        wrench: (6,) [N, N m] to exert on the object about its origin, in object axes.
        mean_normal: mean normal force [N] at which it is exerted.
        joint_margin: distances [rad] of the fingers' joints to their limits, of any shape; the least counts.
        workspace_margin: distances of the fingers to the borders of their workspaces, of any shape; the least counts.

    Raises ValueError as :func:`~dexplan.grasp.closure.compute_load_margin` does, and for a length that is not positive.
    """
    return GraspQuality(
        closure_margin=check_force_closure(grasp).margin,
        load_margin=compute_load_margin(grasp, wrench, mean_normal).margin,
        ferrari_canny=compute_ferrari_canny(grasp, length),
        singular_value_min=compute_singular_value_min(grasp, length),
        pair_lack=compute_pair_lack(grasp),
        joint_margin=_least(joint_margin),
        workspace_margin=_least(workspace_margin),
    )


def compute_singular_value_min(grasp: Grasp, length: float = 1.0) -> float:
    """Return the smallest of the six singular values of G, torques divided by ``length`` [m].

    Zero means that some wrench cannot be exerted at all; it knows nothing of friction limits.  Raises ValueError for a
    length that is not positive.
    """
    values = np.linalg.svd(_scale_map(grasp, length), compute_uv=False)
    return float(values[5]) if len(values) >= 6 else 0.0


def compute_pair_lack(grasp: Grasp) -> float:
    """Return the friction angle [rad] that the best pair of contacts lacks to hold the object as two soft fingers.

    It is the least, over all pairs, of the angle by which the chord misses the narrower friction cone, and 0 where some
    chord lies in both: the antipodal condition.  On a sphere each contact of that pair has to move by this angle along
    their great circle [paper §3, figure 1].
    """
    return float(_pair_lacks(grasp).min())


def compute_pair_cost(grasp: Grasp) -> float:
    """Return a smooth cost [rad^2] of being far from a grasp by two fingers: the paper's preference [paper §3].

        cost = 1 / sum over pairs of 1 / lack^2

    is zero iff some pair can hold the object alone, grows with the lack of every pair, has a continuous gradient there
    too, and for three fingers lies between a third of the square of :func:`compute_pair_lack` and that square.
    """
    lacks = _pair_lacks(grasp)
    least = float(lacks.min())
    return 0.0 if least == 0.0 else least**2 / float(np.sum((least / lacks) ** 2))


def compute_support(grasp: Grasp, directions: ArrayLike, length: float) -> Array:
    """Return the largest ``direction . wrench`` (...) of forces in the exact cones with f_n in [0, 1] N.

    ``directions`` (..., 6) pair with (f, tau / length).  The wrench set is a Minkowski sum, so its support function is the
    sum over contacts of max(0, a_n + |c * a_t|) with a = G_i^T direction: no hull has to be built.
    """
    normal, shear = _build_blocks(grasp, length)
    return _support(normal, shear, np.asarray(directions, dtype=np.float64))


def compute_ferrari_canny(grasp: Grasp, length: float, starts: int = 64, seed: int = 0) -> float:
    """Return the radius [N] of the largest ball of wrenches that unit normal forces can resist.

    Torques are divided by ``length`` [m] (the radius of a sphere).  This is the Minkowski-sum form [Ferrari & Canny 1992]:
    the least support over all unit directions; zero without force closure.  Three equatorial hard fingers: 3 mu / sqrt(5).

    The support is convex but the sphere of directions is not.  Some thousand seeded directions are looked at, the lowest
    ``starts`` of them that lie apart are followed downhill together, by Newton's method on the sphere with the kinks of the
    support rounded off, ever less.  The value is that of a direction, so it is never too small, and too large only if the
    weakest direction's basin was missed by all.
    """
    if not check_force_closure(grasp).is_closed:
        return 0.0
    normal, shear = _build_blocks(grasp, length)
    sampled = np.random.default_rng(seed).normal(size=(_SAMPLES, 6))
    sampled = np.concatenate([np.eye(6), sampled / np.linalg.norm(sampled, axis=1, keepdims=True)])
    sampled = np.concatenate([sampled, -sampled])
    directions = _descend(normal, shear, _choose_lowest(sampled, _support(normal, shear, sampled), starts))
    return float(_support(normal, shear, directions).min())


def _least(values: ArrayLike | None) -> float:
    return float("nan") if values is None else float(np.min(np.asarray(values, dtype=np.float64)))


def _pair_lacks(grasp: Grasp) -> Array:
    """Return the angle (pairs,) [rad] by which each pair's chord misses its friction cones, 0 inside."""
    if len(grasp.contacts) < 2:
        raise ValueError("one contact makes no pair; grasps of two or more contacts are accepted")
    lacks = []
    for a, b in combinations(grasp.contacts, 2):
        friction = [a.model.capacity[0], b.model.capacity[0]]
        lacks.append(max(0.0, -check_antipodal(a.p_OC, a.n_O, b.p_OC, b.n_O, friction).margin))
    return np.array(lacks)


def _scale_map(grasp: Grasp, length: float) -> Array:
    if not (np.isfinite(length) and length > 0.0):
        raise ValueError(f"length is {length} m; a positive finite one is accepted")
    G = compute_grasp_map(grasp)
    G[3:] /= length
    return G


def _build_blocks(grasp: Grasp, length: float) -> tuple[Array, Array]:
    """Return what maps a direction (6,) to a_n, (F, 6), and to c * a_t, (F, 3, 6) with zero rows for hard fingers."""
    G = _scale_map(grasp, length)
    normal, shear = np.zeros((len(grasp.contacts), 6)), np.zeros((len(grasp.contacts), 3, 6))
    for i, (contact, part) in enumerate(zip(grasp.contacts, grasp.slices, strict=True)):
        block = G[:, part].T
        normal[i] = block[NORMAL]
        friction = np.delete(block, NORMAL, axis=0) * contact.model.capacity[:, None]
        shear[i, : len(friction)] = friction
    return normal, shear


def _support(normal: Array, shear: Array, directions: Array, rounding: float = 0.0) -> Array:
    """Return the support (...) in ``directions`` (..., 6), its kinks rounded off by hyperbolas of this radius."""
    friction = np.einsum("fij,...j->...fi", shear, directions)
    gain = directions @ normal.T + np.sqrt((friction * friction).sum(axis=-1) + rounding**2)
    support: Array = 0.5 * (gain + np.sqrt(gain * gain + rounding**2)).sum(axis=-1)
    return support


def _choose_lowest(directions: Array, values: Array, count: int) -> Array:
    """Return up to ``count`` of the directions, lowest values first, no two closer than :data:`_APART`."""
    left = values.copy()
    chosen: list[Array] = []
    while len(chosen) < count and np.isfinite(left).any():
        lowest = directions[int(np.argmin(left))]
        chosen.append(lowest)
        left[directions @ lowest > _APART] = np.inf
    return np.array(chosen)


def _descend(normal: Array, shear: Array, d: Array) -> Array:
    """Return the unit directions (B, 6) followed to local minima of the support, all at once."""
    scale = float(np.abs(normal).max() + np.abs(shear).max())
    squares = np.swapaxes(shear, 1, 2) @ shear
    for rounding in scale * _ROUNDING:
        for _ in range(_STEPS):
            friction = np.einsum("fij,bj->bfi", shear, d)
            load = np.sqrt((friction * friction).sum(axis=-1) + rounding**2)
            gain = d @ normal.T + load
            bend = np.sqrt(gain * gain + rounding**2)
            pull = np.einsum("fij,bfi->bfj", shear, friction) / load[..., None]
            slopes, share = normal + pull, 0.5 * (1.0 + gain / bend)
            gradient = (share[..., None] * slopes).sum(axis=1)
            hessian = np.einsum("bf,fij->bij", share / load, squares)
            hessian -= np.swapaxes(pull * (share / load)[..., None], 1, 2) @ pull
            hessian += np.swapaxes(slopes * (0.5 * rounding**2 / bend**3)[..., None], 1, 2) @ slopes
            # On the sphere: project, and account for its curvature; along d itself nothing is to move.
            radial = (gradient * d).sum(axis=1)
            outer = d[:, :, None] * d[:, None, :]
            tangent = np.eye(6) - outer
            curved = tangent @ hessian @ tangent - radial[:, None, None] * tangent + outer
            downhill = -(tangent @ gradient[..., None])[..., 0]
            values, vectors = np.linalg.eigh(curved)
            rate = np.maximum(
                np.abs(values), 1e-6 * scale
            )  # downhill also where the support bends the other way
            step = (vectors @ ((np.swapaxes(vectors, 1, 2) @ downhill[..., None]) / rate[..., None]))[..., 0]
            step *= np.minimum(1.0, _LONGEST / np.maximum(np.linalg.norm(step, axis=1), 1e-12))[:, None]
            # A symmetric grasp has saddles, where Newton's step is zero: look along the least curvature as well.
            aside = _LONGEST * vectors[:, :, 0]
            shares = np.concatenate([_SHARES, -_SHARES])[:, None, None]
            trials = np.concatenate([d[None], d + shares[: len(_SHARES)] * step, d + shares * aside])
            trials /= np.linalg.norm(trials, axis=2, keepdims=True)
            best = np.argmin(_support(normal, shear, trials, rounding), axis=0)
            d = trials[best, np.arange(len(d))]
            if not best.any():
                break
    return d
