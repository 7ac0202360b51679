"""Cube, egg and prism in MuJoCo: honest runs pass, and runs with one thing wrong do not; each made by simulation."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from short_runs import DROPPED, failed, lift_wrong_finger, plan_of, report_of, with_truth

from dexplan import pipeline
from dexplan.problems.problem import Problem
from dexplan.problems.read import build_problem, load_problem

PRISM = [
    [0.03 * float(np.cos(a)), 0.03 * float(np.sin(a)), z]
    for z in (-0.025, 0.025)
    for a in np.radians(np.arange(6) * 60.0)
]
SHAPES = {
    "cube": {"kind": "box", "half_sizes_m": [0.03, 0.03, 0.03]},
    "egg": {"kind": "ellipsoid", "semi_axes_m": [0.03, 0.03, 0.04]},
    "prism": {"kind": "mesh", "vertices_m": PRISM},
}
TURNED = {"cube": 150.0, "egg": 20.0, "prism": 20.0}
"""So far the cube turns with a handover on a face."""
EXACT = {
    "position_error_max": 0.5, "rotation_error_max": 1.0, "position_error_final": 0.3, "rotation_error_final": 0.5,
    "coulomb_slip_max": 0.05,
}  # fmt: skip


@lru_cache
def body_problem(name: str) -> Problem:
    return build_problem(
        {
            "format": 1,
            "name": name,
            "object": {"shape": SHAPES[name], "mass_kg": 0.07},
            "hand": {"tip_radii_m": [0.012] * 3},
            "goal": {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": TURNED[name]}},
        }
    )


@pytest.mark.parametrize("name", SHAPES)
def test_an_honest_run_passes(name: str) -> None:
    report = report_of(body_problem(name))
    assert report.is_passed, report.table()
    for check, most in EXACT.items():
        value = report[check].value
        assert value is not None
        assert value <= most
    assert (report["edge_distance_min"].status == "not_applicable") == (name == "egg")


@pytest.mark.parametrize("name", SHAPES)
def test_less_friction_than_believed(name: str) -> None:
    problem = body_problem(name)
    true = with_truth(problem, sliding=0.03)
    trace = pipeline.rollout(problem, plan_of(problem), world=true)
    known = failed(pipeline.validate(problem, plan_of(problem), trace, world=true))
    assert known & {*DROPPED, "coulomb_slip_max", "friction_utilisation_max"}
    assert known.isdisjoint({"physics_untouched", "files_agree"})


def test_wrong_finger_lifts_off_a_face() -> None:
    problem = body_problem("cube")
    plan = plan_of(problem)
    first = next(k for k, action in enumerate(plan.actions) if action.name == "lift")
    wrong = lift_wrong_finger(problem, replace(plan, actions=plan.actions[: first + 1]))
    trace = pipeline.rollout(problem, wrong)
    assert {*DROPPED, "plan_force_closure"} <= failed(pipeline.validate(problem, wrong, trace))


@pytest.mark.parametrize("name", ["cube", "prism"])
def test_contacts_beside_an_edge_are_seen(name: str) -> None:
    """The true body ends 1.5 mm above or below the first contacts."""
    problem = body_problem(name)
    points = [c.point_O for c in plan_of(problem).start_contacts if c is not None]
    height = max(abs(float(p[2])) for p in points) + 1.5e-3
    shape = problem.object.shape
    assert shape is not None
    if shape.half_sizes_m is not None:
        lower = replace(shape, half_sizes_m=(*shape.half_sizes_m[:2], height))
    else:
        assert shape.vertices_m is not None
        corners = tuple((x, y, float(np.sign(z)) * height) for x, y, z in shape.vertices_m)
        lower = replace(shape, vertices_m=corners)
    true = replace(problem, object=replace(problem.object, shape=lower))
    trace = pipeline.rollout(problem, plan_of(problem), world=true)
    report = pipeline.validate(problem, plan_of(problem), trace, world=true)
    assert "edge_distance_min" in failed(report)
    # Of the prism's two contacts the higher one is 1.5 mm from its edge; the cube's handover goes nearer still.
    value = report["edge_distance_min"].value
    assert value is not None
    assert value <= 1.8
    assert "physics_untouched" not in failed(report)


def test_another_body_than_the_problem_says_is_seen() -> None:
    problem = body_problem("egg")
    shape = problem.object.shape
    assert shape is not None
    true = replace(
        problem, object=replace(problem.object, shape=replace(shape, semi_axes_m=(0.03, 0.03, 0.043)))
    )
    trace = pipeline.rollout(problem, plan_of(problem), world=true)
    assert "physics_untouched" in failed(pipeline.validate(problem, plan_of(problem), trace))


def test_a_pen_lies_still_at_125_hz() -> None:
    """What turns slowly was shaken off where carried poses followed measured ones by a fifth in ticks of 8 ms."""
    problem = load_problem("pen", {"control.rate_hz": 125})
    plan = pipeline.plan(problem)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan))
    assert report.is_passed, report
    assert report["rotation_error_max"].value < 0.1
