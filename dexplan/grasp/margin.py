"""How far inside their cones can contact forces stay that balance a wrench?  A small convex program, two ways.

All forces of the wanted mean that balance the wrench form an affine space, f = f_0 + N z.  In its coordinates z a contact
has the normal force n(z) and the shear t(z), friction's share divided by its capacity so that every cone is circular:

    maximise s  s.t.  |t_i(z)| <= n_i(z) - s  for all contacts i.

The exact cones are second-order ones; inscribed pyramids make the program linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from dexplan.brief import brief_repr
from dexplan.contact.friction import NORMAL
from dexplan.grasp.grasp import Grasp, compute_grasp_map
from dexplan.spatial import Array, lock_arrays

GAP = 1e-8
"""The exact margin is known to this much, in units of the mean normal force."""

_RANK = 1e-9  # singular values below this share of the largest one count as zero
_SIGN = np.array([1.0, -1.0, -1.0, -1.0])  # of the second-order cone's quadratic form
_GROWTH = 40.0  # of the barrier's weight between two centrings


@dataclass(frozen=True, eq=False)
class MarginProgram:
    """Balancing forces per newton of mean normal force, as affine functions of z (K,).

    ``forces`` (sum m, 1 + K), ``normal`` (F, 1 + K) and ``shear`` (F, 3, 1 + K) act on (1, z); hard fingers have a zero
    row where soft ones have torsion.  ``rank`` is that of the grasp map, torques divided by the contacts' mean distance.
    """

    forces: Array
    normal: Array
    shear: Array
    rank: int

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def attained(self, z: Array) -> float:
        """Return the least normal force to spare at z (K,), by the exact cones."""
        x = np.concatenate([[1.0], z])
        return float((self.normal @ x - np.linalg.norm(self.shear @ x, axis=1)).min())


def build_margin_program(grasp: Grasp, wrench: Array, mean_normal: float) -> tuple[MarginProgram | None, int]:
    """Return the program and the rank of the grasp map; None where no forces of this mean balance the wrench."""
    G = compute_grasp_map(grasp)
    length = max(float(np.mean([np.linalg.norm(c.p_OC) for c in grasp.contacts])), 1e-6)
    G[3:] /= length  # torque rows as large as force rows
    rank = int(np.linalg.matrix_rank(G, tol=_RANK))

    count, size = len(grasp.contacts), G.shape[1]
    capacity = np.concatenate([np.insert(model.capacity, NORMAL, 1.0) for model in grasp.models])
    equality = np.concatenate([G * capacity, np.zeros((1, size))])
    right = np.concatenate([wrench[:3], wrench[3:] / length, [0.0]]) / mean_normal
    right[6] = count
    for part in grasp.slices:
        equality[6, part.start + NORMAL] = 1.0

    left, values, rows = np.linalg.svd(equality)
    kept = int(np.sum(values > _RANK * values[0]))
    y = rows[:kept].T @ ((left[:, :kept].T @ right) / values[:kept])
    if np.abs(equality @ y - right).max() > 1e-8 * np.abs(right).max():
        return None, rank
    affine = np.column_stack([y, rows[kept:].T])  # y = affine @ (1, z)

    normal, shear = np.zeros((count, affine.shape[1])), np.zeros((count, 3, affine.shape[1]))
    for i, part in enumerate(grasp.slices):
        block = affine[part]
        normal[i] = block[NORMAL]
        shear[i, : len(block) - 1] = np.delete(block, NORMAL, axis=0)
    return MarginProgram(affine * capacity[:, None], normal, shear, rank), rank


def solve_exact_margin(program: MarginProgram) -> Array:
    """Return the z (K,) that attains the margin against the exact cones, to within :data:`GAP`.

    Newton's method on the logarithmic barrier of the second-order cones,

        minimise  -w s - sum_i log((n_i - s)^2 - |t_i|^2),

    whose minimiser is within 2 F / w of the best margin [Boyd & Vandenberghe 2004, §11.6].  Any z with s below its least
    slack starts it, and the level sets of s are bounded, so there is always a minimiser.
    """
    count, size = program.normal.shape
    z = np.zeros(size)  # (z, s)
    if size == 1:
        return z[:0]
    # x_i = offset_i + linear_i @ (z, s) is (n - s, t) of contact i, and q_i = x^T sign x what the barrier takes the log of.
    offset = np.column_stack([program.normal[:, 0], program.shear[:, :, 0]])
    linear = np.zeros((count, 4, size))
    linear[:, 0, :-1], linear[:, 0, -1], linear[:, 1:, :-1] = (
        program.normal[:, 1:],
        -1.0,
        program.shear[:, :, 1:],
    )
    flat, signed = linear.reshape(-1, size), _SIGN[:, None] * linear
    fixed = 2.0 * (np.swapaxes(linear, 1, 2) @ signed).reshape(count, -1)  # Hessians of q

    extent = 1.0 + 2.0 * float(np.abs(offset).max())
    z[-1] = program.attained(z[:-1]) - extent
    x = offset + (flat @ z).reshape(count, 4)
    q = (x * x) @ _SIGN
    weight, goal = 2.0 * count / extent, 2.0 * count / GAP
    while True:
        for _ in range(50):
            slope = 2.0 * (x[:, None, :] @ signed)[:, 0] / q[:, None]
            gradient = -slope.sum(axis=0)
            gradient[-1] -= weight
            hessian = slope.T @ slope - ((1.0 / q) @ fixed).reshape(size, size)
            step = np.linalg.solve(hessian, -gradient)
            decrement = -float(gradient @ step)
            if decrement < 1e-3:
                break
            value, share = weight * z[-1] + float(np.log(q).sum()), 1.0
            along = (flat @ step).reshape(count, 4)
            while share > 1e-12:
                trial = x + share * along
                gap = trial[:, 0] - np.sqrt((trial[:, 1:] * trial[:, 1:]).sum(axis=1))
                # as a product, because the square of n - s less that of |t| loses its digits near the cone
                trial_q = gap * (2.0 * trial[:, 0] - gap)
                if gap.min() > 0.0:
                    gain = weight * (z[-1] + share * step[-1]) + float(np.log(trial_q).sum()) - value
                    if gain >= 0.1 * share * decrement:
                        break
                share *= 0.5
            else:  # no better point can be told apart in floating point
                break
            z, x, q = z + share * step, trial, trial_q
        if weight >= goal:
            return z[:-1]
        weight = min(goal, weight * _GROWTH)


def solve_pyramid_margin(
    program: MarginProgram, sections: Sequence[tuple[Array, float]]
) -> tuple[Array, float]:
    """Return the z (K,) and the margin against inscribed pyramids, by one linear program.

    ``sections`` holds per contact the facet normals (k, m - 1) and the inradius of the polytope in the unit ball.
    """
    rows, bounds = [], []
    for i, (facets, inradius) in enumerate(sections):
        # facet . t <= inradius (n - s)
        table = facets @ program.shear[i, : facets.shape[1]] - inradius * program.normal[i]
        rows.append(np.column_stack([table[:, 1:], np.full(len(table), inradius)]))
        bounds.append(-table[:, 0])
    size = program.normal.shape[1] - 1
    cost = np.append(np.zeros(size), -1.0)
    answer = linprog(cost, np.concatenate(rows), np.concatenate(bounds), bounds=(None, None), method="highs")
    if answer.status != 0:  # s is bounded by the mean normal force and may be as small as it likes
        raise RuntimeError(f"the margin program has a solution, but HiGHS says: {answer.message}")
    return answer.x[:-1], float(answer.x[-1])


def solve_bounded_margin(grasp: Grasp, wrench: Array, floor: float, ceiling: float) -> float:
    """Return the normal force [N] to spare at the weakest contact while the contacts exert ``wrench`` (6,) on the object.

        maximise s  s.t.  G f = wrench,  A_i f_i <= -inradius_i s,  floor <= f_n,i <= ceiling

    with A_i the facets of the pyramid inscribed in the cone of contact i.  Negative where friction is short, -inf where no normal
    forces within the bounds [N] balance the wrench at all.
    """
    G, size = compute_grasp_map(grasp), sum(model.dimension for model in grasp.models)
    rows, bounds = [], list[tuple[float | None, float | None]]([(None, None)] * (size + 1))
    for model, part in zip(grasp.models, grasp.slices, strict=True):
        facets = model.facets()
        table = np.zeros((len(facets), size + 1))
        table[:, part], table[:, -1] = facets, model.facet_inradius
        rows.append(table)
        bounds[part.start + NORMAL] = (floor, ceiling)
    answer = linprog(
        np.append(np.zeros(size), -1.0),
        np.concatenate(rows),
        np.zeros(sum(len(table) for table in rows)),
        np.column_stack([G, np.zeros(6)]),
        wrench,
        bounds=bounds,
        method="highs",
    )
    return float(answer.x[-1]) if answer.status == 0 else -np.inf
