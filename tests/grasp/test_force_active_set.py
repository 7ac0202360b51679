"""DAQP on the contact-force program: it answers whatever is feasible, and nothing is believed without proof."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
from reference_forces import RADIUS, build_solver, draw_problem

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.force.active_set import DualActiveSet, is_optimal
from dexplan.grasp.force.program import ForceRows
from dexplan.grasp.force.solver import (
    ForceLimits,
    ForceProblem,
    ForceSettings,
    ForceSolution,
    ForceSolver,
    SolverOptions,
)
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere
from dexplan.spatial import Array, direction_from_angles

SOFT, HARD = SoftFinger(0.55, 0.0025), HardFinger(0.5)


def build_rows(problem: ForceProblem) -> ForceRows:
    joints = 0 if problem.torque_maps is None else problem.torque_maps.shape[1]
    rows = ForceRows(problem.settings, joints)
    rows.write(problem)
    return rows


def draw_sequence(models: list[ContactModel], azimuths: list[float], weight: float) -> Iterator[ForceProblem]:
    """Yield problems that jump: contacts let go (ceiling 0) and return, every third grasp is symmetrical, so that rows of
    its map vanish or depend on others."""
    rng, count = np.random.default_rng(2), len(models)
    settings = ForceSettings(tuple(models), length=RADIUS, friction_weight=weight)
    for k in range(150):
        turn, lift = (3.0 if k % 3 else 0.0) * rng.normal(size=(2, count))
        contacts = [
            contact_on_sphere(i, direction_from_angles(azimuths[i] + turn[i], lift[i]), RADIUS, model)
            for i, model in enumerate(models)
        ]
        G = compute_grasp_map(Grasp(tuple(contacts)))
        wrench = G @ np.linalg.pinv(G) @ (rng.normal(scale=0.3, size=6) * [1, 1, 1, 0.03, 0.03, 0.03])
        ceiling = rng.choice([0.0, 1.0, 10.0, 500.0], size=count, p=[0.1, 0.1, 0.4, 0.4])
        floor = np.minimum(ceiling, rng.choice([0.0, 0.5, 4.0], size=count, p=[0.6, 0.2, 0.2]))
        yield ForceProblem(
            settings, G, wrench, ForceLimits(floor, ceiling), rng.choice([0.0, 1.0, 8.0], size=count)
        )


@pytest.mark.parametrize("weight", [1e-5, 0.02, 1.0])
@pytest.mark.parametrize(
    ("models", "azimuths"),
    [
        ([HARD] * 2, [0.0, 180.0]),
        ([SOFT] * 2, [0.0, 180.0]),
        ([SOFT] * 3, [0.0, 120.0, 240.0]),
        ([HARD, SOFT, HARD, SOFT], [0.0, 90.0, 180.0, 270.0]),
    ],
    ids=["two hard", "two soft", "three soft", "four mixed"],
)
def test_warm_through_jumps(models: list[ContactModel], azimuths: list[float], weight: float) -> None:
    """No slower method is needed for any feasible problem, and what is called infeasible is so by HiGHS."""
    solver = ForceSolver(ForceSettings(tuple(models), length=RADIUS, friction_weight=weight))
    methods: Counter[str] = Counter()
    for problem in draw_sequence(models, azimuths, weight):
        solution = solver.solve(problem)
        assert solution.is_solved == (solution.method == "DAQP"), (solution.status, solution.method)
        assert solution.is_solved or solution.cures, solution.status
        methods[solution.method] += 1
    assert methods["DAQP"] > 50
    assert methods["linear program"] > 10


def test_other_methods_take_over_where_exchanges_do_not_suffice() -> None:
    taken: Counter[str] = Counter()
    for seed in range(60):
        problem = draw_problem(np.random.default_rng(seed))
        few, many = (solve(problem, exchanges) for exchanges in (3, 200))
        assert few.is_solved == many.is_solved
        if many.is_solved:
            assert np.allclose(few.forces, many.forces, atol=1e-3)
            taken[few.method] += 1
    assert taken["DAQP"] > 5
    assert taken["OSQP"] + taken["exact"] > 5


def solve(problem: ForceProblem, exchanges: int) -> ForceSolution:
    return build_solver(problem, SolverOptions(exchanges=exchanges)).solve(problem)


class TestProof:
    """Every condition of an optimum is looked at: break one and the proof is gone."""

    # nearest to (2, 2) with x <= 1 and y >= -1, y <= 3
    D, AIM = np.eye(2), np.full(2, 2.0)
    LOWER, UPPER = np.array([-1e30, -1.0]), np.array([1.0, 3.0])

    def is_optimal(self, x: list[float], multipliers: list[float]) -> bool:
        return is_optimal(np.array(x), np.array(multipliers), self.D, self.AIM, self.LOWER, self.UPPER)

    def test_the_optimum(self) -> None:
        assert self.is_optimal([1.0, 2.0], [1.0, 0.0])

    @pytest.mark.parametrize(
        ("x", "multipliers"),
        [
            ([2.0, 2.0], [0.0, 0.0]),  # oversteps a row
            ([0.0, 2.0], [2.0, 0.0]),  # rests on no bound
            ([1.0, 3.0], [1.0, -1.0]),  # presses against its bound from outside
            ([1.0, 2.1], [1.0, 0.0]),  # the Lagrangian is not stationary
            ([np.nan, 2.0], [1.0, 0.0]),
            ([1.0, 2.0], [np.nan, 0.0]),
        ],
    )
    def test_what_is_none(self, x: list[float], multipliers: list[float]) -> None:
        assert not self.is_optimal(x, multipliers)

    @pytest.mark.parametrize("name", ["D", "aim", "lower", "upper"])
    def test_numbers_that_are_none_are_not_answered_and_leave_nothing_behind(self, name: str) -> None:
        rows = build_rows(draw_problem(np.random.default_rng(4)))
        active_set = DualActiveSet(200)
        good: dict[str, Array] = {
            "D": rows.D,
            "aim": rows.aim,
            "lower": rows.lower,
            "upper": rows.upper,
        }
        before = active_set.solve(**good)
        assert before is not None
        bad = good | {name: good[name].copy()}
        bad[name].flat[-1] = np.nan
        assert active_set.solve(**bad) is None
        after = active_set.solve(**good)
        assert after is not None
        assert np.allclose(after.x, before.x, atol=1e-12)
