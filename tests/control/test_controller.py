"""One tick: the task's Jacobian, what the servos are told at rest, what may be seen, and what waits for a touch."""

from __future__ import annotations

import dataclasses
import inspect
import typing
from pathlib import Path

import mink
import mujoco
import numpy as np
import pytest

import dexplan.control
from dexplan import pipeline
from dexplan.control.controller import Command, Controller
from dexplan.control.hand import build_hand_body
from dexplan.control.observation import Observation
from dexplan.control.options import RATE, ControlOptions
from dexplan.control.poses import Pose
from dexplan.control.reference import Reference, build_reference
from dexplan.control.tasks import FingertipTask
from dexplan.kinematics.chain import solve_ik
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.scene.scene import Scene
from dexplan.spatial import GRAVITY

TICK = 1.0 / RATE


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem(
        "fig4_substitution",
        {"goal.rotation.angle_deg": 15.0, "start.contacts_deg": [[36.0, 0.0], [180.0, 0.0], "free"]},
    )


@pytest.fixture(scope="module")
def scene(problem: Problem) -> Scene:
    return pipeline.build_scene(problem)


@pytest.fixture(scope="module")
def reference(problem: Problem) -> Reference:
    return build_reference(pipeline.plan(problem))


@pytest.fixture(scope="module")
def options(problem: Problem) -> ControlOptions:
    return pipeline.build_options(problem)


@pytest.fixture(scope="module")
def at_start(scene: Scene, reference: Reference) -> Observation:
    """The hand in its first grasp, at rest."""
    q = np.stack([f.q_home for f in scene.fingers])
    touching = np.array([begin is not None for begin in reference.start])
    for i, begin in enumerate(reference.start):
        if begin is not None:
            X_OF, q_start = begin
            X_WF = scene.object.X_WO_home @ X_OF
            solved, reached = solve_ik(scene.fingers[i].chain, X_WF[None], q_start[None], iterations=60)
            assert reached.all()
            q[i] = solved[0]
    return Observation(0.0, q, np.zeros_like(q), scene.object.X_WO_home, touching)


# -- the task -----------------------------------------------------------------------------------------------


def test_fingertip_task_jacobian_agrees_with_differences(scene: Scene) -> None:
    model = mujoco.MjModel.from_xml_string(scene.xml)
    task = FingertipTask(scene.tip_sites, model.nv)
    configuration = mink.Configuration(model)
    q = scene.as_qpos(np.stack([f.q_home for f in scene.fingers]), scene.object.X_WO_home)
    rng = np.random.default_rng(1)
    q[scene.joint_qpos] += rng.uniform(-0.2, 0.2, scene.joint_qpos.shape)
    configuration.update(q)
    X = np.tile(np.eye(4), (scene.n_fingers, 1, 1))
    X[:, :3, :3] = configuration.data.site_xmat[scene.tip_sites].reshape(-1, 3, 3)
    X[:, :3, 3] = configuration.data.site_xpos[scene.tip_sites]
    X[:, :3, 3] += 0.003  # the position error is exact at any distance
    task.set_targets([Pose.from_matrix(x) for x in X])
    J = task.compute_jacobian(configuration).copy()
    h = 1e-6
    for finger in range(scene.n_fingers):
        for qpos, dof in zip(scene.joint_qpos[finger], scene.joint_dof[finger], strict=True):
            sides = []
            for sign in (-1.0, 1.0):
                moved = q.copy()
                moved[qpos] += sign * h
                configuration.update(moved)
                sides.append(task.compute_error(configuration).copy())
            np.testing.assert_allclose(J[:, dof], (sides[1] - sides[0]) / (2 * h), atol=1e-8)


def test_fingertip_task_error_is_zero_on_target_and_points_from_it(scene: Scene) -> None:
    task = FingertipTask(scene.tip_sites, scene.model.nv)
    configuration = mink.Configuration(scene.model)
    configuration.update(scene.model.qpos0)
    data = configuration.data
    X = np.tile(np.eye(4), (scene.n_fingers, 1, 1))
    X[:, :3, :3] = data.site_xmat[scene.tip_sites].reshape(-1, 3, 3)
    X[:, :3, 3] = data.site_xpos[scene.tip_sites]
    task.set_targets([Pose.from_matrix(x) for x in X])
    np.testing.assert_allclose(task.compute_error(configuration), 0.0, atol=1e-12)
    X[0, :3, 3] += [0.0, 0.0, 0.01]
    task.set_targets([Pose.from_matrix(x) for x in X])
    np.testing.assert_allclose(task.compute_error(configuration)[:3], [0.0, 0.0, -0.01], atol=1e-12)


# -- at rest ------------------------------------------------------------------------------------------------


def test_feedforward_is_gravity_and_the_wanted_forces(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    command = Controller(scene, reference, options).step(at_start)
    model = scene.model
    data = mujoco.MjData(model)
    data.qpos[:] = scene.as_qpos(at_start.q, at_start.X_WO)
    mujoco.mj_forward(model, data)
    p_WO, jacp, jacr = at_start.X_WO[:3, 3], np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for i, finger in enumerate(scene.fingers):
        expected = data.qfrc_bias[scene.joint_dof[i]].copy()
        force = command.forces_W[i]
        assert np.isfinite(force).all() == bool(at_start.touching[i])
        if np.isfinite(force).all():
            outward = data.site_xpos[scene.tip_sites[i]] - p_WO
            outward /= np.linalg.norm(outward)
            # Where the ball is touched, as a point of the tip.
            point = p_WO + scene.object.surface.radius * outward  # type: ignore[attr-defined]
            mujoco.mj_jac(model, data, jacp, jacr, point, model.site_bodyid[scene.tip_sites[i]])
            moment = -force[3] * outward
            expected += (jacp.T @ force[:3] + jacr.T @ moment)[scene.joint_dof[i]]
        told = finger.servo_gain * (command.ctrl[scene.actuators[i]] - at_start.q[i])
        np.testing.assert_allclose(told, expected, atol=2e-5)


def test_wanted_forces_carry_the_object(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    forces = Controller(scene, reference, options).step(at_start).forces_W
    total = np.nansum(forces[:, :3], axis=0)
    np.testing.assert_allclose(total, [0.0, 0.0, scene.object.mass * GRAVITY], atol=1e-5)


def test_without_feedforward_the_servos_are_sent_where_they_are(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    silent = dataclasses.replace(options, feedforward=0.0)
    command = Controller(scene, reference, silent).step(at_start)
    np.testing.assert_allclose(command.ctrl[scene.actuators], at_start.q, atol=1e-6)


def test_object_off_its_reference_is_led_back(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    off = at_start.X_WO.copy()
    off[:3, 3] += [0.0, 0.0, -4e-4]
    low = dataclasses.replace(at_start, X_WO=off)
    shift = {}
    for share in (0.0, 1.0):
        controller = Controller(scene, reference, dataclasses.replace(options, object_feedback=share))
        # Tips carried by the lowered object are asked to rise with it, tick after tick.
        commands = [
            controller.step(dataclasses.replace(low, time=k * TICK)).ctrl[scene.actuators] for k in range(20)
        ]
        q_last = commands[-1] - commands[0]
        heights = [
            scene.fingers[i].pose_at(at_start.q[i] + q_last[i])[2, 3]
            - scene.fingers[i].pose_at(at_start.q[i])[2, 3]
            for i in range(2)
        ]
        shift[share] = min(heights)
    assert shift[1.0] > shift[0.0] + 1e-5


# -- what may be seen ---------------------------------------------------------------------------------------


def test_controller_sees_observations_only() -> None:
    assert list(inspect.signature(Controller.step).parameters) == ["self", "observation"]
    assert typing.get_type_hints(Controller.step) == {"observation": Observation, "return": Command}
    told = typing.get_type_hints(Controller.__init__)
    assert told == {
        "scene": Scene,
        "reference": Reference,
        "options": ControlOptions,
        "return": type(None),
    }
    senses = {field.name for field in dataclasses.fields(Observation)}
    assert senses == {"time", "q", "qdot", "X_WO", "touching", "motion"}
    # The last one is no sense but the plan's, which the controller has, so it is not told.
    assert Observation.motion is None


def test_no_simulated_world_is_named_in_the_controllers_room() -> None:
    room = Path(dexplan.control.__file__).parent
    for path in sorted(room.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        for word in ("MjData", "mj_step", "contactForce", "xfrc", "qfrc_"):
            assert word not in text, f"{word} in {path.name}"


def test_controllers_own_model_has_no_object(
    scene: Scene,
) -> None:
    own = build_hand_body(scene).model
    assert own.nv == scene.joint_dof.size
    assert not [own.body(b).name for b in range(own.nbody) if own.body(b).name.startswith("object")]


def test_same_observations_give_the_same_commands(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    rng = np.random.default_rng(7)
    seen = []
    for k in range(150):
        X = at_start.X_WO.copy()
        X[:3, 3] += rng.normal(0.0, 1e-4, 3)
        q = at_start.q + rng.normal(0.0, 1e-3, at_start.q.shape)
        seen.append(Observation(k * TICK, q, rng.normal(0.0, 1e-2, q.shape), X, at_start.touching))
    runs = []
    for _ in range(2):
        controller = Controller(scene, reference, options)
        runs.append([controller.step(observation) for observation in seen])
    for a, b in zip(*runs, strict=True):
        assert a.ctrl.tobytes() == b.ctrl.tobytes()
        assert a.forces_W.tobytes() == b.forces_W.tobytes()
        assert (a.action_index, a.phase_index) == (b.action_index, b.phase_index)


def test_observation_is_not_written_to(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    frozen = []
    for name in ("q", "qdot", "X_WO", "touching"):
        array = np.array(getattr(at_start, name))
        array.setflags(write=False)
        frozen.append(array)
    controller = Controller(scene, reference, options)
    for k in range(5):
        controller.step(Observation(k * TICK, *frozen))


# -- touching down ------------------------------------------------------------------------------------------


def walk(
    controller: Controller, observation: Observation, until: float, touches: tuple[int, ...] = ()
) -> list[tuple[float, Command]]:
    """Return what the controller says while the hand stands still and fingers ``touches`` report contact."""
    touching = observation.touching.copy()
    touching[list(touches)] = True
    out = []
    for k in range(round(until / TICK)):
        seen = dataclasses.replace(observation, time=k * TICK, touching=touching)
        out.append((seen.time, controller.step(seen)))
        if out[-1][1].failure:
            break
    return out


def test_finger_that_finds_nothing_fails_by_name(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    said = walk(Controller(scene, reference, options), at_start, reference.duration)
    t, command = said[-1]
    assert command.failure == "finger_3 found no object where it should have touched"
    landing = [p.duration for p in reference.phases[:4]]
    assert reference.phases[3].name == "approach"
    assert t == pytest.approx(sum(landing) + reference.touchdown.timeout, abs=5 * TICK)


def test_touch_ends_the_approach_at_once(
    scene: Scene, reference: Reference, options: ControlOptions, at_start: Observation
) -> None:
    before = sum(p.duration for p in reference.phases[:3])
    said = walk(Controller(scene, reference, options), at_start, before + 10 * TICK, touches=(2,))
    names = {(c.action_index, c.phase_index) for t, c in said if t > before + 3 * TICK}
    load = next(p for p in reference.phases if p.name == "load")
    assert names == {(load.action_index, load.phase_index)}
    # Three fingers carry it now.
    assert np.isfinite(said[-1][1].forces_W).all()
