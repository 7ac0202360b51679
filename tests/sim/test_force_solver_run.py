"""``control.force_solver``: either solver holds the ball, the same bytes every time."""

from __future__ import annotations

from collections import Counter

import pytest
from short_runs import HOLD_TIMING, build_plan_reference, plan_of

from dexplan import pipeline
from dexplan.control.controller import ControlOptions
from dexplan.grasp.force import ForceSolution, ForceSolver
from dexplan.problems.read import load_problem
from dexplan.sim.rollout import rollout
from dexplan.sim.trace import Trace


def run(solver: str) -> Trace:
    problem = load_problem("hold_two", {"control.force_solver": solver})
    plan = plan_of(load_problem("hold_two"))
    reference = build_plan_reference(problem, plan, HOLD_TIMING)
    return rollout(pipeline.build_scene(problem), reference, pipeline.build_options(problem))


@pytest.mark.parametrize("solver", ["daqp", "osqp"])
def test_each_solver_holds_the_ball_by_itself(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    methods: Counter[str] = Counter()
    solve = ForceSolver.solve

    def count(self: ForceSolver, *args: object, **kwargs: object) -> ForceSolution:
        solution = solve(self, *args, **kwargs)  # type: ignore[arg-type]
        methods[solution.method.lower()] += 1
        return solution

    monkeypatch.setattr(ForceSolver, "solve", count)
    problem = load_problem("hold_two", {"control.force_solver": solver})
    trace = run(solver)
    assert set(methods) == {solver}
    assert pipeline.validate(problem, plan_of(load_problem("hold_two")), trace).is_passed


def test_osqp_gives_the_same_bytes_again() -> None:
    assert run("osqp") == run("osqp")
    assert run("osqp") != run("daqp")


def test_unknown_solver_is_refused() -> None:
    with pytest.raises(ValueError, match="'ipopt'; accepted: daqp or osqp"):
        ControlOptions(0.4, 0.002, force_solver="ipopt")  # type: ignore[arg-type]


def test_option_is_written_out_and_read_again(tmp_path) -> None:
    problem = load_problem("hold_two", {"control.force_solver": "osqp"})
    problem.save(tmp_path / "problem.toml")
    assert 'force_solver = "osqp"' in (tmp_path / "problem.toml").read_text(encoding="utf-8")
    assert type(problem).load(tmp_path / "problem.toml") == problem
