"""What control computes in a shorter way, against the general code that says the same."""

from __future__ import annotations

import mink
import mujoco
import numpy as np
import pytest
import qpsolvers

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody
from dexplan.contact.bodies.smooth import BallBody, EllipsoidBody
from dexplan.control.ahead import AHEAD, ObjectAhead
from dexplan.control.follow import DAMPING, PostureFollower
from dexplan.control.grasp_maps import map_grasp
from dexplan.control.hand import build_hand_body
from dexplan.control.poses import (
    Pose,
    as_rotation_vector,
    compose,
    express,
    from_rotation_vector,
    move_towards,
    multiply,
    rotate,
    transpose,
)
from dexplan.control.reference import ObjectPath
from dexplan.control.tasks import FingertipTask
from dexplan.grasp.grasp import map_contact
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.pace import Pace
from dexplan.scene.library import load_scene
from dexplan.spatial import Array, build_frame, build_frames, invert_pose, rotate_about

TICK, SPEED = 0.004, 8.0


def draw_pose(rng: np.random.Generator, angle: float = 1.0) -> Array:
    X = np.eye(4)
    axis = rng.normal(size=3)
    X[:3, :3] = rotate_about(axis / np.linalg.norm(axis), angle * rng.uniform(-1.0, 1.0))
    X[:3, 3] = rng.normal(scale=0.1, size=3)
    return X


def test_poses_of_floats_are_the_matrices() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        A, B = draw_pose(rng), draw_pose(rng)
        a, b = Pose.from_matrix(A), Pose.from_matrix(B)
        np.testing.assert_array_equal(a.as_matrix(), A)
        np.testing.assert_allclose(compose(a, b).as_matrix(), A @ B, atol=1e-15)
        np.testing.assert_allclose(express(a, b).as_matrix(), invert_pose(A) @ B, atol=1e-15)
        np.testing.assert_allclose(rotate(a.R, b.p), A[:3, :3] @ B[:3, 3], atol=1e-15)
        np.testing.assert_allclose(
            np.reshape(multiply(a.R, transpose(b.R)), (3, 3)), A[:3, :3] @ B[:3, :3].T, atol=1e-15
        )


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0])
def test_rotation_vectors_there_and_back(angle: float) -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    R = from_rotation_vector(tuple(angle * axis))
    np.testing.assert_allclose(np.reshape(R, (3, 3)), rotate_about(axis, angle), atol=1e-15)
    np.testing.assert_allclose(as_rotation_vector(R), angle * axis, rtol=1e-9, atol=1e-16)


def test_moving_towards_a_pose_takes_the_same_axis_and_a_share_of_the_angle() -> None:
    rng = np.random.default_rng(1)
    A, axis = draw_pose(rng), np.array([0.0, 0.6, 0.8])
    B = A.copy()
    B[:3, :3] = rotate_about(axis, 0.5) @ A[:3, :3]
    B[:3, 3] += [0.01, 0.0, -0.02]
    moved = move_towards(Pose.from_matrix(A), Pose.from_matrix(B), 0.2).as_matrix()
    np.testing.assert_allclose(moved[:3, :3], rotate_about(axis, 0.1) @ A[:3, :3], atol=1e-15)
    np.testing.assert_allclose(moved[:3, 3], A[:3, 3] + [0.002, 0.0, -0.004], atol=1e-15)


def test_frames_of_a_few_are_those_of_each() -> None:
    directions = np.vstack([np.random.default_rng(2).normal(size=(20, 3)), [[0, 0, 2.0], [0, 0, -0.5]]])
    for frame, z in zip(build_frames(directions), directions, strict=True):
        np.testing.assert_allclose(frame, build_frame(z / np.linalg.norm(z)), atol=1e-15)


@pytest.mark.parametrize(
    "body", [BallBody(0.035), EllipsoidBody(0.02, 0.03, 0.05), BoxBody(0.01, 0.03, 0.02)], ids=type
)
def test_maps_of_a_grasp_are_those_of_its_contacts(body: ConvexBody) -> None:
    rng = np.random.default_rng(3)
    centers, p_OF = rng.normal(size=(2, 3, 3))
    jacobians, forces, X_WO = rng.normal(size=(3, 2, 3, 6)), rng.normal(size=(3, 4)), draw_pose(rng)
    maps = map_grasp(body, centers, p_OF, jacobians)
    pushes, points = maps.place_pushes(forces, X_WO)
    for k in range(3):
        touched = body.project(centers[k])
        p_OC, n_O = touched.point, touched.normal
        columns, torques = map_contact(jacobians[k].reshape(6, 6), p_OC, p_OC - p_OF[k], n_O)
        np.testing.assert_allclose(maps.G[:, 4 * k : 4 * k + 4], columns, atol=1e-14)
        np.testing.assert_allclose(maps.torques[k], torques, atol=1e-14)
        R_WC = X_WO[:3, :3] @ columns[:3, :3]
        np.testing.assert_allclose(pushes[k, 0], R_WC @ forces[k, :3], atol=1e-14)
        np.testing.assert_allclose(pushes[k, 1], R_WC[:, 2] * forces[k, 3], atol=1e-14)
        np.testing.assert_allclose(points[k], X_WO[:3, :3] @ p_OC + X_WO[:3, 3], atol=1e-14)


def test_many_ticks_ahead_are_the_ticks_themselves() -> None:
    turn = ObjectMotion(np.eye(4), np.array([0.0, 0.6, 0.8]), 2.0, np.array([0.01, 0.0, 0.02]))
    paths = [ObjectPath(turn, Pace(0.5, 0.1, "ramp")), ObjectPath(turn, Pace(0.3, 0.1, "ramp"))]
    ahead, samples = ObjectAhead(TICK), 0
    for path in paths:
        # Time goes on by ticks, and jumps once.
        for t in [k * TICK for k in range(2 * AHEAD)] + [k * TICK + 0.0013 for k in range(5)]:
            now, exact, later = ahead.look(path, t), path.sample(t), path.sample(t + TICK)
            np.testing.assert_allclose(now.X_WO, exact.X_WO, atol=1e-13)
            np.testing.assert_allclose(now.acceleration, exact.acceleration, atol=1e-9)
            np.testing.assert_array_equal(now.pose.as_matrix(), now.X_WO)
            np.testing.assert_allclose(now.pose_next.as_matrix(), later.X_WO, atol=1e-13)
            samples += 1
    assert samples == 2 * (2 * AHEAD + 5)


@pytest.mark.parametrize("reach", [1e-4, 0.05], ids=["within limits", "against speed limits"])
def test_the_follower_answers_minks_program(reach: float) -> None:
    """The same task with mink's own limits, built and solved by mink."""
    scene = load_scene()
    body = build_hand_body(scene)
    follower, task = PostureFollower(body, SPEED, TICK), FingertipTask(body.sites, body.model.nv)
    configuration = mink.Configuration(body.model)
    names = [mujoco.mj_id2name(body.model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(body.model.njnt)]
    limits = [
        mink.ConfigurationLimit(body.model),
        mink.VelocityLimit(body.model, dict.fromkeys(names, SPEED)),
    ]
    rng, bound = np.random.default_rng(4), 0
    home = np.concatenate([finger.q_home for finger in scene.fingers])
    follower.start(home)
    for _ in range(20):
        configuration.update(follower.q.ravel())
        targets = []
        for site in body.sites:
            X = np.eye(4)
            X[:3, :3] = configuration.data.site_xmat[site].reshape(3, 3)
            X[:3, 3] = configuration.data.site_xpos[site] + rng.normal(scale=reach, size=3)
            targets.append(Pose.from_matrix(X))
        task.set_targets(targets)
        problem = mink.build_ik(configuration, [task], TICK, DAMPING, limits)
        step = qpsolvers.solve_problem(problem, solver="daqp").x
        assert step is not None
        moved = follower.follow(targets)
        np.testing.assert_allclose(moved.qdot.ravel(), step / TICK, rtol=1e-6, atol=1e-6)
        bound += int((np.abs(step) > 0.999 * SPEED * TICK).any())
    assert bool(bound) == (reach > 1e-3)
