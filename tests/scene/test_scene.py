"""Descriptions are what the compiled model says; scenes by name."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from dexplan.errors import UnknownNameError
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.scene.compose import HOME_POSITION
from dexplan.scene.description import SceneParameters
from dexplan.scene.library import SCENES, load_scene
from dexplan.scene.probe import HandProbe
from dexplan.scene.scene import HOME_GAP, Scene, scene_from_xml
from dexplan.scene.shape import Shape
from dexplan.spatial import make_pose, rotate_about


@pytest.fixture(scope="module", params=sorted(SCENES))
def scene(request: pytest.FixtureRequest) -> Scene:
    return load_scene(request.param)


def test_finger_descriptions_are_the_models(scene: Scene) -> None:
    model = scene.model
    for i, finger in enumerate(scene.fingers):
        joints = [model.joint(name) for name in finger.joint_names]
        servos = [model.actuator(int(a)) for a in scene.actuators[i]]
        assert finger.name == f"finger_{i + 1}"
        assert finger.joint_names == tuple(f"{finger.name}/joint_{j}" for j in range(1, 7))
        assert [j.qposadr[0] for j in joints] == scene.joint_qpos[i].tolist()
        assert [j.dofadr[0] for j in joints] == scene.joint_dof[i].tolist()
        assert [s.trnid[0] for s in servos] == [j.id for j in joints]
        assert np.array_equal(finger.chain.lower, [j.range[0] for j in joints])
        assert np.array_equal(finger.chain.upper, [j.range[1] for j in joints])
        assert np.array_equal(finger.torque_limit, [s.forcerange[1] for s in servos])
        assert np.array_equal(finger.servo_gain, [s.gainprm[0] for s in servos])
        assert np.array_equal(finger.servo_damping, [-s.biasprm[2] for s in servos])
        assert finger.tip_radius == model.geom(f"{finger.name}/tip").size[0]
        assert model.geom(int(scene.tip_geoms[i])).name == f"{finger.name}/tip"
        assert model.site(int(scene.tip_sites[i])).name == f"{finger.name}/tip_center"


def test_servo_laws_are_the_models(scene: Scene) -> None:
    """Gains and damping of the description predict the torque of every servo."""
    data, rng = mujoco.MjData(scene.model), np.random.default_rng(0)
    q = np.stack([f.q_home for f in scene.fingers])
    rate, target = rng.uniform(-0.2, 0.2, q.shape), q + rng.uniform(-0.01, 0.01, q.shape)
    data.qpos[:] = scene.as_qpos(q, scene.object.X_WO_home)
    data.qvel[scene.joint_dof] = rate
    data.ctrl[scene.actuators] = target
    mujoco.mj_forward(scene.model, data)
    gain = np.stack([f.servo_gain for f in scene.fingers])
    damping = np.stack([f.servo_damping for f in scene.fingers])
    assert np.allclose(data.qfrc_actuator[scene.joint_dof], gain * (target - q) - damping * rate, atol=1e-12)


def test_object_description_is_the_models(scene: Scene) -> None:
    model = scene.model
    assert model.body(scene.object_body).name == "object/"
    assert model.geom(scene.object_geom).name == "object/surface"
    assert scene.object.mass == model.body_mass[scene.object_body]
    assert scene.object.surface.radius == model.geom_size[scene.object_geom, 0]  # type: ignore[attr-defined]
    assert np.allclose(np.diag(scene.object.mass_properties.inertia), model.body_inertia[scene.object_body])
    assert np.allclose(scene.object.X_WO_home, make_pose(np.eye(3), np.array(HOME_POSITION)))


def test_home_points_at_the_object_from_a_short_way_off(scene: Scene) -> None:
    center = scene.object.X_WO_home[:3, 3]
    for finger, azimuth in zip(scene.fingers, SCENES[scene.name].base_azimuths_deg, strict=True):
        yaw = np.radians(azimuth)
        outward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        X_WF = finger.pose_at(finger.q_home)
        gap = scene.object.surface.radius + finger.tip_radius + HOME_GAP  # type: ignore[attr-defined]
        assert np.allclose(X_WF[:3, 3], center + gap * outward, atol=1e-6)
        assert np.allclose(X_WF[:3, 2], -outward, atol=1e-6)
        assert compute_joint_margin(finger.chain, finger.q_home) > np.radians(20.0)


def test_fingers_stand_alike(scene: Scene) -> None:
    first = scene.fingers[0].q_home
    for finger in scene.fingers[1:]:
        assert np.allclose(finger.q_home, first, atol=1e-6)


def test_qpos_round_trip(scene: Scene) -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, scene.joint_qpos.shape)
    X_WO = make_pose(rotate_about([0.6, 0.0, 0.8], 1.2), np.array([0.01, -0.02, 0.3]))
    data = mujoco.MjData(scene.model)
    data.qpos[:] = scene.as_qpos(q, X_WO)
    mujoco.mj_kinematics(scene.model, data)
    assert np.array_equal(data.qpos[scene.joint_qpos], q)
    body = data.body(scene.object_body)
    assert np.allclose(make_pose(body.xmat.reshape(3, 3), body.xpos), X_WO, atol=1e-12)
    # Every coordinate is somebody's: none is left at zero by mistake.
    ours = {*scene.joint_qpos.ravel().tolist(), *range(scene.object_qpos, scene.object_qpos + 7)}
    assert ours == set(range(scene.model.nq))
    assert {*scene.joint_dof.ravel().tolist(), *range(scene.object_dof, scene.object_dof + 6)} == set(
        range(scene.model.nv)
    )


def test_a_scene_is_what_its_text_says(scene: Scene) -> None:
    again = scene_from_xml(scene.name, scene.xml)
    assert np.array_equal(again.model.qpos0, scene.model.qpos0)
    for a, b in zip(again.fingers, scene.fingers, strict=True):
        assert np.array_equal(a.q_home, b.q_home)
        assert np.array_equal(a.chain.offsets, b.chain.offsets)


def test_the_same_parameters_are_composed_once(scene: Scene) -> None:
    assert load_scene(scene.name) is scene
    assert load_scene(scene.name, object_mass=0.05) is not scene


def test_unknown_scene_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownNameError) as caught:
        load_scene("two_finger_cube")
    assert str(caught.value) == "unknown scene 'two_finger_cube'; known: three_finger_sphere"


def test_a_finger_that_cannot_point_at_the_object_waits_out_of_the_way() -> None:
    hand = load_scene(joint_ranges_deg=(("finger_1.joint_3", 10.0, 20.0),))
    center = hand.object.X_WO_home[:3, 3]
    for finger in hand.fingers:
        assert compute_joint_margin(finger.chain, finger.q_home) >= -1e-9
        tip = finger.pose_at(finger.q_home)[:3, 3] - center
        assert np.linalg.norm(tip) > 0.035 + 0.018 + 0.01
        base = finger.chain.offsets[0][:3, 3] - center
        assert tip[:2] @ base[:2] > 0.0


@pytest.mark.parametrize("radius", [0.075, 0.09, 0.12])
def test_fingers_around_a_large_ball_wait_clear_of_themselves(radius: float) -> None:
    hand = load_scene(object_shape=Shape.ball(radius))
    clearance, names = HandProbe(hand).compute_clearance(
        np.stack([f.q_home for f in hand.fingers]), hand.object.X_WO_home, ()
    )
    assert clearance >= 0.002, names
    for finger in hand.fingers:
        X = finger.pose_at(finger.q_home)
        arm = X[:3, 3] - hand.object.X_WO_home[:3, 3]
        assert -X[:3, 2] @ arm == pytest.approx(np.linalg.norm(arm), rel=1e-6)


def test_library_knows_its_scenes_by_their_own_names() -> None:
    assert all(parameters == SceneParameters(scene=name) for name, parameters in SCENES.items())
