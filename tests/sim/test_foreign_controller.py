"""Other people's controllers in the loop: what they are told, what is recorded, and every answer that is none."""

from __future__ import annotations

import asyncio
import contextlib
import pickle
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
import pytest
from foreign_controllers import Spy, held_trace, hold, load_example, make_hold
from short_runs import plan_of, trace_of, turn_problem

from dexplan import pipeline
from dexplan.control.foreign import compute_target_limits
from dexplan.control.observation import Observation
from dexplan.errors import ControllerError
from dexplan.problems.read import load_problem
from dexplan.scene.library import load_scene
from dexplan.sim.judge.groups import OWN_COLUMNS
from dexplan.sim.trace import Trace

BAD_AT = 25
"""The tick at which a controller below goes wrong: 0.1 s."""


@pytest.fixture(scope="module")
def told() -> tuple[Spy, Trace]:
    spy = Spy(make_hold())
    return spy, pipeline.rollout(*hold(), controller=spy)


# -- what a controller is told ------------------------------------------------------------------------------------


def test_the_start_is_told_once_and_is_that_of_our_own_run(told: tuple[Spy, Trace]) -> None:
    spy, trace = told
    (start,) = spy.starts
    own = trace_of(hold()[0])
    assert trace["initial_state"].tobytes() == own["initial_state"].tobytes()
    assert start.tick == trace["time"][1] - trace["time"][0] == 0.004
    assert start.duration == pytest.approx(own["time"][-1], abs=0.005)
    model = mujoco.MjModel.from_xml_string(start.model_xml)
    # A run's own model has keyframes, too.
    assert (
        start.model_xml.removesuffix("</mujoco>\n")
        == trace.model_xml[: len(start.model_xml) - len("</mujoco>\n")]
    )
    assert start.servos == tuple(model.actuator(a).name for a in range(model.nu))
    driven = tuple(model.joint(model.actuator_trnid[a, 0]).name for a in range(model.nu))
    assert start.joints == driven
    assert start.fingers == ("finger_1", "finger_2", "finger_3")
    assert start.observation is spy.seen[0]


def test_what_is_sensed_is_what_the_record_has(told: tuple[Spy, Trace]) -> None:
    spy, trace = told
    assert len(spy.seen) == trace.sample_count
    assert [seen.time for seen in spy.seen] == trace["time"].tolist()
    for t in (0, 100, len(spy.seen) - 1):
        seen = spy.seen[t]
        assert seen.q.shape == seen.qdot.shape == (3, 6)
        assert (seen.q.ravel() == trace["qpos"][t, :18]).all()
        assert (seen.qdot.ravel() == trace["qvel"][t, :18]).all()
        assert (seen.X_WO[:3, 3] == trace["qpos"][t, 18:21]).all()
        assert seen.motion is not None
        assert (seen.motion.X_WO[:3, 3] == trace["object_pose_reference"][t, :3]).all()
        assert (seen.motion.action_index, seen.motion.phase_index) == (
            trace["action_index"][t],
            trace["phase_index"][t],
        )
        with pytest.raises(ValueError, match="read-only"):
            seen.q[0, 0] = 1.0
        with pytest.raises(ValueError, match="read-only"):
            seen.motion.X_WO[0, 0] = 1.0


def test_the_plan_is_told_as_our_own_controller_follows_it() -> None:
    """Up to the first touch, which is the controller's own doing, phases begin and the object goes as in our own run."""
    problem = turn_problem()
    own, spy = trace_of(problem), Spy()
    trace = pipeline.rollout(problem, plan_of(problem), controller=spy)
    # The servos are told to stay, and the weight is carried by nobody: the ball falls before long.
    assert trace.meta["failure"] == "the object was dropped"
    count = trace.sample_count
    for name in ("object_pose_reference", "action_index", "phase_index"):
        assert trace[name].tobytes() == own[name][:count].tobytes()
    motion = spy.seen[-1].motion
    assert motion is not None
    assert motion.holding.tolist() == [True, True, False]


def test_velocity_and_next_pose_fit_the_pose() -> None:
    seen: list[Observation] = []
    follow = load_example("follow_a_turn")["CarryAlong"]()

    class Watched:
        reset = staticmethod(follow.reset)

        def step(self, observation: Observation) -> Any:
            seen.append(observation)
            return follow.step(observation)

    problem = load_problem("fixed_contacts", {"goal.rotation.angle_deg": 5.0})
    plan = pipeline.plan(problem)
    trace = pipeline.rollout(problem, plan, controller=Watched())
    motions = [observation.motion for observation in seen]
    moving = [k for k, m in enumerate(motions) if m is not None and np.linalg.norm(m.V_WO) > 0.1]
    assert len(moving) > 20
    for k in moving[5:-5]:
        before, now, after = motions[k - 1], motions[k], motions[k + 1]
        assert before is not None
        assert now is not None
        assert after is not None
        np.testing.assert_allclose(now.X_WO_next, after.X_WO, atol=1e-9)
        spin = (after.X_WO[:3, :3] - before.X_WO[:3, :3]) @ now.X_WO[:3, :3].T / (2 * 0.004)
        assert now.V_WO[5] == pytest.approx(0.5 * (spin[1, 0] - spin[0, 1]), rel=1e-3)
        assert now.A_WO[5] == pytest.approx((after.V_WO[5] - before.V_WO[5]) / (2 * 0.004), abs=0.05)
    report = pipeline.validate(problem, plan, trace)
    assert report.is_passed, report.table()


def test_every_run_begins_with_a_reset() -> None:
    spy = Spy()
    for _ in range(2):
        pipeline.rollout(*hold(), controller=spy)
    assert len(spy.starts) == 2
    assert spy.seen[0].time == 0.0


# -- what is recorded -----------------------------------------------------------------------------------------------


def test_the_same_columns_but_what_nobody_could_fill() -> None:
    own, trace = trace_of(hold()[0]), held_trace()
    assert set(own.columns) - set(trace.columns) == set(OWN_COLUMNS)
    assert set(trace.columns) < set(own.columns)
    for name, column in trace.columns.items():
        assert (column.dtype, column.shape[1:]) == (own[name].dtype, own[name].shape[1:]), name
    assert trace.meta["controller"] == "foreign_controller.Hold"
    assert "controller" not in own.meta


def test_a_function_will_do_and_runs_as_the_object_does() -> None:
    steady = make_hold()
    spy = Spy()
    pipeline.rollout(*hold(), controller=spy)
    steady.reset(spy.starts[0])
    targets = steady.targets.tolist()

    def step(observation: Observation) -> list[float]:
        return targets

    trace = pipeline.rollout(*hold(), controller=step)
    assert trace["qpos"].tobytes() == held_trace()["qpos"].tobytes()
    assert trace.meta["controller"].endswith("step")
    assert trace["ctrl"].dtype == np.float64


def test_what_a_controller_does_to_its_answer_later_changes_nothing() -> None:
    kept = np.zeros(18)

    class Reuses(Spy):
        def step(self, observation: Observation) -> np.ndarray:
            kept[:] = observation.q.ravel()
            return kept

    trace = pipeline.rollout(*hold(), controller=Reuses())
    assert (trace["ctrl"] == trace["qpos"][:, :18]).all()


# -- what is no answer ----------------------------------------------------------------------------------------------


def _nan(q: np.ndarray) -> Any:
    q[7] = np.nan
    return q


def _degrees(q: np.ndarray) -> Any:
    return np.degrees(q)


class _Stubborn:
    """Nothing about it can be told."""

    def __repr__(self) -> str:
        raise RuntimeError

    def __array__(self, *given: Any, **options: Any) -> np.ndarray:
        raise RuntimeError


async def _wait(q: np.ndarray) -> np.ndarray:
    await asyncio.sleep(0)
    return q


@contextlib.contextmanager
def _later() -> Iterator[Callable[[np.ndarray], Any]]:
    """Yield a function that returns a coroutine, which is closed afterwards: nobody waits for it."""
    made: list[Any] = []

    def answer(q: np.ndarray) -> Any:
        made.append(_wait(q))
        return made[0]

    yield answer
    made[0].close()


def _raise(error: BaseException) -> Any:
    raise error


BAD: dict[str, tuple[Callable[[np.ndarray], Any], str]] = {
    "nothing": (lambda q: None, "it returned nothing (None) at 0.100 s; an array (18,) of servo targets"),
    "as q": (lambda q: q.reshape(3, 6), "it returned an array of shape (3, 6) at 0.100 s; an array (18,)"),
    "too few": (lambda q: q[:17], "it returned an array of shape (17,) at 0.100 s"),
    "one number": (lambda q: 0.5, "it returned an array of shape () at 0.100 s"),
    "empty": (lambda q: [], "it returned an array of shape (0,) at 0.100 s"),
    "nan": (
        _nan,
        "it returned nan for finger_2/servo_2 (number 7) at 0.100 s; a servo's target is a joint angle",
    ),
    "infinite": (lambda q: q - np.inf, "it returned -inf for finger_1/servo_1 (number 0) at 0.100 s"),
    "degrees": (_degrees, "a servo's target is a joint angle in radians, and from "),
    "text": (lambda q: "open", "it returned 'open', which is no array of numbers at 0.100 s"),
    "texts": (lambda q: ["0.5"] * 18, "which is no array of numbers"),
    "dict": (lambda q: {"finger_1": q[:6]}, "which is no array of numbers"),
    "ragged": (lambda q: [q[:6], q[6:11]], "which is no array of numbers"),
    "complex": (lambda q: q + 1j, "which is no array of numbers"),
    "flags": (lambda q: q > 0.0, "which is no array of numbers"),
    "objects": (lambda q: np.array([None] * 18), "which is no array of numbers"),
    "generator": (lambda q: (x for x in q), "which is no array of numbers"),
    "mute": (lambda q: _Stubborn(), "it returned a _Stubborn, which is no array of numbers"),
    "raises": (
        lambda q: 1 / 0,
        "its step raised ZeroDivisionError: division by zero (test_foreign_controller.py, line ",
    ),
    "raises mutely": (lambda q: _raise(AssertionError()), "its step raised AssertionError (test_foreign"),
    "exits": (
        lambda q: _raise(SystemExit(0)),
        "its step raised SystemExit: 0 (test_foreign_controller.py, line ",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_is_no_answer_is_one_sentence_with_its_time_and_keeps_the_run(kind: str) -> None:
    _check_no_answer(*BAD[kind])


def test_a_coroutine_is_no_answer() -> None:
    with _later() as answer:
        _check_no_answer(answer, "which is no array of numbers at 0.100 s")


def _check_no_answer(wrong: Callable[[np.ndarray], Any], words: str) -> None:
    good, count = make_hold(), iter(range(10**6))

    class GoesWrong:
        reset = staticmethod(good.reset)

        def step(self, observation: Observation) -> Any:
            return wrong(observation.q.ravel().copy()) if next(count) == BAD_AT else good.step(observation)

    with pytest.raises(ControllerError) as caught:
        pipeline.rollout(*hold(), controller=GoesWrong())
    said = str(caught.value)
    assert words in said
    assert said.startswith("controller test_foreign_controller.")
    assert " at 0.100 s; " in said
    assert len(said.splitlines()) == 1
    assert caught.value.time == pytest.approx(0.1)
    trace = caught.value.trace  # type: ignore[attr-defined]
    assert trace.sample_count == BAD_AT
    assert trace.meta["failure"] == f"cut short: {said}"
    assert (trace["qpos"] == held_trace()["qpos"][:BAD_AT]).all()
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.name, again.time) == (said, caught.value.name, caught.value.time)
    assert again.trace == trace
    report = pipeline.validate(*hold(), trace)
    assert "phases_in_order" in {check.name for check in report.failures}


def test_the_error_itself_stays_the_cause() -> None:
    error = LookupError("no such grasp\nin the table")
    with pytest.raises(ControllerError, match=r"LookupError: no such grasp in the table \(") as caught:
        pipeline.rollout(*hold(), controller=lambda observation: _raise(error))
    assert caught.value.__cause__ is error
    assert not hasattr(caught.value, "trace"), "nothing was recorded yet"


def test_an_interruption_is_none_of_the_controllers_errors() -> None:
    with pytest.raises(KeyboardInterrupt):
        pipeline.rollout(*hold(), controller=lambda observation: _raise(KeyboardInterrupt()))


def test_a_reset_that_fails_is_told_without_a_time() -> None:
    class Unready(Spy):
        def reset(self, start: Any) -> None:
            start.lowest[0] = -1.0

    with pytest.raises(
        ControllerError, match=r"its reset raised ValueError: .*read-only \(.*line \d+\); it has"
    ):
        pipeline.rollout(*hold(), controller=Unready())


@pytest.mark.parametrize(
    ("thing", "words"),
    [
        (Spy, "it is a class; an object of it is accepted, such as foreign_controllers.Spy()"),
        (
            5,
            "controller builtins.int: it has no step and cannot be called; a function step(observation) -> ctrl",
        ),
        (np.zeros(18), "it has no step and cannot be called"),
        (type("Odd", (), {"step": 3})(), "its step is of type int"),
        (type("Odd", (), {"step": lambda self, o: o, "reset": True})(), "its reset is of type bool"),
        (lambda: np.zeros(18), "its step raised TypeError"),
    ],
)
def test_what_is_no_controller_is_refused(thing: Any, words: str) -> None:
    with pytest.raises(ControllerError) as caught:
        pipeline.rollout(*hold(), controller=thing)
    assert words in str(caught.value)


def test_limits_are_where_more_asks_for_nothing_more() -> None:
    scene = load_scene()
    low, high = compute_target_limits(scene, joint_speed=8.0)
    model = scene.model
    data = mujoco.MjData(model)
    for bound, side, speed in ((low, 0, -8.0), (high, 1, 8.0)):
        data.qpos[:18] = model.jnt_range[:18, side]
        data.qvel[:18] = speed
        torques = []
        for beyond in (0.0, 0.5 if side else -0.5):
            data.ctrl[:] = bound + beyond
            mujoco.mj_forward(model, data)
            torques.append(data.actuator_force.copy())
        assert (torques[0] == torques[1]).all()
        np.testing.assert_allclose(np.abs(torques[0]), model.actuator_forcerange[:, 1])
