"""The batched chain against the compiled model, against finite differences, and against itself."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from dexplan.kinematics.chain import (
    Chain,
    compute_dexterity,
    compute_joint_margin,
    compute_tip_jacobian,
    compute_tip_pose,
    solve_ik,
    wrap_to_limits,
)
from dexplan.scene.library import load_scene
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, make_pose, rotate_about


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene()


def _draw_postures(chain: Chain, count: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, chain.n_joints))


@pytest.mark.parametrize("finger", [0, 1, 2])
def test_pose_and_jacobian_are_the_models(scene: Scene, finger: int) -> None:
    chain = scene.fingers[finger].chain
    data = mujoco.MjData(scene.model)
    q = _draw_postures(chain, 20, seed=finger)
    poses, jacobians = compute_tip_pose(chain, q), compute_tip_jacobian(chain, q)
    home = np.stack([f.q_home for f in scene.fingers])
    for row, X, J in zip(q, poses, jacobians, strict=True):
        all_q = home.copy()
        all_q[finger] = row
        data.qpos[:] = scene.as_qpos(all_q, scene.object.X_WO_home)
        mujoco.mj_kinematics(scene.model, data)
        mujoco.mj_comPos(scene.model, data)
        site = scene.tip_sites[finger]
        assert np.allclose(X, make_pose(data.site_xmat[site].reshape(3, 3), data.site_xpos[site]), atol=1e-9)
        linear, angular = np.zeros((2, 3, scene.model.nv))
        mujoco.mj_jacSite(scene.model, data, linear, angular, site)
        assert np.allclose(J, np.vstack([linear, angular])[:, scene.joint_dof[finger]], atol=1e-9)
        # The tip frame sits in the sphere that collides, its pole away from the wrist.
        wrist = data.body(f"{scene.fingers[finger].name}/link_6").xpos
        assert np.allclose(X[:3, 3], data.geom_xpos[scene.tip_geoms[finger]], atol=1e-9)
        assert X[:3, 2] @ (X[:3, 3] - wrist) == pytest.approx(0.042, abs=1e-9)


def test_jacobian_is_the_derivative_of_the_pose(scene: Scene) -> None:
    chain, h = scene.fingers[1].chain, 1e-6
    q = _draw_postures(chain, 8)
    J, R = compute_tip_jacobian(chain, q), compute_tip_pose(chain, q)[:, :3, :3]
    for j in range(chain.n_joints):
        step = h * np.eye(chain.n_joints)[j]
        ahead, behind = compute_tip_pose(chain, q + step), compute_tip_pose(chain, q - step)
        rate = (ahead - behind) / (2 * h)
        spin = rate[:, :3, :3] @ R.swapaxes(1, 2)
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
        assert np.allclose(J[:, :3, j], rate[:, :3, 3], atol=1e-8)
        assert np.allclose(J[:, 3:, j], omega, atol=1e-8)


def test_shapes_of_batches(scene: Scene) -> None:
    chain = scene.fingers[0].chain
    q = _draw_postures(chain, 6).reshape(2, 3, 6)
    assert compute_tip_pose(chain, q).shape == (2, 3, 4, 4)
    assert compute_tip_jacobian(chain, q).shape == (2, 3, 6, 6)
    assert np.array_equal(compute_tip_pose(chain, q[1, 2]), compute_tip_pose(chain, q)[1, 2])
    assert compute_joint_margin(chain, q).shape == compute_dexterity(chain, q).shape == (2, 3)


def test_ik_reaches_reachable_poses_from_nearby(scene: Scene) -> None:
    chain = scene.fingers[2].chain
    q = _draw_postures(chain, 400)
    q = q[compute_dexterity(chain, q) > 0.1]
    goal = compute_tip_pose(chain, q)
    start = q + np.random.default_rng(1).uniform(-0.25, 0.25, q.shape)
    found, reached = solve_ik(chain, goal, start, iterations=40)
    assert reached.mean() > 0.99
    assert np.allclose(compute_tip_pose(chain, found)[reached], goal[reached], atol=1e-6)


def test_ik_follows_a_path_exactly(scene: Scene) -> None:
    finger = scene.fingers[0]
    chain, q = finger.chain, finger.q_home[None]
    X = finger.pose_at(finger.q_home)
    for angle in np.radians(np.arange(0.0, 31.0, 3.0)):
        goal = X.copy()
        goal[:3, :3] = rotate_about([0.0, 1.0, 0.0], angle) @ X[:3, :3]
        goal[:3, 3] += [0.0, 0.02 * angle, 0.01 * angle]
        found, reached = solve_ik(chain, goal[None], q)
        assert reached.all()
        assert np.abs(found - q).max() < 0.2
        q = found


def test_ik_says_what_it_cannot_reach(scene: Scene) -> None:
    chain = scene.fingers[0].chain
    goal = make_pose(np.eye(3), np.array([0.0, 0.0, 2.0]))[None]
    _, reached = solve_ik(chain, goal, scene.fingers[0].q_home[None])
    assert not reached.any()


def test_wrap_moves_whole_turns_towards_the_middle(scene: Scene) -> None:
    chain = scene.fingers[0].chain
    # A joint with more than a turn of range has several right answers; these have one.
    middle = 0.5 * (chain.lower + chain.upper)
    q = np.clip(_draw_postures(chain, 50), middle - 3.1, middle + 3.1)
    turns = np.random.default_rng(2).integers(-3, 4, q.shape)
    wrapped = wrap_to_limits(chain, q + 2.0 * np.pi * turns)
    assert np.allclose(wrapped, q, atol=1e-9)
    assert np.allclose(
        compute_tip_pose(chain, q + 2.0 * np.pi * turns), compute_tip_pose(chain, q), atol=1e-9
    )


def test_joint_margin_is_the_nearest_limit(scene: Scene) -> None:
    chain = scene.fingers[0].chain
    middle = 0.5 * (chain.lower + chain.upper)
    assert compute_joint_margin(chain, middle) == pytest.approx(0.5 * (chain.upper - chain.lower).min())
    low = middle.copy()
    low[2] = chain.lower[2] + 0.05
    assert compute_joint_margin(chain, low) == pytest.approx(0.05)
    low[2] = chain.lower[2] - 0.05
    assert compute_joint_margin(chain, low) == pytest.approx(-0.05)


@pytest.mark.parametrize(("joint", "what"), [(4, "both rolls on one axis"), (2, "the elbow straight")])
def test_dexterity_vanishes_at_singular_postures(scene: Scene, joint: int, what: str) -> None:
    finger = scene.fingers[0]
    assert compute_dexterity(finger.chain, finger.q_home) > 0.25
    q = finger.q_home.copy()
    q[joint] = 0.0
    assert compute_dexterity(finger.chain, q) < 1e-9, what


def test_last_hinge_is_the_spin_about_the_pole(scene: Scene) -> None:
    for finger in scene.fingers:
        chain, q = finger.chain, finger.q_home
        assert chain.has_tip_roll
        X = finger.pose_at(q)
        turned = finger.pose_at(q + 0.3 * np.eye(6)[5])
        assert np.allclose(turned[:3, 3], X[:3, 3], atol=1e-12)
        assert np.allclose(
            turned[:3, :3], X[:3, :3] @ rotate_about([0.0, 0.0, chain.roll_sign], 0.3), atol=1e-12
        )


def test_a_chain_without_tip_roll_says_so(scene: Scene) -> None:
    chain = scene.fingers[0].chain
    bent = chain.X_JF.copy()
    bent[:3, :3] = rotate_about([0.0, 1.0, 0.0], 0.2) @ bent[:3, :3]
    assert not Chain(chain.offsets, chain.axes, bent, chain.lower, chain.upper).has_tip_roll


def test_arrays_are_frozen(scene: Scene) -> None:
    with pytest.raises(ValueError, match="read-only"):
        scene.fingers[0].chain.lower[0] = 0.0
