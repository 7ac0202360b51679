"""The force audit on simulated runs of the whole hand: one that never could have held, and ones that do."""

from __future__ import annotations

import numpy as np
import pytest
from short_runs import plan_of, report_of, trace_of, turn_problem, with_truth

from dexplan import pipeline
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.judge.checks_case import CheckResult
from dexplan.sim.trace import Trace

MU = 0.55


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Two contacts 140 degrees apart hold the ball."""
    return load_problem("hold_two")


def rerun(problem: Problem, sliding: float) -> Trace:
    """Return the run where friction truly is ``sliding``, torsion with it; planner and controller believe the problem."""
    return pipeline.rollout(problem, plan_of(problem), world=with_truth(problem, sliding=sliding))


def judge(problem: Problem, sliding: float, trace: Trace) -> CheckResult:
    true = with_truth(problem, sliding=sliding)
    return pipeline.validate(problem, plan_of(problem), trace, world=true)["force_qp_feasible"]


def test_grasp_that_cannot_hold_is_infeasible_before_anything_moves(problem: Problem) -> None:
    trace = rerun(problem, 0.30)
    assert np.all(trace["qvel"][0] == 0.0)
    result = judge(problem, 0.30, trace)
    assert (result.status, result.worst_time_s) == ("fail", 0.0)
    # A pair of fingers 140 degrees apart leans by 20: friction 0.364 is the least, and the weight asks for a little more.
    assert "2 contacts miss the wrench by" in result.note
    assert "forces exist from 1.25 times the friction on" in result.note
    # The friction is MuJoCo's: a problem that claims the old one changes nothing.
    nominal = pipeline.validate(problem, plan_of(problem), trace)["force_qp_feasible"]
    assert nominal.note.split(";")[:2] == result.note.split(";")[:2]
    assert nominal.status == "fail"


def test_least_friction_is_one_number_whatever_is_true(problem: Problem) -> None:
    """What is needed is a property of the grasp: the factor times the true friction is the same."""
    needed = []
    for sliding in (MU, 0.45):
        trace = trace_of(problem) if sliding == MU else rerun(problem, sliding)
        result = judge(problem, sliding, trace)
        assert (result.status, result.value) == ("pass", 0.0)
        needed.append(sliding * float(result.note.split("forces exist from ")[1].split(" ")[0]))
    assert needed == pytest.approx([0.374, 0.374], abs=0.006)


def test_turn_with_a_substitution_is_feasible_throughout() -> None:
    result = report_of(turn_problem())["force_qp_feasible"]
    assert (result.status, result.value) == ("pass", 0.0)
    assert "undecided" not in result.note
    assert "times the friction on" in result.note
