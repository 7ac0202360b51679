"""The validator's own statics of a grasp: is it force closed, and how hard does it lean on friction to carry
a load?

Contacts are points p (K, 3) and outward normals n (K, 3) in the object frame; the soft-finger cone of one
contact, in its own frame with z into the object, is f_z >= sqrt((f_x^2 + f_y^2)/mu^2 + tau^2/mu_t^2).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from dexplan.spatial import Array

_EDGES = 24
"""Edges of the inscribed friction pyramid in the closure test: an angle smaller by at most 0.3 degrees."""
_HALVINGS = 14
_CUTS = 12
_ROUNDS = 60
_PRECISION = 1e-3


def compute_closure_slack(points: Array, normals: Array, sliding: float, torsional: float) -> float:
    """Return the angle [rad] by which the friction angle atan(mu) exceeds the smallest one that closes the
    grasp.

    Negative where the grasp is not force closed.  Two soft fingers: exactly atan(mu) minus the larger angle
    between the chord and an inward normal.  More fingers: by bisection over the friction angle with the
    linear program of force closure.
    """
    inward = -normals / np.linalg.norm(normals, axis=1, keepdims=True)
    believed = float(np.arctan(sliding))
    if len(points) < 2:
        return believed - np.pi / 2
    if len(points) == 2:
        chord = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        return believed - max(_angle(inward[0], chord), _angle(inward[1], -chord))
    lower, upper = 0.0, np.pi / 2
    for _ in range(_HALVINGS):
        middle = (lower + upper) / 2
        if is_force_closed(points, normals, float(np.tan(middle)), torsional):
            upper = middle
        else:
            lower = middle
    return believed - upper


def is_force_closed(points: Array, normals: Array, sliding: float, torsional: float) -> bool:
    """Return whether positive combinations of the inscribed cones' edges give every wrench.

    The edges' wrenches W (6, N) do so iff they span all six dimensions and some strictly positive x has W x =
    0; the program finds the x of sum 1 whose smallest entry is largest.
    """
    frames = [_contact_map(p, n) for p, n in zip(points, normals, strict=True)]
    turn = np.linspace(0, 2 * np.pi, _EDGES, endpoint=False)
    edges = [np.stack([sliding * np.cos(turn), sliding * np.sin(turn), np.ones(_EDGES), np.zeros(_EDGES)])]
    edges.append(np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 1.0], [torsional, -torsional]]))
    wrenches = np.concatenate([G @ np.concatenate(edges, axis=1) for G in frames], axis=1)
    # Torques in units of the grasp's own size, so that rank and program see numbers of one order.
    wrenches[3:] /= np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    if np.linalg.matrix_rank(wrenches, tol=1e-6) < 6:
        return False
    count = wrenches.shape[1]
    cost = np.zeros(count + 1)
    cost[-1] = -1.0
    equal = np.zeros((7, count + 1))
    equal[:6, :count], equal[6, :count] = wrenches, 1.0
    above = np.concatenate([-np.eye(count), np.ones((count, 1))], axis=1)
    answer = linprog(
        cost,
        A_ub=above,
        b_ub=np.zeros(count),
        A_eq=equal,
        b_eq=[0.0] * 6 + [1.0],
        bounds=[(0, None)] * (count + 1),
    )
    return bool(answer.status == 0 and answer.x[-1] > 1e-9)


def compute_load_margin(
    points: Array, normals: Array, load: Array, sliding: float, torsional: float, squeeze: float
) -> float:
    """Return 1 - u, u the smallest friction utilisation that balances the force ``load`` (3,) [N] at the
    origin, the centre of mass, from which ``points`` are measured.

    Normal forces lie between 0 and ``squeeze`` [N].  Found by bisection over u; each linear program bounds
    the round cones from outside and is cut where its answer leaves them, so the result is exact to 0.001.
    Never below -3; where the contacts cannot balance the load at any friction, -3.
    """
    count = len(points)
    scale = np.array([sliding, sliding, 1.0, torsional])
    # Unknowns per finger: (f_x/mu, f_y/mu, f_z, tau/mu_t); last one: how far the worst cut is violated.
    maps = np.concatenate([_contact_map(p, n) * scale for p, n in zip(points, normals, strict=True)], axis=1)
    size = float(np.linalg.norm(points, axis=1).max())
    maps[3:] /= size
    equal = np.concatenate([maps, np.zeros((6, 1))], axis=1)
    balance = np.concatenate([-load, np.zeros(3)])
    turn = np.linspace(0, 2 * np.pi, _CUTS, endpoint=False)
    cuts: list[tuple[int, Array]] = []
    for k in range(count):
        cuts += [(k, np.array([np.cos(a), np.sin(a), 0.0])) for a in turn]
        cuts += [(k, np.array([0.0, 0.0, s])) for s in (1.0, -1.0)]
    bounds = [b for _ in range(count) for b in ((None, None), (None, None), (0.0, squeeze), (None, None))] + [
        (None, None)
    ]
    cost = np.zeros(4 * count + 1)
    cost[-1] = 1.0
    lower, upper = 0.0, 4.0
    for _ in range(_ROUNDS):
        if upper - lower < _PRECISION:
            break
        u = (lower + upper) / 2
        rows = np.zeros((len(cuts), 4 * count + 1))
        for i, (k, a) in enumerate(cuts):
            rows[i, [4 * k, 4 * k + 1, 4 * k + 3]] = a
            rows[i, 4 * k + 2] = -u
        rows[:, -1] = -1.0
        answer = linprog(cost, A_ub=rows, b_ub=np.zeros(len(cuts)), A_eq=equal, b_eq=balance, bounds=bounds)
        if answer.status != 0:
            return 1.0 - upper
        if answer.x[-1] > 0:
            lower = u
            continue
        forces = answer.x[:-1].reshape(count, 4)
        sideways = np.linalg.norm(forces[:, [0, 1, 3]], axis=1)
        used = float(np.max(sideways / np.maximum(forces[:, 2], 1e-12)))
        upper = min(upper, used)
        if used > u:
            # Outside the round cone though inside its bounds: tighten there and ask again.
            cuts += [(k, forces[k, [0, 1, 3]] / sideways[k]) for k in range(count) if sideways[k] > 0]
    return 1.0 - upper


def _contact_map(point: Array, normal: Array) -> Array:
    """Return (6, 4): wrench about the object's centre of a contact's (f_x, f_y, f_z, tau_z), z into the
    object.
    """
    z = -normal / np.linalg.norm(normal)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    out = np.zeros((6, 4))
    out[:3, :3] = axes
    out[3:, :3] = np.cross(point, axes.T).T
    out[3:, 3] = z
    return out


def _angle(a: Array, b: Array) -> float:
    """Return the angle [rad] between two unit vectors (3,)."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))
