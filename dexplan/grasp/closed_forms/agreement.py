"""Do the general test and the closed forms agree?  Random grasps, many of them near the border of closure.

**The band.**  The general test calls a grasp closed from 1e-6 N/N on, and knows its margin to 1e-8; the closed forms measure
angles.  Near the border both vanish together, but not at one rate.  A pair has at least 1 - tan(lean)/mu to spare, which
is more than its angle in radians, so 2e-6 rad is beyond doubt.  A triple may need a third force that is small where the other two
are at their limit: to spare at all three is then the product of two small numbers, an angle's square, and 1e-6 N/N stands
for 1e-3 rad.  Answers are compared outside these bands, and what lies inside is counted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.closed_forms.pair import check_sphere_pair
from dexplan.grasp.closed_forms.triple import compute_triple_margin
from dexplan.grasp.closure import ClosureResult, check_antipodal, check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.spatial import Array, build_frame

PAIR_BAND = 2e-6
"""Closed-form margins [rad] of pairs below which the answers are not compared."""
TRIPLE_BAND = 1e-3
"""Closed-form margins [rad] of triples below which the answers are not compared."""

_RADIUS = 0.03
_TORSIONAL = 0.002
_NEAR = 0.02  # friction angles of every second grasp lie this near [rad] to where it opens


@dataclass(frozen=True, eq=False)
class Sample:
    """A grasp, its closed-form answer, and that at the friction which an inscribed pyramid keeps for certain."""

    grasp: Grasp
    closed_form: ClosureResult
    closed_form_at_inradius: ClosureResult

    __repr__ = brief_repr


@dataclass(frozen=True)
class Agreement:
    """What a comparison found.

    ``closed`` of ``count`` grasps are closed in closed form, ``in_band`` were not compared.  ``disagreements`` lists the
    closed-form and general margins of those where the answers differ although the closed form settles the question;
    ``beyond`` counts those that are closed although a sufficient condition fails.  ``pyramid_faults`` are those where the
    pyramid closes what is open, or opens what is closed even at its inradius.  ``nearest`` is the smallest compared
    margin [rad].
    """

    count: int
    closed: int
    in_band: int
    beyond: int
    disagreements: tuple[tuple[float, float], ...]
    pyramid_faults: tuple[tuple[float, float], ...]
    nearest: float

    __repr__ = brief_repr


def sample_pairs(count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Yield soft pairs at random on a sphere, every second one near the border."""
    for k in range(count):
        d = _random_directions(rng, 2)
        mu = float(rng.uniform(0.2, 1.2))
        if k % 2:
            mu = _friction_near(np.arctan(mu) - 0.5 * check_sphere_pair(d[0], d[1], mu).margin, rng)
        model = SoftFinger(mu, _TORSIONAL)
        forms = [check_sphere_pair(d[0], d[1], share * mu) for share in (1.0, model.facet_inradius)]
        yield Sample(_build_grasp(_RADIUS * d, d, model), forms[0], forms[1])


def sample_chords(count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Yield soft pairs on no surface in particular, both normals near the chord; every second one near the border."""
    for k in range(count):
        p = _RADIUS * _random_directions(rng, 2)
        mu = float(rng.uniform(0.2, 1.2))
        frame = build_frame((p[1] - p[0]) / np.linalg.norm(p[1] - p[0]))
        lean, way = rng.uniform(0.0, 1.5 * np.arctan(mu), 2), rng.uniform(0.0, 2.0 * np.pi, 2)
        tilted = np.stack([np.sin(lean) * np.cos(way), np.sin(lean) * np.sin(way), np.cos(lean)], axis=1)
        n = np.array([-1.0, 1.0])[:, None] * (tilted @ frame.T)
        if k % 2:
            mu = _friction_near(float(lean.max()), rng)
        model = SoftFinger(mu, _TORSIONAL)
        forms = [check_antipodal(p[0], n[0], p[1], n[1], share * mu) for share in (1.0, model.facet_inradius)]
        yield Sample(_build_grasp(p, n, model), forms[0], forms[1])


def sample_triples(count: int, rng: np.random.Generator) -> Iterator[Sample]:
    """Yield hard triples at random, by turns on a sphere and on no surface in particular; half of each near the border."""
    n = np.stack([_random_directions(rng, 3) for _ in range(count)])
    p, turn = _RADIUS * n, np.arange(count) % 4
    free = turn >= 2
    p[free] *= rng.uniform(0.5, 1.5, size=(int(free.sum()), 3, 1))
    n[free] += 0.4 * rng.normal(size=n[free].shape)
    mu = rng.uniform(0.2, 1.2, size=(count, 1))
    critical = np.arctan(mu[:, 0]) - compute_triple_margin(p, n, mu)
    for near in np.flatnonzero(turn % 2):
        mu[near] = _friction_near(critical[near], rng)
    inradius = HardFinger(1.0).facet_inradius
    margins = np.stack([compute_triple_margin(p, n, share * mu) for share in (1.0, inradius)], axis=1)
    for k in range(count):
        forms = [ClosureResult(m > 0.0, float(m), "rad", "friction angle to spare") for m in margins[k]]
        yield Sample(_build_grasp(p[k], n[k], HardFinger(float(mu[k, 0]))), forms[0], forms[1])


def compare(samples: Iterable[Sample], band: float) -> Agreement:
    """Ask the general test, with cones and with pyramids, about all samples farther than ``band`` [rad] from the border."""
    count = closed = in_band = beyond = 0
    nearest = np.inf
    disagreements: list[tuple[float, float]] = []
    faults: list[tuple[float, float]] = []
    for sample in samples:
        form = sample.closed_form
        count, closed = count + 1, closed + int(form.is_closed)
        if abs(form.margin) <= band:
            in_band += 1
            continue
        nearest = min(nearest, abs(form.margin))
        exact, pyramid = check_force_closure(sample.grasp), check_force_closure(sample.grasp, "polytope")
        if not form.is_settled:
            beyond += int(exact.is_closed)
        elif exact.is_closed != form.is_closed:
            disagreements.append((form.margin, exact.margin))
        must_close = sample.closed_form_at_inradius.margin > band
        if (pyramid.is_closed and not exact.is_closed) or (must_close and not pyramid.is_closed):
            faults.append((form.margin, pyramid.margin))
    return Agreement(count, closed, in_band, beyond, tuple(disagreements), tuple(faults), nearest)


def _build_grasp(points: Array, normals: Array, model: ContactModel) -> Grasp:
    rows = zip(points, normals / np.linalg.norm(normals, axis=1, keepdims=True), strict=True)
    return Grasp(tuple(Contact(i, p, build_frame(-n), model) for i, (p, n) in enumerate(rows)))


def _random_directions(rng: np.random.Generator, count: int) -> Array:
    d = rng.normal(size=(count, 3))
    unit: Array = d / np.linalg.norm(d, axis=1, keepdims=True)
    return unit


def _friction_near(critical: float, rng: np.random.Generator) -> float:
    """Return a friction whose angle is near the critical one [rad], and one a hand could have."""
    return float(np.tan(np.clip(critical + rng.uniform(-_NEAR, _NEAR), 0.05, 1.4)))
