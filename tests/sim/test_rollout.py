"""The whole hand under the controller: it holds, it relocates, it repeats itself exactly, and it says what failed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_runs import (
    HOLD_TIMING,
    HOLDS,
    PROFILES,
    build_plan_reference,
    failed,
    hold_problem,
    plan_of,
    report_of,
    simulate,
    trace_of,
    turn_problem,
)

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.sim.judge.replay import replay
from dexplan.sim.judge.validate import CHECKS
from dexplan.sim.record import rollout as rollout_module
from dexplan.sim.record.rollout import rollout
from dexplan.sim.trace import Trace

SHORT = replace(HOLD_TIMING, first_hold=0.1, last_hold=0.1)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", ["hold_three", "hold_12"])
def test_hold_passes_every_check(name: str, profile: str) -> None:
    problem = hold_problem(name, profile)
    report = report_of(problem, HOLD_TIMING)
    assert report.is_passed, report.table()
    assert report.timing["simulated_s"] == pytest.approx(2.0, abs=0.02)
    touching = [contact != "free" for contact in HOLDS[name][1]]
    assert (trace_of(problem, HOLD_TIMING)["contact_active"] == touching).all()


def test_hold_settles_where_the_forces_were_asked_for() -> None:
    trace = trace_of(hold_problem("hold_three", "firm"), HOLD_TIMING)
    wanted, measured = trace["contact_force_reference"][-1, :, 2], trace["contact_force"][-1, :, 2]
    np.testing.assert_allclose(measured, wanted, rtol=0.01)


@pytest.mark.parametrize("profile", PROFILES)
def test_one_substitution_passes_every_check(profile: str) -> None:
    problem = turn_problem(profile)
    assert {"place", "lift"} <= {action.name for action in plan_of(problem).actions}
    report = report_of(problem)
    assert report.is_passed, report.table()


def test_columns_are_those_of_the_contract() -> None:
    trace, F = trace_of(turn_problem()), 3
    T = trace.sample_count
    shapes = {
        "time": (T,),
        "object_pose_reference": (T, 7),
        "action_index": (T,),
        "contact_active": (T, F),
        "contact_point_O": (T, F, 3),
        "contact_rotation_O": (T, F, 3, 3),
        "contact_force": (T, F, 4),
        "contact_force_reference": (T, F, 4),
        "contact_slip_velocity": (T, F, 3),
        "tip_contact_angle": (T, F),
        "qp_status": (T,),
        "qp_wrench_residual": (T,),
        "physics_steps_per_sample": (),
    }
    assert {name: trace[name].shape for name in shapes} == shapes
    assert trace["qpos"].shape[0] == trace["qvel"].shape[0] == trace["ctrl"].shape[0] == T
    np.testing.assert_allclose(np.diff(trace["time"]), 0.004, atol=1e-12)
    # A force is recorded exactly where there is a contact.
    assert (np.isnan(trace["contact_force"][..., 2]) == ~trace["contact_active"]).all()


def test_replay_is_exact_to_the_bit() -> None:
    trace = trace_of(turn_problem())
    again = replay(
        trace.model_xml, trace["initial_state"], trace["ctrl"], int(trace["physics_steps_per_sample"])
    )
    assert again.qpos.tobytes() == trace["qpos"].tobytes()
    assert again.qvel.tobytes() == trace["qvel"].tobytes()
    assert again.time.tobytes() == trace["time"].tobytes()


def test_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    problem = hold_problem("hold_12", "firm")
    reference = build_plan_reference(problem, plan_of(problem), SHORT)
    files = [simulate(problem, reference).save(tmp_path / f"{k}.npz").read_bytes() for k in range(2)]
    assert files[0] == files[1]


def test_seed_stands_in_the_trace() -> None:
    problem = hold_problem("hold_12", "firm")
    plan = plan_of(problem)
    trace = pipeline.rollout(replace(problem, seed=11), plan)
    assert trace.meta["seed"] == 11
    assert trace.meta["failure"] is None
    assert {"python", "mujoco", "mink", "osqp"} <= set(trace.meta["versions"])


def test_progress_grows_to_one() -> None:
    problem = hold_problem("hold_12", "firm")
    shares: list[float] = []
    rollout(
        pipeline.build_scene(problem),
        build_plan_reference(problem, plan_of(problem), SHORT),
        pipeline.build_options(problem),
        progress=shares.append,
    )
    assert len(shares) > 10
    assert (np.diff(shares) >= 0.0).all()
    assert shares[0] > 0.0
    assert shares[-1] == pytest.approx(1.0, abs=0.05)
    assert max(shares) <= 1.0


def test_failed_run_is_a_trace_and_a_verdict(tmp_path: Path) -> None:
    problem = turn_problem()
    plan = plan_of(problem)
    trace = pipeline.rollout(problem, plan, options=pipeline.build_options(problem, feedforward=0.0))
    assert trace.meta["failure"] == "the object was dropped"
    assert 0 < trace.sample_count < 200
    report = pipeline.validate(problem, plan, trace)
    assert not report.is_passed
    assert {"phases_in_order", "not_dropped", "contact_schedule"} <= failed(report)
    assert {"replay_matches", "trace_consistent", "physics_untouched"}.isdisjoint(failed(report))
    assert [check.name for check in report.checks] == [name for name, _ in CHECKS]
    assert report.summary_line().startswith("FAIL ")
    # It can be kept as evidence.
    trace.save(tmp_path / "trace.npz")
    report.save(tmp_path / "report.json")


def test_start_off_its_home_is_led_back() -> None:
    problem = turn_problem()
    plan, scene = plan_of(problem), pipeline.build_scene(problem)
    X = scene.object.X_WO_home.copy()
    X[:3, 3] += [1.2e-4, -8e-5, 4e-5]
    trace = pipeline.rollout(problem, plan, X_WO_start=X)
    off = np.linalg.norm(trace["qpos"][:, scene.object_qpos : scene.object_qpos + 3] - X[:3, 3], axis=1)
    miss = np.linalg.norm(
        trace["qpos"][:, scene.object_qpos : scene.object_qpos + 3] - scene.object.X_WO_home[:3, 3], axis=1
    )
    assert off[0] == pytest.approx(0.0, abs=1e-12)
    assert miss[0] == pytest.approx(np.sqrt(14.0) * 4e-5, rel=1e-6)
    assert miss[-1] < 0.1 * miss[0]
    report = pipeline.validate(problem, plan, trace)
    # The error at the first sample is the start's own, and it counts.
    assert report["position_error_max"].value >= 1e3 * miss[0] - 1e-9
    assert report.is_passed, report.table()


@cache
def _run_once(plan: Plan) -> Trace:
    return pipeline.rollout(hold_problem("hold_three", "firm"), plan)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_a_run_that_is_cut_short_carries_what_was_recorded(
    error: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of a sample, too: the columns are as long as the shortest."""
    problem = hold_problem("hold_three", "firm")
    plan = plan_of(problem)
    whole = _run_once(plan)
    step, count = rollout_module.Controller.step, iter(range(10**6))

    def stop(self: Any, observation: Any) -> Any:
        if next(count) == 30:
            raise error
        return step(self, observation)

    monkeypatch.setattr(rollout_module.Controller, "step", stop)
    with pytest.raises(error) as caught:
        pipeline.rollout(problem, plan)
    trace = caught.value.trace  # type: ignore[attr-defined]
    assert 10 < trace.sample_count < 30
    assert trace.meta["failure"].startswith("cut short: ")
    for name in ("qpos", "ctrl", "contact_force"):
        np.testing.assert_array_equal(trace[name], whole[name][: trace.sample_count])
    monkeypatch.undo()
    assert not pipeline.validate(problem, plan, trace).is_passed
