"""``control.force_solver``: either solver holds the ball, the same bytes every time."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from pathlib import Path

import pytest
from short_runs import build_plan_reference, plan_of

from dexplan import pipeline
from dexplan.control.options import ControlOptions
from dexplan.grasp.force.solver import ForceSolution, ForceSolver
from dexplan.plans.timing import Timing
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.record.rollout import rollout
from dexplan.sim.trace import Trace

TIMING = Timing(first_hold=0.4, last_hold=0.4)


def ask_for(solver: str) -> Problem:
    return load_problem("hold_two", {"control.force_solver": solver})


@lru_cache
def run(solver: str, number: int = 1) -> tuple[Trace, Counter[str]]:
    """Return a run with the solver that the problem names, and how often which method solved a tick."""
    problem, methods = ask_for(solver), Counter[str]()
    solve = ForceSolver.solve

    def count(self: ForceSolver, *args: object, **kwargs: object) -> ForceSolution:
        solution = solve(self, *args, **kwargs)  # type: ignore[arg-type]
        methods[solution.method.lower()] += 1
        return solution

    reference = build_plan_reference(problem, plan_of(load_problem("hold_two")), TIMING)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ForceSolver, "solve", count)
        trace = rollout(pipeline.build_scene(problem), reference, pipeline.build_options(problem))
    return trace, methods


@pytest.mark.parametrize("solver", ["daqp", "osqp"])
def test_each_solver_holds_the_ball_by_itself(solver: str) -> None:
    trace, methods = run(solver)
    assert set(methods) == {solver}
    assert pipeline.validate(ask_for(solver), plan_of(load_problem("hold_two")), trace).is_passed


def test_osqp_gives_the_same_bytes_again() -> None:
    assert run("osqp", 2)[0] == run("osqp")[0]
    assert run("osqp")[0] != run("daqp")[0]


def test_unknown_solver_is_refused() -> None:
    with pytest.raises(ValueError, match="'ipopt'; accepted: daqp or osqp"):
        ControlOptions(0.4, 0.002, force_solver="ipopt")  # type: ignore[arg-type]


def test_option_is_written_out_and_read_again(tmp_path: Path) -> None:
    problem = ask_for("osqp")
    problem.save(tmp_path / "problem.toml")
    assert 'force_solver = "osqp"' in (tmp_path / "problem.toml").read_text(encoding="utf-8")
    assert Problem.load(tmp_path / "problem.toml") == problem
