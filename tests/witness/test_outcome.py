"""The classification tells hold from spin, slip and drop, each made to happen."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.scene.library import load_scene
from dexplan.sim.judge.replay import replay
from dexplan.witness.experiments import (
    CHORD,
    EXPERIMENTS,
    PATCH,
    PRELOAD,
    STEPS,
    build_grasp,
    run,
    solve_forces,
)
from dexplan.witness.outcome import MOVED, SLID, Kind, Outcome, classify
from dexplan.witness.stance import solve_stance

PAIR, TRIPLE, TORSION, SHEAR = EXPERIMENTS
MU = 0.3


def push_pair(force: tuple[float, float, float], torque: float, seconds: float) -> Outcome:
    """Return what a sudden push [N] with a torque [N m] about the chord does to an opposite pair that expects none."""
    directions, model = SHEAR.place(0.0), SHEAR.model(MU)
    _, forces = solve_forces(build_grasp(directions, model), np.zeros(6), PRELOAD)
    scene = load_scene(sliding_friction=MU, torsional_friction=MU * PATCH)
    stance = solve_stance(scene, directions, forces[None])
    samples = 120
    push = np.zeros((samples, scene.model.nbody, 6))
    push[5 : 5 + round(seconds / (1e-3 * STEPS)), scene.object_body] = [*force, *(torque * CHORD)]
    command = np.tile(stance.compute_command(forces), (samples, 1))
    done = replay(scene.xml, stance.state, command, STEPS, push, clearance_stride=samples)
    return classify(done, tuple(directions))


def test_hold() -> None:
    outcome = run(PAIR, MU, 160.0)
    assert outcome.kind is Kind.HOLD
    assert not outcome.is_lost
    assert outcome.moved_mm < 1e3 * MOVED
    assert outcome.utilisation < 0.8
    assert outcome.normal_force_N == pytest.approx(PRELOAD, rel=0.01)


def test_drop_when_a_pair_is_pushed_out() -> None:
    outcome = run(PAIR, MU, 130.0)
    assert outcome.kind is Kind.DROP
    assert outcome.is_lost
    assert outcome.utilisation == pytest.approx(1.0, abs=0.01)


def test_spin_when_torsion_gives_out() -> None:
    outcome = run(TORSION, MU, 1.05 * TORSION.closed_form(MU))
    assert outcome.kind is Kind.SPIN
    assert outcome.turned_deg > 10.0
    assert outcome.turned_deg == pytest.approx(outcome.rotated_deg, rel=0.01)
    assert outcome.moved_mm < 1.0


def test_slip_when_a_push_is_over_before_the_object_is_out() -> None:
    outcome = push_pair((0.0, 0.0, 12.0), 0.0, 0.004)
    assert outcome.kind is Kind.SLIP, outcome
    assert not outcome.is_lost
    assert outcome.slid_mm > 2e3 * SLID


def test_a_short_twist_spins_and_a_small_push_does_nothing() -> None:
    twist = push_pair((0.0, 0.0, 0.0), 0.08, 0.04)
    assert twist.kind is Kind.SPIN, twist
    assert not twist.is_lost
    assert push_pair((0.0, 0.0, 1.0), 0.0, 0.04).kind is Kind.HOLD


def test_three_fingers_have_no_chord_to_spin_about() -> None:
    outcome = run(TRIPLE, MU, 0.35)
    assert outcome.kind in {Kind.SLIP, Kind.DROP}
    assert outcome.turned_deg == 0.0


def test_beyond_the_servos_is_no_outcome() -> None:
    """A pull of 60 N asks for more than the servos give."""
    assert run(SHEAR, 3.0, 60.0) is None
