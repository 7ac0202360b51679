"""Problems without an answer: each is recognised, what stands in the way is named, and granting exactly that helps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference_forces import RADIUS, build_solver, draw_problem, measure_lack

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.force.diagnosis import Loosening
from dexplan.grasp.force.solver import ForceLimits, ForceProblem, ForceSettings, ForceSolution
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere
from dexplan.spatial import GRAVITY, direction_from_angles

SOFT, HARD = SoftFinger(0.5, 0.002), HardFinger(0.5)
WEIGHT = np.array([0.0, 0.0, 0.06 * GRAVITY, 0.0, 0.0, 0.0])
BIG = 1e3


def build_problem(
    azimuths: tuple[float, ...] = (0.0, 120.0, 240.0),
    model: ContactModel = SOFT,
    wrench: np.ndarray = WEIGHT,
    floor: float = 0.0,
    ceiling: float = 15.0,
    torque: float | None = None,
    **settings: float,
) -> ForceProblem:
    """Return a problem on the equator; with ``torque`` each finger has one joint, a 0.1 m lever on its normal force."""
    contacts = [
        contact_on_sphere(i, direction_from_angles(a, 0.0), RADIUS, model) for i, a in enumerate(azimuths)
    ]
    count = len(azimuths)
    maps = np.zeros((count, 1, model.dimension))
    maps[:, 0, 2] = 0.1
    bound = None if torque is None else np.full((count, 1), torque)
    limits = ForceLimits(
        np.full(count, floor), np.full(count, ceiling), None if bound is None else -bound, bound
    )
    return ForceProblem(
        ForceSettings((model,) * count, length=RADIUS, **settings),
        compute_grasp_map(Grasp(tuple(contacts))),
        wrench,
        limits,
        np.full(count, 4.0),
        None if torque is None else maps,
    )


def solve(problem: ForceProblem, band: float = 0.0) -> ForceSolution:
    """Solve ``problem`` afresh."""
    problem = replace(problem, settings=replace(problem.settings, wrench_tolerance=band))
    return build_solver(problem).solve(problem)


def widen(problem: ForceProblem, cure: tuple[Loosening, ...]) -> ForceProblem | None:
    """Return the problem with a cure granted, or None where a caller of the solver cannot grant it."""
    limits = problem.limits
    changed = {
        name: None if getattr(limits, name) is None else getattr(limits, name).copy()
        for name in ("normal_floor", "normal_ceiling", "torque_lower", "torque_upper")
    }
    for item in cure:
        amount, on = item.amount * (1.0 + 1e-6), list(item.contacts)
        if item.group == "friction":
            return None
        prefix = {
            "normal force": ("normal_floor", "normal_ceiling"),
            "joint torque": ("torque_lower", "torque_upper"),
        }
        if item.group in prefix:
            low, high = prefix[item.group]
            if item.bound in ("lower", "both"):
                changed[low][on] -= amount
            if item.bound in ("upper", "both"):
                changed[high][on] += amount
    changed["normal_floor"] = np.maximum(changed["normal_floor"], 0.0)
    return replace(problem, limits=ForceLimits(**changed))


def assert_cures_cure(problem: ForceProblem, solution: ForceSolution) -> None:
    """Each cure as granted is enough, 1 % less is not, and solving again says the same."""
    assert solution.status.startswith("infeasible: ")
    assert measure_lack(problem) > 1e-6
    assert solution.cures
    for cure in solution.cures:
        assert measure_lack(problem, cure) < 1e-6, cure
        assert measure_lack(problem, cure, 0.99) > 1e-6, cure
        for item in cure:
            assert f"{item.amount:.3g} {item.unit}" in solution.status
        wider = widen(problem, cure)
        if wider is not None:
            band = sum(item.amount for item in cure if item.group == "wrench") * (1.0 + 1e-6)
            again = solve(wider, band)
            assert again.is_solved, (cure, again.status)


class TestOneReason:
    def test_ceiling(self) -> None:
        problem = build_problem(ceiling=0.2)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        cure = next(c[0] for c in solution.cures if c[0].group == "normal force")
        # the weight takes mg / (3 mu reach), where reach is that of the polytope along the load
        normals, inradius = SOFT.section
        need = WEIGHT[2] / 1.5 * normals[:, 1].max() / inradius
        assert cure == Loosening("normal force", pytest.approx(need - 0.2, abs=1e-6), "N", (0, 1, 2), "upper")
        assert "(ceiling of contacts 0, 1, 2)" in solution.status

    def test_floor_that_cannot_be_balanced(self) -> None:
        """Two contacts 150 degrees apart push the object out the more the harder they have to press."""
        problem = build_problem((-75.0, 75.0), HardFinger(0.2), np.zeros(6), floor=2.0)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        cure = next(c[0] for c in solution.cures if c[0].group == "normal force")
        assert cure == Loosening("normal force", pytest.approx(2.0, abs=1e-6), "N", (0, 1), "lower")

    def test_one_floor_names_its_contact(self) -> None:
        """One finger presses with 6 N or more, the two opposite it may give 2 N each: 2 N from each, or 4 N from the one."""
        problem = build_problem(model=HardFinger(0.05), wrench=np.zeros(6))
        problem = replace(problem, limits=ForceLimits(np.array([6.0, 0.0, 0.0]), np.array([9.0, 2.0, 9.0])))
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        (cure,) = next(c for c in solution.cures if c[0].group == "normal force")
        assert cure.contacts == (0, 1)
        assert cure.bound == "both"

    def test_friction(self) -> None:
        """Two contacts on the same side of their cones' limit: only more friction can hold."""
        problem = build_problem((0.0, 100.0), floor=4.0, ceiling=4.0)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert "friction" in solution.faults
        assert "more normal force per contact (contacts 0, 1) would do" in solution.status

    def test_joint_torque(self) -> None:
        problem = build_problem(torque=0.1, floor=4.0)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert "0.3 N m more joint torque (upper limit of contacts 0, 1, 2) would do" in solution.status
        assert "normal-force limits wider by 3 N (floor of contacts 0, 1, 2) would do" in solution.status

    def test_one_weak_finger_is_named(self) -> None:
        problem = build_problem(torque=2.0, floor=4.0)
        weak = np.array([[2.0], [0.15], [2.0]])
        problem = replace(
            problem, limits=ForceLimits(problem.limits.normal_floor, np.full(3, 15.0), -weak, weak)
        )
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert solution.cures[-1] == (
            Loosening("joint torque", pytest.approx(0.25, abs=1e-7), "N m", (1,), "upper"),
        )
        assert "(upper limit of contact 1)" in solution.status

    def test_wrench_out_of_the_span(self) -> None:
        """Two hard fingers transmit no torque about their line, whatever they press."""
        problem = build_problem((0.0, 180.0), HARD, np.array([0.0, 0.0, 0.0, 0.05, 0.0, 0.0]), floor=4.0)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert solution.faults == ("wrench",)
        assert "only another wrench would do" in solution.status
        assert f"{0.05 / RADIUS:.3g} N and 0.05 N m" in solution.status


class TestSeveralReasons:
    def test_any_of_three_helps(self) -> None:
        problem = build_problem(ceiling=0.3, torque=0.03)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert solution.faults[0] == "friction"

    def test_two_together(self) -> None:
        """Ceilings of 0.2 N and joints for 0.15 N: neither alone carries the weight, and friction is not enough at nothing."""
        problem = build_problem((0.0, 180.0), HARD, ceiling=0.2, torque=0.015)
        problem = replace(
            problem, wrench=np.array([4.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        )  # along the normals: friction is no cure
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert [len(cure) for cure in solution.cures] == [2]
        assert solution.faults == ("normal force", "joint torque")
        assert " together with " in solution.status

    def test_limits_that_contradict_one_another_whatever_the_wrench(self) -> None:
        problem = build_problem(torque=0.1, floor=4.0)
        solution = solve(problem)
        assert np.isnan(solution.forces).all()
        assert "wrench" not in solution.faults

    def test_contradiction_and_a_wrench_out_of_the_span(self) -> None:
        twist = np.array([0.0, 0.0, 0.0, 0.05, 0.0, 0.0])
        problem = build_problem((0.0, 180.0), HARD, twist, floor=4.0, torque=0.1)
        solution = solve(problem)
        assert_cures_cure(problem, solution)
        assert "wrench" in solution.faults
        assert len(solution.faults) == 2
        assert " together with " in solution.status

    def test_random_problems(self) -> None:
        """Whatever is drawn: infeasible exactly where HiGHS says so, and every cure is tight."""
        rng, counted = np.random.default_rng(11), {"solved": 0, "infeasible": 0}
        for _ in range(120):
            problem = draw_problem(rng)
            lack = measure_lack(problem)
            solution = solve(problem)
            if lack < 1e-6:
                assert solution.is_solved, solution.status
                assert solution.cures == ()
                counted["solved"] += 1
            else:
                assert_cures_cure(problem, solution)
                counted["infeasible"] += 1
        assert min(counted.values()) >= 15


def test_forces_of_an_infeasible_problem_come_nearest_to_the_wrench() -> None:
    problem = build_problem(ceiling=0.2)
    solution = solve(problem)
    residual = solution.primal_residual
    assert residual["wrench"] > 0.1
    assert residual["friction"] < 1e-6
    assert residual["normal force"] < 1e-6
    # the weight along z is what two newtons of normal force in all can carry less
    assert residual["wrench"] == pytest.approx(measure_wrench_lack(problem), rel=1e-6)


def measure_wrench_lack(problem: ForceProblem) -> float:
    """Return the least band [N] around the wrench with which there are forces, by bisection."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        is_enough = measure_lack(problem, (Loosening("wrench", middle, "N"),)) < 1e-9
        low, high = (low, middle) if is_enough else (middle, high)
    return high


def test_a_solver_recovers_from_infeasible_problems() -> None:
    good, bad = build_problem(floor=4.0), build_problem(ceiling=0.2)
    solver = build_solver(good)
    for problem in (good, bad, bad, good):
        solution = solver.solve(problem)
        assert solution.is_solved == (problem is good)


def test_numbers_that_are_none_raise() -> None:
    problem = build_problem()
    wrench = problem.wrench.copy()
    wrench[0] = np.nan
    with pytest.raises(ValueError, match="wrench has entries that are not finite"):
        solve(replace(problem, wrench=wrench))
