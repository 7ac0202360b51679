"""The contact-force problem written anew for Clarabel, an interior-point method: on the polytope and on the exact cone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_matrix, diags

from dexplan.contact.friction import HardFinger, SoftFinger
from dexplan.grasp.force.diagnosis import Loosening
from dexplan.grasp.force.solver import (
    ForceLimits,
    ForceProblem,
    ForceSettings,
    ForceSolution,
    ForceSolver,
    SolverOptions,
)
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere

RADIUS = 0.035


def ask(solver: ForceSolver, *values: Any, **more: Any) -> ForceSolution:
    """Return what ``solver`` answers to the problem of its settings with these values."""
    return solver.solve(ForceProblem(solver.settings, *values, **more))


def build_solver(problem: ForceProblem, options: SolverOptions | None = None) -> ForceSolver:
    """Return a new solver for problems like this one."""
    joints = 0 if problem.torque_maps is None else problem.torque_maps.shape[1]
    return ForceSolver(problem.settings, joints, options)


@dataclass(frozen=True, eq=False)
class Reference:
    """``status`` of Clarabel, its cost [N^2] and forces (F, 4); inf and NaN for an infeasible problem."""

    status: str
    cost: float
    forces: np.ndarray


def solve_reference(problem: ForceProblem, cone: str = "polytope", share: float | None = None) -> Reference:
    """Return the optimum of ``problem`` on "polytope" or on "exact" cones with ``share`` of their friction.

    ``share`` None means all of it; 0 is special: each contact's own inradius.  The cost does not change with it.
    """
    settings, limits = problem.settings, problem.limits
    models = settings.models
    dims = [model.dimension for model in models]
    start = np.concatenate([[0], np.cumsum(dims)])
    size = start[-1]
    c = np.concatenate([[m.capacity[0], m.capacity[1], 1.0, *m.capacity[2:]] for m in models])
    weight = np.full(size, settings.friction_weight)
    weight[start[:-1] + 2] = settings.normal_weight
    gradient = np.zeros(size)
    gradient[start[:-1] + 2] = -2.0 * settings.normal_weight * problem.target_normal
    constant = settings.normal_weight * float(problem.target_normal @ problem.target_normal)
    per_length = np.array([1.0, 1.0, 1.0, *[1.0 / settings.length] * 3])
    assert settings.wrench_tolerance == 0.0
    assert problem.previous is None

    equal = (problem.G * c) * per_length[:, None]
    below, bound = [], []  # below @ y <= bound
    cones, conic = [], []
    for i, model in enumerate(models):
        own = slice(start[i], start[i + 1])
        unit = np.zeros((1, size))
        unit[0, start[i] + 2] = 1.0
        below += [unit, -unit]
        bound += [[limits.normal_ceiling[i]], [-limits.normal_floor[i]]]
        if cone == "polytope":
            facets = np.zeros((len(model.facets()), size))
            facets[:, own] = model.facets() * c[own]
            below.append(facets)
            bound.append(np.zeros(len(facets)))
        else:
            # s = -A y = (k f_n, f_t / c) in a second-order cone
            k = {None: 1.0, 0: model.facet_inradius}.get(share, share)
            block = np.zeros((dims[i], size))
            block[0, start[i] + 2] = -k
            for row, column in enumerate([0, 1, 3][: dims[i] - 1]):
                block[row + 1, start[i] + column] = -1.0
            conic.append(block)
            cones.append(clarabel.SecondOrderConeT(dims[i]))
        if problem.torque_maps is not None:
            maps = np.zeros((problem.torque_maps.shape[1], size))
            maps[:, own] = problem.torque_maps[i][:, : dims[i]] * c[own]
            bias = np.zeros(len(maps)) if problem.torque_bias is None else problem.torque_bias[i]
            below += [maps / settings.reach, -maps / settings.reach]
            bound += [
                (limits.torque_upper[i] - bias) / settings.reach,
                (bias - limits.torque_lower[i]) / settings.reach,
            ]
    plain = np.vstack(below)
    A = np.vstack([equal, plain, *conic])
    b = np.concatenate([problem.wrench * per_length, *bound, np.zeros(len(A) - 6 - len(plain))])
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-10
    solver = clarabel.DefaultSolver(
        csc_matrix(diags(2.0 * weight)),
        gradient,
        csc_matrix(A),
        b,
        [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(plain)), *cones],
        options,
    )
    answer = solver.solve()
    forces = np.full((len(models), 4), np.nan)
    if str(answer.status) not in ("Solved", "AlmostSolved"):
        return Reference(str(answer.status), np.inf, forces)
    forces[:] = 0.0
    y = np.array(answer.x)
    for i in range(len(models)):
        forces[i, : dims[i]] = (y * c)[start[i] : start[i + 1]]
    return Reference(str(answer.status), float(weight @ y**2 + gradient @ y) + constant, forces)


def measure_lack(problem: ForceProblem, cure: tuple[Loosening, ...] = (), share: float = 1.0) -> float:
    """Return by how much [N] every row has to give way for there to be forces, once ``share`` of a cure is granted.

    By HiGHS, in plain forces; only the contacts and bounds that the cure names are widened.
    """
    settings, limits = problem.settings, problem.limits
    size, start, rows, room = problem.G.shape[1], 0, [], []
    wider = {item.group: item for item in cure}
    per_length = np.array([1.0, 1.0, 1.0, *[1.0 / settings.length] * 3])
    band = settings.wrench_tolerance + (share * wider["wrench"].amount if "wrench" in wider else 0.0)
    for sign in (1.0, -1.0):
        rows.append(sign * problem.G * per_length[:, None])
        room.append(sign * problem.wrench * per_length + band)

    def grant(group: str, contact: int, bound: str) -> float:
        item = wider.get(group)
        if item is None or contact not in item.contacts or item.bound not in (bound, "both"):
            return 0.0
        return share * item.amount

    for i, model in enumerate(settings.models):
        own = slice(start, start + model.dimension)
        start = own.stop
        facets = np.zeros((len(model.facets()), size))
        facets[:, own] = model.facets()
        # friction of f_n + grant: facet . (f_t, f_n + grant) <= 0
        room.append(-model.facets()[:, 2] * grant("friction", i, "upper"))
        rows.append(facets)
        for sign, bound, limit in (
            (1.0, "upper", limits.normal_ceiling[i]),
            (-1.0, "lower", limits.normal_floor[i]),
        ):
            unit = np.zeros((1, size))
            unit[0, own.start + 2] = sign
            rows.append(unit)
            least = sign * limit + grant("normal force", i, bound)
            # no contact pulls, whatever is granted
            room.append(np.array([least if bound == "upper" else min(least, 0.0)]))
        if problem.torque_maps is None:
            continue
        bias = (
            np.zeros(problem.torque_maps.shape[1]) if problem.torque_bias is None else problem.torque_bias[i]
        )
        for sign, bound, torque in (
            (1.0, "upper", limits.torque_upper),
            (-1.0, "lower", limits.torque_lower),
        ):
            if torque is not None:
                block = np.zeros((len(bias), size))
                block[:, own] = sign * problem.torque_maps[i][:, : model.dimension]
                rows.append(block / settings.reach)
                room.append((sign * (torque[i] - bias) + grant("joint torque", i, bound)) / settings.reach)
    A, b = np.vstack(rows), np.concatenate(room)
    answer = linprog(
        np.append(np.zeros(size), 1.0),
        A_ub=np.column_stack([A, -np.ones(len(A))]),
        b_ub=b,
        bounds=[(None, None)] * size + [(0.0, None)],
    )
    return float(answer.fun)


def draw_problem(rng: np.random.Generator) -> ForceProblem:
    """Return a random problem: two or three fingers, hard, soft or mixed, with and without joints; not always feasible."""
    count = int(rng.integers(2, 4))
    mu = rng.uniform(0.3, 0.9)
    kinds = {
        "soft": [SoftFinger(mu, rng.uniform(0.001, 0.004)) for _ in range(count)],
        "hard": [HardFinger(mu) for _ in range(count)],
        "mixed": [HardFinger(mu), *[SoftFinger(mu, rng.uniform(0.001, 0.004)) for _ in range(count - 1)]],
    }
    # two hard fingers transmit no torque about their line: not held
    models = kinds[str(rng.choice(["soft", "mixed"] if count == 2 else ["soft", "hard", "mixed"]))]
    around = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False) + rng.normal(scale=0.12, size=count)
    points = np.column_stack([np.cos(around), np.sin(around), rng.normal(scale=0.12, size=count)])
    G = compute_grasp_map(
        Grasp(
            tuple(
                contact_on_sphere(i, p, RADIUS, m)
                for i, (p, m) in enumerate(zip(points, models, strict=True))
            )
        )
    )
    wrench = np.concatenate([rng.normal(scale=0.6, size=3), rng.normal(scale=0.002, size=3)])
    floor = rng.choice([0.0, 1.0, 4.0]) * rng.uniform(0.5, 1.0, size=count)
    ceiling = floor + rng.uniform(0.5, 8.0, size=count)
    target = rng.choice([0.0, 1.0, 5.0]) * rng.uniform(0.5, 1.0, size=count)
    settings = ForceSettings(
        tuple(models), length=RADIUS, friction_weight=float(rng.choice([0.02, 0.1, 1.0]))
    )
    if rng.random() < 0.5:
        return ForceProblem(settings, G, wrench, ForceLimits(floor, ceiling), target)
    maps = rng.normal(scale=0.05, size=(count, 3, max(m.dimension for m in models)))
    reach = rng.uniform(0.1, 0.6, size=(count, 3))
    bias = rng.normal(scale=0.03, size=(count, 3))
    return ForceProblem(settings, G, wrench, ForceLimits(floor, ceiling, -reach, reach), target, maps, bias)
