"""A hand of three joints per finger turns a ball in MuJoCo: gravity, whole chains, and nothing but contacts on the ball."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.witness.rolling_hand import RollingTrial, turn_ball


@pytest.fixture(scope="module")
def trial() -> RollingTrial:
    return turn_ball(24.0)


def test_the_ball_follows_and_tips_slide_as_the_law_says(trial: RollingTrial) -> None:
    run = trial.measured
    assert run.failure is None
    assert run.end_mm < 0.05
    assert run.end_deg < 0.2
    assert run.worst_mm < 0.15
    assert run.worst_deg < 0.5
    assert run.unbalanced_ticks == 0
    assert run.other_contacts == 0
    # The law with planned forces and turns, not with measured ones: it can fail.
    assert np.allclose(run.slip_mm, run.law_mm, rtol=0.3, atol=0.02)
    assert max(run.pivot_deg) > 1.0


def test_replay_is_exact_and_physics_untouched(trial: RollingTrial) -> None:
    assert trial.measured.replay_difference == 0.0
    model = trial.scene.model
    assert model.opt.gravity[2] == pytest.approx(-9.81)
    assert not np.any(model.body_gravcomp)
    assert trial.trace is not None
    start, end = (trial.trace.columns["qpos"][k][:7] for k in (0, -1))
    assert not np.allclose(start, end)
