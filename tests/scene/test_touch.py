"""Sign, frame and unit of every touch, settled by Newton's laws rather than by the conventions that were used to write it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pytest
from mujoco.batch import Batch

from dexplan.kinematics.chain import compute_tip_jacobian, solve_ik
from dexplan.kinematics.workspace import compute_aligned_pose
from dexplan.scene.library import load_scene
from dexplan.scene.scene import Scene, scene_from_xml
from dexplan.scene.touch import (
    TOUCH_FIELDS,
    Touches,
    build_touch_model,
    compute_static_normal_force,
    read_touches,
)
from dexplan.spatial import GRAVITY, Array, direction_from_angles, make_pose, rotate_about

DEPTHS = (30e-6, 60e-6, 90e-6)
AZIMUTHS = (10.0, 105.0, 250.0)
R_WO = rotate_about([0.6, 0.0, 0.8], 0.7)
"""The object is turned, so that a mix-up of world and object axes shows."""


def _with_object_first(xml: str) -> str:
    """Return the same model with the object ahead of the fingers, so that MuJoCo lists each pair the other way round."""
    root = ET.fromstring(xml)
    world = root.find("worldbody")
    assert world is not None
    ball = next(body for body in world.findall("body") if body.get("name") == "object/")
    world.remove(ball)
    world.insert(0, ball)
    return ET.tostring(root, encoding="unicode")


@pytest.fixture(scope="module", params=["object second", "object first"])
def scene(request: pytest.FixtureRequest) -> Scene:
    scene = load_scene()
    return (
        scene if request.param == "object second" else scene_from_xml("turned", _with_object_first(scene.xml))
    )


def _press(scene: Scene, fingers: tuple[int, ...]) -> tuple[mujoco.MjData, Array, Array]:
    """Return data with the tips of ``fingers`` pressed into the object, the postures (F, J) and the outward normals (F, 3)."""
    center = scene.object.X_WO_home[:3, 3]
    q = np.stack([f.q_home for f in scene.fingers])
    normals = np.stack([direction_from_angles(a, 5.0) for a in AZIMUTHS])
    for i in fingers:
        distance = 0.035 + scene.fingers[i].tip_radius - DEPTHS[i]
        X_WF = compute_aligned_pose(center, normals[i][None], distance)
        solved, reached = solve_ik(scene.fingers[i].chain, X_WF, q[i][None], iterations=60, tolerance=1e-11)
        assert reached.all()
        q[i] = solved[0]
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(q, make_pose(R_WO, center))
    data.ctrl[scene.actuators] = q
    return data, q, normals


def read(scene: Scene, data: mujoco.MjData) -> Touches:
    """Return the touches (F, ...) of the state and control of ``data``, as a run's are read: by a batch of one."""
    batch = Batch(build_touch_model(scene), 1, 1)
    fields = {name: batch.bind(name) for name in TOUCH_FIELDS}
    mujoco.mj_getState(scene.model, data, batch.state[0], mujoco.mjtState.mjSTATE_INTEGRATION)
    batch.forward()
    touches = read_touches(scene, fields)
    return Touches(**{name: value[0] for name, value in vars(touches).items()})


def _force_W(touches: Touches, finger: int) -> Array:
    return R_WO @ touches.rotation_O[finger] @ touches.force[finger, :3]


def _torque_W(touches: Touches, finger: int) -> Array:
    """Return the torque about the object's centre."""
    arm = R_WO @ touches.point_O[finger]
    return (
        np.cross(arm, _force_W(touches, finger))
        + R_WO @ touches.rotation_O[finger][:, 2] * touches.force[finger, 3]
    )


def test_geometry_of_a_touch(scene: Scene) -> None:
    data, _, normals = _press(scene, (0, 2))
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    assert touches.active.tolist() == [True, False, True]
    for column in (
        touches.point_O,
        touches.rotation_O,
        touches.force,
        touches.slip_velocity,
        touches.penetration,
    ):
        assert np.isnan(column[1]).all()
    for i in (0, 2):
        # The normal looks into the object; the point lies half the depth below both surfaces.
        assert np.allclose(R_WO @ touches.rotation_O[i][:, 2], -normals[i], atol=1e-6)
        assert np.allclose(R_WO @ touches.point_O[i], (0.035 - DEPTHS[i] / 2) * normals[i], atol=1e-8)
        assert np.allclose(touches.rotation_O[i].T @ touches.rotation_O[i], np.eye(3), atol=1e-12)
        assert np.linalg.det(touches.rotation_O[i]) == pytest.approx(1.0)
        assert touches.penetration[i] == pytest.approx(DEPTHS[i], abs=1e-9)
        assert touches.force[i, 2] > 0.0


def test_many_instants_are_read_as_one_by_one(scene: Scene) -> None:
    batch = Batch(build_touch_model(scene), 3, 1)
    fields = {name: batch.bind(name) for name in TOUCH_FIELDS}
    alone = []
    for row, fingers in zip(batch.state, ((0, 1, 2), (), (1,)), strict=True):
        data, _, _ = _press(scene, fingers)
        mujoco.mj_getState(scene.model, data, row, mujoco.mjtState.mjSTATE_INTEGRATION)
        alone.append(read(scene, data))
    batch.forward()
    together = read_touches(scene, fields)
    assert together.active.sum(axis=1).tolist() == [3, 0, 1]
    for name, values in vars(together).items():
        np.testing.assert_array_equal(values, np.stack([vars(one)[name] for one in alone]))


def test_sensors_leave_the_physics_alone(scene: Scene) -> None:
    """Equal states give equal accelerations, bit for bit, and there is no more to the state."""
    data, _, _ = _press(scene, (0, 1, 2))
    data.xfrc_applied[scene.object_body] = [0.3, -0.5, 0.4, 0.004, -0.003, 0.006]
    model, kind = build_touch_model(scene), mujoco.mjtState.mjSTATE_INTEGRATION
    assert mujoco.mj_stateSize(model, kind) == mujoco.mj_stateSize(scene.model, kind)
    state = np.zeros(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(scene.model, data, state, kind)
    other = mujoco.MjData(model)
    mujoco.mj_setState(model, other, state, kind)
    mujoco.mj_forward(scene.model, data)
    mujoco.mj_forward(model, other)
    np.testing.assert_array_equal(other.qacc, data.qacc)
    np.testing.assert_array_equal(other.qfrc_constraint, data.qfrc_constraint)


def test_nothing_touches_at_home(scene: Scene) -> None:
    data, _, _ = _press(scene, ())
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    assert not touches.active.any()
    assert np.isnan(touches.force).all()


def test_a_known_push_in_equilibrium(scene: Scene) -> None:
    """The outer force that keeps a pressed ball at rest is, with its weight, minus the touch's force."""
    data, _, normals = _press(scene, (0,))
    mujoco.mj_forward(scene.model, data)
    data.qacc[:] = 0.0
    mujoco.mj_inverse(scene.model, data)
    outer = data.qfrc_inverse[scene.object_dof : scene.object_dof + 3].copy()
    weight = np.array([0.0, 0.0, -scene.object.mass * GRAVITY])
    data.qfrc_applied[:] = data.qfrc_inverse - data.qfrc_actuator
    touches = read(scene, data)
    assert np.allclose(_force_W(touches, 0), -outer - weight, atol=1e-9)
    # Pushed straight along the normal, away from the finger.
    assert np.allclose(_force_W(touches, 0), -touches.force[0, 2] * normals[0], atol=1e-6)
    assert compute_static_normal_force(scene, data, 0) == pytest.approx(touches.force[0, 2], rel=1e-9)
    assert compute_static_normal_force(scene, data, 1) == 0.0


def test_touches_move_the_object_as_newton_says(scene: Scene) -> None:
    """Sum of touches, weight and a declared push equals mass times acceleration, in force and torque."""
    data, _, _ = _press(scene, (0, 1, 2))
    push, twist = np.array([0.3, -0.5, 0.4]), np.array([0.004, -0.003, 0.006])
    data.xfrc_applied[scene.object_body] = [*push, *twist]
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    assert touches.active.all()
    linear = data.qacc[scene.object_dof : scene.object_dof + 3]
    angular = R_WO @ data.qacc[scene.object_dof + 3 : scene.object_dof + 6]
    weight = np.array([0.0, 0.0, -scene.object.mass * GRAVITY])
    forces = np.sum([_force_W(touches, i) for i in range(3)], axis=0)
    torques = np.sum([_torque_W(touches, i) for i in range(3)], axis=0)
    assert np.allclose(forces + push + weight, scene.object.mass * linear, atol=1e-9)
    assert np.allclose(
        torques + twist, R_WO @ scene.object.mass_properties.inertia @ R_WO.T @ angular, atol=1e-10
    )
    # The push was such that shear and torsion are in play.
    assert np.abs(touches.force[:, :2]).max() > 0.05
    assert np.abs(touches.force[:, 3]).max() > 1e-5


def test_action_is_reaction(scene: Scene) -> None:
    """What the joints feel is minus the touch's force, through the Jacobian of the contact point."""
    data, q, _ = _press(scene, (0, 1, 2))
    data.xfrc_applied[scene.object_body] = [0.3, -0.5, 0.4, 0.004, -0.003, 0.006]
    mujoco.mj_forward(scene.model, data)
    touches, center = read(scene, data), scene.object.X_WO_home[:3, 3]
    for i, finger in enumerate(scene.fingers):
        J = compute_tip_jacobian(finger.chain, q[i])
        arm = center + R_WO @ touches.point_O[i] - finger.pose_at(q[i])[:3, 3]
        force, torque = _force_W(touches, i), R_WO @ touches.rotation_O[i][:, 2] * touches.force[i, 3]
        felt = J.T @ np.concatenate([-force, -torque - np.cross(arm, force)])
        assert np.allclose(data.qfrc_constraint[scene.joint_dof[i]], felt, atol=1e-9)


def test_force_is_the_simulators_own_number(scene: Scene) -> None:
    """Against `mj_contactForce` by its documentation: normal first, acting on the second geom."""
    data, _, _ = _press(scene, (0, 1, 2))
    data.xfrc_applied[scene.object_body] = [0.3, -0.5, 0.4, 0.004, -0.003, 0.006]
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    assert data.ncon == 3
    for k in range(data.ncon):
        contact, wrench = data.contact[k], np.zeros(6)
        mujoco.mj_contactForce(scene.model, data, k, wrench)
        on_second = contact.frame.reshape(3, 3).T @ wrench[:3]
        is_second = contact.geom[1] == scene.object_geom
        tip = contact.geom[0] if is_second else contact.geom[1]
        finger = scene.tip_geoms.tolist().index(tip)
        assert np.allclose(_force_W(touches, finger), on_second if is_second else -on_second, atol=1e-12)
        assert touches.force[finger, 2] == pytest.approx(wrench[0])


def _move_tip(scene: Scene, data: mujoco.MjData, q: Array, finger: int, twist: Array) -> None:
    J = compute_tip_jacobian(scene.fingers[finger].chain, q[finger])
    data.qvel[scene.joint_dof[finger]] = np.linalg.solve(J, twist)


def test_slip_is_the_tip_relative_to_the_object(scene: Scene) -> None:
    data, q, normals = _press(scene, (0,))
    sideways = np.cross([0.0, 0.0, 1.0], normals[0])
    sideways /= np.linalg.norm(sideways)
    _move_tip(scene, data, q, 0, np.concatenate([0.02 * sideways, np.zeros(3)]))
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    slip_W = R_WO @ touches.rotation_O[0][:, :2] @ touches.slip_velocity[0, :2]
    assert np.allclose(slip_W, 0.02 * sideways, atol=1e-7)
    # Friction drags the object along with the tip.
    assert _force_W(touches, 0) @ sideways > 0.0
    # The same motion of the object takes the slip away again.
    data.qvel[scene.object_dof : scene.object_dof + 3] = 0.02 * sideways
    mujoco.mj_forward(scene.model, data)
    assert np.allclose(read(scene, data).slip_velocity[0], 0.0, atol=1e-7)


def test_spin_is_about_the_normal_into_the_object(scene: Scene) -> None:
    data, q, normals = _press(scene, (0,))
    _move_tip(scene, data, q, 0, np.concatenate([np.zeros(3), -0.3 * normals[0]]))
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    assert np.allclose(touches.slip_velocity[0], [0.0, 0.0, 0.3], atol=1e-6)
    assert touches.force[0, 3] > 0.0
    # qvel of a free joint turns in body axes.
    data.qvel[scene.object_dof + 3 : scene.object_dof + 6] = R_WO.T @ (-0.5 * normals[0])
    mujoco.mj_forward(scene.model, data)
    assert read(scene, data).slip_velocity[0, 2] == pytest.approx(-0.2, abs=1e-6)


def test_rolling_is_not_slipping(scene: Scene) -> None:
    """A tip that rolls on the ball at rest: its centre moves, its contact point does not."""
    data, q, normals = _press(scene, (0,))
    axis = np.cross(normals[0], [0.0, 0.0, 1.0])
    touch_to_center = (scene.fingers[0].tip_radius - DEPTHS[0] / 2) * normals[0]
    _move_tip(scene, data, q, 0, np.concatenate([np.cross(axis, touch_to_center), axis]))
    mujoco.mj_forward(scene.model, data)
    assert np.allclose(read(scene, data).slip_velocity[0], 0.0, atol=1e-7)
    # The ball turning under a tip at rest slips the other way.
    data, _, _ = _press(scene, (0,))
    data.qvel[scene.object_dof + 3 : scene.object_dof + 6] = R_WO.T @ np.array([0.0, 0.0, 1.0])
    mujoco.mj_forward(scene.model, data)
    touches = read(scene, data)
    surface = np.cross([0.0, 0.0, 1.0], R_WO @ touches.point_O[0])
    slip_W = R_WO @ touches.rotation_O[0][:, :2] @ touches.slip_velocity[0, :2]
    assert np.allclose(slip_W, -surface, atol=1e-7)
