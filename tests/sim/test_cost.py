"""A coarse guard: what a run and its replay cost beside the physics.  Ratios, never seconds, and generous: cores are shared."""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
import pytest

from dexplan import pipeline
from dexplan.control.reference import build_reference
from dexplan.problems.read import load_problem
from dexplan.sim.judge.replay import replay
from dexplan.sim.record.recorder import STATE
from dexplan.sim.record.rollout import rollout
from dexplan.sim.trace import Trace

LOOP, REPLAY = 16.0, 5.0
"""Above what a loaded machine shows (8 and 2), and below what there was when contacts were read on every tick (17 and 4)."""


def _measure(*functions: Callable[[], object]) -> list[float]:
    """Return the least processor time [s] of each function, called by turns."""
    least = [float("inf")] * len(functions)
    for _ in range(3):
        for k, function in enumerate(functions):
            began = time.process_time()
            function()
            least[k] = min(least[k], time.process_time() - began)
    return least


def _step_bare(trace: Trace) -> None:
    model = mujoco.MjModel.from_xml_string(trace.model_xml)
    data, steps = mujoco.MjData(model), int(trace["physics_steps_per_sample"])
    mujoco.mj_setState(model, data, trace["initial_state"], STATE)
    for row in trace["ctrl"]:
        data.ctrl[:] = row
        mujoco.mj_step(model, data, nstep=steps)


@pytest.fixture(scope="module")
def ratios() -> tuple[float, float]:
    """What the closed loop and the replay cost, in bare steps of the same run."""
    problem = load_problem("fig4_substitution", {"goal.rotation.angle_deg": 30.0})
    scene, plan, options = (
        pipeline.build_scene(problem),
        pipeline.plan(problem),
        pipeline.build_options(problem),
    )
    reference = build_reference(plan)
    trace = rollout(scene, reference, options)
    steps = int(trace["physics_steps_per_sample"])
    bare, loop, again = _measure(
        lambda: _step_bare(trace),
        lambda: rollout(scene, reference, options),
        lambda: replay(trace.model_xml, trace["initial_state"], trace["ctrl"], steps),
    )
    return loop / bare, again / bare


def test_the_loop_costs_few_times_the_physics(ratios: tuple[float, float]) -> None:
    assert ratios[0] < LOOP


def test_a_replay_costs_little_more_than_the_physics(ratios: tuple[float, float]) -> None:
    assert ratios[1] < REPLAY
