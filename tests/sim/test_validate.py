"""The report: verdict, texts, files, and limits that a problem may set."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from held_ball import make_case, make_plan, make_problem, record

from dexplan.errors import RunFolderError
from dexplan.sim.judge.validate import CHECKS, ValidationReport, load_default_limits, validate_run
from dexplan.sim.trace import Trace


@pytest.fixture(scope="module")
def trace() -> Trace:
    run = record(samples=250)
    return Trace(run.model_xml, make_case(run).columns, run.meta)


@pytest.fixture(scope="module")
def report(trace: Trace) -> ValidationReport:
    return validate_run(make_problem(), make_plan(), trace)


def test_honest_hold_passes(report: ValidationReport) -> None:
    assert report.failures == ()
    assert report.is_passed
    assert report.summary_line().startswith("PASS hold: turn off by ")
    assert [c.name for c in report.checks] == [name for name, _ in CHECKS]
    assert report["contact_error_final"].status == "not_applicable"


def test_report_says_what_was_simulated(report: ValidationReport) -> None:
    assert report.physics["implied_patch_radius_mm"] == pytest.approx(7.72, abs=0.01)
    assert report.physics["object_mass_kg"] == pytest.approx(0.06)
    assert report.timing["simulated_s"] == pytest.approx(1.0)
    assert set(report.versions) == {"python", "dexplan", "mujoco", "numpy", "osqp", "scipy"}


def test_report_survives_its_file(report: ValidationReport, tmp_path: Path) -> None:
    path = report.save(tmp_path / "report.json")
    assert ValidationReport.load(path) == report
    assert [p.name for p in tmp_path.iterdir()] == ["report.json"]
    assert set(json.loads(path.read_text(encoding="utf-8"))["checks"][0]) == {
        "name",
        "status",
        "value",
        "limit",
        "unit",
        "worst_time_s",
        "note",
    }


def test_bad_reports_are_named(report: ValidationReport, tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    with pytest.raises(RunFolderError, match="cannot be read as a report"):
        ValidationReport.load(path)
    path.write_text('{"format": 2}')
    with pytest.raises(RunFolderError, match="report format 2"):
        ValidationReport.load(path)


def test_table_has_one_line_per_check(report: ValidationReport) -> None:
    lines = report.table().splitlines()
    assert len(lines) == len(CHECKS) + 1
    assert lines[0].split() == ["check", "status", "value", "limit", "unit", "at", "s", "note"]


def test_limits_of_problem_and_caller_stand_over_the_defaults(trace: Trace) -> None:
    strict = make_problem(acceptance={"penetration_max_um": 1.0})
    judged = validate_run(strict, make_plan(), trace)
    assert [c.name for c in judged.failures] == ["penetration_max"]
    assert judged.summary_line().startswith("FAIL penetration_max ")
    assert "(limit 1) at " in judged.summary_line()
    assert validate_run(strict, make_plan(), trace, {"penetration_max_um": 200.0}).is_passed


def test_tampered_record_fails(trace: Trace) -> None:
    ctrl = np.array(trace["ctrl"])
    ctrl[100, 2] += 1e-6
    judged = validate_run(
        make_problem(), make_plan(), Trace(trace.model_xml, {**trace.columns, "ctrl": ctrl}, {})
    )
    assert judged.failures[0].name == "replay_matches"
    assert judged.failures[0].worst_time_s is not None
    assert judged.failures[0].worst_time_s > 0.4


def test_failure_without_a_value_says_why(trace: Trace) -> None:
    columns = {name: column for name, column in trace.columns.items() if name != "qp_status"}
    judged = validate_run(make_problem(), make_plan(), Trace(trace.model_xml, columns, {}))
    assert judged.summary_line() == (
        "FAIL force_qp_feasible without a value (limit 0): the record has no qp_status or qp_wrench_residual"
    )


def test_run_without_controls_is_refused(trace: Trace) -> None:
    columns = {name: column for name, column in trace.columns.items() if name != "ctrl"}
    with pytest.raises(RunFolderError, match="lacks ctrl"):
        validate_run(make_problem(), make_plan(), Trace(trace.model_xml, columns, {}))


def test_run_of_one_sample_is_judged() -> None:
    judged = validate_run(make_problem(), make_plan(), record(samples=1))
    assert not judged.is_passed


def test_plan_without_actions_fails(trace: Trace) -> None:
    plan = {**make_plan(), "actions": [], "status": "unsolved"}
    names = {c.name for c in validate_run(make_problem(), plan, trace).failures}
    assert {"phases_in_order", "contact_schedule", "plan_force_closure"} <= names


def test_defaults_are_a_copy() -> None:
    load_default_limits()["penetration_max_um"] = 0.0
    assert load_default_limits()["penetration_max_um"] > 0.0
