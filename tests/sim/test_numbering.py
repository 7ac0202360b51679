"""Actions are counted from 1 in everything that is written for readers; only ``index`` and ``action_index`` count from 0."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dexplan.control.reference import build_reference
from dexplan.pipeline import load_run, validate
from dexplan.plans.plan import Plan

RUN = Path(__file__).resolve().parents[1] / "old_runs" / "hold_two"


def test_notes_of_checks_count_actions_from_one() -> None:
    report = validate(*load_run(RUN), groups=["forces"])
    assert report["plan_force_closure"].note.startswith("action 1 start: ")
    assert report["plan_load_margin"].note.startswith("action 1 start: ")


def test_phases_that_were_never_reached_are_counted_from_one() -> None:
    problem, plan, trace = load_run(RUN)
    twice = replace(plan, actions=(*plan.actions, plan.actions[-1]))
    report = validate(problem, twice, trace, groups=["task"])
    assert f"first: action {len(twice.actions)}, phase 1" in report["phases_in_order"].note


def test_messages_about_a_plan_count_actions_from_one() -> None:
    data = json.loads((RUN / "plan.json").read_text(encoding="utf-8"))
    plan = Plan.from_dict(data)
    if not plan.is_timed:
        with pytest.raises(ValueError, match=r"^action 1 "):
            build_reference(plan)
    data = plan.as_dict()
    data["actions"][0]["kind"] = "juggle"
    with pytest.raises(ValueError, match=r"^action 1 is of kind 'juggle'"):
        Plan.from_dict(data)
