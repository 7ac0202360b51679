"""A plan says how fast the object turns, and what keeps it from turning as fast as was asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.control.reference import build_reference
from dexplan.plans.pace import PACES
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem

CASES = Path(__file__).parents[1] / "cases"


@pytest.fixture(scope="module")
def plan() -> Plan:
    return pipeline.plan(load_problem(CASES / "fast.toml"))


def test_a_speed_that_is_not_reached_is_told_with_its_limit(plan: Plan) -> None:
    assert plan.speed is not None
    assert np.degrees(plan.speed.asked) == pytest.approx(720.0)
    assert 5.0 < np.degrees(plan.speed.reached) < 30.0
    assert [limit.limit for limit in plan.speed.limits] == [PACES["drift"]]
    said = next(line for line in plan.explain().splitlines() if line.startswith("speed: "))
    assert f"720 deg/s asked for, limited to {np.degrees(plan.speed.reached):.1f} deg/s by the drift" in said
    assert plan.as_dict()["speed"]["words"] == str(plan.speed)
    assert Plan.from_dict(plan.as_dict()).as_dict() == plan.as_dict()


def test_a_speed_that_is_reached_is_not_called_limited() -> None:
    problem = load_problem(CASES / "fast.toml", {"control.speed_deg_s": 2.0})
    plan = pipeline.plan(problem)
    assert plan.speed is not None
    assert np.degrees(plan.speed.reached) == pytest.approx(2.0)
    assert plan.speed.limits == ()
    assert "limited" not in str(plan.speed)


def test_told_speed_is_what_the_reference_does(plan: Plan) -> None:
    reference = build_reference(plan)
    rates = [
        abs(phase.object_path.progress(t).rate * phase.object_path.motion.angle)
        for phase in reference.phases
        for t in np.linspace(0.0, phase.duration, 101)
    ]
    assert plan.speed is not None
    assert max(rates) == pytest.approx(plan.speed.reached, rel=1e-9)


def test_short_turns_are_limited_by_getting_up_to_speed() -> None:
    problem = load_problem(CASES / "fast.toml", {"goal.rotation.angle_deg": 1.0})
    plan = pipeline.plan(problem)
    assert plan.speed is not None
    assert [limit.limit for limit in plan.speed.limits] == [PACES["ramp"]]


def test_nothing_is_said_of_a_hand_that_holds_still() -> None:
    assert pipeline.plan(load_problem("hold_two")).speed is None


def test_slow_motions_keep_to_the_drift_per_radian() -> None:
    """A contact that may drift by next to nothing per radian makes the motion slow, in proportion and not as a square root."""
    problem = load_problem(CASES / "fast.toml")
    timing, found = pipeline.build_timing(problem), pipeline.plan(problem)
    speeds = []
    for share in (0.1, 0.05):
        strict = replace(timing, drift_per_radian=share * timing.drift_per_radian)
        told = pipeline.time_plan(problem, found, strict).speed
        assert told is not None
        speeds.append(told.reached)
    assert speeds[1] == pytest.approx(0.5 * speeds[0], rel=1e-6)
