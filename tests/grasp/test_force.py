"""The contact-force program against two other solvers, its own residuals and its limits."""

from __future__ import annotations

import clarabel
import daqp
import numpy as np
import pytest
from reference_forces import ask
from scipy.sparse import csc_matrix, diags

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.force.program import Program
from dexplan.grasp.force.recovery import solve_exact
from dexplan.grasp.force.solver import ForceLimits, ForceSettings, ForceSolution, ForceSolver, SolverOptions
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere
from dexplan.spatial import GRAVITY, direction_from_angles

R, MASS = 0.035, 0.06
SOFT = SoftFinger(0.55, 0.0025).scaled(1.0 / 1.3)
WEIGHT = np.array([0.0, 0.0, MASS * GRAVITY, 0.0, 0.0, 0.0])


def build_map(
    azimuths: tuple[float, ...] = (0, 120, 240), model: ContactModel = SOFT, elevation: float = 0.0
) -> np.ndarray:
    contacts = [
        contact_on_sphere(i, direction_from_angles(a, elevation), R, model) for i, a in enumerate(azimuths)
    ]
    return compute_grasp_map(Grasp(tuple(contacts)))


def build_limits(count: int = 3, floor: float = 4.0, ceiling: float = 15.0) -> ForceLimits:
    return ForceLimits(np.full(count, floor), np.full(count, ceiling))


def assert_honest(solution: ForceSolution, limits: ForceLimits) -> None:
    assert solution.is_solved, solution.status
    assert np.abs(solution.wrench_residual[:3]).max() < 2e-5
    assert np.abs(solution.wrench_residual[3:]).max() < 2e-5 * R
    assert solution.cone_margins.min() > -1e-5
    normal = solution.forces[:, 2]
    assert np.all(normal >= limits.normal_floor - 1e-4)
    assert np.all(normal <= limits.normal_ceiling + 1e-4)


def dense_problem(
    models: list[ContactModel], G: np.ndarray, wrench: np.ndarray, floor: float, ceiling: float, target: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The same program written anew in plain forces: Hessian diagonal, gradient, rows and bounds."""
    p, q, rows, upper, lower = [], [], [G], [wrench], [wrench]
    size, start = G.shape[1], 0
    for model in models:
        c = np.insert(model.capacity, 2, 1.0)
        p += [2 * 0.1 / c[0] ** 2, 2 * 0.1 / c[1] ** 2, 2.0] + [2 * 0.1 / x**2 for x in c[3:]]
        q += [0.0, 0.0, -2.0 * target] + [0.0] * (model.dimension - 3)
        facets = np.zeros((len(model.facets()), size))
        facets[:, start : start + model.dimension] = model.facets()
        normal = np.zeros((1, size))
        normal[0, start + 2] = 1.0
        rows += [facets, normal]
        upper += [np.zeros(len(facets)), np.array([ceiling])]
        lower += [np.full(len(facets), -1e30), np.array([floor])]
        start += model.dimension
    return np.array(p), np.array(q), np.vstack(rows), np.concatenate(lower), np.concatenate(upper)


@pytest.mark.parametrize("model", [SOFT, HardFinger(0.5)])
@pytest.mark.parametrize(("floor", "target"), [(4.0, 4.0), (0.0, 0.0), (0.0, 0.6)])
def test_agrees_with_daqp_and_clarabel(model: ContactModel, floor: float, target: float) -> None:
    G, limits = build_map((0, 115, 245), model, 4.0), build_limits(floor=floor)
    wrench = WEIGHT + np.array([0.1, -0.05, 0.0, 0.0, 0.0, 0.001])
    solution = ask(ForceSolver(ForceSettings((model,) * 3, length=R)), G, wrench, limits, np.full(3, target))
    assert_honest(solution, limits)
    f = solution.forces[:, : model.dimension].ravel()

    p, q, A, lower, upper = dense_problem([model] * 3, G, wrench, floor, 15.0, target)
    scale = np.tile(np.insert(model.capacity, 2, 1.0), 3)  # daqp wants comparable variables
    sense = np.where(lower == upper, 5, 0).astype(np.int32)
    y, _, flag, _ = daqp.solve(
        np.diag(p * scale**2), q * scale, np.ascontiguousarray(A * scale), upper, lower, sense
    )
    assert flag == 1
    assert np.allclose(f / scale, y, atol=2e-5)

    finite = lower > -1e29
    is_equal = lower == upper
    both = np.vstack([A[is_equal], A[~is_equal], -A[finite & ~is_equal]])
    bounds = np.concatenate([upper[is_equal], upper[~is_equal], -lower[finite & ~is_equal]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(both) - 6)]
    P = csc_matrix(diags(p * scale**2))
    answer = clarabel.DefaultSolver(P, q * scale, csc_matrix(both * scale), bounds, cones, settings).solve()
    assert np.allclose(f / scale, answer.x, atol=2e-5)


def test_warm_run_stays_honest_while_everything_moves() -> None:
    solver = ForceSolver(ForceSettings((SOFT,) * 3, length=R), 6)
    limits = ForceLimits(np.full(3, 0.0), np.full(3, 15.0), np.full((3, 6), -2.0), np.full((3, 6), 2.0))
    maps = np.random.default_rng(0).normal(size=(3, 6, 4)) * 0.1
    for k in range(300):
        azimuths = tuple(np.array([0, 120, 240]) + 10 * np.sin(k / 100))
        G = build_map(azimuths, SOFT, 4.0 * np.sin(k / 80))
        wrench = WEIGHT + np.array([0.1 * np.sin(k / 30), 0.05, 0, 0, 0, 0.001 * np.sin(k / 20)])
        target = 4.0 * (k % 50 < 25)  # half the time it rides the cone
        solution = ask(solver, G, wrench, limits, np.full(3, target), maps * (1 + 0.1 * np.sin(k / 50)))
        assert_honest(solution, limits)


def test_lightest_hold_grows_by_the_pyramid_only() -> None:
    limits = build_limits(floor=0.0)
    solution = ask(
        ForceSolver(ForceSettings((HardFinger(0.5),) * 3, length=R, friction_weight=1e-3)),
        build_map(model=HardFinger(0.5)),
        WEIGHT * 0.05 / MASS,
        limits,
        np.zeros(3),
    )
    assert_honest(solution, limits)
    assert np.allclose(solution.forces[:, 2], 0.35394, atol=1e-5)
    assert np.allclose(solution.utilisation, np.cos(np.pi / 8), atol=1e-5)


def test_floor_keeps_away_from_the_cone() -> None:
    solution = ask(
        ForceSolver(ForceSettings((SOFT,) * 3, length=R)),
        build_map(),
        WEIGHT,
        build_limits(),
        np.full(3, 4.0),
    )
    assert solution.utilisation.max() < 0.2


def test_torque_limits_are_kept_and_bind() -> None:
    maps = np.zeros((3, 1, 4))
    maps[:, 0, 2] = 0.1  # 0.1 m lever on the normal force
    solver = ForceSolver(ForceSettings((SOFT,) * 3, length=R), 1)
    free = ForceLimits(np.zeros(3), np.full(3, 15.0))
    tight = ForceLimits(np.zeros(3), np.full(3, 15.0), np.full((3, 1), -0.5), np.full((3, 1), 0.45))
    bias = np.full((3, 1), 0.15)
    assert np.allclose(
        ask(solver, build_map(), WEIGHT, free, np.full(3, 4.0), maps, bias).forces[:, 2], 4.0, atol=1e-4
    )
    bound = ask(solver, build_map(), WEIGHT, tight, np.full(3, 4.0), maps, bias)
    assert_honest(bound, tight)
    assert np.allclose(bound.forces[:, 2], 3.0, atol=1e-4)
    # and the limit is gone again when none is given
    assert np.allclose(
        ask(solver, build_map(), WEIGHT, free, np.full(3, 4.0), maps, bias).forces[:, 2], 4.0, atol=1e-4
    )


def test_unloading_ramp_ends_at_exactly_nothing() -> None:
    solver = ForceSolver(ForceSettings((SOFT,) * 3, length=R, smoothness=0.2))
    G = build_map((0, 150, 260))
    previous = None
    for share in np.linspace(1.0, 0.0, 21):
        limits = ForceLimits(np.array([4.0, 4.0, 0.0]), np.array([15.0, 15.0, 4.0 * share]))
        solution = ask(solver, G, WEIGHT, limits, np.array([4.0, 4.0, 4.0 * share]), previous=previous)
        assert_honest(solution, limits)
        previous = solution.forces
    assert np.abs(solution.forces[2]).max() < 1e-5
    # loading again from nothing
    limits = build_limits(floor=0.0)
    assert_honest(ask(solver, G, WEIGHT, limits, np.full(3, 4.0), previous=previous), limits)


def test_smoothness_stays_near_the_previous_forces() -> None:
    G, limits = build_map(), build_limits()
    previous = ask(
        ForceSolver(ForceSettings((SOFT,) * 3, length=R)), G, WEIGHT, limits, np.full(3, 4.0)
    ).forces
    solver = ForceSolver(ForceSettings((SOFT,) * 3, length=R, smoothness=1.0))
    step = ask(solver, G, WEIGHT, limits, np.full(3, 6.0), previous=previous)
    assert np.allclose(step.forces[:, 2], 5.0, atol=1e-3)
    assert np.allclose(ask(solver, G, WEIGHT, limits, np.full(3, 6.0)).forces[:, 2], 6.0, atol=1e-3)


def test_wrench_band_is_kept() -> None:
    G, limits = build_map(), build_limits(floor=0.0)
    solution = ask(
        ForceSolver(ForceSettings((SOFT,) * 3, length=R, wrench_tolerance=0.01)),
        G,
        WEIGHT,
        limits,
        np.zeros(3),
    )
    assert solution.is_solved
    assert 0.005 < np.abs(solution.wrench_residual).max() <= 0.01 + 1e-5


def test_mixed_contacts_are_padded() -> None:
    models = [SOFT, HardFinger(0.5), SOFT]
    contacts = [contact_on_sphere(i, direction_from_angles(120 * i, 0.0), R, m) for i, m in enumerate(models)]
    solver = ForceSolver(ForceSettings(tuple(models), length=R), 2)
    limits = ForceLimits(np.full(3, 1.0), np.full(3, 9.0), np.full((3, 2), -9.0), np.full((3, 2), 9.0))
    G = compute_grasp_map(Grasp(tuple(contacts)))
    solution = ask(solver, G, WEIGHT, limits, np.full(3, 2.0), np.ones((3, 2, 4)) * 0.1)
    assert_honest(solution, limits)
    assert solution.forces.shape == (3, 4)
    assert solution.forces[1, 3] == 0.0


class TestInfeasible:
    def test_ceiling_too_low(self) -> None:
        solver = ForceSolver(ForceSettings((SOFT,) * 3, length=R))
        solution = ask(solver, build_map(), WEIGHT, build_limits(floor=0.0, ceiling=0.2), np.full(3, 0.2))
        assert not solution.is_solved
        assert solution.status.startswith("infeasible: ")
        assert "normal-force limits wider by" in solution.status
        assert "normal force" in solution.faults
        # nearest wrench, other constraints kept
        assert 0.0 < np.abs(solution.wrench_residual).max() < MASS * GRAVITY
        assert solution.cone_margins.min() > -1e-6
        # and the solver recovers
        limits = build_limits()
        assert_honest(ask(solver, build_map(), WEIGHT, limits, np.full(3, 4.0)), limits)

    def test_weak_joints(self) -> None:
        maps = np.full((3, 1, 4), 0.0)
        maps[:, 0, 2] = 0.1
        limits = ForceLimits(np.full(3, 4.0), np.full(3, 15.0), np.full((3, 1), -0.1), np.full((3, 1), 0.1))
        solution = ask(
            ForceSolver(ForceSettings((SOFT,) * 3, length=R), 1),
            build_map(),
            WEIGHT,
            limits,
            np.full(3, 4.0),
            maps,
        )
        assert "0.3 N m more joint torque (upper limit of contacts 0, 1, 2) would do" in solution.status
        assert set(solution.faults) == {"joint torque", "normal force"}

    def test_wrench_out_of_the_span(self) -> None:
        G, limits = build_map((0, 180), HardFinger(0.5)), build_limits(2)
        twist = np.array([0.0, 0.0, 0.0, 0.05, 0.0, 0.0])  # about the line through both hard fingers
        solution = ask(
            ForceSolver(ForceSettings((HardFinger(0.5),) * 2, length=R)), G, twist, limits, np.full(2, 4.0)
        )
        assert solution.faults == ("wrench",)
        assert "only another wrench would do" in solution.status

    def test_pair_outside_its_cones(self) -> None:
        solution = ask(
            ForceSolver(ForceSettings((SOFT,) * 2, length=R)),
            build_map((0, 100)),
            WEIGHT,
            build_limits(2),
            np.full(2, 4.0),
        )
        assert not solution.is_solved
        assert "friction" in solution.faults


def test_exact_rescue_agrees_and_recognises_infeasibility() -> None:
    p, q, A, lower, upper = dense_problem([SOFT] * 3, build_map(), WEIGHT, 0.0, 15.0, 0.0)
    scale = np.tile(np.insert(SOFT.capacity, 2, 1.0), 3)
    y = solve_exact(Program(p * scale**2, q * scale, A * scale, lower, upper))
    assert y is not None
    solver = ForceSolver(
        ForceSettings((SOFT,) * 3, length=R), options=SolverOptions(max_iterations=5, exchanges=0)
    )  # never converges by itself
    solution = ask(solver, build_map(), WEIGHT, build_limits(floor=0.0), np.zeros(3))
    assert_honest(solution, build_limits(floor=0.0))
    assert np.allclose(solution.forces.ravel(), y * scale, atol=1e-8)
    upper[-1], lower[-1] = 0.1, 0.05
    upper[46], lower[46] = 0.0, 0.0  # first contact lets go
    assert solve_exact(Program(p * scale**2, q * scale, A * scale, lower, upper)) is None


def test_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    solver = ForceSolver(ForceSettings((SOFT,) * 3, length=R))
    ask(solver, build_map(), WEIGHT, build_limits(floor=0.0), np.zeros(3))
    ask(solver, build_map(), WEIGHT, build_limits(floor=0.0, ceiling=0.1), np.zeros(3))
    assert capfd.readouterr() == ("", "")


def test_results_are_frozen_and_keep_their_problem() -> None:
    G = build_map()
    solution = ask(
        ForceSolver(ForceSettings((SOFT,) * 3, length=R)), G, WEIGHT, build_limits(), np.full(3, 4.0)
    )
    G[:] = 0.0
    assert np.abs(solution.wrench_residual).max() < 1e-5
    for array in (solution.forces, solution.problem.G, solution.problem.wrench):
        assert not array.flags.writeable


def test_callers_mistakes_raise_with_what_is_accepted() -> None:
    solver = ForceSolver(ForceSettings((SOFT,) * 3), 2)
    with pytest.raises(ValueError, match=r"\(6, 12\), \(6,\), \(3,\) are accepted"):
        ask(solver, np.zeros((6, 9)), WEIGHT, build_limits(), np.zeros(3))
    with pytest.raises(ValueError, match=r"torque maps None; \(3, 2, 4\) is accepted"):
        ask(solver, build_map(), WEIGHT, build_limits(), np.zeros(3))
    with pytest.raises(ValueError, match="0 <= floor <= ceiling"):
        ForceLimits(np.array([2.0]), np.array([1.0]))
    with pytest.raises(ValueError, match="no contact models"):
        ForceSolver(ForceSettings(()))
