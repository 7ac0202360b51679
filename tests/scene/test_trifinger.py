"""A hand of real fingers with three joints each, composed as any other."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from real_fingers import build_trifinger

from dexplan.errors import UnknownNameError
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.scene.library import TRIFINGER_BALL
from dexplan.scene.probe import HandProbe
from dexplan.scene.scene import Scene, build_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(TRIFINGER_BALL)


def test_the_chains_are_those_of_the_published_lengths(scene: Scene) -> None:
    q = np.random.default_rng(0).uniform(-0.3, 1.0, (20, 3))
    for finger, azimuth in zip(scene.fingers, TRIFINGER_BALL.base_azimuths_deg, strict=True):
        published = build_trifinger(azimuth - 90.0)
        assert np.allclose(compute_tip_pose(finger.chain, q), compute_tip_pose(published, q), atol=1e-9)
        assert np.allclose(finger.chain.lower, published.lower)
        assert np.allclose(finger.chain.upper, published.upper)
        assert np.allclose(finger.torque_limit, 0.396)


def test_fingers_wait_beside_the_object_each_on_its_own_side(scene: Scene) -> None:
    center = scene.object.X_WO_home[:3, 3]
    assert center[2] == pytest.approx(0.10)
    homes = np.stack([f.q_home for f in scene.fingers])
    for finger, azimuth in zip(scene.fingers, np.radians(TRIFINGER_BALL.base_azimuths_deg), strict=True):
        arm = finger.pose_at(finger.q_home)[:3, 3] - center
        side = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        assert arm @ side > 0.9 * np.linalg.norm(arm)
        assert compute_joint_margin(finger.chain, finger.q_home) > np.radians(5.0)
    assert HandProbe(scene).find_nearest(homes, scene.object.X_WO_home, ()).distance > 0.005


def test_gravity_holds_for_the_whole_chain(scene: Scene) -> None:
    """What the probe says of the links' weight is the sum of weight times lever arm, link by link."""
    model, data = scene.model, mujoco.MjData(scene.model)
    q = np.stack([f.q_home for f in scene.fingers])
    data.qpos[:] = scene.as_qpos(q, scene.object.X_WO_home)
    mujoco.mj_forward(model, data)
    wanted = np.zeros(model.nv)
    for body in range(model.nbody):
        J = np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, J, None, body)
        wanted += model.body_mass[body] * 9.81 * J[2]
    torque = HandProbe(scene).compute_gravity_torque(q)
    assert np.allclose(torque, wanted[scene.joint_dof], atol=1e-9)
    assert np.abs(torque).max() < 0.396
    assert (model.body_gravcomp == 0.0).all()


def test_an_unknown_kind_of_finger_is_named() -> None:
    with pytest.raises(UnknownNameError, match="allegro"):
        build_scene(replace(TRIFINGER_BALL, finger="allegro"))
