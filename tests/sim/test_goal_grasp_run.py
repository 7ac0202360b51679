"""Goal contacts in the simulator: the object kept where it is, and shifted as well as turned, while a finger travels."""

from __future__ import annotations

from dexplan import pipeline
from dexplan.problems.read import load_problem
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.record.rollout import FALLEN

PAIR = [[-38.0, 0.0], [102.0, 0.0], "free"]


def run(goal: dict[str, object]) -> tuple[list[str], ValidationReport]:
    """Return the kinds of the plan's actions, and the judgement of its run."""
    problem = load_problem("hold_two", {"start.contacts_deg": PAIR, "goal": goal})
    plan = pipeline.plan(problem)
    assert plan.is_solved, plan.reason
    trace = pipeline.rollout(problem, plan)
    return [a.name for a in plan.actions], pipeline.validate(problem, plan, trace)


def values(report: ValidationReport) -> dict[str, float]:
    """Return the measured values of a run that passed."""
    assert report.verdict == "pass", report.table()
    return {c.name: float("nan") if c.value is None else float(c.value) for c in report.checks}


def test_the_grasp_changes_and_the_object_stays() -> None:
    """Finger 3 comes, finger 2 goes; with goal.keep_object the object's pose at the end is judged too."""
    goal = {
        "kind": "grasp_adjustment",
        "keep_object": True,
        "contacts_deg": [[-38.0, 0.0], "free", [180.0, 0.0]],
    }
    kinds, report = run(goal)
    assert kinds == ["hold", "place", "lift", "hold"]
    found = values(report)
    assert found["position_error_final"] < 0.3
    assert found["rotation_error_final"] < 0.5
    assert found["contact_error_final"] < 1.5


def test_the_object_is_shifted_and_turned_while_a_finger_travels() -> None:
    goal = {
        "kind": "dextrous_manipulation",
        "order": "simultaneous",
        "translation_m": [0.004, -0.003, 0.003],
        "rotation": {"axis": [0.1, 0.0, 1.0], "angle_deg": 24.0},
        "contacts_deg": [*PAIR[:2], [205.0, 10.0]],
    }
    kinds, report = run(goal)
    assert "move_object" in kinds
    found = values(report)
    assert found["position_error_final"] < 0.3
    assert found["rotation_error_final"] < 0.5
    assert found["contact_error_final"] < 1.5


def test_the_object_is_put_down_far_below_where_it_was() -> None:
    """An object that is lowered as far as one falls before it counts as dropped is not dropped."""
    kinds, report = run({"kind": "object_manipulation", "translation_m": [0.0, 0.0, -1.1 * FALLEN]})
    assert "move_object" in kinds
    found = values(report)
    assert found["position_error_final"] < 0.3
    assert found["not_dropped"] < 0.5
