"""How often the controller is asked: commands held for a tick twist the tips, and thin torsional friction needs short ticks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.control.rate import JOINT_STEP, RATES, SLOWEST, STEPS, TWIST, TWIST_SPEED, choose_rate
from dexplan.errors import ProblemError
from dexplan.problems.read import load_problem


@pytest.mark.parametrize(
    ("room", "rate"),
    [(1.0, 250.0), (TWIST, 250.0), (0.999 * TWIST, 500.0), (0.33 * TWIST, 1000.0), (0.0, 1000.0)],
)
def test_the_rate_is_the_least_that_leaves_room(room: float, rate: float) -> None:
    assert choose_rate(room, 1e-3) == rate


def test_a_tick_of_one_physics_step_has_no_twist() -> None:
    assert RATES[0] * STEPS * 1e-3 == pytest.approx(1.0)
    assert choose_rate(0.0, 1.0 / RATES[0]) == RATES[0]


@pytest.mark.parametrize(
    ("changes", "rate"),
    [
        ({}, 250.0),
        ({"control.physics_profile": "portable"}, 250.0),
        ({"friction.torsional_m": 0.0012}, 500.0),
        ({"friction.torsional_m": 0.0005}, 1000.0),
        ({"friction.safety": 1.0}, 1000.0),
        ({"friction.torsional_m": 0.0005, "control.rate_hz": 125}, 125.0),
    ],
)
def test_thin_torsional_friction_raises_the_rate_unless_one_is_asked_for(
    changes: dict[str, object], rate: float
) -> None:
    assert pipeline.build_options(load_problem("hold_three", changes)).rate == rate


@pytest.mark.parametrize("value", [0, -250, 333, 250.5, "fast", True])
def test_other_rates_are_refused_with_those_that_are_accepted(value: object) -> None:
    with pytest.raises(ProblemError, match="125, 250, 500 or 1000"):
        load_problem("hold_three", {"control.rate_hz": value})


def test_a_rate_that_is_no_whole_number_of_physics_steps_is_refused() -> None:
    problem = load_problem("hold_two")
    options = dataclasses.replace(pipeline.build_options(problem), rate=300.0)
    with pytest.raises(ValueError, match="whole number of physics steps"):
        pipeline.rollout(problem, pipeline.plan(problem), options=options)


def test_shorter_ticks_twist_less() -> None:
    problem = load_problem(
        "fig4_substitution",
        {"goal.rotation.angle_deg": 15.0, "start.contacts_deg": [[36.0, 0.0], [180.0, 0.0], "free"]},
    )
    plan = pipeline.plan(problem)
    twist = {}
    for rate in RATES:
        options = dataclasses.replace(pipeline.build_options(problem), rate=rate)
        trace = pipeline.rollout(problem, plan, options=options)
        moving = np.array([plan.actions[k].name == "move_object" for k in trace["action_index"]])
        off = trace["contact_force"][moving, :, 3] - trace["contact_force_reference"][moving, :, 3]
        twist[rate] = float(np.nanmax(np.abs(off)))
    # In steps of 4, 2 and 1 ms the tick begins 1.5, 0.5 and 0 steps away from its mean.
    assert twist[500.0] < 0.5 * twist[250.0]
    assert twist[1000.0] < 0.3 * twist[250.0]


def test_forces_follow_what_is_told_while_load_goes_from_finger_to_finger() -> None:
    problem = load_problem(
        "fig4_substitution",
        {"goal.rotation.angle_deg": 120.0, "start.contacts_deg": [[36.0, 0.0], [180.0, 0.0], "free"]},
    )
    plan = pipeline.plan(problem)
    first = next(k for k, action in enumerate(plan.actions) if action.name == "place")
    plan = dataclasses.replace(plan, actions=plan.actions[: first + 1])
    off = {}
    for relaxation in (0.02, 0.15):
        options = dataclasses.replace(pipeline.build_options(problem), relaxation=relaxation)
        trace = pipeline.rollout(problem, plan, options=options)
        loading = (trace["action_index"] == first) & (trace["phase_index"] == trace["phase_index"].max())
        assert loading.any()
        late = np.flatnonzero(loading)[20:]
        off[relaxation] = trace["contact_force"][late] - trace["contact_force_reference"][late]
    assert np.nanmax(np.abs(off[0.02][..., 2])) < 0.1
    assert np.nanmax(np.abs(off[0.02][..., 3])) < 0.7 * np.nanmax(np.abs(off[0.15][..., 3]))


@pytest.mark.parametrize(
    ("asked", "speed"), [("auto", 6.0), (125, 125 * JOINT_STEP), (250, 6.0), (500, 6.0), (1000, 6.0)]
)
def test_free_fingers_go_no_farther_in_a_tick_than_servos_bear(asked: object, speed: float) -> None:
    problem = load_problem("hold_two", {"control.rate_hz": asked})
    assert pipeline.build_timing(problem).joint_speed == speed


@pytest.mark.parametrize(
    ("changes", "share"),
    [
        ({}, 1.0),
        ({"control.rate_hz": 500}, 1.0),
        ({"control.rate_hz": 250, "friction.torsional_m": 0.0019}, 0.80),
        ({"control.rate_hz": 125, "friction.torsional_m": 0.0019}, 0.34),
        ({"control.rate_hz": 125, "friction.safety": 1.0}, SLOWEST / TWIST_SPEED),
    ],
)
def test_at_a_rate_that_was_asked_for_the_object_turns_no_faster_than_tips_bear_to_be_twisted(
    changes: dict[str, object], share: float
) -> None:
    """An egg that was turned at 125 Hz as fast as at 250 reached the true cone; room is proportional to torsional friction."""
    speed = pipeline.build_timing(load_problem("hold_three", changes)).object_speed
    full = pipeline.build_timing(load_problem("hold_three")).object_speed
    assert speed == pytest.approx(full if share == 1.0 else share * TWIST_SPEED, rel=0.03)


def test_servos_have_torque_to_spare_at_125_hz() -> None:
    """With the finger speeds of 250 Hz they gave 0.93 of it on this way."""
    problem = load_problem("adjust_grasp", {"control.rate_hz": 125})
    plan = pipeline.plan(problem)
    report = pipeline.validate(problem, plan, pipeline.rollout(problem, plan), groups=["physics"])
    (check,) = (check for check in report.checks if check.name == "torque_utilisation_max")
    assert check.status == "pass", check
