"""The probe: whose bodies count, and distances that no posture changes."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest

from dexplan.scene.description import OBJECT, STANDING, Obstacle, SceneParameters
from dexplan.scene.library import load_scene_with
from dexplan.scene.probe import HandProbe, leave_out
from dexplan.scene.scene import Scene


def build(*obstacles: Obstacle, bases: tuple[float, ...] = (0.0, 120.0, 240.0)) -> tuple[Scene, HandProbe]:
    scene = load_scene_with(SceneParameters(obstacles=obstacles, base_azimuths_deg=bases))
    return scene, HandProbe(scene)


def test_nothing_of_the_hand_itself_overlaps() -> None:
    assert build()[1].find_overlaps() == ()


@pytest.mark.parametrize("gap", [0.0013, -0.0004])
def test_bodies_that_never_move_against_one_another(gap: float) -> None:
    """A ball beside the first link of finger 2, which turns on the spot: the same distance in every posture."""
    angle = np.radians(120.0)
    at = (0.18 + 0.015 + 0.004 + gap) * np.array([np.cos(angle), np.sin(angle)])
    scene, probe = build(Obstacle("sphere", (float(at[0]), float(at[1]), 0.21), (0.004,)))
    q, X_WO = np.stack([f.q_home for f in scene.fingers]), scene.object.X_WO_home
    overlaps = probe.find_overlaps()
    assert len(overlaps) == (gap < 0.0)
    # It is the distance that the judge measures wherever the finger is free, and nobody's while it holds.
    free, held = (probe.find_nearest(q, X_WO, touching) for touching in ((), (1,)))
    assert free.distance == pytest.approx(gap, abs=1e-9)
    assert set(free.owners) == {1, STANDING}
    assert held.distance > gap + 1e-4
    if overlaps:
        assert overlaps[0] == free
    assert probe.find_nearest(q, X_WO, (), (1,)).distance > gap + 1e-4
    assert probe.find_nearest(q, X_WO, (), (STANDING,)).distance > gap + 1e-4


def test_absent_fingers_and_obstacles_do_not_count() -> None:
    scene, probe = build(bases=(0.0, 20.0, 180.0))
    q, X_WO = np.stack([f.q_home for f in scene.fingers]), scene.object.X_WO_home
    assert set(probe.find_nearest(q, X_WO, ()).owners) == {0, 1}
    assert probe.compute_clearance(q, X_WO, (), (1,))[0] > 0.0
    inside = X_WO.copy()
    inside[:3, 3] = scene.fingers[2].pose_at(q[2])[:3, 3]
    assert set(probe.find_nearest(q, inside, (), (0, 1)).owners) == {OBJECT, 2}
    assert OBJECT not in probe.find_nearest(q, inside, (), (0, 1, 2)).owners
    assert probe.find_nearest(q, inside, (2,), (0, 1)).names != "finger_3/tip and object/surface"


def test_what_is_left_out_is_these_pairs_alone() -> None:
    scene, _ = build(Obstacle("sphere", (0.0, 0.0, 0.3), (0.004,)))
    model, data = copy.copy(scene.model), mujoco.MjData(scene.model)
    model.geom_margin[:] = model.body_margin[:] = 0.02
    data.qpos[:] = scene.as_qpos(np.stack([f.q_home for f in scene.fingers]), scene.object.X_WO_home)
    mujoco.mj_kinematics(model, data)

    def collide() -> list[tuple[list[int], float]]:
        mujoco.mj_collision(model, data)
        return list(zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True))

    before = collide()
    pairs = [(min(g), max(g)) for g, _ in before][::2]
    leave_out(model, pairs)
    assert collide() == [(g, d) for g, d in before if (min(g), max(g)) not in pairs]
    assert len(pairs) > 6
