"""The batched load test of pairs against the equations of balance and against the force program, pair by pair."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.grasp.force.solver import ForceLimits, ForceProblem, ForceSettings, ForceSolver
from dexplan.grasp.grasp import map_contact
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.loads import (
    compute_contact_torques,
    compute_object_wrench,
    compute_pair_loads,
    sure_share,
)
from dexplan.spatial import Array

AXIS = np.array([0.3, 0.5, 1.0]) / np.linalg.norm([0.3, 0.5, 1.0])


def draw_pairs(count: int, spread: float) -> tuple[Array, Array]:
    """Return normals (N, 3) of random pairs, from opposite to far from it."""
    rng = np.random.default_rng(0)
    first = rng.normal(size=(count, 3))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = -first + spread * rng.uniform(0.0, 1.0, (count, 1)) * rng.normal(size=(count, 3))
    return first, second / np.linalg.norm(second, axis=1, keepdims=True)


@pytest.mark.parametrize("axis", [None, AXIS])
def test_forces_balance_the_load(hand: HandModel, axis: Array | None) -> None:
    first, second = draw_pairs(200, 0.8)
    wrench = compute_object_wrench(hand, axis)
    loads = compute_pair_loads(hand, first, second, wrench)
    surface = hand.object.surface
    force = loads.forces.sum(axis=1)
    torque = np.cross(surface.radial(first), loads.forces[:, 0]) + np.cross(
        surface.radial(second), loads.forces[:, 1]
    )
    torque -= loads.torsions[:, :1] * first + loads.torsions[:, 1:] * second
    assert np.allclose(force, wrench[:3], atol=1e-12)
    assert np.allclose(torque, wrench[3:], atol=1e-12)


def test_utilisation_is_that_of_the_forces_or_less(hand: HandModel) -> None:
    first, second = draw_pairs(200, 0.5)
    loads = compute_pair_loads(hand, first, second, compute_object_wrench(hand, AXIS))
    used = []
    for k, normal in enumerate((first, second)):
        pressed = -(loads.forces[:, k] * normal).sum(axis=1)
        tangential = loads.forces[:, k] + pressed[:, None] * normal
        parts = [
            np.linalg.norm(tangential, axis=1) / hand.friction.sliding,
            loads.torsions[:, k] / hand.friction.torsional,
        ]
        used.append(np.hypot(*parts) / pressed)
    found = np.isfinite(loads.utilisation)
    assert found.sum() > 150
    most = np.maximum(*used)
    assert (most[found] >= loads.utilisation[found] - 1e-9).all()
    sure = loads.utilisation <= sure_share(hand)
    assert (most[sure] <= sure_share(hand) + 1e-9).all()


def test_verdicts_agree_with_the_force_program(hand: HandModel) -> None:
    """Sure pairs are solved; pairs beyond the cone are not."""
    first, second = draw_pairs(250, 0.8)
    limits, wrench = hand.limits, compute_object_wrench(hand, AXIS)
    loads = compute_pair_loads(hand, first, second, wrench)
    solver = ForceSolver(ForceSettings((hand.friction.scaled(limits.cone_share),) * 2, length=0.035))
    bounds = ForceLimits(np.full(2, limits.normal_floor), np.full(2, limits.normal_ceiling))
    outcomes = set()
    for a, b, used in zip(first, second, loads.utilisation, strict=True):
        arms = [hand.object.surface.radial(n) for n in (a, b)]
        G = np.hstack([map_contact(np.zeros((6, 6)), arm, np.zeros(3))[0] for arm in arms])
        problem = ForceProblem(solver.settings, G, wrench, bounds, np.full(2, hand.normal_force))
        solved = solver.solve(problem, explain=False).is_solved
        if used <= sure_share(hand):
            assert solved
        elif used > 1.02 * limits.cone_share:
            assert not solved
        else:
            continue
        outcomes.add(solved)
    assert outcomes == {True, False}


def test_contact_torques_are_those_of_the_grasp(hand: HandModel) -> None:
    rng = np.random.default_rng(1)
    J, normal, f = rng.normal(size=(6, 6)), np.array([0.6, 0.0, 0.8]), rng.normal(size=4)
    arm, offset = hand.object.surface.radial(normal), -0.018 * normal
    columns, maps = map_contact(J, arm, offset)
    torque = compute_contact_torques(
        J[None], offset[None], (columns[:3] @ f)[None], np.array([f[3]]), normal[None]
    )
    assert np.allclose(torque[0], maps @ f)
