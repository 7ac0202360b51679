"""Statuses are one enum: each says what it means, and a plan takes no other."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dexplan import pipeline
from dexplan.errors import RunFolderError
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.read import load_problem


@pytest.fixture(scope="module")
def plan() -> Plan:
    return pipeline.plan(load_problem("hold_two"))


@pytest.mark.parametrize("status", Status)
def test_each_says_what_it_means(status: Status) -> None:
    assert Status(str(status)) is status
    assert status.value == status.name.lower()
    assert len(status.meaning.split()) > 4
    assert status.is_solved == (status is Status.SOLVED)


def test_what_refuses_a_start() -> None:
    assert {s.value for s in Status if s.is_about_start} == {
        s.value for s in Status if s.name.startswith("START")
    }


def test_a_plan_has_a_status_of_the_enum_and_writes_its_value(plan: Plan) -> None:
    assert plan.status is Status.SOLVED
    assert json.loads(json.dumps(plan.as_dict()))["status"] == "solved"
    assert Plan.from_dict(plan.as_dict()).status is Status.SOLVED
    assert replace(plan, status=Status.NO_GAIT, actions=()).as_dict()["status"] == "no_gait"


def test_an_unknown_status_is_not_read(plan: Plan, tmp_path: Path) -> None:
    file = tmp_path / "plan.json"
    file.write_text(json.dumps({**plan.as_dict(), "status": "perhaps"}), encoding="utf-8")
    with pytest.raises(RunFolderError, match="perhaps"):
        Plan.load(file)
