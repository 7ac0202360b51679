"""Creep is a displacement, judged per radian while something moves: by tampered runs, and by honest ones that go too fast."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from held_ball import HOME, RADIUS, TIP, make_case, slide
from scipy.spatial.transform import Rotation
from short_runs import build_plan_reference, failed, plan_of, simulate, trace_of

from dexplan import pipeline
from dexplan.problems.read import load_problem
from dexplan.sim.judge.checks_case import Case
from dexplan.sim.judge.checks_contact import check_creep_rate_max, compute_slip_path
from dexplan.sim.judge.replay import replay

CASES = Path(__file__).parents[1] / "cases"
ARM = RADIUS + TIP
MOTIONS = ("turn", "shift")


@lru_cache
def moving(motion: str, degrees_per_s: float) -> Case:
    """Return the ball held still while its reference turns, or is shifted as fast as that turn would carry a tip."""
    held = make_case()
    time = held.replay.time
    pose = np.tile(HOME, (len(time), 1))
    if motion == "turn":
        turn = Rotation.from_rotvec(np.outer(np.radians(degrees_per_s) * time, [0.0, 0.0, 1.0]))
        pose[:, 3:] = turn.as_quat(scalar_first=True)
    else:
        pose[:, 0] += np.radians(degrees_per_s) * ARM * time
    return replace(held, columns={**held.columns, "object_pose_reference": pose})


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("speed", [3.0, 14.0, 40.0])
def test_moving_creep_is_allowed_in_proportion_to_the_speed(motion: str, speed: float) -> None:
    """12.5 um/s at 14 deg/s, whatever the speed; a shift counts as the turn that carries the tip as far."""
    allowed = 12.5e-6 * speed / 14.0
    for share, status in ((0.95, "pass"), (1.05, "fail")):
        result = check_creep_rate_max(slide(moving(motion, speed), share * allowed))
        assert result.status == status
        assert result.value == pytest.approx(share * 12.5, rel=0.02)


@pytest.mark.parametrize("motion", MOTIONS)
def test_slow_motion_is_judged_no_more_strictly_than_rest(motion: str) -> None:
    slow = moving(motion, 0.01)
    assert check_creep_rate_max(slide(slow, 0.9e-6)).status == "pass"
    assert check_creep_rate_max(slide(slow, 1.1e-6)).status == "fail"


def test_slip_that_comes_back_is_no_creep_and_slip_that_stays_is() -> None:
    held = moving("turn", 14.0)
    drift = np.linalg.norm(compute_slip_path(slide(held, 2e-5))[:, 0].sum(axis=0))
    duration = held.replay.time[-1] - held.replay.time[0]
    assert drift == pytest.approx(2e-5 * duration, rel=0.02)
    there_and_back = slide(held, 1e-4)
    back = replace(
        there_and_back.replay,
        contact_point_O=np.concatenate(
            [there_and_back.replay.contact_point_O[:125], there_and_back.replay.contact_point_O[124::-1]]
        ),
        tip_position=np.concatenate(
            [there_and_back.replay.tip_position[:125], there_and_back.replay.tip_position[124::-1]]
        ),
    )
    assert np.linalg.norm(compute_slip_path(replace(held, replay=back))[:, 0].sum(axis=0)) < 1e-6


def test_honest_run_that_turns_too_fast_for_its_contacts_is_caught() -> None:
    """Drift grows with the square of the speed, its limit with the speed: at 13 deg/s this plan uses a third of its limit."""
    problem = load_problem(CASES / "fast.toml")
    plan = plan_of(problem)
    timing = replace(
        pipeline.build_timing(problem), object_speed=np.radians(120.0), drift=1.0, drift_per_radian=1.0
    )
    report = pipeline.validate(problem, plan, simulate(problem, build_plan_reference(problem, plan, timing)))
    assert "creep_rate_max" in failed(report)
    assert failed(report).isdisjoint({"physics_untouched", "replay_matches", "position_error_max"})


def test_contacts_of_a_light_ball_drift_by_less_than_their_sampled_slip_says() -> None:
    """Velocities are sampled where the servos have just been told something new, when the last step is over."""
    problem = load_problem(CASES / "table_tennis_ball.toml", {"goal.rotation.angle_deg": 30.0})
    plan, trace = plan_of(problem), trace_of(problem)
    report = pipeline.validate(problem, plan, trace)
    assert report.is_passed, report.table()
    steps = int(trace["physics_steps_per_sample"])
    seen = replay(trace.model_xml, trace["initial_state"], trace["ctrl"], steps)
    case = Case(problem.as_dict(), plan.as_dict(), trace.columns, seen, {}, None)
    held = np.flatnonzero(seen.contact_active.all(axis=0))
    assert len(held) == 2
    moved = np.linalg.norm(compute_slip_path(case)[:, held].sum(axis=0), axis=-1)
    slip = seen.contact_slip_velocity[:, held, :2]
    sampled_O = np.einsum("tfij,tfj->fi", seen.contact_rotation_O[:, held, :, :2], slip)
    assert (moved < 0.7 * case.sample_time * np.linalg.norm(sampled_O, axis=-1)).all()
    # The tips neither roll nor spin to speak of: where the contacts end on the ball tells how far they slid.
    point = np.linalg.norm(seen.contact_point_O[-1, held] - seen.contact_point_O[0, held], axis=-1)
    assert moved == pytest.approx(point, abs=1e-5)
