"""Forces over time: a first-order filter in what is free, no lag at all in what is asked."""

from __future__ import annotations

import numpy as np
import pytest
from reference_forces import RADIUS, ask

from dexplan.contact.friction import SoftFinger
from dexplan.grasp.force.solver import (
    ForceLimits,
    ForceProblem,
    ForceSettings,
    ForceSolution,
    ForceSolver,
    compute_smoothness,
)
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere
from dexplan.spatial import GRAVITY, direction_from_angles

SOFT = SoftFinger(0.55, 0.0025).scaled(1.0 / 1.3)
WEIGHT = np.array([0.0, 0.0, 0.06 * GRAVITY, 0.0, 0.0, 0.0])
TICK, TIME_CONSTANT = 0.004, 0.05
S = compute_smoothness(TICK, TIME_CONSTANT)
WIDE = ForceLimits(np.full(3, 0.5), np.full(3, 30.0))
AT_ONCE = 1e12  # a smoothness with which nothing moves but what has to


def grasp_map(turn: float = 0.0) -> np.ndarray:
    contacts = [
        contact_on_sphere(i, direction_from_angles(a + turn, 3.0 * i), RADIUS, SOFT)
        for i, a in enumerate((0.0, 115.0, 245.0))
    ]
    return compute_grasp_map(Grasp(tuple(contacts)))


def build_solver(smoothness: float = S) -> ForceSolver:
    return ForceSolver(ForceSettings((SOFT,) * 3, length=RADIUS, friction_weight=0.02, smoothness=smoothness))


def distance(problem: ForceProblem, a: np.ndarray, b: np.ndarray) -> float:
    """Return |a - b| in the norm of the cost [N]."""
    return float(np.sqrt(problem.weights @ problem.stack(a - b) ** 2))


def aim(target: np.ndarray) -> np.ndarray:
    forces = np.zeros((3, 4))
    forces[:, 2] = target
    return forces


def test_smoothness_from_a_time_constant() -> None:
    left = (S / (1.0 + S)) ** (TIME_CONSTANT / TICK)
    assert left == pytest.approx(np.exp(-1.0))
    assert compute_smoothness(TICK, 10.0) == pytest.approx(10.0 / TICK, rel=1e-3)
    assert compute_smoothness(TICK, 0.0) == 0.0
    for tick, constant in ((0.0, 0.1), (0.004, -1.0), (np.nan, 0.1)):
        with pytest.raises(ValueError, match="> 0 and >= 0 are accepted"):
            compute_smoothness(tick, constant)


def test_step_in_the_target_is_followed_exponentially() -> None:
    """All components, friction too, leave s / (1 + s) of their way per tick; the wrench is exact in every one."""
    G = grasp_map()
    before = ask(build_solver(0.0), G, WEIGHT, WIDE, np.full(3, 4.0)).forces
    after = ask(build_solver(0.0), G, WEIGHT, WIDE, np.array([7.0, 6.0, 5.0])).forces
    solver, forces = build_solver(), before
    for k in range(1, 60):
        solution = ask(solver, G, WEIGHT, WIDE, np.array([7.0, 6.0, 5.0]), previous=forces)
        forces = solution.forces
        share = np.exp(-k * TICK / TIME_CONSTANT)
        assert np.allclose(forces, after + share * (before - after), atol=1e-8)
        assert np.abs(solution.wrench_residual).max() < 1e-9
    assert np.allclose(forces, after, atol=0.05)


def test_step_in_the_wrench_is_followed_at_once_by_the_least_change() -> None:
    G, target = grasp_map(), np.full(3, 5.0)
    rest = ask(build_solver(0.0), G, WEIGHT, WIDE, target)
    pushed = WEIGHT + np.array([0.2, -0.1, 0.1, 0.0, 0.001, 0.0])
    now = ask(build_solver(), G, pushed, WIDE, target, previous=rest.forces)
    assert np.abs(now.wrench_residual).max() < 1e-9
    # least change in the norm of the cost: G+ weighted
    problem = now.problem
    inverse = np.diag(1.0 / problem.weights)
    least = inverse @ G.T @ np.linalg.solve(G @ inverse @ G.T, pushed - WEIGHT)
    # the rest was at its optimum, and is there again after the least change: the target asks for nothing more
    assert np.allclose(problem.stack(now.forces - rest.forces), least, atol=1e-8)


def test_change_is_bounded_whatever_steps() -> None:
    """|f - P(previous)| <= |t - previous| / (1 + s): steps in wrench, target, contact load and grasp, cones ridden or not."""
    rng, solver, follower = np.random.default_rng(2), build_solver(), build_solver(AT_ONCE)
    wrench, target, load, turn = WEIGHT.copy(), np.full(3, 4.0), np.ones(3), 0.0
    forces = ask(build_solver(0.0), grasp_map(), wrench, WIDE, target).forces
    tight = 0
    for k in range(400):
        if k % 10 == 0:
            wrench = WEIGHT + rng.normal(size=6) * np.array([0.1, 0.1, 0.1, 1e-3, 1e-3, 1e-3])
        if k % 15 == 0:
            target = rng.uniform(0.0, 7.0, size=3)
        if k % 40 == 0:
            load = np.ones(3)
            load[rng.integers(3)] = rng.uniform(0.3, 1.0)
            turn = rng.uniform(-5.0, 5.0)
        limits = ForceLimits(0.2 * load, 8.0 * load)
        arguments = (grasp_map(turn), wrench, limits, load * target)
        solution = ask(solver, *arguments, previous=forces)
        needed = ask(follower, *arguments, previous=forces)
        assert solution.is_solved
        assert needed.is_solved
        assert np.abs(solution.wrench_residual).max() < 1e-8
        problem = solution.problem
        bound = distance(problem, aim(load * target), forces) / (1.0 + S)
        assert distance(problem, solution.forces, needed.forces) <= bound + 1e-7
        # hence the rate: what has to change, and the filter's step
        change = distance(problem, solution.forces, forces)
        assert change <= distance(problem, needed.forces, forces) + bound + 1e-7
        tight += solution.utilisation.max() > 0.95
        forces = solution.forces
    assert tight > 20


def test_a_contact_whose_load_steps_to_nothing_lets_go_at_once() -> None:
    """Limits are constraints: they do not wait, and the others take over in the same tick."""
    G, target = grasp_map(), np.full(3, 4.0)
    previous = ask(build_solver(0.0), G, WEIGHT, WIDE, target).forces
    gone = ForceLimits(np.array([0.5, 0.5, 0.0]), np.array([30.0, 30.0, 0.0]))
    pair = grasp_map()
    pair[:, :8] = compute_grasp_map(
        Grasp(
            tuple(
                contact_on_sphere(i, direction_from_angles(a, 0.0), RADIUS, SOFT)
                for i, a in enumerate((0.0, 175.0))
            )
        )
    )
    solution = ask(build_solver(), pair, WEIGHT, gone, np.array([4.0, 4.0, 0.0]), previous=previous)
    assert solution.is_solved
    assert np.abs(solution.forces[2]).max() < 1e-8
    assert np.abs(solution.wrench_residual).max() < 1e-8


def test_without_previous_forces_nothing_is_smoothed() -> None:
    def solve(smoothness: float) -> ForceSolution:
        return ask(build_solver(smoothness), grasp_map(), WEIGHT, WIDE, np.full(3, 4.0))

    assert np.allclose(solve(S).forces, solve(0.0).forces, atol=1e-10)
