"""Limits: what cannot be set, which way is looser, and that a looser one is told wherever a verdict stands."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from held_ball import make_case, make_plan, make_problem, record

from dexplan.errors import ProblemError
from dexplan.sim.judge.limits import (
    INTEGRITY,
    find_loose_limits,
    is_floor,
    load_default_limits,
    resolve_limits,
)
from dexplan.sim.judge.validate import ValidationReport, validate_run
from dexplan.sim.trace import Trace

FREE = [name for name in load_default_limits() if name not in INTEGRITY]


@pytest.fixture(scope="module")
def trace() -> Trace:
    run = record(samples=250)
    return Trace(run.model_xml, make_case(run).columns, run.meta)


def judge(trace: Trace, **acceptance: Any) -> ValidationReport:
    """Return the judgement of holding still under other limits."""
    return validate_run(make_problem(acceptance=acceptance), make_plan(), trace)


def test_names_are_limits() -> None:
    assert set(INTEGRITY) <= set(load_default_limits())
    assert {name for name in FREE if is_floor(name)} == {
        "creep_moving_speed_deg_s",
        "edge_distance_min_mm",
        "episode_gap_s",
        "force_cone_margin_min",
        "free_finger_clearance_min_mm",
        "joint_limit_margin_min_deg",
        "plan_force_closure_min_deg",
        "plan_load_margin_min",
    }


@pytest.mark.parametrize("name", FREE)
def test_looser_is_told_and_tighter_is_not(name: str) -> None:
    default = float(load_default_limits()[name])
    up, down = 2.0 * default + 1.0, 0.5 * default
    looser, tighter = (down, up) if is_floor(name) else (up, down)
    told = find_loose_limits({**load_default_limits(), name: looser})
    if looser != default:  # a floor of nothing cannot be lower
        assert [(limit.name, limit.value, limit.default) for limit in told] == [(name, looser, default)]
    assert find_loose_limits({**load_default_limits(), name: tighter}) == ()
    assert find_loose_limits(load_default_limits()) == ()


@pytest.mark.parametrize("name", INTEGRITY)
def test_integrity_cannot_be_bought(trace: Trace, name: str) -> None:
    with pytest.raises(ProblemError, match=f"acceptance.{name}: .* cannot be set"):
        judge(trace, **{name: 1000})
    with pytest.raises(ProblemError, match=f"acceptance.{name}: .* cannot be set"):
        validate_run(make_problem(), make_plan(), trace, {name: 1000.0})
    assert resolve_limits({name: load_default_limits()[name]}) == load_default_limits()


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), "much", None])
def test_limits_are_numbers(value: Any) -> None:
    with pytest.raises(ProblemError, match=r"acceptance.penetration_max_um: .* accepted: "):
        resolve_limits({"penetration_max_um": value})
    with pytest.raises(ProblemError, match="no such limit"):
        resolve_limits({"penetration": 1.0})


def test_looser_limits_stand_in_line_and_report(trace: Trace, tmp_path: Path) -> None:
    bought = judge(trace, penetration_max_um=400, plan_load_margin_min=0.01, coulomb_slip_max_mm=0.01)
    assert bought.is_passed
    told = "limits looser than default (2): penetration_max_um 400 instead of 150, plan_load_margin_min 0.01 instead of 0.02"
    assert bought.summary_line().endswith(f"; {told}")
    assert bought.summary_line().startswith("PASS hold: ")
    assert bought.reservations == (told,)
    again = ValidationReport.load(bought.save(tmp_path / "report.json"))
    assert again == bought
    assert again.loose_limits["penetration_max_um"] == {"value": 400.0, "default": 150.0}


def test_looser_limits_stand_beside_a_failure(trace: Trace) -> None:
    line = judge(trace, penetration_max_um=1.0, creep_rest_um_s=2.0).summary_line()
    assert line.startswith("FAIL penetration_max ")
    assert line.endswith("; limits looser than default (1): creep_rest_um_s 2 instead of 1")


def test_default_limits_are_not_worth_a_word(trace: Trace) -> None:
    assert judge(trace, **load_default_limits()).reservations == ()
    assert "looser" not in judge(trace).summary_line()
