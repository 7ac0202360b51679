"""A pointing finger in closed form: an arm of three hinges that carries a wrist whose three axes meet in one point.

Where the tip's centre is and along what its pole looks fix the wrist's centre; the arm takes that there as two links in a plane
that the first hinge turns, the wrist points the pole, and the last hinge is free [Pieper 1968].  A fast path of
:mod:`dexplan.kinematics.pointing`, for chains of that build; the answers are the same, without steps and without seeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dexplan.kinematics.chain import Chain, compute_dexterity, compute_tip_pose, solve_ik, wrap_to_limits
from dexplan.kinematics.pointing import LENGTH, move_to_base
from dexplan.kinematics.workspace import Workspace
from dexplan.spatial import Array, lock_arrays, read_only

_EXACT = 1e-9
_STEPS = 12
"""Newton steps to the smallest eigenvalue: the first halve what is left at worst, the last ones square it."""


ROOM = float(np.radians(5.0))
"""Joints this far from their limits have room enough [rad]."""

Branch = tuple[int, int, int]
"""Signs of shoulder, elbow and wrist."""


@dataclass(frozen=True, eq=False)
class SphericalWrist:
    """A chain in the axes that make it plain: ``up`` along the first hinge, ``side`` along the second, ``out`` = side x up.

    Vectors (3,) are in the frame of the first joint, lengths in metres.  In the plane of the arm a point ``up + i out`` is a
    complex number, and a turn about ``side`` a product.  ``shoulder`` is where the second hinge is, ``upper`` leads from there
    to the third hinge, ``lower`` on to the wrist's centre, ``reach`` [m] along the pole to the tip's centre.  ``wrist`` (3, 3)
    has the wrist's axes at zero angles as rows: the fourth hinge's, fifth x fourth, and the fifth's; ``tilt`` [rad] is the
    pole's angle in the plane of the first two.  ``elbow_sign`` tells the third hinge from the second.
    """

    up: Array
    out: Array
    side: Array
    shoulder: complex
    upper: complex
    lower: complex
    elbow_sign: float
    wrist: Array
    tilt: float
    reach: float

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def frame(self) -> Array:
        """Rows up, out, side (3, 3)."""
        return np.stack([self.up, self.out, self.side])

    def find_branches(self, q: Array) -> tuple[Branch, ...]:
        """Return the branches that postures (N, 6) lie on, the most usual first."""
        bend = np.exp(1j * self.elbow_sign * q[:, 2]) * self.lower
        out = (self.shoulder + np.exp(1j * q[:, 1]) * (self.upper + bend)).imag
        signs = np.sign([out, (bend / self.upper).imag, np.sin(self.tilt + q[:, 4])]).astype(np.int_)
        found, count = np.unique(signs[:, (signs != 0).all(axis=0)], axis=1, return_counts=True)
        return tuple((int(a), int(b), int(c)) for a, b, c in found[:, np.argsort(-count)].T)

    def solve(self, positions: Array, poles: Array, branch: Branch) -> tuple[Array, NDArray[np.bool_]]:
        """Return postures (6, N), last angle zero, with tips at ``positions`` (N, 3) and poles (N, 3), and which exist (N,).

        Both in the frame of the first joint; ``branch`` as from :meth:`find_branches`.  What is out of reach gets the arm's
        posture that is stretched, or folded, towards it.
        """
        front, bend, flip = (float(sign) for sign in branch)
        q = np.zeros((6, len(positions)))
        up, x, y = self.frame @ (positions - self.reach * poles).T
        a, b, side = self.frame @ poles.T
        flat = np.hypot(x, y)
        q[0] = np.arctan2(front * y, front * x)
        cosine, sine = np.cos(q[0]), np.sin(q[0])
        # The arm's plane: links of two lengths and the angle between them.
        goal = (up - self.shoulder.real) + 1j * (front * flat - self.shoulder.imag)
        one, two = abs(self.upper), abs(self.lower)
        c = ((goal.real**2 + goal.imag**2) - one * one - two * two) / (2.0 * one * two)
        exists = np.abs(c) <= 1.0
        inner = bend * np.arccos(np.clip(c, -1.0, 1.0))
        q[2] = self.elbow_sign * _wrap(inner - np.angle(self.lower / self.upper))
        arm = self.upper * (1.0 + two / one * np.exp(1j * inner))
        q[1] = np.angle(goal * arm.conj())
        # The pole as the third link sees it.
        bare, aside = b * cosine + side * sine, side * cosine - b * sine
        link = np.exp(-1j * (q[1] + self.elbow_sign * q[2])) * (a + 1j * bare)
        u = self.wrist @ self.frame.T @ np.stack([link.real, link.imag, aside])
        polar = flip * np.arctan2(np.hypot(u[1], u[2]), u[0])
        q[3], q[4] = np.arctan2(flip * u[2], flip * u[1]), _wrap(polar - self.tilt)
        return q, exists

    def compute_dexterity(self, q: Array) -> Array:
        """Return the smallest singular value (N,) of the tip's Jacobian at postures (6, N), lengths in units of ``LENGTH``."""
        # Turns of everything change nothing: seen from the arm's plane, up, out and side.
        count = q.shape[1]
        turn = np.exp(1j * q[1])
        bend = np.exp(1j * (q[1] + self.elbow_sign * q[2]))
        axes, arms = np.zeros((6, 3, count)), np.zeros((6, 3, count))
        axes[0, 0], axes[1, 2], axes[2, 2] = 1.0, 1.0, self.elbow_sign
        fourth, cross, fifth = self.wrist @ self.frame.T
        c, s = np.cos(q[3]), np.sin(q[3])
        inner = cross[:, None] * c + fifth[:, None] * s
        polar = self.tilt + q[4]
        for n, v in (
            (3, fourth[:, None]), (4, fifth[:, None] * c - cross[:, None] * s),
            (5, fourth[:, None] * np.cos(polar) + inner * np.sin(polar)),
        ):  # fmt: skip
            w = bend * (v[0] + 1j * v[1])
            axes[n, 0], axes[n, 1], axes[n, 2] = w.real, w.imag, v[2]
        tip = self.reach * axes[5]
        for n, z in ((2, bend * self.lower), (1, turn * self.upper), (0, np.array(self.shoulder))):
            tip[0] += z.real
            tip[1] += z.imag
            arms[n] = tip
        arms[3:5] = self.reach * axes[5]
        J = np.empty((6, 6, count))  # joint, row, posture
        J[:, 3:] = axes
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            J[:, k] = (axes[:, m] * arms[:, n] - axes[:, n] * arms[:, m]) / LENGTH
        return compute_least_singular_values(J)


def compute_least_singular_values(J: Array) -> Array:
    """Return the smallest singular value (N,) of matrices (6, 6, N), closely enough for a grid: see its test.

    Newton's steps on the characteristic polynomial of J J^T, from zero: its roots are real, so that they come up to the smallest
    from below.  All of them at once, several times faster than one after the other.
    """
    A = np.einsum("kin,kjn->ijn", J, J)
    A2 = np.einsum("ikn,kjn->ijn", A, A)
    A3 = np.einsum("ikn,kjn->ijn", A2, A)
    pairs = ((A, A2), (A2, A2), (A2, A3), (A3, A3))
    power = [np.einsum("iin->n", A), np.einsum("iin->n", A2)] + [
        np.einsum("ijn,ijn->n", a, b) for a, b in pairs
    ]
    # Elementary symmetric functions from power sums, by Newton's identities.
    e = [np.ones_like(power[0])]
    for k in range(1, 7):
        e.append(sum(((-1.0) ** (i - 1) * e[k - i] * power[i - 1] for i in range(1, k + 1)), np.zeros(1)) / k)
    root = np.zeros_like(power[0])
    for _ in range(_STEPS):
        value, slope = e[0], np.zeros_like(root)
        for k in range(1, 7):
            slope = slope * root + value
            value = value * root + (-1.0) ** k * e[k]
        root = np.maximum(root - value / np.where(slope < 0.0, slope, -1.0), root)
    least: Array = np.sqrt(root)
    return least


def estimate_dexterity(chain: Chain, q: Array) -> Array:
    """Return :func:`compute_dexterity` (N,) of postures (N, J), for a spherical wrist several times faster and nearly exact."""
    wrist = find_spherical_wrist(chain)
    return (
        compute_dexterity(chain, q) if wrist is None else wrist.compute_dexterity(np.ascontiguousarray(q.T))
    )


def _wrap(angle: Array) -> Array:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


@lru_cache(maxsize=256)
def find_spherical_wrist(chain: Chain) -> SphericalWrist | None:
    """Return the chain in plain axes, None where it is built otherwise.

    Asked of it: six hinges; the second at right angles to the first, the third parallel to the second, the wrist's centre in the
    plane of the first; the fourth, fifth and last meet there, the fifth at right angles to both, the last along the pole.
    """
    if chain.n_joints != 6 or not chain.has_tip_roll:
        return None
    X, axes, places = np.eye(4), [], []
    for j, axis in enumerate(chain.axes):
        X = X @ chain.offsets[j] if j else X
        axes.append(X[:3, :3] @ axis)
        places.append(X[:3, 3])
    tip = X @ chain.X_JF
    pole, p = tip[:3, 2], tip[:3, 3]
    up, side = axes[0], axes[1]
    reach = float((p - places[4]) @ pole)
    center = p - reach * pole
    off = [
        up @ side, *np.cross(side, axes[2]), (center - places[0]) @ side, axes[3] @ axes[4], axes[4] @ pole,
        *np.cross(center - places[4], axes[4]), *np.cross(center - places[3], axes[3]),
    ]  # fmt: skip
    if np.abs(off).max() > _EXACT:
        return None
    out = np.cross(side, up)

    def project(v: Array) -> complex:
        return complex(up @ v, out @ v)

    wrist = np.stack([axes[3], np.cross(axes[4], axes[3]), axes[4]])
    upper, lower = project(places[2] - places[1]), project(center - places[2])
    if min(abs(upper), abs(lower)) < _EXACT:
        return None
    return SphericalWrist(
        up=read_only(up), out=read_only(out), side=read_only(side),
        shoulder=project(places[1] - places[0]), upper=upper, lower=lower, elbow_sign=float(np.sign(axes[2] @ side)),
        wrist=read_only(wrist), tilt=float(np.arctan2(pole @ wrist[1], pole @ wrist[0])), reach=reach,
    )  # fmt: skip


@lru_cache(maxsize=24)
def find_sampled_branches(workspace: Workspace) -> tuple[Branch, ...]:
    """Return the branches of the closed form that sampled postures lie on."""
    wrist = find_spherical_wrist(workspace.chain)
    assert wrist is not None
    return wrist.find_branches(workspace.postures)


def solve_tip_pose(
    workspace: Workspace, X_WF: Array, *, counts_spin: bool = False
) -> tuple[Array, NDArray[np.bool_]]:
    """Return postures (N, J) for tip poses (N, 4, 4) and which were reached (N,): as :meth:`Workspace.solve`, faster.

    The branch on which most of the workspace lies, the home posture's, is taken wherever it leaves the joints ``ROOM``: from
    there a finger gets home without turning its wrist over.  Elsewhere it is the branch that leaves them most.  The last joint
    counts only if ``counts_spin``: where a contact is to be landed on, its spin is still free.  Chains of another build go the
    general way.  Raises ValueError where the workspace is empty.
    """
    chain, wrist = workspace.chain, find_spherical_wrist(workspace.chain)
    if wrist is None or not len(workspace.postures):
        return workspace.solve(X_WF)
    positions, poles = move_to_base(chain, X_WF[:, :3, 3], X_WF[:, :3, 2])
    postures, reached = np.zeros((len(X_WF), 6)), np.zeros(len(X_WF), dtype=bool)
    spare = np.full(len(X_WF), -np.inf)
    for branch in find_sampled_branches(workspace):
        pointing, exists = wrist.solve(positions, poles, branch)
        q = wrap_to_limits(chain, _spin(chain, pointing, X_WF))
        room = np.minimum(q - chain.lower, chain.upper - q)
        least = room.min(axis=1) if counts_spin else room[:, :5].min(axis=1)
        better = exists & (least > spare) & (spare < ROOM)
        postures[better], spare[better] = q[better], least[better]
        reached |= better
    return postures, reached


def solve_standing(chain: Chain, X_WF: Array, q_landed: Array) -> Array:
    """Return the posture (J,) of a finger that landed in ``q_landed`` (J,) and has been carried to the tip pose (4, 4) since."""
    q, _ = solve_near(chain, X_WF[None], q_landed[None])
    return np.asarray(wrap_to_limits(chain, q)[0])


def solve_near(
    chain: Chain, X_WF: Array, q_near: Array, *, tolerance: float = 1e-7
) -> tuple[Array, NDArray[np.bool_]]:
    """Return postures (N, J) for tip poses (N, 4, 4) on the branch of ``q_near`` (N, J), and which were reached (N,).

    As :func:`dexplan.kinematics.chain.solve_ik`, which answers for chains of another build and where the branch is not the same
    throughout.
    """
    wrist = find_spherical_wrist(chain)
    branches = () if wrist is None else wrist.find_branches(q_near)
    if wrist is None or len(branches) != 1:
        return solve_ik(chain, X_WF, q_near, tolerance=tolerance)
    postures, reached = wrist.solve(*move_to_base(chain, X_WF[:, :3, 3], X_WF[:, :3, 2]), branches[0])
    q = _spin(chain, postures, X_WF)
    return q - 2.0 * np.pi * np.round((q - q_near) / (2.0 * np.pi)), reached


def _spin(chain: Chain, postures: Array, X_WF: Array) -> Array:
    """Return pointing postures (6, N) as (N, 6) with the last joint turned so that the tips have the poses ``X_WF`` (N, 4, 4)."""
    q = np.ascontiguousarray(postures.T)
    E = compute_tip_pose(chain, q)[:, :3, :3].swapaxes(1, 2) @ X_WF[:, :3, :3]
    q[:, -1] += chain.roll_sign * np.arctan2(E[:, 1, 0] - E[:, 0, 1], E[:, 0, 0] + E[:, 1, 1])
    return q
