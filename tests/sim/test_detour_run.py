"""A bar between a fingertip's home and where it has to land: the run passes by a detour; along the arc it would hit the bar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.contacts.states import StateChecks
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.spatial import direction_from_angles


def cone(azimuth: float, elevation: float, half_angle: float) -> dict[str, object]:
    axis = direction_from_angles(np.array(azimuth), np.array(elevation))
    return {"axis": axis.tolist(), "half_angle_deg": half_angle}


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Return the problem of a ball that may be touched at three places only, the third of them behind a bar."""
    return load_problem(
        "fig4_substitution",
        {
            "start.contacts_deg": ["free", [82.0, 0.0], [-138.0, 0.0]],
            "object.allowed_regions": [cone(82.0, 0.0, 4.0), cone(-138.0, 0.0, 4.0), cone(-80.0, -40.0, 6.0)],
            "goal.rotation.angle_deg": 110.0,
            "gait.node_budget": 15,
            "obstacles": [{"kind": "box", "pos_m": [0.075, -0.03, 0.136], "size_m": [0.002, 0.06, 0.002]}],
        },
    )


@pytest.fixture(scope="module")
def plan(problem: Problem) -> Plan:
    return pipeline.plan(problem)


def test_the_plan_goes_around_the_bar_and_passes_every_check(problem: Problem, plan: Plan) -> None:
    assert plan.is_solved, plan.reason
    detours = [a for a in plan.actions if any(way.is_detour for way in a.ways)]
    assert [(a.name, a.finger) for a in detours] == [("place", 0)]
    assert "a detour keeps finger_1/tip and obstacle_1 apart" in plan.explain()
    trace = pipeline.rollout(problem, plan)
    report = pipeline.validate(problem, plan, trace)
    assert report.is_passed, report.table()
    clearance = report["free_finger_clearance_min"].value
    assert clearance is not None
    assert clearance >= 2.0


def test_along_the_arc_the_finger_would_hit_the_bar(problem: Problem, plan: Plan) -> None:
    arcs = replace(plan, actions=tuple(replace(a, ways=()) for a in plan.actions))
    arcs = pipeline.time_plan(problem, arcs)
    report = pipeline.validate(problem, arcs, pipeline.rollout(problem, arcs))
    assert not report.is_passed
    assert report["free_finger_clearance_min"].status == "fail"


def test_with_arcs_alone_there_is_no_plan(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StateChecks, "may_go_around", lambda self, *asked: False)
    refused = pipeline.plan(problem)
    assert not refused.is_solved
    assert "finger_1/tip and obstacle_1 come too near on the way" in refused.reason
