"""The phase diagram as numbers: for every experiment the boundary by closed form, by load margin and in the simulator.

What limits the agreement, as measured (mu 0.5, MuJoCo 3.17, profile firm):

- *Contact softness.* The contact lies half the overlap (about 35 um at 10 N) under the surface, and MuJoCo's normal force is
  0.05 % short: together less than 0.02 degrees and 0.0014 r.  The profile ``portable`` gives the same boundaries.
- *The nudge.* It is a load that theory does not know.  At 0.05 N the pull gives way 0.04 N early; at 0.5 N, 5 % of the
  preload, 0.36 N early and three fingers 0.012 r early.
- *Servo compliance* does not enter, because loads are fed forward.  With constant commands torsion still ends within 1 %, but
  under a shear load the servos let the ball go by more than a millimetre long before its contacts slide.
- *Beyond the boundary*, sliding is not told from loss as sharply as holding from giving way: MuJoCo's convex friction lets a
  contact that slides fast part from the surface, so fingertips bounce.  Slip and drop are mixed there.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from dexplan.brief import brief_repr
from dexplan.pool import answer_as_done
from dexplan.witness import experiments
from dexplan.witness.experiments import EXPERIMENTS, Experiment, compute_load_aware, run
from dexplan.witness.outcome import (
    HARD_TORSION,
    JUDGED_MOVED,
    JUDGED_TURNED,
    MOVED,
    SLID,
    TURNED,
    Kind,
    Outcome,
)

FRICTIONS = (0.3, 0.5, 0.8)
"""Friction coefficients at which agreement is demanded."""
MORE_FRICTIONS = (0.2, 0.4, 0.65, 1.0)
"""Friction coefficients that the full diagram adds."""
CURVE_FRICTIONS = np.linspace(0.18, 1.02, 15)
FIRST_STEP = 0.25
"""Bisection starts this share of the demand on either side of the load-aware boundary, and widens until sides differ."""


@dataclass(frozen=True)
class Boundary:
    """One boundary, in the experiment's unit.

    ``closed_form`` without weight; ``load_aware`` with weight at the preload; ``simulated`` the middle between the nearest
    runs that held and gave way, ``resolution`` apart; ``difference`` is simulated minus load aware, ``demand`` its bound.
    ``simulated`` is None where the hand could not be brought to either side of it (``note``).
    """

    experiment: str
    unit: str
    mu: float
    closed_form: float
    load_aware: float
    simulated: float | None
    difference: float | None
    demand: float
    resolution: float | None
    gives_way: str | None
    torque_share: float | None
    runs: int
    note: str = ""

    @property
    def is_within(self) -> bool:
        """Whether the simulated boundary is as near to the load-aware one as demanded."""
        return self.difference is not None and abs(self.difference) <= self.demand


@dataclass(frozen=True)
class GridPoint:
    """The outcome at one point of the picture; ``outcome`` is None where the hand's servos or joints do not allow it."""

    experiment: str
    mu: float
    x: float
    margin: float
    outcome: Outcome | None

    @property
    def agrees(self) -> bool | None:
        """Whether the hand held where the margin is positive and only there; None where it could not be tried."""
        return None if self.outcome is None else (self.outcome.kind is Kind.HOLD) == (self.margin > 0.0)


@dataclass(frozen=True)
class CurvePoint:
    """Theory's two boundaries at one friction coefficient, in the experiment's unit."""

    experiment: str
    mu: float
    closed_form: float
    load_aware: float


@dataclass(frozen=True)
class PhaseDiagram:
    """All boundaries, theory's curves, all outcomes of the grid, and what they were measured with."""

    boundaries: tuple[Boundary, ...]
    curves: tuple[CurvePoint, ...]
    grid: tuple[GridPoint, ...]
    settings: dict[str, Any] = field(default_factory=dict)

    __repr__ = brief_repr

    @property
    def misses(self) -> tuple[GridPoint, ...]:
        """Points of the picture that were tried and did not do what the sign of their load margin says."""
        return tuple(point for point in self.grid if point.agrees is False)

    def as_json(self) -> dict[str, Any]:
        """Return the diagram as plain data, ``format`` 1."""
        return {
            "format": 1,
            "settings": self.settings,
            "boundaries": [{**asdict(b), "is_within": b.is_within} for b in self.boundaries],
            "curves": [asdict(point) for point in self.curves],
            "grid": [{**asdict(point), "agrees": point.agrees} for point in self.grid],
        }


def measure_boundary(
    experiment: Experiment, mu: float, steps: int = 6, believed: float | None = None
) -> Boundary:
    """Return the boundary of ``experiment`` at ``mu``, bisected ``steps`` times after it was bracketed.

    ``believed`` (default: mu) is the friction that theory and hand are told, for the test that a wrong belief shows.
    """
    told = mu if believed is None else believed
    closed, aware = experiment.closed_form(told), compute_load_aware(experiment, told)
    demand, sign = experiment.demand(closed), 1.0 if experiment.holds_above else -1.0
    seen: dict[float, Outcome | None] = {}

    def holds(x: float) -> bool | None:
        seen[x] = run(experiment, mu, x, believed)
        outcome = seen[x]
        return None if outcome is None else outcome.kind is Kind.HOLD

    safe, unsafe = _bracket(aware, sign * FIRST_STEP * demand, holds)
    if safe is None or unsafe is None:
        found = dict.fromkeys(("simulated", "difference", "resolution", "gives_way", "torque_share"), None)
        note = "no run that held was found" if safe is None else "no run that gave way was found"
        note += " within the servos' torques and the joints' ranges"
        return Boundary(
            experiment.name,
            experiment.unit,
            mu,
            closed,
            aware,
            demand=demand,
            runs=len(seen),
            note=note,
            **found,
        )
    for _ in range(steps):
        middle = 0.5 * (safe + unsafe)
        if holds(middle):
            safe = middle
        else:
            unsafe = middle
    simulated = 0.5 * (safe + unsafe)
    lost, kept = seen[unsafe], seen[safe]
    return Boundary(
        experiment=experiment.name,
        unit=experiment.unit,
        mu=mu,
        closed_form=closed,
        load_aware=aware,
        simulated=simulated,
        difference=simulated - aware,
        demand=demand,
        resolution=abs(safe - unsafe),
        gives_way=None if lost is None else str(lost.kind),
        torque_share=None if kept is None else kept.torque_share,
        runs=len(seen),
    )


def _bracket(
    center: float, step: float, holds: Callable[[float], bool | None]
) -> tuple[float | None, float | None]:
    """Return a setting that holds and one that does not; ``step`` points to where theory expects to hold."""
    safe = unsafe = None
    for widening in range(6):
        if safe is None:
            x = center + step * 2.0**widening
            verdict = holds(x)
            if verdict:
                safe = x
            elif verdict is False:
                unsafe = x
        if unsafe is None:
            x = center - step * 2.0**widening
            verdict = holds(x)
            if verdict is False:
                unsafe = x
            elif verdict:
                safe = x
        if safe is not None and unsafe is not None:
            break
    return safe, unsafe


def measure_point(experiment: Experiment, mu: float, x: float) -> GridPoint:
    """Return one outcome of the picture with theory's margin beside it."""
    margin = experiments.compute_margin(experiment, mu, x)
    return GridPoint(experiment.name, mu, x, max(margin, -1e9), run(experiment, mu, x))


def measure_diagram(
    is_coarse: bool = False,
    workers: int = 2,
    progress: Callable[[Iterable[Any], int], Iterable[Any]] | None = None,
) -> PhaseDiagram:
    """Return the whole diagram; ``progress(jobs, count)`` wraps the iteration over finished jobs."""
    begin = time.perf_counter()
    frictions = FRICTIONS if is_coarse else tuple(sorted((*FRICTIONS, *MORE_FRICTIONS)))
    steps = 2 if is_coarse else 6
    jobs: list[tuple[Any, ...]] = [(e.name, mu, steps) for e in EXPERIMENTS for mu in frictions]
    jobs += [(e.name, float(mu)) for e in EXPERIMENTS for mu in CURVE_FRICTIONS]
    jobs += [(e.name, mu, x, None) for e in EXPERIMENTS for mu, x in _list_grid(e, is_coarse)]
    done = _map(_work, jobs, workers)
    results = list(done if progress is None else progress(done, len(jobs)))
    order = {e.name: k for k, e in enumerate(EXPERIMENTS)}
    boundaries = [r for r in results if isinstance(r, Boundary)]
    curves = [r for r in results if isinstance(r, CurvePoint)]
    grid = [r for r in results if isinstance(r, GridPoint)]
    return PhaseDiagram(
        tuple(sorted(boundaries, key=lambda b: (order[b.experiment], b.mu))),
        tuple(sorted(curves, key=lambda c: (order[c.experiment], c.mu))),
        tuple(sorted(grid, key=lambda p: (order[p.experiment], p.mu, p.x))),
        {**describe_settings(), "is_coarse": is_coarse, "run_time_s": round(time.perf_counter() - begin, 1)},
    )


def describe_settings() -> dict[str, Any]:
    """Return what the diagram was measured with, as plain data."""
    return {
        "scene": "three_finger_sphere",
        "object_radius_m": experiments.RADIUS,
        "object_mass_kg": experiments.MASS,
        "preload_N": experiments.PRELOAD,
        "torsional_over_sliding_m": experiments.PATCH,
        "torsional_hard_m": HARD_TORSION,
        "nudge_N": experiments.NUDGE,
        "hold_moved_mm": 1e3 * MOVED,
        "hold_turned_deg": math.degrees(TURNED),
        "hold_slid_mm": 1e3 * SLID,
        "judged_moved_mm": 1e3 * JUDGED_MOVED,
        "judged_turned_deg": math.degrees(JUDGED_TURNED),
        "physics_profile": "firm",
        "versions": {name: version(name) for name in ("mujoco", "numpy", "scipy")},
    }


def _list_grid(experiment: Experiment, is_coarse: bool) -> list[tuple[float, float]]:
    """Return the points (mu, x) of the picture."""
    frictions = np.linspace(0.2, 1.0, 3 if is_coarse else 9)
    low, high = experiment.span
    return [
        (round(float(mu), 6), float(x))
        for mu in frictions
        for x in np.linspace(low, high, 5 if is_coarse else 13)
    ]


def _work(job: tuple[Any, ...]) -> Boundary | CurvePoint | GridPoint:
    experiment = next(e for e in EXPERIMENTS if e.name == job[0])
    if len(job) == 2:
        closed = experiment.closed_form(job[1])
        return CurvePoint(experiment.name, job[1], closed, compute_load_aware(experiment, job[1]))
    if len(job) == 3:
        return measure_boundary(experiment, job[1], job[2])
    return measure_point(experiment, job[1], job[2])


def _map(work: Callable[[Any], Any], jobs: Sequence[Any], workers: int) -> Iterator[Any]:
    """Yield the results of ``work`` in the order in which they are done, from ``workers`` processes (1: this one)."""
    for _, done in answer_as_done(work, jobs, workers):
        yield done
