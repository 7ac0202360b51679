"""Runs of other controllers are judged by what they have; runs of ours that lost what they had are not let off."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from foreign_controllers import held_trace, hold, load_example
from short_runs import failed, report_of, trace_of

from dexplan import pipeline
from dexplan.control.foreign import RunStart
from dexplan.control.observation import Observation
from dexplan.errors import ProblemError
from dexplan.sim.judge.groups import GROUPS, OWN_COLUMNS
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace

JUDGED = "judged: physics, task, contacts, forces; not recorded: internals"
NAME = "foreign_controller.Hold"


def without(trace: Trace, *names: str, **meta: Any) -> Trace:
    """Return the trace without columns, its meta replaced by ``meta``."""
    kept = {name: column for name, column in trace.columns.items() if name not in names}
    return Trace(trace.model_xml, kept, {**trace.meta, **meta})


@pytest.fixture(scope="module")
def held() -> ValidationReport:
    return pipeline.validate(*hold(), held_trace())


def test_constant_targets_pass_by_what_they_have(held: ValidationReport, tmp_path: Path) -> None:
    assert held.is_passed, held.table()
    assert held.groups == ("physics", "task", "contacts", "forces")
    assert held.summary_line().startswith("PASS hold_three: ")
    assert held.summary_line().endswith(f"; run by {NAME}; {JUDGED}")
    for check in held.checks:
        is_internal = check.name in GROUPS["internals"]
        assert (check.status == "not_recorded") == is_internal
        if is_internal:
            assert (check.value, check.limit, check.note) == (
                None,
                None,
                f"{NAME} is asked for its controls alone",
            )
    assert f"{JUDGED}" in str(held)
    assert held.table().count("not recorded") == len(GROUPS["internals"])
    assert held.as_dict()["recorded"]["controller"] == NAME
    assert ValidationReport.load(held.save(tmp_path / "report.json")) == held


def test_forces_are_audited_without_a_program_of_the_controllers(held: ValidationReport) -> None:
    audit = held["force_qp_feasible"]
    assert (audit.status, audit.value) == ("pass", 0.0)
    assert "forces exist from" in audit.note
    assert "residual" not in audit.note
    assert "residual" in report_of(hold()[0])["force_qp_feasible"].note


def test_a_run_of_ours_says_nothing_of_groups() -> None:
    own = report_of(hold()[0])
    assert own.is_passed
    assert own.groups == tuple(GROUPS)
    assert "judged" not in own.summary_line()
    assert own.recorded["controller"] is None


def test_one_that_lets_go_fails_physically_and_its_internals_do_not() -> None:
    trace = pipeline.rollout(*hold(), controller=load_example("foreign_controller")["LetGo"]())
    report = pipeline.validate(*hold(), trace)
    assert {"not_dropped", "position_error_max", "contact_schedule"} <= failed(report)
    assert report["not_dropped"].worst_time_s == pytest.approx(0.6, abs=0.05)
    assert failed(report).isdisjoint({*GROUPS["physics"], *GROUPS["internals"]})
    assert report.summary_line().startswith("FAIL not_dropped ")
    assert report.summary_line().endswith(JUDGED)


# -- what is judged cannot be talked away ------------------------------------------------------------------------------


def test_our_own_run_does_not_pass_without_its_internals() -> None:
    own = trace_of(hold()[0])
    for names in (OWN_COLUMNS, *((name,) for name in OWN_COLUMNS)):
        report = pipeline.validate(*hold(), without(own, *names))
        assert not report.is_passed, names
        assert not any(check.status == "not_recorded" for check in report.checks)
        assert failed(report) <= {*GROUPS["internals"], "force_qp_feasible"}


@pytest.mark.parametrize("named", ["", "   ", None, 7, ["Hold"], {}, True])
def test_what_names_no_controller_is_a_run_of_ours(named: Any) -> None:
    report = pipeline.validate(*hold(), without(held_trace(), controller=named))
    assert failed(report) == {*GROUPS["internals"], "force_qp_feasible"}


def test_another_controllers_name_on_our_record_contradicts_it() -> None:
    """Bad numbers of ours cannot be hidden behind a name while they stand there."""
    own = trace_of(hold()[0])
    at_limit = {**own.columns, "ik_at_limit": np.ones(own.sample_count, dtype=bool)}
    bad = Trace(own.model_xml, at_limit, {**own.meta, "controller": "mine"})
    report = pipeline.validate(*hold(), bad)
    assert failed(report) == {"files_agree"}
    assert "names mine and holds contact_force_reference, qp_status" in report["files_agree"].note
    left = [name for name in OWN_COLUMNS if name != "ik_at_limit"]
    report = pipeline.validate(*hold(), without(bad, *left))
    assert failed(report) == {"files_agree"}


def test_a_record_that_is_stripped_and_renamed_is_told_by_its_verdict() -> None:
    """All that is left of it then is its controls, and no more is claimed of it."""
    own = trace_of(hold()[0])
    report = pipeline.validate(*hold(), without(own, *OWN_COLUMNS, controller="mine"))
    assert report.summary_line().endswith(f"; run by mine; {JUDGED}")
    assert report.summary_line() != report_of(hold()[0]).summary_line()


def test_controls_that_were_edited_do_not_replay() -> None:
    trace = held_trace()
    ctrl = np.array(trace["ctrl"])
    ctrl[30, 3] += 1e-9
    edited = Trace(trace.model_xml, {**trace.columns, "ctrl": ctrl}, trace.meta)
    assert "replay_matches" in failed(pipeline.validate(*hold(), edited))


class ReachesBehind:
    """Presses no more, and holds the ball up by a force that it writes into the simulation."""

    def __init__(self) -> None:
        self._loose = load_example("foreign_controller")["Hold"](0.5)

    def reset(self, start: RunStart) -> None:
        self._loose.reset(start)

    def step(self, observation: Observation) -> np.ndarray:
        frame = sys._getframe()
        while frame is not None and not isinstance(frame.f_locals.get("data"), mujoco.MjData):
            frame = frame.f_back  # type: ignore[assignment]
        frame.f_locals["data"].body("object/").xfrc_applied[2] = 0.06 * 9.81
        return self._loose.step(observation)


def test_what_a_controller_does_behind_the_simulation_is_not_believed() -> None:
    trace = pipeline.rollout(*hold(), controller=ReachesBehind())
    assert trace.meta["failure"] is None
    assert "replay_matches" in failed(pipeline.validate(*hold(), trace))


def test_a_name_over_several_lines_stays_in_one() -> None:
    report = pipeline.validate(*hold(), without(held_trace(), controller="mine\nPASS everything"))
    assert len(report.summary_line().splitlines()) == 1
    assert report.summary_line().endswith(f"; run by mine PASS everything; {JUDGED}")


# -- groups -------------------------------------------------------------------------------------------------------------


def test_nothing_that_is_recorded_is_no_pass() -> None:
    with pytest.raises(
        ProblemError, match=f"nothing is recorded of internals in a run by {NAME}; accepted: physics"
    ):
        pipeline.validate(*hold(), held_trace(), groups=["internals"])
    own = pipeline.validate(*hold(), trace_of(hold()[0]), groups=["internals"])
    assert own.groups == ("internals",)


def test_what_is_left_out_and_what_was_not_recorded_are_told_apart() -> None:
    report = pipeline.validate(*hold(), held_trace(), groups=["task", "internals"])
    assert report.groups == ("task",)
    assert report.summary_line().endswith(
        "judged: task; not recorded: internals; not judged: physics, contacts, forces"
    )
    statuses = {check.status for check in report.checks if check.name in GROUPS["physics"]}
    assert statuses == {"not_applicable"}


def test_a_folder_of_another_controllers_run_is_whole(held: ValidationReport, tmp_path: Path) -> None:
    problem, plan = hold()
    pipeline.save_run(tmp_path, problem, plan, held_trace(), held)
    assert (tmp_path / "summary.png").stat().st_size > 10_000
    again = pipeline.load_run(tmp_path)
    assert again[2] == held_trace()
    judged = pipeline.validate_as_recorded(*again)
    assert judged.checks == held.checks
    assert judged.summary_line() == held.summary_line()


def test_old_reports_are_read(tmp_path: Path) -> None:
    """Reports of before have neither a controller nor a true world."""
    own = report_of(hold()[0])
    data = own.as_dict()
    del data["untrue"], data["recorded"]["controller"]
    (tmp_path / "report.json").write_text(json.dumps(data), encoding="utf-8")
    assert ValidationReport.load(tmp_path / "report.json").summary_line() == own.summary_line()
