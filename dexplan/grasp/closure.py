"""Force closure: can the contacts resist any wrench by squeezing hard enough?

A general test for any set of hard and soft contacts, and the closed forms of special cases, which are tested
against it. Every answer carries a margin, its unit and what it means, because "closed" alone hides how near
the edge a grasp is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog

from dexplan.contact.friction import NORMAL
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.spatial import GRAVITY, Array, read_only

Method = Literal["cone", "polytope"]

_GAP = 1e-7  # the cutting planes stop when the margin is known to this much
_CLOSED = 1e-6  # a margin below the solver's own tolerance proves nothing


@dataclass(frozen=True, eq=False)
class ClosureResult:
    """Answer to a closure question.

    ``margin`` is positive inside, in ``unit``, and ``meaning`` says what it measures.  ``rank`` is that of
    the grasp map and ``internal_forces`` (sum m,) the squeeze that attains the margin, where the test
    computes them.
    """

    is_closed: bool
    margin: float
    unit: str
    meaning: str
    rank: int | None = None
    internal_forces: Array | None = None


def check_force_closure(grasp: Grasp, method: Method = "cone") -> ClosureResult:
    """Check force closure of any set of contacts.

    A grasp is force closed iff G is onto and some internal force lies strictly inside all cones [MLS 1994,
    prop. 5.3].  The second half is :func:`compute_load_margin` of no wrench at a mean squeeze of 1 N; rank G = 6
    alone is not force closure.
    """
    found = compute_load_margin(grasp, np.zeros(6), 1.0, method)
    meaning = (
        "normal force to spare at the weakest contact per newton of mean squeeze, by the best internal force"
    )
    is_closed = found.rank == 6 and found.margin > _CLOSED
    return ClosureResult(is_closed, found.margin, "N/N", meaning, found.rank, found.internal_forces)


def compute_load_margin(
    grasp: Grasp, wrench: ArrayLike, mean_normal: float, method: Method = "cone"
) -> ClosureResult:
    """Compute how far inside their cones the contacts stay while they exert ``wrench`` on the object.

        maximise s  s.t.  G f = wrench,  |f_t / c|_i <= f_n,i - s,  mean f_n = mean_normal

    and return s / mean_normal.  With ``"cone"`` the cones are exact; they enter as cutting planes, added where the
    last solution leaves them, so that the linear program bounds the margin from above while its solution, measured
    with the exact cone, bounds it from below; the margin returned is the attained one.  With ``"polytope"`` they are
    the models' inscribed pyramids, and the margin is never more than the exact one.

    Args:
        grasp: the contacts.
        wrench: (6,) [N, N m] that the contacts exert on the object about its origin, in object axes: minus
            gravity's, to hold it.
        mean_normal: mean normal force [N], positive.
        method: ``"cone"`` or ``"polytope"``.

    Returns:
        A result whose ``is_closed`` says that the contacts can carry the wrench, and whose ``internal_forces``
        (sum m,) [N, N m] attain the margin.  The margin is -inf where no forces of this mean balance the wrench.

    Raises ValueError for a wrench of another shape, a mean that is not positive, and an unknown method.
    """
    load = np.asarray(wrench, dtype=np.float64)
    if load.shape != (6,) or not np.isfinite(load).all():
        raise ValueError(f"wrench is {load.tolist()}; six finite numbers (f, tau) are accepted")
    if not (np.isfinite(mean_normal) and mean_normal > 0.0):
        raise ValueError(f"mean normal force is {mean_normal} N; a positive finite one is accepted")
    if method not in ("cone", "polytope"):
        raise ValueError(f"method is {method!r}; 'cone' and 'polytope' are accepted")
    meaning = "normal force to spare at the weakest contact per newton of mean squeeze, under the wrench"
    G = compute_grasp_map(grasp)
    length = max(float(np.mean([np.linalg.norm(c.p_OC) for c in grasp.contacts])), 1e-6)
    scaled = G.copy()
    scaled[3:] /= length  # torque rows as large as force rows
    rank = int(np.linalg.matrix_rank(scaled, tol=1e-9))

    count, size = len(grasp.contacts), G.shape[1]
    normal = np.array([s.start + NORMAL for s in grasp.slices])
    # Unknowns y = f / (c mean_normal) (f_n / mean_normal for the normal) and s: all cones become circular.
    scale = np.concatenate([np.insert(model.capacity, NORMAL, 1.0) for model in grasp.models])
    equality = np.zeros((7, size + 1))
    equality[:6, :size] = scaled * scale
    equality[6, normal] = 1.0
    right = np.concatenate([load[:3], load[3:] / length, [count * mean_normal]]) / mean_normal
    cost = np.zeros(size + 1)
    cost[-1] = -1.0
    cuts = []
    for i, model in enumerate(grasp.models):
        facets, inradius = model.section
        cuts += [_cut(grasp, i, n, size, inradius if method == "polytope" else 1.0) for n in facets]

    best, forces = -np.inf, None
    for _ in range(60):
        answer = linprog(
            cost,
            A_ub=np.array(cuts),
            b_ub=np.zeros(len(cuts)),
            A_eq=equality,
            b_eq=right,
            bounds=(None, None),
        )
        if answer.status != 0:
            break
        if method == "polytope":
            best, forces = float(answer.x[-1]), answer.x[:size] * scale
            break
        shear = [np.delete(answer.x[s], NORMAL) for s in grasp.slices]
        used = np.array([np.linalg.norm(x) for x in shear])
        slack = answer.x[normal] - used
        if slack.min() > best:
            best, forces = float(slack.min()), answer.x[:size] * scale
        if -answer.fun - best <= _GAP:
            break
        # Cut where the exact cone, not the pyramid, is left.
        outside = np.flatnonzero(slack < answer.x[-1] - 0.1 * _GAP)
        cuts += [_cut(grasp, int(i), shear[i] / used[i], size, 1.0) for i in outside]
    attained = None if forces is None else read_only(forces * mean_normal)
    return ClosureResult(best > _CLOSED, best, "N/N", meaning, rank, attained)


def _cut(grasp: Grasp, index: int, direction: Array, size: int, height: float) -> Array:
    """Return the row of ``direction . y_t <= height * (f_n - s)`` for one contact: tangent to its cone at height 1."""
    row = np.zeros(size + 1)
    row[grasp.slices[index]] = np.insert(direction, NORMAL, -height)
    row[-1] = height
    return row


def check_antipodal(p1: ArrayLike, n1: ArrayLike, p2: ArrayLike, n2: ArrayLike, mu: float) -> ClosureResult:
    """Check two soft fingers at p1, p2 with **outward** normals n1, n2: is the chord in both cones?

    [Nguyen 1988; MLS 1994, th. 5.7].  Any surface; the margin is an angle [rad].  Raises ValueError for
    coincident points.
    """
    a, b = np.asarray(p1, dtype=np.float64), np.asarray(p2, dtype=np.float64)
    chord = b - a
    if np.linalg.norm(chord) == 0.0:
        raise ValueError("the two contact points coincide; distinct points are accepted")
    worst = max(
        _angle(-np.asarray(n1, dtype=np.float64), chord), _angle(-np.asarray(n2, dtype=np.float64), -chord)
    )
    margin = float(np.arctan(mu) - worst)
    return ClosureResult(
        margin > 0.0, margin, "rad", "angle by which the chord stays inside the narrower friction cone"
    )


def _angle(a: Array, b: Array) -> float:
    """Return the angle [rad] between two vectors, exact near 0 and pi as well."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))


def sphere_pair_angle_min(mu: float) -> float:
    """Return the least central angle [rad] of a closed soft pair: pi - 2 atan(mu) [paper §3]."""
    return float(np.pi - 2.0 * np.arctan(mu))


def check_sphere_pair(direction_1: ArrayLike, direction_2: ArrayLike, mu: float) -> ClosureResult:
    """Check two soft fingers on a sphere at directions (3,) from its centre [paper §3, result 2].

    The paper counts the boundary as closed; here it is not, for there the squeeze needed for any load is
    infinite.
    """
    phi = _angle(np.asarray(direction_1, dtype=np.float64), np.asarray(direction_2, dtype=np.float64))
    margin = phi - sphere_pair_angle_min(mu)
    return ClosureResult(margin > 0.0, margin, "rad", "central angle beyond the smallest that is closed")


def check_sphere_triple_sufficient(directions: ArrayLike, mu: float) -> ClosureResult:
    """Check the **sufficient** condition for three hard fingers on a sphere, directions in rows.

    [paper §3, result 3]: the triangle is acute and its plane is nearer to the centre than r sin(theta).  A
    grasp that fails may still be closed (equatorial azimuths 0, 60, 150 deg at mu 0.5): ask
    :func:`check_force_closure` then.
    """
    d = np.asarray(directions, dtype=np.float64)
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    sides = np.roll(d, -1, axis=0) - d
    # cosine of the angle at each corner, between the sides that leave it
    out, back = sides, -np.roll(sides, 1, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.sum(out * back, axis=1) / (np.linalg.norm(out, axis=1) * np.linalg.norm(back, axis=1))
    area = np.cross(sides[0], sides[1])
    if np.linalg.norm(area) < 1e-12:
        raise ValueError("the three contact points are collinear or coincide; a proper triangle is accepted")
    height = abs(float(np.dot(area, d[0]))) / float(np.linalg.norm(area))
    margin = min(float(np.sin(np.arctan(mu))) - height, float(cosine.min()))
    meaning = "smaller of sin(theta) - h/r and the cosine of the largest corner (sufficient condition only)"
    return ClosureResult(margin > 0.0, margin, "-", meaning)


def required_pair_preload(
    mu: float, mu_t: float, mass: float, radius: float, phi: float, utilisation: float = 1.0
) -> float:
    """Return the normal force [N] of each of two soft fingers that hold a ball by a horizontal chord.

    At central angle ``phi`` [rad] the chord passes beside the centre by R sin(beta), beta = 90 deg - phi/2,
    so that each finger carries half the weight, the tangential share N tan(beta) of the squeeze and the
    torque m g R tan(beta) / 2:

        N^2 = [(m g / 2 mu)^2 + (m g R tan(beta) / 2 mu_t)^2] / [u^2 - (tan(beta) / mu)^2].

    ``mu`` [-], ``mu_t`` [m], ``mass`` [kg], ``radius`` [m], ``utilisation`` u in (0, 1].  inf where the
    squeeze alone exceeds u: geometric closure needs infinite squeeze at its boundary.
    """
    slope = np.tan(0.5 * np.pi - 0.5 * phi)
    left = utilisation**2 - (slope / mu) ** 2
    weight = mass * GRAVITY
    if left <= 0.0:
        return float("inf")
    return float(np.sqrt(((weight / (2 * mu)) ** 2 + (weight * radius * slope / (2 * mu_t)) ** 2) / left))
