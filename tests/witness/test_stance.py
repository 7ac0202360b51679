"""The hand stands in equilibrium: MuJoCo feels the forces that were wanted, and nothing accelerates."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from dexplan.contact.friction import HardFinger, SoftFinger
from dexplan.scene.library import load_scene
from dexplan.scene.touch import TOUCH_FIELDS, build_touch_model, read_touches
from dexplan.spatial import build_frame, direction_from_angles
from dexplan.witness.experiments import PRELOAD, build_grasp, solve_forces
from dexplan.witness.stance import STATE, Stance, solve_stance

PAIR = {0: direction_from_angles(-12.0, 10.0), 1: direction_from_angles(130.0, -5.0)}
TRIPLE = {i: direction_from_angles(120.0 * i, 15.0) for i in range(3)}


def stand(directions, model, load=(0.0,) * 6) -> tuple[Stance, np.ndarray]:
    _, forces = solve_forces(build_grasp(directions, model), np.array(load), PRELOAD)
    stance = solve_stance(load_scene(), directions, forces[None])
    assert stance is not None
    return stance, forces


@pytest.mark.parametrize(
    ("directions", "model"),
    [(PAIR, SoftFinger(0.5, 0.0022)), (TRIPLE, HardFinger(0.5))],
    ids=["pair", "triple"],
)
def test_starts_with_the_wanted_forces_at_rest(directions, model) -> None:
    stance, forces = stand(directions, model)
    scene = stance.scene
    data = mujoco.MjData(scene.model)
    mujoco.mj_setState(scene.model, data, stance.state, STATE)
    data.ctrl[:] = stance.compute_command(forces)
    mujoco.mj_forward(scene.model, data)
    assert np.abs(data.qvel).max() == 0.0
    # The object: weight is 0.59 N on 60 g; what is left of 10 N per contact is its softness.
    assert np.abs(data.qacc[scene.object_dof : scene.object_dof + 3]).max() < 0.1
    sensing = build_touch_model(scene)
    sensed = mujoco.MjData(sensing)
    mujoco.mj_setState(sensing, sensed, stance.state, STATE)
    sensed.ctrl[:] = data.ctrl
    mujoco.mj_forward(sensing, sensed)
    touches = read_touches(scene, {name: np.array(getattr(sensed, name))[None] for name in TOUCH_FIELDS})
    for k, (i, direction) in enumerate(directions.items()):
        felt = touches.rotation_O[0, i] @ touches.force[0, i, :3]
        wanted = build_frame(-direction) @ forces[k, :3]
        np.testing.assert_allclose(felt, wanted, atol=0.02)
        assert touches.force[0, i, 3] == pytest.approx(forces[k, 3], abs=2e-4)
    share = np.abs(data.actuator_force[scene.actuators]) / np.stack([f.torque_limit for f in scene.fingers])
    assert share.max() == pytest.approx(stance.compute_torque_share(forces), abs=1e-3)


def test_nothing_but_fingertips_meets_anything() -> None:
    """At 135 degrees the posture of least torque would run a link into the finger that stays at home."""
    stance, _ = stand(
        {0: direction_from_angles(-7.5, 0.0), 1: direction_from_angles(127.5, 0.0)}, SoftFinger(0.6, 0.0027)
    )
    data = mujoco.MjData(stance.scene.model)
    mujoco.mj_setState(stance.scene.model, data, stance.state, STATE)
    mujoco.mj_forward(stance.scene.model, data)
    tips = set(stance.scene.tip_geoms.tolist())
    for pair in data.contact.geom.tolist():
        assert stance.scene.object_geom in pair
        assert set(pair) & tips


def test_forces_that_pull_and_places_out_of_reach_have_no_stance() -> None:
    _, forces = stand(PAIR, SoftFinger(0.5, 0.0022))
    assert solve_stance(load_scene(), PAIR, -forces[None]) is None
    below = {0: direction_from_angles(180.0, -60.0), 1: direction_from_angles(130.0, 0.0)}
    assert solve_stance(load_scene(), below, forces[None]) is None
