"""What is believed and what is true are two problems: who is told which, what is judged by which, and what is no world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from foreign_controllers import Spy, hold, make_hold
from matplotlib.figure import Figure
from short_runs import failed, trace_of, with_truth

from dexplan import pipeline
from dexplan.errors import ProblemError
from dexplan.problems.problem import Obstacle, Problem
from dexplan.problems.read import load_problem
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace

TRUE = {"friction.sliding": 0.45, "object.mass_kg": 0.09, "object.radius_m": 0.034}
SAID = (
    "the world is not as believed: object.radius_m 0.034 instead of 0.035, object.mass_kg 0.09 instead of 0.06, "
    "friction.sliding 0.45 instead of 0.55, friction.torsional_m 0.00243 instead of 0.0025"
)


@pytest.fixture(scope="module")
def world() -> Problem:
    return load_problem(
        "hold_three", {**TRUE, "start.contacts_deg": [[0.0, 0.0], [120.0, 0.0], [240.0, 0.0]]}
    )


@pytest.fixture(scope="module")
def run(world: Problem) -> Trace:
    return pipeline.rollout(*hold(), world=world)


@pytest.fixture(scope="module")
def report(run: Trace, world: Problem) -> ValidationReport:
    return pipeline.validate(*hold(), run, world=world)


def test_physics_is_the_worlds(run: Trace) -> None:
    model = mujoco.MjModel.from_xml_string(run.model_xml)
    assert model.body("object/").mass[0] == pytest.approx(0.09)
    assert model.geom("object/surface").size[0] == pytest.approx(0.034)
    assert model.geom("object/surface").friction[0] == pytest.approx(0.45)


def test_the_controller_is_told_what_is_believed(world: Problem) -> None:
    spy = Spy(make_hold())
    trace = pipeline.rollout(*hold(), controller=spy, world=world)
    believed = mujoco.MjModel.from_xml_string(spy.starts[0].model_xml)
    assert believed.body("object/").mass[0] == pytest.approx(0.06)
    assert spy.starts[0].model_xml == trace_of(hold()[0]).model_xml != trace.model_xml
    report = pipeline.validate(*hold(), trace, world=world)
    assert failed(report).isdisjoint({"physics_untouched", "files_agree", "replay_matches", "not_dropped"})


def test_our_own_controller_plans_with_what_is_believed(run: Trace) -> None:
    """At rest the planned forces carry the believed weight, the measured ones the true one."""
    t = 20
    R_OC = run["contact_rotation_O"][t]
    lift = {
        name: np.einsum("fij,fj->fi", R_OC, run[name][t, :, :3])[:, 2].sum()
        for name in ("contact_force", "contact_force_reference")
    }
    assert lift["contact_force"] == pytest.approx(0.09 * 9.81, rel=0.05)
    assert lift["contact_force_reference"] == pytest.approx(0.06 * 9.81, rel=0.05)


def test_the_report_states_both(report: ValidationReport, tmp_path: Path) -> None:
    assert failed(report).isdisjoint(
        {"physics_untouched", "files_agree", "replay_matches", "trace_consistent"}
    )
    assert report.reservations == (SAID,)
    assert report.summary_line().endswith(SAID)
    assert report.untrue["object.mass_kg"] == {"believed": 0.06, "true": 0.09}
    physics = report.physics
    assert (physics["object_mass_kg"], physics["object_mass_believed_kg"]) == (pytest.approx(0.09), 0.06)
    assert (physics["sliding_friction"], physics["sliding_friction_believed"]) == (0.45, 0.55 / 1.3)
    assert physics["torsional_friction_believed_m"] == 0.0025 / 1.3
    assert ValidationReport.load(report.save(tmp_path / "report.json")) == report


def test_a_judge_that_is_not_told_does_not_guess(run: Trace) -> None:
    stated = pipeline.validate(*hold(), run)
    assert {"physics_untouched", "files_agree"} <= failed(stated)
    assert "made in a world with object.radius_m 0.034 instead of 0.035" in stated["files_agree"].note
    assert stated.untrue == {}
    other = pipeline.validate(*hold(), run, world=with_truth(hold()[0], mass_kg=0.08))
    assert {"physics_untouched", "files_agree"} <= failed(other)


def test_a_world_that_was_not_there_is_not_believed() -> None:
    """Friction that the run did not have makes no run better."""
    problem, plan = hold()
    report = pipeline.validate(problem, plan, trace_of(problem), world=with_truth(problem, sliding=0.9))
    assert "physics_untouched" in failed(report)


def test_a_world_as_believed_changes_nothing() -> None:
    problem, plan = hold()
    trace = pipeline.rollout(
        problem, plan, world=replace(problem, name="another", summary="the same", seed=5)
    )
    assert trace == pipeline.rollout(problem, plan)
    assert pipeline.validate(problem, plan, trace, world=problem).reservations == ()


def test_a_saved_run_is_judged_by_the_world_it_was_made_in(
    run: Trace, report: ValidationReport, tmp_path: Path
) -> None:
    pipeline.save_run(tmp_path, *hold(), run, report)
    again = pipeline.validate_as_recorded(*pipeline.load_run(tmp_path))
    assert again.checks == report.checks
    assert again.summary_line() == report.summary_line()
    assert again.untrue == report.untrue


def test_plans_are_judged_by_what_was_believed_and_forces_by_what_is_true() -> None:
    """Friction that carries nothing: the plan was sound, and no forces existed."""
    problem = load_problem("hold_two")
    plan, true = pipeline.plan(problem), with_truth(problem, sliding=0.3)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan, world=true), world=true)
    assert "force_qp_feasible" in failed(report)
    assert failed(report).isdisjoint({"plan_force_closure", "plan_load_margin"})


# -- what is no world ---------------------------------------------------------------------------------------------------

BAD: dict[str, tuple[dict[str, Any], str]] = {
    "safety": (
        {"friction.safety": 1.2},
        "friction.safety: 1.2 is given where the problem has 1.3; a world may differ in",
    ),
    "goal": ({"goal.rotation.angle_deg": 10.0}, "goal.rotation: "),
    "limit": ({"acceptance.penetration_max_um": 900.0}, "acceptance.penetration_max_um: 900 is given where"),
    "profile": (
        {"control.physics_profile": "portable"},
        "control.physics_profile: 'portable' is given where",
    ),
    "speed": ({"control.speed_deg_s": 5.0}, "control.speed_deg_s: 5 is given where the problem has 30"),
    "start": ({"start.contacts_deg": "auto"}, "start.contacts_deg: 'auto' is given"),
    "tip limit": ({"hand.tip_polar_limit_deg": 70.0}, "hand.tip_polar_limit_deg: 70 is given where"),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_world_differs_in_the_world_alone(kind: str) -> None:
    problem, plan = hold()
    changes, words = BAD[kind]
    world = load_problem("hold_three", changes)
    for ask in (
        lambda: pipeline.rollout(problem, plan, world=world),
        lambda: pipeline.validate(problem, plan, trace_of(problem), world=world),
    ):
        with pytest.raises(ProblemError) as caught:
            ask()
        assert str(caught.value).startswith(f"world: {words}")
        assert "a world may differ in object.radius_m, object.mass_kg, object.shape, object.com_m" in str(
            caught.value
        )


def _with(section: str, **values: Any) -> Problem:
    problem = hold()[0]
    return replace(problem, **{section: replace(getattr(problem, section), **values)})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: _with("object", mass_kg=-1.0), "world: object.mass_kg: -1.0 is out of range"),
        (lambda: _with("object", mass_kg=float("nan")), "world: object.mass_kg: "),
        (lambda: _with("friction", sliding=0.0), "world: friction.sliding: 0.0 is out of range"),
        (
            lambda: _with("friction", torsional_m=0.1),
            "world: friction.torsional_m: 0.1 implies a contact patch",
        ),
        (lambda: _with("hand", tip_radii_m=(0.018, 0.018)), "world: hand"),
        (
            lambda: _with("hand", joint_ranges_deg={"finger_1.joint_9": (0.0, 1.0)}),
            "world: hand.joint_ranges_deg",
        ),
        (lambda: replace(hold()[0], obstacles=(Obstacle("cone", (0, 0, 0), (1.0,)),)), "world: obstacles"),
        (
            lambda: replace(hold()[0], scene="another"),
            "world: scene: 'another' is given where the problem has",
        ),
        (lambda: pipeline.build_scene(hold()[0]), "world: it is of type Scene; a Problem is accepted"),
        (lambda: "hold_three", "world: it is of type str; a Problem is accepted"),
        (lambda: 0.4, "world: it is of type float"),
    ],
)
def test_what_is_no_world_is_refused_in_one_sentence(make: Any, words: str) -> None:
    world = make()
    with pytest.raises(ProblemError) as caught:
        pipeline.rollout(*hold(), world=world)
    assert str(caught.value).startswith(words)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    "recorded", [5, [], "world", {}, {"friction": 5}, {"friction": {"sliding": "ice"}}, {"object": None}]
)
def test_a_record_that_names_no_world_is_refused(recorded: Any) -> None:
    problem, plan = hold()
    trace = trace_of(problem)
    odd = Trace(trace.model_xml, trace.columns, {**trace.meta, "world_as_run": recorded})
    with pytest.raises(ProblemError):
        pipeline.validate_as_recorded(problem, plan, odd)


def test_a_recorded_world_of_bad_numbers_is_refused() -> None:
    problem, plan = hold()
    trace = trace_of(problem)
    for table, key, value in (
        ("friction", "sliding", "ice"),
        ("object", "mass_kg", -1.0),
        ("hand", "tip_radii_m", []),
    ):
        data = problem.as_dict()
        data[table] = {**data[table], key: value}
        odd = Trace(trace.model_xml, trace.columns, {**trace.meta, "world_as_run": data})
        with pytest.raises(ProblemError, match=rf"world: {table}\.{key}"):
            pipeline.validate_as_recorded(problem, plan, odd)


def test_the_figure_shows_what_is_true_and_keeps_off_its_legend(
    run: Trace, report: ValidationReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dexplan.viz import figure

    shown: list[Any] = []
    draw = figure.compute_curves
    monkeypatch.setattr(figure, "compute_curves", lambda *given: shown.append(given[0]) or draw(*given))
    long = replace(report, groups=("physics",), recorded={**report.recorded, "controller": "mine" * 30})
    lines: list[float] = []
    write = Figure.text
    monkeypatch.setattr(
        Figure, "text", lambda self, x, y, *a, **k: lines.append(y) or write(self, x, y, *a, **k)
    )
    keys: list[float] = []
    name = Figure.legend
    monkeypatch.setattr(
        Figure, "legend", lambda self, **k: keys.append(k["bbox_to_anchor"][1]) or name(self, **k)
    )
    pipeline.draw_run(tmp_path, *hold(), run, long)
    assert shown[0]["friction"]["sliding"] == 0.45
    assert len(lines) > 4
    assert min(lines) > keys[0] + 0.005
