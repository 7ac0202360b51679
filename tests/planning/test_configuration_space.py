"""The hand's configuration space: free, contact and collision, against MuJoCo's own distances."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from dexplan import pipeline
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.ways.configuration_space import TOUCH, classify, compute_tip_gaps
from dexplan.problems.problem import Obstacle
from dexplan.problems.read import load_problem
from dexplan.scene.scene import Scene
from dexplan.spatial import Array


@pytest.fixture(scope="module")
def scene() -> Scene:
    return pipeline.build_scene(load_problem("hold_three"))


@pytest.fixture(scope="module")
def hand(scene: Scene) -> HandModel:
    return pipeline.build_hand(load_problem("hold_three"), scene)


def touch(hand: HandModel, azimuths_deg: dict[int, float], depth: float = 0.0) -> Array:
    """Return the posture (F, J) with these fingers on the equator, ``depth`` [m] in the ball, the others at home."""
    q, X_WO = hand.q_home.copy(), hand.object.X_WO_home
    for i, azimuth in azimuths_deg.items():
        a = np.radians(azimuth)
        normal = np.array([np.cos(a), np.sin(a), 0.0])
        (landing,) = build_landings(hand, X_WO, i, normal[None])
        assert landing is not None
        X = X_WO @ landing.X_OF
        X[:3, 3] -= depth * normal
        solved, reached = hand.workspaces[i].solve(X[None])
        assert reached[0]
        q[i] = solved[0]
    return q


def test_home_is_free(hand: HandModel) -> None:
    at = classify(hand, hand.q_home)
    assert (at.kind, at.touching) == ("free", ())
    assert at.is_allowed
    assert at.clearance > 0.0


def test_tips_on_the_object_are_contact(hand: HandModel) -> None:
    at = classify(hand, touch(hand, {0: 0.0, 2: 240.0}))
    assert (at.kind, at.touching) == ("contact", (0, 2))
    assert classify(hand, touch(hand, {1: 120.0}, depth=0.5 * TOUCH)).kind == "contact"


@pytest.mark.parametrize(("depth", "kind"), [(-0.002, "free"), (0.0, "contact"), (0.002, "collision")])
def test_depth_decides(hand: HandModel, depth: float, kind: str) -> None:
    at = classify(hand, touch(hand, {0: 10.0}, depth))
    assert at.kind == kind
    assert at.is_allowed == (kind != "collision")
    if kind != "contact":
        assert at.clearance == pytest.approx(-depth, abs=1e-6)
        assert at.nearest == "finger_1/tip and object/surface"


def test_fingers_collide_with_each_other(hand: HandModel) -> None:
    # Two tips of 18 mm, 20 degrees apart on a ball of 35 mm: 18 mm between their centres.
    at = classify(hand, touch(hand, {0: 50.0, 1: 70.0}))
    assert at.kind == "collision"
    assert "finger_1" in at.nearest
    assert "finger_2" in at.nearest


def test_object_elsewhere(hand: HandModel) -> None:
    X_WO = hand.object.X_WO_home.copy()
    X_WO[0, 3] += 0.004
    at = classify(hand, touch(hand, {0: 0.0}), X_WO)
    assert at.kind == "collision"
    assert at.clearance == pytest.approx(-0.004, abs=1e-6)


def test_obstacle_turns_contact_into_collision(hand: HandModel) -> None:
    q = touch(hand, {0: 0.0, 1: 120.0})
    centre = hand.fingers[0].pose_at(q[0])[:3, 3]
    x, y, z = (float(v) for v in centre)
    # A ball below the tip: free of it by 3 mm, then 3 mm into it.
    for gap, kind in ((0.003, "contact"), (-0.003, "collision")):
        below = Obstacle("sphere", (x, y, z - 0.018 - gap - 0.005), (0.005,))
        problem = replace(load_problem("hold_three"), obstacles=(below,))
        beside = pipeline.build_hand(problem, pipeline.build_scene(problem))
        at = classify(beside, q)
        assert at.kind == kind
        assert at.touching == (0, 1)
        assert at.clearance == pytest.approx(gap, abs=1e-6)
        assert "obstacle_1" in at.nearest


def test_object_in_an_obstacle_is_seen(hand: HandModel) -> None:
    """The object does not move while postures are tried, and is a body like any other all the same."""
    x, y, z = (float(v) for v in hand.object.X_WO_home[:3, 3])
    for gap in (0.003, -0.003):
        below = Obstacle("box", (x, y, z - 0.035 - gap - 0.005), (0.02, 0.02, 0.005))
        problem = replace(load_problem("hold_three"), obstacles=(below,))
        beside = pipeline.build_hand(problem, pipeline.build_scene(problem))
        clearance, names = beside.probe.compute_clearance(hand.q_home, hand.object.X_WO_home, ())
        assert clearance == pytest.approx(gap, abs=1e-6)
        assert "obstacle_1" in names


def test_gaps_are_mujocos_distances(hand: HandModel, scene: Scene) -> None:
    data, rng = mujoco.MjData(scene.model), np.random.default_rng(0)
    for _ in range(20):
        q = hand.q_home + rng.normal(scale=0.2, size=hand.q_home.shape)
        data.qpos[:] = scene.as_qpos(q, hand.object.X_WO_home)
        mujoco.mj_kinematics(scene.model, data)
        measured = [
            mujoco.mj_geomDistance(scene.model, data, int(tip), scene.object_geom, 1.0, None)
            for tip in scene.tip_geoms
        ]
        np.testing.assert_allclose(compute_tip_gaps(hand, q, hand.object.X_WO_home), measured, atol=1e-9)


@pytest.mark.parametrize("q", [np.zeros((2, 6)), np.zeros(18), np.full((3, 6), np.nan)])
def test_no_posture(hand: HandModel, q: Array) -> None:
    with pytest.raises(ValueError, match="finite joint angles"):
        classify(hand, q)
