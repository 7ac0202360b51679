"""Goals in a row: plans are joined only where they fit, every goal is measured in the one run, and shortfalls are told."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from dexplan import pipeline
from dexplan.plans.goal import RotationGoal
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.trace import Trace
from dexplan.spatial import VERTICAL, Array
from dexplan.witness.endurance import (
    Chain,
    Endurance,
    build_whole_problem,
    choose_attitude,
    choose_full_turn,
    join_plans,
    measure_goals,
    plan_chain,
    run_chain,
)
from dexplan.witness.endurance_picture import describe, draw


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem("any_attitude")


@pytest.fixture(scope="module")
def chain(problem: Problem) -> Chain:
    """Three short turns, to and fro."""
    signs = iter((1.0, -1.0, 1.0))
    return plan_chain(problem, lambda X: RotationGoal(X, VERTICAL, next(signs) * np.radians(8.0)), 3)


@pytest.fixture(scope="module")
def run(problem: Problem, chain: Chain) -> Endurance:
    return run_chain("short", problem, chain)


def test_attitudes_are_far_apart() -> None:
    choose, X_WO = choose_attitude(np.random.default_rng(0)), np.eye(4)
    for _ in range(50):
        goal = choose(X_WO)
        trace = np.trace(goal.X_WO_goal[:3, :3] @ X_WO[:3, :3].T)
        assert np.degrees(np.arccos(0.5 * (trace - 1.0))) >= 90.0 - 1e-6
        X_WO = goal.X_WO_goal
    np.testing.assert_allclose(choose_full_turn(X_WO).X_WO_goal, X_WO, atol=1e-12)


def test_a_chain_is_one_plan_without_gaps(chain: Chain) -> None:
    assert (len(chain.goals), chain.asked, chain.reason) == (3, 3, "")
    assert [a.name for a in chain.plan.actions] == ["hold", *["move_object", "hold"] * 3]
    assert [g.last_action for g in chain.goals] == [2, 4, 6]
    for a, b in zip(chain.plan.actions, chain.plan.actions[1:], strict=False):
        np.testing.assert_allclose(a.X_WO_end, b.X_WO_start, atol=1e-12)
    assert chain.plan.turned_angle == pytest.approx(np.radians(8.0))
    np.testing.assert_allclose(chain.plan.X_WO_goal, chain.plan.actions[-1].X_WO_end, atol=1e-12)


def test_every_goal_is_met_in_one_run(run: Endurance, tmp_path: Path) -> None:
    assert run.is_met, list(describe(run))
    assert run.report.is_passed
    for goal in run.goals:
        assert goal.position_mm is not None
        assert goal.position_mm < 0.1
        assert goal.turn_deg == pytest.approx(8.0)
    data = json.loads(json.dumps(run.as_dict()))
    assert (data["asked"], data["met"], data["is_met"]) == (3, 3, True)
    assert "3 of 3 goals met" in list(describe(run))[-1]
    assert imread(draw((run,), tmp_path / "endurance.png")).shape[1] > 1000


def test_an_object_that_moved_is_seen(run: Endurance, problem: Problem) -> None:
    """A trace whose object stands 2 mm and 2 degrees off during the second goal fails that goal alone."""
    address = pipeline.build_scene(problem).object_qpos
    inside = np.isin(run.trace["action_index"], (3, 4))
    half = np.radians(1.0)
    for column, change, name in ((0, 0.002, "position_mm"), (6, half, "rotation_deg")):
        columns = {key: run.trace[key] for key in run.trace.columns}
        columns["qpos"] = columns["qpos"].copy()
        columns["qpos"][inside, address + column] += change
        results = measure_goals(run.chain, Trace(run.trace.model_xml, columns, run.trace.meta), address)
        assert [r.is_met for r in results] == [True, False, True]
        assert getattr(results[1], name) > 1.9


def test_a_run_that_ends_early_misses_the_rest(run: Endurance, problem: Problem) -> None:
    address = pipeline.build_scene(problem).object_qpos
    whole = len(run.trace["time"])
    count = int(np.flatnonzero(run.trace["action_index"] == 4)[3])
    columns = {
        key: value[:count] if np.shape(value)[:1] == (whole,) else value
        for key, value in ((k, run.trace[k]) for k in run.trace.columns)
    }
    meta = {**run.trace.meta, "failure": "the object was dropped"}
    cut = Trace(run.trace.model_xml, columns, meta)
    results = measure_goals(run.chain, cut, address)
    assert [r.is_met for r in results] == [True, False, False]
    assert results[2].reached_s is None
    short = replace(run, trace=cut, goals=results)
    assert not short.is_met
    assert "the object was dropped" in "\n".join(describe(short))


def test_a_goal_without_a_plan_ends_the_chain(problem: Problem) -> None:
    def choose(X_WO: Array) -> RotationGoal:
        far = np.array([0.0, 0.5, 0.0]) if X_WO[0, 1] != 0.0 else np.zeros(3)
        return RotationGoal(X_WO, VERTICAL, np.radians(5.0), far)

    chain = plan_chain(problem, choose, 3)
    assert len(chain.goals) == 1
    assert chain.reason.startswith("goal 2: goal_unreachable: ")
    with pytest.raises(ValueError, match="1 or more"):
        plan_chain(problem, choose_full_turn, 0)


def test_plans_that_do_not_fit_are_not_joined(chain: Chain) -> None:
    plan = chain.plan
    with pytest.raises(ValueError, match="starts elsewhere"):
        join_plans(plan, plan)
    end = plan.actions[-1]
    with pytest.raises(ValueError, match="other contacts"):
        join_plans(plan, replace(plan, X_WO_start=end.X_WO_end, start_contacts=(None, *end.contacts_end[1:])))


def test_the_whole_is_judged_by_its_last_goal(chain: Chain, problem: Problem) -> None:
    turn = build_whole_problem(problem, chain.plan).goal.rotation
    assert turn is not None
    assert turn.angle_deg == pytest.approx(8.0)
    goal = build_whole_problem(problem, replace(chain.plan, turned_angle=None)).goal
    assert goal.orientation_wxyz == pytest.approx(
        [np.cos(np.radians(4.0)), 0.0, 0.0, np.sin(np.radians(4.0))]
    )
