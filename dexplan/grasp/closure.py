"""Force closure: can the contacts resist any wrench by squeezing hard enough?

A general test for any set of hard and soft contacts on any surface, and the antipodal test of a soft pair.  The closed
forms of three hard fingers stand in ``triple.py``, those of the sphere in ``sphere.py``; all are tested against the general
one.  Every answer carries a margin, its unit and what it means, because "closed" alone hides how near the edge a grasp is,
and whether a "no" settles the question, because a sufficient condition that fails proves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dexplan.brief import brief_repr
from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.grasp import Grasp
from dexplan.grasp.margin import build_margin_program, solve_exact_margin, solve_pyramid_margin
from dexplan.spatial import Array, lock_arrays, read_only

Method = Literal["cone", "polytope"]

_CLOSED = 1e-6  # a margin below the solver's own tolerance proves nothing
_COPLANAR = 1e-9  # triple product of unit vectors that counts as zero


@dataclass(frozen=True, eq=False)
class ClosureResult:
    """Answer to a closure question.

    ``margin`` is positive inside, in ``unit``, and ``meaning`` says what it measures.  ``strength`` says what the test is:
    an ``"exact"`` one answers yes and no; a ``"sufficient"`` one proves closure where ``is_closed`` is true and nothing
    where it is false.  ``rank`` is that of the grasp map and ``internal_forces`` (sum m,) [N, N m] the forces that attain
    the margin, where the test computes them.
    """

    is_closed: bool
    margin: float
    unit: str
    meaning: str
    rank: int | None = None
    internal_forces: Array | None = None
    strength: Literal["exact", "sufficient"] = "exact"

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def is_settled(self) -> bool:
        """Whether the answer decides the question: every exact answer, and the yes of a sufficient condition."""
        return self.is_closed or self.strength == "exact"


def choose_contact_model(count: int, sliding: float, torsional: float) -> ContactModel:
    """Return the model of each contact of a grasp by ``count`` fingers: soft for two, hard for three or more.

    [paper §2.2].  Two point contacts cannot resist a torque about the line that joins them (rank G is 5), so a pair
    lives on torsional friction; three need none, and to leave it out is conservative: every wrench that hard fingers
    resist, soft ones do too.

    Args:
        count: fingers that hold the object.
        sliding: friction coefficient mu [-].
        torsional: torsional friction mu_t [m], used for two fingers only.

    Raises ValueError for fewer than two fingers, which never hold an object by friction alone.
    """
    if count < 2:
        raise ValueError(f"{count} finger(s) cannot grasp; two or more are accepted")
    return SoftFinger(sliding, torsional) if count == 2 else HardFinger(sliding)


def check_force_closure(grasp: Grasp, method: Method = "cone") -> ClosureResult:
    """Check force closure of any set of contacts on any surface.

    A grasp is force closed iff G is onto and some internal force lies strictly inside all cones [MLS 1994,
    prop. 5.3].  The second half is :func:`compute_load_margin` of no wrench at a mean squeeze of 1 N; rank G = 6
    alone is not force closure.  The polytope's answer is sufficient only.
    """
    found = compute_load_margin(grasp, np.zeros(6), 1.0, method)
    meaning = (
        "normal force to spare at the weakest contact per newton of mean squeeze, by the best internal force"
    )
    is_closed = found.rank == 6 and found.margin > _CLOSED
    return ClosureResult(
        is_closed, found.margin, "N/N", meaning, found.rank, found.internal_forces, found.strength
    )


def compute_load_margin(
    grasp: Grasp, wrench: ArrayLike, mean_normal: float, method: Method = "cone"
) -> ClosureResult:
    """Compute how far inside their cones the contacts stay while they exert ``wrench`` on the object.

        maximise s  s.t.  G f = wrench,  |f_t / c|_i <= f_n,i - s,  mean f_n = mean_normal

    and return s / mean_normal.  With ``"cone"`` the cones are exact, by an interior-point method whose answer is within
    1e-8 of the best; the margin returned is the attained one.  With ``"polytope"`` they are the models' inscribed
    pyramids, by one linear program: as if each contact had lost the share 1 - inradius of its friction in the pyramid's
    worst directions, so that the margin lies between the exact ones at ``inradius`` times the friction and at all of it.

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
    strength: Literal["exact", "sufficient"] = "exact" if method == "cone" else "sufficient"

    program, rank = build_margin_program(grasp, load, mean_normal)
    if program is None:
        return ClosureResult(False, -np.inf, "N/N", meaning, rank)
    if method == "cone":
        z = solve_exact_margin(program)
        margin = program.attained(z)
    else:
        z, margin = solve_pyramid_margin(program, [model.section for model in grasp.models])
    forces = read_only(mean_normal * (program.forces @ np.concatenate([[1.0], z])))
    return ClosureResult(margin > _CLOSED, margin, "N/N", meaning, rank, forces, strength)


def check_antipodal(
    p1: ArrayLike, n1: ArrayLike, p2: ArrayLike, n2: ArrayLike, mu: ArrayLike
) -> ClosureResult:
    """Check two soft fingers on any surface: does the chord between them lie inside both friction cones?

    A chord inside both cones makes the pair force closed [Nguyen 1988; MLS 1994, th. 5.7].  The converse, which is
    usually stated with it, holds where the chord and both normals lie in one plane, as on a sphere: there the answer is
    exact.  For skew normals the torsion of both fingers can balance the couple of two forces that lean off the chord,
    each towards its own normal, and a pair may be closed whose chord misses a cone by a fraction of a degree; there the
    condition is sufficient, and :func:`check_force_closure` decides.

    Args:
        p1, p2: contact points (3,) [m].
        n1, n2: **outward** normals (3,), of any length.
        mu: friction coefficient, or one per finger (2,).

    Returns:
        A result whose margin is an angle [rad].

    Raises ValueError for coincident points.
    """
    a, b = np.asarray(p1, dtype=np.float64), np.asarray(p2, dtype=np.float64)
    chord = b - a
    if np.linalg.norm(chord) == 0.0:
        raise ValueError("the two contact points coincide; distinct points are accepted")
    inward_1, inward_2 = -np.asarray(n1, dtype=np.float64), -np.asarray(n2, dtype=np.float64)
    lean = np.array([compute_angle(inward_1, chord), compute_angle(inward_2, -chord)])
    margin = float(np.min(np.arctan(np.asarray(mu, dtype=np.float64)) - lean))
    volume = np.dot(np.cross(inward_1, inward_2), chord)
    lengths = np.linalg.norm(inward_1) * np.linalg.norm(inward_2) * np.linalg.norm(chord)
    return ClosureResult(
        margin > 0.0,
        margin,
        "rad",
        "least angle by which the chord stays inside a friction cone",
        strength="exact" if abs(volume) <= _COPLANAR * lengths else "sufficient",
    )


def compute_angle(a: Array, b: Array) -> float:
    """Return the angle [rad] between two vectors (3,), exact near 0 and pi as well."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))
