"""Many problems planned, carried out in MuJoCo and judged: the built-in ones, random attitudes, random worlds.

What is called solved has to pass; what is not solved is listed with its status and reason.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from dexplan import pipeline
from dexplan.errors import DexplanError
from dexplan.plans.actions import count_placements
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem, list_problems, load_problem

PROFILES = ("firm", "portable")
SOLVERS = ("daqp", "osqp")
BUDGET = 600
"""Nodes that the search of a random world may open: what takes more is left to other evidence."""
LEAST_PLACEMENTS = 3
"""A random world counts where its plan relocates fingers at least so often."""


@dataclass(frozen=True, eq=False)
class Case:
    """One problem to be confirmed, under a ``key`` that names it from one call to the next.

    ``least_placements``: its plan is only carried out where it has as many.
    """

    key: str
    problem: Problem
    least_placements: int = 0


def list_builtin_cases(solvers: Sequence[str] = SOLVERS, rate: int | None = None) -> Iterator[Case]:
    """Yield every built-in problem in both physics profiles with each of the force ``solvers``, at ``rate`` [Hz], or at its own
    control rate.
    """
    for name, profile, solver in product(list_problems(), PROFILES, solvers):
        changes: dict[str, Any] = {"control.physics_profile": profile, "control.force_solver": solver}
        key = f"{name} {profile} {solver}"
        if rate is not None:
            changes["control.rate_hz"] = rate
            key += f" {rate} Hz"
        yield Case(key, load_problem(name, changes))


def list_attitude_cases(first: int, count: int) -> Iterator[Case]:
    """Yield the built-in problem ``any_attitude`` with the seeds ``first`` to ``first + count - 1``."""
    for seed in range(first, first + count):
        yield Case(f"any_attitude seed {seed}", load_problem("any_attitude", {"seed": seed}))


def list_random_cases(first: int, count: int) -> Iterator[Case]:
    """Yield ``count`` random worlds, each of a seed of its own from ``first`` on."""
    for seed in range(first, first + count):
        problem = build_problem(draw_world(seed), source=f"random world {seed}")
        yield Case(f"random world {seed}", problem, LEAST_PLACEMENTS)


def draw_world(seed: int) -> dict[str, Any]:
    """Return the problem file, as a dict, of a random world: ball, tips, friction, bases, axis, turn, and every third a shift.

    Radius 12 to 65 mm, mass 1 to 400 g and friction 0.25 to 1.5, all uniform in their logarithm; tips 6 to 28 mm, all alike in
    every second world; bases within 15 degrees of thirds of a turn; turns of 240 to 540 degrees about any axis.
    """
    rng = np.random.default_rng(seed)

    def draw(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    tips = rng.uniform(0.006, 0.028, 3) if rng.random() < 0.5 else np.full(3, rng.uniform(0.006, 0.028))
    axis = rng.normal(size=3)
    bases = np.array([0.0, 120.0, 240.0]) + rng.uniform(-15.0, 15.0, 3)
    turn = rng.choice([-1.0, 1.0]) * rng.uniform(240.0, 540.0)
    world: dict[str, Any] = {
        "format": 1,
        "name": f"random_world_{seed}",
        "object": {"radius_m": round(draw(0.012, 0.065), 4), "mass_kg": round(draw(0.001, 0.4), 4)},
        "hand": {
            "tip_radii_m": [round(float(r), 4) for r in tips],
            "base_azimuths_deg": [round(float(b), 1) for b in bases],
        },
        "friction": {"sliding": round(draw(0.25, 1.5), 3)},
        "goal": {
            "rotation": {
                "axis": [float(v) for v in axis / np.linalg.norm(axis)],
                "angle_deg": round(float(turn), 1),
            }
        },
        "gait": {"node_budget": BUDGET},
    }
    shift = rng.normal(size=3)
    if seed % 3 == 0:
        shift *= rng.uniform(0.0, 0.02) / np.linalg.norm(shift)
        world["goal"]["translation_m"] = [round(float(v), 4) for v in shift]
    return world


def confirm(case: Case) -> dict[str, Any]:
    """Return what came of a case: status, verdict ("" where nothing was carried out), failed checks, times [s].

    An error is an answer, too: its kind and sentence stand under ``error``.
    """
    row: dict[str, Any] = {"key": case.key, "status": "", "reason": "", "verdict": "", "failed": []}
    begun = time.process_time()
    try:
        plan = pipeline.plan(case.problem)
        row |= {"status": str(plan.status), "reason": plan.reason}
        row["planning_s"] = round(time.process_time() - begun, 2)
        row["placements"] = count_placements(plan.actions)
        if not plan.is_solved or row["placements"] < case.least_placements:
            return row
        begun = time.process_time()
        trace = pipeline.rollout(case.problem, plan)
        report = pipeline.validate(case.problem, plan, trace)
        row["run_s"] = round(time.process_time() - begun, 2)
        row["simulated_s"] = round(float(trace["time"][-1]), 2)
        row["verdict"] = report.verdict
        row["failed"] = [
            {"name": c.name, "value": c.value, "limit": c.limit, "note": c.note}
            for c in report.checks
            if c.status == "fail"
        ]
    except DexplanError as error:
        row["error"] = f"{type(error).__name__}: {error}"
    return row
