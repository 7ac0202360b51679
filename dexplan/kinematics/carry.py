"""How far one finger carries a contact while the object moves: fixed on the body, or rolling over it.

A finger with six joints can keep its tip's pose on the object: the contact stays where it is.  With fewer joints it cannot follow
every turn; the tip, a sphere, then **rolls** on the body, and turns about the normal (*pivots*) where its joints leave no choice.
Both are asked the same question here and answer with the same value, so that a search need not know which hand it plans for.

The rule of rolling is that the two surfaces do not slide on each other at the contact::

    J_c qdot = v + w x r        J_c = J_v + r_tip [n]x J_w

with the tip's Jacobian (J_v, J_w), the outward normal n, and the twist (v, w) of the object.  Three joints are determined by
these three rows.  What more joints leave free is used to turn the tip as the object turns, as far as that goes: with six
independent ones the tip then does not roll at all and the fixed contact is the special case [BODIES: "Method"].
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.kinematics.chain import (
    Chain,
    compute_joint_margin,
    compute_tip_jacobian,
    compute_tip_motion,
    compute_tip_pose,
    solve_ik,
    wrap_near,
)
from dexplan.spatial import Array, hat, lock_arrays

STEP = float(np.radians(0.5))
"""Longest turn of the object in one step of the integration [rad]; with it a carry of 90 deg slides less than a micrometre."""
STRIDE = 5e-4
"""Longest shift of the object in one step of the integration [m]."""
SINGULAR = 0.08
"""Smallest singular value of the contact's rows, in metres per radian over 60 mm, below which joints turn too fast."""
_LENGTH = 0.06  # a length of 60 mm counts as one radian, as everywhere in this room
_REACHED = 1e-5  # a tip that is farther from where it should be [m] has left its workspace


class CarryEnd(Enum):
    """Why a carry ends."""

    GOAL = "the end of the way"
    JOINT = "a joint comes near its limit"
    POLE = "the contact leaves the part of the tip that may touch"
    EDGE = "the contact comes near an edge of the body"
    SINGULAR = "the finger comes near a singular posture"
    REACH = "the way leads out of the finger's workspace"
    PIVOT = "the tip would turn too far about the normal"


@dataclass(frozen=True, eq=False)
class Carrier:
    """A finger as it carries: its ``chain``, ``tip_radius`` [m], and what it may.

    ``joint_margin`` [rad] to every limit; ``polar_limit`` [rad], the largest angle of the contact from the tip's pole;
    ``edge_band`` [m] of the body that stays free; ``pivot_limit`` [rad], the largest turn about the normal in one carry.
    """

    chain: Chain
    tip_radius: float
    joint_margin: float = 0.0
    polar_limit: float = 0.5 * np.pi
    edge_band: float = 0.0
    pivot_limit: float = np.inf

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class Carried:
    """N contacts of one finger at K poses of the object.

    ``q`` (K, N, J) [rad]; ``p_O``, ``n_O`` (K, N, 3): contact point [m] and **outward** normal on the body, object axes;
    ``X_OF`` (K, N, 4, 4) the tip in the object; ``pivot`` (K, N) [rad], how far the tip has turned about the normal against the
    object, counted about the outward normal.  ``until`` (N,) is the last pose that is held within all limits, -1 where the first
    is not; rows after it repeat the last that could be computed.  ``ends`` (N,) says what ended each.
    """

    q: Array
    p_O: Array
    n_O: Array
    X_OF: Array
    pivot: Array
    until: NDArray[np.intp]
    ends: tuple[CarryEnd, ...]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def carry_fixed(carrier: Carrier, body: ConvexBody, q: Array, X_WO: Array) -> Carried:
    """Carry contacts whose tip poses stay fixed on the body, along poses of the object.

    Args:
        carrier: the finger, with six joints.
        body: the object's body.
        q: postures (N, J) [rad] that touch it at the first pose.
        X_WO: the object's poses (K, 4, 4), near enough to each other for Newton steps: a few degrees.
    """
    start = _touch(carrier, body, q, X_WO[0])
    rows, q_now, is_reached = [start], np.array(q, dtype=np.float64), np.ones(len(q), dtype=bool)
    reached = [is_reached]
    for pose in X_WO[1:]:
        solved, ok = solve_ik(carrier.chain, pose @ start.X_OF, q_now)
        is_reached = is_reached & ok
        q_now = np.where(is_reached[:, None], wrap_near(solved, q_now), q_now)
        rows.append(_Touch(q_now, start.p_O, start.n_O, start.X_OF, start.pivot))
        reached.append(is_reached)
    return _judge(carrier, body, X_WO, rows, np.array(reached))


def carry_rolling(
    carrier: Carrier, body: ConvexBody, q: Array, X_WO: Array, *, step: float = STEP
) -> Carried:
    """Carry contacts that roll on the body without sliding, along poses of the object; any number of joints from three on.

    Between two poses the object is taken to turn about a fixed axis while its origin moves in a straight line.  What a carry
    does depends on the way, not only on its ends: a contact that goes out and back has moved where the way enclosed an area.

    Args:
        carrier: the finger.
        body: the object's body.
        q: postures (N, J) [rad] that touch it at the first pose.
        X_WO: the object's poses (K, 4, 4).
        step: longest turn of the object [rad] in one step of the integration; a shift counts as in ``STRIDE`` per ``STEP``.

    Raises ValueError for a finger with fewer than three joints, which cannot follow a point.
    """
    if carrier.chain.n_joints < 3:
        raise ValueError(
            f"a finger with {carrier.chain.n_joints} joints cannot carry; three or more are accepted"
        )
    here = _touch(carrier, body, q, X_WO[0])
    rows, is_reached = [here], np.ones(len(q), dtype=bool)
    reached = [is_reached]
    for before, after in pairwise(X_WO):
        turn = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec()
        shift = after[:3, 3] - before[:3, 3]
        steps = max(np.linalg.norm(turn) / step, np.linalg.norm(shift) / (STRIDE * step / STEP))
        count = max(1, int(np.ceil(steps)))
        for k in range(count):
            poses = [_move(before, turn, shift, share / count) for share in (k, k + 0.5, k + 1.0)]
            here = _roll(carrier, body, here, (turn / count, shift / count), poses)
            gap = body.project(here.X_OF[:, :3, 3]).distance - carrier.tip_radius
            is_reached = is_reached & (np.abs(gap) < _REACHED)
        rows.append(here)
        reached.append(is_reached)
    return _judge(carrier, body, X_WO, rows, np.array(reached))


@dataclass(frozen=True, eq=False)
class _Touch:
    """N contacts at one pose, as in :class:`Carried`."""

    q: Array
    p_O: Array
    n_O: Array
    X_OF: Array
    pivot: Array

    def __post_init__(self) -> None:
        lock_arrays(self)


def _touch(carrier: Carrier, body: ConvexBody, q: Array, X_WO: Array, pivot: Array | None = None) -> _Touch:
    """Return where tips touch at postures ``q`` (N, J)."""
    X_OF = np.linalg.inv(X_WO) @ compute_tip_pose(carrier.chain, q)
    found = body.project(X_OF[:, :3, 3])
    return _Touch(
        np.array(q, dtype=np.float64),
        found.point,
        found.normal,
        X_OF,
        np.zeros(len(q)) if pivot is None else pivot,
    )


def _move(X_WO: Array, turn: Array, shift: Array, share: float) -> Array:
    """Return the pose after a share of a turn (3,) [rad] about the origin and of a shift (3,) [m], world axes."""
    X = X_WO.copy()
    X[:3, :3] = Rotation.from_rotvec(share * turn).as_matrix() @ X_WO[:3, :3]
    X[:3, 3] += share * shift
    return X


def _roll(
    carrier: Carrier, body: ConvexBody, here: _Touch, step: tuple[Array, Array], poses: list[Array]
) -> _Touch:
    """Return the contacts after one step (turn, shift) of the object, whose poses before, halfway and after are given."""
    half = here.q + 0.5 * _rate(carrier, body, here.q, poses[0], step).dq
    there = _rate(carrier, body, half, poses[1], step)
    q = here.q + there.dq
    # What rounding and curvature leave of the distance is taken out along the normal.
    for _ in range(2):
        X_WF, J = compute_tip_motion(carrier.chain, q)
        R_WO, p_WO = poses[2][:3, :3], poses[2][:3, 3]
        found = body.project((X_WF[:, :3, 3] - p_WO) @ R_WO)
        row = np.einsum("ni,nij->nj", found.normal @ R_WO.T, J[:, :3])
        gap = found.distance - carrier.tip_radius
        q = q - gap[:, None] * row / np.maximum(np.sum(row**2, axis=1, keepdims=True), 1e-12)
    return _touch(carrier, body, q, poses[2], here.pivot + there.pivot)


@dataclass(frozen=True, eq=False)
class _Step:
    """Joint steps ``dq`` (N, J) [rad] and turns ``pivot`` (N,) [rad] of the tips about the outward normal, for one step."""

    dq: Array
    pivot: Array

    def __post_init__(self) -> None:
        lock_arrays(self)


def _rate(carrier: Carrier, body: ConvexBody, q: Array, X_WO: Array, step: tuple[Array, Array]) -> _Step:
    """Return how the joints follow a small step of the object without sliding."""
    turn, shift = step
    X_WF, J = compute_tip_motion(carrier.chain, q)
    R_WO, p_WO = X_WO[:3, :3], X_WO[:3, 3]
    n = body.project((X_WF[:, :3, 3] - p_WO) @ R_WO).normal @ R_WO.T
    contact = X_WF[:, :3, 3] - carrier.tip_radius * n
    rows = J[:, :3] + carrier.tip_radius * hat(n) @ J[:, 3:]
    wanted = shift + np.cross(turn, contact - p_WO)
    inverse = np.linalg.pinv(rows / _LENGTH, rcond=1e-6)
    dq = (inverse @ (wanted / _LENGTH)[..., None])[..., 0]
    if carrier.chain.n_joints > 3:
        # In what is left free the tip turns with the object.
        free = np.eye(carrier.chain.n_joints) - inverse @ (rows / _LENGTH)
        spin = J[:, 3:] @ free
        missing = turn - (J[:, 3:] @ dq[..., None])[..., 0]
        dq = dq + (free @ np.linalg.pinv(spin, rcond=1e-6) @ missing[..., None])[..., 0]
    relative = (J[:, 3:] @ dq[..., None])[..., 0] - turn
    return _Step(dq, np.sum(relative * n, axis=1))


def _judge(
    carrier: Carrier, body: ConvexBody, X_WO: Array, rows: list[_Touch], reached: NDArray[np.bool_]
) -> Carried:
    """Return contacts with the first limit that each meets."""
    q, p_O, n_O, X_OF, pivot = (
        np.stack([getattr(row, name) for row in rows]) for name in ("q", "p_O", "n_O", "X_OF", "pivot")
    )
    chain = carrier.chain
    lean = np.arccos(np.clip(-np.sum(X_OF[..., :3, 2] * n_O, axis=-1), -1.0, 1.0))
    J = compute_tip_jacobian(chain, q)
    n_W = np.einsum("kij,knj->kni", X_WO[:, :3, :3], n_O)
    contact = (J[..., :3, :] + carrier.tip_radius * hat(n_W) @ J[..., 3:, :]) / _LENGTH
    tests = {
        CarryEnd.REACH: ~reached,
        CarryEnd.JOINT: compute_joint_margin(chain, q) < carrier.joint_margin,
        CarryEnd.POLE: lean > carrier.polar_limit + 1e-9,
        CarryEnd.EDGE: body.measure_edge_distance(p_O) < carrier.edge_band - 1e-12,
        CarryEnd.SINGULAR: np.linalg.svd(contact, compute_uv=False)[..., -1] < SINGULAR,
        CarryEnd.PIVOT: np.abs(pivot) > carrier.pivot_limit,
    }
    firsts = np.array([np.where(bad.any(axis=0), bad.argmax(axis=0), len(rows)) for bad in tests.values()])
    until = firsts.min(axis=0) - 1
    kinds = list(tests)
    ends = tuple(
        CarryEnd.GOAL if until[k] == len(rows) - 1 else kinds[int(firsts[:, k].argmin())]
        for k in range(q.shape[1])
    )
    return Carried(q, p_O, n_O, X_OF, pivot, until, ends)
