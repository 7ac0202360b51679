"""Where on the object can one finger touch?  CWS_i as a signed field over the directions from the object's centre.

A finger touches along an outward normal n when its tip's pole points along -n (the spin about the pole is free: the last joint
turns it).  That leaves five equations for the other joints.  The field is the smallest of what the finger then has to spare:
joint range, dexterity, and the angle to the border of what lies before the finger; its zero level is the border of CWS_i.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.icosphere import Icosphere, build_icosphere
from dexplan.planning.spherical import FINE, LevelSet
from dexplan.scene.chain import (
    IK_DAMPING,
    IK_MAX_STEP,
    Chain,
    compute_dexterity,
    compute_joint_margin,
    wrap_to_limits,
)
from dexplan.scene.workspace import Workspace, compute_aligned_pose
from dexplan.spatial import Array, hat, read_only

COARSE = 3
"""Level of the grid at which every direction before the finger is asked; those near the border are asked down to the finest."""
SIGHT = float(np.radians(85.0))
"""Directions farther than this from the finger's own are not tried."""
NEAR = 0.02
"""Values nearer to zero than this may hide a border between them [rad]."""
LENGTH = 0.06
"""A radian weighs as much as this distance [m]."""
_JUMP = 0.5
"""Postures of neighbours that differ more than this lie on different branches [rad]."""


@dataclass(frozen=True)
class ContactLimits:
    """What a contact must leave to spare: ``joint_margin`` [rad] to every joint's limits, ``dexterity`` [-]."""

    joint_margin: float
    dexterity: float


@dataclass(frozen=True, eq=False)
class Contactable:
    """CWS_i of one finger on a sphere at one position, over the directions of ``grid``, in the axes of the workspace.

    ``margin`` (V,) is the field [rad], positive inside; values far from its zero level are interpolated.  ``postures`` (V, J)
    [rad] reach the vertices of ``is_solved`` (V,).  ``distance`` is the tip centre's from the object's centre [m], ``front``
    (3,) the finger's own direction.
    """

    grid: Icosphere
    workspace: Workspace
    limits: ContactLimits
    center: Array
    front: Array
    distance: float
    margin: Array
    postures: Array
    is_solved: NDArray[np.bool_]

    def compute_margin(self, directions: Array) -> Array:
        """Return the field (N,) [rad] at unit vectors (N, 3) exactly: the inverse kinematics is solved there."""
        return self.solve(directions)[0]

    def solve(self, directions: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return field (N,) [rad], postures (N, J) and whether they reach (N,) for unit vectors (N, 3)."""
        margin = np.full(len(directions), -SIGHT)
        q = np.zeros((len(directions), self.workspace.chain.n_joints))
        reached = np.zeros(len(directions), dtype=bool)
        near = (
            np.flatnonzero(directions @ self.front > np.cos(SIGHT))
            if len(self.workspace.postures)
            else np.zeros(0, int)
        )
        if len(near):
            seeds = (
                self.postures[self._solved[self._nearest_solved(directions[near])]]
                if len(self._solved)
                else None
            )
            margin[near], q[near], reached[near] = _ask(self, directions[near], seeds)
        return margin, q, reached

    @cached_property
    def _solved(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.is_solved)

    def _nearest_solved(self, directions: Array) -> NDArray[np.intp]:
        return np.argmax(directions @ self.grid.vertices[self._solved].T, axis=1)

    def as_level_set(self) -> LevelSet:
        """Return the field as a level set in the axes of the workspace."""
        return LevelSet(self.grid, self.margin, self.compute_margin)


@lru_cache(maxsize=48)
def compute_contactable(
    workspace: Workspace,
    limits: ContactLimits,
    home: tuple[float, float, float],
    center: tuple[float, float, float],
    distance: float,
) -> LevelSet:
    """Return CWS_i, in the axes of the workspace, of the finger with ``workspace`` and its tip at ``home`` [m] when at home.

    The object is a sphere about ``center`` [m]; a touching tip's centre is ``distance`` [m] away from it.  The last are kept.
    """
    grid = build_icosphere(COARSE)
    front = np.subtract(home, center)
    front = read_only(front / np.linalg.norm(front))
    chain = workspace.chain
    field = Contactable(
        build_icosphere(FINE), workspace, limits, read_only(center), front, distance,
        np.zeros(0), np.zeros((0, chain.n_joints)), np.zeros(0, dtype=bool),
    )  # fmt: skip
    off = SIGHT - np.arccos(np.clip(grid.vertices @ front, -1.0, 1.0))
    margin, q = off.copy(), np.zeros((len(off), chain.n_joints))
    solved, exact = np.zeros(len(off), dtype=bool), off < -2.0 * grid.spacing
    ask = np.flatnonzero(~exact) if len(workspace.postures) else np.zeros(0, dtype=np.intp)
    if not len(ask):
        margin = np.minimum(margin, -SIGHT)
        exact[:] = True
    else:
        margin[ask], q[ask], solved[ask] = _ask(field, grid.vertices[ask], None)
        exact[ask] = True
    for level in range(COARSE + 1, FINE + 1):
        grid = build_icosphere(level)
        a, b = grid.parents.T
        joined = solved[a] & solved[b] & (np.abs(q[a] - q[b]).max(axis=1) < _JUMP)
        middle = np.where(joined[:, None], 0.5 * (q[a] + q[b]), np.where(solved[a, None], q[a], q[b]))
        seeded = np.concatenate([solved, solved[a] | solved[b]])
        margin, q = grid.extend(margin), np.concatenate([q, middle])
        solved = np.concatenate([solved, np.zeros(len(a), dtype=bool)])
        exact = np.concatenate([exact, np.zeros(len(a), dtype=bool)])
        far = grid.vertices @ front < np.cos(SIGHT + 2.0 * grid.spacing)
        for _ in range(4):
            values = margin[grid.triangles]
            crossed = (values.min(axis=1) < NEAR) & (values.max(axis=1) > -NEAR)
            wanted = np.zeros(len(margin), dtype=bool)
            wanted[grid.triangles[crossed]] = True
            ask = np.flatnonzero(wanted & ~exact & ~far)
            if not len(ask) or not len(workspace.postures):
                break
            with_seed = seeded[ask]
            for rows, seeds in ((ask[with_seed], q[ask[with_seed]]), (ask[~with_seed], None)):
                if len(rows):
                    margin[rows], q[rows], solved[rows] = _ask(field, grid.vertices[rows], seeds)
            exact[ask] = True
    return Contactable(
        grid, workspace, limits, field.center, front, distance, read_only(margin), read_only(q), solved
    ).as_level_set()


def _ask(
    field: Contactable, directions: Array, seeds: Array | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return field (N,), postures (N, J) and whether they reach (N,), starting from ``seeds`` or the nearest samples."""
    chain, limits = field.workspace.chain, field.limits
    off = SIGHT - np.arccos(np.clip(directions @ field.front, -1.0, 1.0))
    if not chain.has_tip_roll:
        X = compute_aligned_pose(field.center, directions, field.distance)
        q, reached = field.workspace.solve(X)
        dexterity = compute_dexterity(chain, q)
    else:
        tips = field.center + field.distance * directions
        if seeds is None:
            seeds = field.workspace.find_seeds(tips, -directions)
        q, reached, dexterity = solve_pointing(chain, tips, -directions, seeds)
        q = wrap_to_limits(chain, q)
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    margin = np.minimum(compute_joint_margin(chain, q) - limits.joint_margin, dexterity - limits.dexterity)
    # Beyond the last posture the dexterity counts as zero: what is not reached lies behind a singular posture.
    margin = np.where(reached, margin, -max(limits.dexterity, 0.05))
    return np.minimum(margin, off), q, reached


def solve_pointing(
    chain: Chain,
    positions: Array,
    poles: Array,
    q_start: Array,
    *,
    iterations: int = 12,
    tolerance: float = 1e-4,
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Return postures (N, J) whose tips are at ``positions`` (N, 3) [m] with poles (N, 3), whether reached (N,), dexterity (N,).

    For chains of six joints whose last turns the tip about its pole: the spin is left as it comes out.  Newton steps from
    ``q_start`` (N, J), one more after the error (radians, and metres in units of ``LENGTH``) has fallen below ``tolerance``:
    what is then left is its square.  The dexterity is that of the posture before this last step.
    """
    q = np.array(q_start, dtype=np.float64)
    reached, dexterity = np.zeros(len(q), dtype=bool), np.zeros(len(q))
    active = np.arange(len(q))
    for _ in range(iterations):
        z, p, J = _walk(chain, q[active])
        goal = poles[active]
        error = np.empty((len(active), 6))
        error[:, :3] = (positions[active] - p) / LENGTH
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            error[:, 3 + k] = z[:, m] * goal[:, n] - z[:, n] * goal[:, m]
        done = (np.abs(error).max(axis=1) < tolerance) & ((z * goal).sum(axis=1) > 0.0)
        try:
            # The last joint takes up whatever spin the others bring about.
            move = np.linalg.solve(J, error[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError:  # some posture is exactly singular
            JT = J.swapaxes(1, 2)
            move = np.linalg.solve(JT @ J + IK_DAMPING * np.eye(6), JT @ error[:, :, None])[:, :, 0]
        longest = np.abs(move).max(axis=1, keepdims=True)
        q[active] += move * np.minimum(1.0, IK_MAX_STEP / np.maximum(longest, 1e-12))
        if done.any():
            rows = active[done]
            reached[rows] = True
            squares = np.linalg.eigvalsh(J[done] @ J[done].swapaxes(1, 2))
            dexterity[rows] = np.sqrt(np.maximum(squares[:, 0], 0.0))
            active = active[~done]
            if not len(active):
                break
    return q, reached, dexterity


def _walk(chain: Chain, q: Array) -> tuple[Array, Array, Array]:
    """Return poles (N, 3), tip centres (N, 3) [m] and Jacobians (N, 6, J) with lengths in units of ``LENGTH``."""
    count, joints = q.shape
    # Columns of the rotation, each (3, N): joint frames keep their z along the hinge, so that a turn mixes two columns.
    A = np.empty((3, 3, count))
    A[:] = np.eye(3)[:, :, None]
    p = np.zeros((3, count))
    axes, arms = np.empty((joints, 3, count)), np.empty((joints, 3, count))
    cosine, sine = np.cos(q.T), np.sin(q.T)
    for j, step in enumerate(_align(chain)):
        # Three rows turn the frame, the fourth carries its origin along.
        moved = (step @ A.reshape(3, -1)).reshape(4, 3, count)
        p += moved[3]
        if j < joints:
            c, s = cosine[j], sine[j]
            A = moved[:3]
            turned = c * A[0] + s * A[1]
            A[1] = c * A[1] - s * A[0]
            A[0] = turned
            axes[j], arms[j] = A[2], p
    np.subtract(p, arms, out=arms)
    arms /= LENGTH
    J = np.empty((count, 6, joints))
    J[:, 3:] = axes.transpose(2, 1, 0)
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        J[:, k] = (axes[:, m] * arms[:, n] - axes[:, n] * arms[:, m]).T
    return moved[2].T, p.T, J


@lru_cache(maxsize=64)
def _align(chain: Chain) -> tuple[Array, ...]:
    """Return each joint frame, z along its hinge, in the one before: axes and origin as rows (4, 3); the tip's comes last."""
    steps, undo = [], np.eye(3)
    for offset, axis in zip(chain.offsets, chain.axes, strict=True):
        turn = _turn_to(axis)
        steps.append(np.vstack([(undo @ offset[:3, :3] @ turn).T, undo @ offset[:3, 3]]))
        undo = turn.T
    steps.append(np.vstack([(undo @ chain.X_JF[:3, :3]).T, undo @ chain.X_JF[:3, 3]]))
    return tuple(steps)


def _turn_to(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is the unit ``axis`` (3,)."""
    v = np.cross([0.0, 0.0, 1.0], axis)
    c = float(axis[2])
    if c < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    K = hat(v)
    return np.asarray(np.eye(3) + K + K @ K / (1.0 + c))
