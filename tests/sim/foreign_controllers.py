"""Controllers of other people's, as small as they can be, and the run that they are put into."""

from __future__ import annotations

import runpy
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from short_runs import hold_problem, plan_of

from dexplan import pipeline
from dexplan.control.foreign import RunStart
from dexplan.control.observation import Observation
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.sim.trace import Trace

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def load_example(name: str) -> dict[str, Any]:
    """Return what the example ``name`` defines."""
    return runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name=name)


@lru_cache
def hold() -> tuple[Problem, Plan]:
    """Return holding still with three fingers, and its plan."""
    problem = hold_problem("hold_three", "firm")
    return problem, plan_of(problem)


def make_hold(squeeze: float = 4.0) -> Any:
    """Return the example's controller with constant servo targets."""
    return load_example("foreign_controller")["Hold"](squeeze)


@lru_cache
def held_trace() -> Trace:
    """Return the run of constant servo targets, simulated once per process."""
    return pipeline.rollout(*hold(), controller=make_hold())


class Spy:
    """Gives the first posture back, or what ``steady`` says, and keeps all that it was told."""

    def __init__(self, steady: Any = None) -> None:
        self._steady = steady
        self.starts: list[RunStart] = []
        self.seen: list[Observation] = []

    def reset(self, start: RunStart) -> None:
        self.starts.append(start)
        if self._steady is not None:
            self._steady.reset(start)

    def step(self, observation: Observation) -> np.ndarray:
        self.seen.append(observation)
        if self._steady is not None:
            return self._steady.step(observation)
        return self.starts[-1].observation.q.ravel()
