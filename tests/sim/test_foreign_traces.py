"""Records from elsewhere and records that are none: told, never believed and never a traceback."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from held_ball import make_case, make_plan, make_problem, record, solve_posture

from dexplan.errors import RunFolderError
from dexplan.sim.judge.validate import ValidationReport, validate_run
from dexplan.sim.machine import describe_machine, describe_versions, find_differences
from dexplan.sim.trace import Trace

ELSEWHERE = {
    "machine": {**describe_machine(), "processor": "Another\nPASS"},
    "versions": describe_versions("mujoco"),
}
NAMES = (
    "time", "qpos", "qvel", "ctrl", "initial_state", "physics_steps_per_sample", "object_pose_reference",
    "action_index", "phase_index", "contact_active", "contact_point_O", "contact_rotation_O", "contact_force",
    "contact_force_reference", "qp_status", "qp_wrench_residual", "tip_tracking_error", "ik_at_limit",
)  # fmt: skip
SPOILT = {
    "missing": lambda a: None,
    "text": lambda a: np.full(a.shape, "x"),
    "nan": lambda a: np.full(a.shape, np.nan),
    "huge": lambda a: np.full(a.shape, 10**12),
    "negative": lambda a: -1 - np.abs(a.astype(np.float64)),
    "empty": lambda a: a[:0] if a.ndim else a[None][:0],
    "short": lambda a: a[:-1] if a.ndim else np.array([1, 2]),
    "deeper": lambda a: a[None],
}


@pytest.fixture(scope="module")
def trace() -> Trace:
    """One second of holding still, with the columns a controller adds."""
    run = record(samples=250)
    return Trace(run.model_xml, make_case(run).columns, run.meta)


@pytest.fixture(scope="module")
def brief() -> Trace:
    """A few samples of it."""
    run = record(samples=12)
    return Trace(run.model_xml, make_case(run).columns, run.meta)


@pytest.fixture(scope="module")
def honest(brief: Trace) -> set[str]:
    """What fails for want of samples alone."""
    return {check.name for check in judge(brief).failures}


def judge_or_refuse(trace: Trace, **columns: Any) -> tuple[ValidationReport | None, str]:
    """Return the judgement, or None and why there is none."""
    try:
        return judge(trace, {}, **columns), ""
    except RunFolderError as error:
        return None, str(error)


def judge(trace: Trace, meta: dict[str, Any] | None = None, **columns: Any) -> ValidationReport:
    """Return the judgement of a record whose columns and meta were changed."""
    kept = {**trace.columns, **columns}
    changed = Trace(trace.model_xml, {k: v for k, v in kept.items() if v is not None}, meta or {})
    return validate_run(make_problem(), make_plan(), changed)


# -- recorded elsewhere -----------------------------------------------------------------------------------------


def test_run_from_elsewhere_is_judged_from_the_replay(trace: Trace) -> None:
    qpos = trace["qpos"] + 1e-9
    here = judge(trace, {"machine": describe_machine(), "versions": describe_versions("mujoco")}, qpos=qpos)
    assert here.summary_line().startswith("FAIL replay_matches 1e-09 ")
    there = judge(trace, ELSEWHERE, qpos=qpos, contact_force=trace["contact_force"] * (1 + 1e-5))
    assert there.is_passed, there.table()
    check = there["replay_matches"]
    assert (check.status, check.limit) == ("not_applicable", None)
    assert check.value == pytest.approx(1e-9, rel=1e-3)
    assert "largest difference 1e-09" in check.note
    assert there["trace_consistent"].status == "not_applicable"
    assert "contact_force: 250" in there["trace_consistent"].note
    line = there.summary_line()
    assert line.startswith("PASS hold: ")
    assert "\n" not in line
    processor = describe_machine()["processor"]
    assert (
        f"recorded elsewhere (processor 'Another\\nPASS', here '{processor}'), judged from the replay" in line
    )
    assert there.recorded["machine"]["processor"] == "Another\nPASS"


@pytest.mark.parametrize(
    ("meta", "word"),
    [
        ({"versions": {"mujoco": "3.0.0"}}, "MuJoCo '3.0.0', here "),
        ({"machine": {"processor": 3}}, "processor '3', here "),
        ({"machine": {"c_library": "musl"}}, "c library 'musl', here "),
        ({"machine": {"processor": "x" * 1000}}, "...; "),
    ],
)
def test_what_differs_is_named(meta: dict[str, Any], word: str) -> None:
    (told,) = find_differences(meta)
    assert told.startswith(word) or len(told) < 250


@pytest.mark.parametrize(
    "meta",
    [
        {},
        {"versions": None, "machine": "x"},
        {"versions": {"numpy": "1.0"}},
        {"machine": {}},
        {"machine": describe_machine(), "versions": {**describe_versions("mujoco"), "scipy": "1.0"}},
    ],
)
def test_what_is_not_said_is_the_same(trace: Trace, meta: dict[str, Any]) -> None:
    assert find_differences(meta) == ()
    assert judge(trace, meta, qpos=trace["qpos"] + 1e-9)["replay_matches"].status == "fail"


def test_false_machine_gains_nothing(trace: Trace) -> None:
    """The motion of a good run beside controls that drop the ball, under another processor's name."""
    _, hold = solve_posture()
    open_hand = hold.copy()
    open_hand[2::6] += 0.5
    ctrl = np.concatenate([np.tile(hold, (50, 1)), np.tile(open_hand, (200, 1))])
    forged = judge(trace, ELSEWHERE, ctrl=ctrl)
    assert {"not_dropped", "object_support_other", "contact_schedule"} <= {c.name for c in forged.failures}
    # Nor is a time, which is the same everywhere, or a motion that is none.
    assert judge(trace, ELSEWHERE, time=trace["time"] + 1e-6)["trace_consistent"].status == "fail"
    assert judge(trace, ELSEWHERE, qpos=trace["qpos"] * np.nan)["replay_matches"].status == "fail"
    assert judge(trace, ELSEWHERE, qpos=None)["replay_matches"].status == "fail"


# -- no records at all ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", SPOILT)
@pytest.mark.parametrize("name", NAMES)
def test_spoilt_column_is_told(brief: Trace, honest: set[str], name: str, how: str) -> None:
    spoilt = SPOILT[how](np.array(brief[name]))
    if spoilt is not None and spoilt.dtype == brief[name].dtype and np.array_equal(spoilt, brief[name]):
        return  # as it was
    report, refusal = judge_or_refuse(brief, **{name: spoilt})
    if report is None:
        assert refusal.startswith("trace.npz: ")
        assert len(refusal.splitlines()) == 1
        return
    # Twelve samples are too few for some checks; what was spoilt is told beside those.
    few = {"creep_rate_max", "friction_utilisation_max", "force_prediction_error"}
    assert honest <= few
    may_be_left_out = (
        "time",
        "qvel",
        "contact_active",
        "contact_point_O",
        "contact_rotation_O",
        "contact_force",
    )
    if not ((how == "missing" and name in may_be_left_out) or how in HARMLESS.get(name, ())):
        assert {c.name for c in report.failures} - honest, report.table()


HARMLESS = {
    "contact_active": ("nan", "huge", "negative"),
    "qp_wrench_residual": ("negative",),
}
"""Numbers that mean the same: every finger touches, nothing is left unbalanced."""


@pytest.mark.parametrize("steps", [0, -1, 0.5, np.nan, np.inf, 10**12, 5, 8, [4], "4"])
def test_steps_that_do_not_make_the_times_are_refused(brief: Trace, steps: Any) -> None:
    with pytest.raises(RunFolderError, match=r"physics(_| )steps"):
        judge(brief, {}, physics_steps_per_sample=np.array(steps))


@pytest.mark.parametrize("times", [lambda t: t[::-1], lambda t: t * 0, lambda t: t[np.r_[0, 0, 1:11]]])
def test_times_that_do_not_increase_are_told(brief: Trace, times: Any) -> None:
    report, refusal = judge_or_refuse(brief, time=times(brief["time"]))
    assert "recorded times" in refusal if report is None else report["trace_consistent"].status == "fail"


def test_record_without_samples_is_told(brief: Trace) -> None:
    empty = {name: brief[name][:0] for name in NAMES if brief[name].shape[:1] == (12,)}
    with pytest.raises(RunFolderError, match="lacks samples"):
        judge(brief, {}, **empty)
