"""Groups of checks: every check has one, what is left out is said, and what is judged is judged as before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from held_ball import make_case, make_plan, make_problem, record

from dexplan.errors import DexplanError
from dexplan.sim.judge.groups import GROUPS, resolve_groups
from dexplan.sim.judge.validate import CHECKS, ValidationReport, run_checks, validate_run


def test_every_check_has_one_group() -> None:
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted(name for name, _ in CHECKS)


def test_what_is_left_out_is_marked_and_what_is_judged_is_as_before() -> None:
    case = make_case()
    at_limit = replace(
        case, columns={**case.columns, "ik_at_limit": np.ones(len(case.replay.time), dtype=bool)}
    )
    everything = {result.name: result for result in run_checks(at_limit)}
    assert everything["ik_at_limit"].status == "fail"
    some = ("physics", "task", "contacts")
    for result in run_checks(at_limit, some):
        if any(result.name in GROUPS[group] for group in some):
            assert result == everything[result.name]
        else:
            assert result.status == "not_applicable"
            assert result.note.endswith("was not judged")


def test_a_record_of_controls_alone_is_judged_and_the_verdict_says_by_what(tmp_path: Path) -> None:
    """Constant servo targets hold the ball: no QP, no forces wanted, nothing recorded but state and controls."""
    trace = record()
    whole = validate_run(make_problem(), make_plan(), trace)
    assert "judged:" not in whole.summary_line()
    assert not whole.is_passed
    held = validate_run(make_problem(), make_plan(), trace, groups=["physics", "task", "contacts"])
    assert held.is_passed, held.table()
    part = validate_run(make_problem(), make_plan(), trace, groups=["contacts", "task"])
    assert part.groups == ("task", "contacts")
    assert part.summary_line().endswith("judged: task, contacts; not judged: physics, forces, internals")
    assert {c.name for c in part.failures} == {
        c.name for c in whole.failures if c.name in GROUPS["task"] + GROUPS["contacts"]
    }
    assert ValidationReport.load(part.save(tmp_path / "report.json")) == part


@pytest.mark.parametrize(
    ("groups", "told"), [(["phisics"], "did you mean 'physics'?"), ([], "no group of checks is named")]
)
def test_no_group_is_refused(groups: list[str], told: str) -> None:
    with pytest.raises(DexplanError) as caught:
        resolve_groups(groups)
    assert told in str(caught.value)
