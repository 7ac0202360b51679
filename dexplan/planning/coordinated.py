"""Coordinated object manipulation: the object moves, all contacts stay where they are on it [paper §1; MLS 1994, ch. 5]."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dexplan.brief import brief_repr
from dexplan.planning.admissible import (
    Admissibility,
    FingerState,
    Margins,
    compute_finger_states,
    worst,
)
from dexplan.planning.following import follow_tip
from dexplan.planning.goal import VERTICAL
from dexplan.planning.hand import HandModel
from dexplan.planning.legs import SHIFT_STEP, STEP
from dexplan.planning.plan import MUST, MUST_NOT, Action, Placement, PlannedPhase
from dexplan.planning.still import spin_tip
from dexplan.spatial import Array, rotate_about


@dataclass(frozen=True, eq=False)
class ObjectMotion:
    """A turn of the object by ``angle`` [rad] about the unit world axis ``axis_W`` (3,) with a straight ``shift_W`` (3,) [m]."""

    X_WO_start: Array
    axis_W: Array
    angle: float
    shift_W: Array

    __repr__ = brief_repr

    @property
    def is_still(self) -> bool:
        """Whether nothing moves."""
        return abs(self.angle) < 1e-9 and not np.any(self.shift_W)

    def poses(self, count: int | None = None) -> Array:
        """Return the object's poses (K, 4, 4) at evenly spaced progress, ``count`` of them or as near as checks need them."""
        if count is None:
            steps = max(abs(self.angle) / STEP, float(np.linalg.norm(self.shift_W)) / SHIFT_STEP)
            count = max(3, int(np.ceil(steps)) + 1)
        share = np.linspace(0.0, 1.0, count)
        X = np.tile(self.X_WO_start, (count, 1, 1))
        X[:, :3, :3] = rotate_about(self.axis_W, share * self.angle) @ self.X_WO_start[:3, :3]
        X[:, :3, 3] += share[:, None] * self.shift_W
        return X

    @property
    def X_WO_end(self) -> Array:
        """The pose (4, 4) at the end."""
        return self.poses(2)[-1]

    def part(self, first: float, last: float) -> ObjectMotion:
        """Return the motion between two shares of its progress."""
        start = ObjectMotion(self.X_WO_start, self.axis_W, first * self.angle, first * self.shift_W).X_WO_end
        return ObjectMotion(start, self.axis_W, (last - first) * self.angle, (last - first) * self.shift_W)


def rest_at(X_WO: Array) -> ObjectMotion:
    """Return no motion, at ``X_WO`` (4, 4)."""
    return ObjectMotion(X_WO, VERTICAL, 0.0, np.zeros(3))


def follow_object(hand: HandModel, placement: Placement, X_WO: Array) -> tuple[Array, str]:
    """Return the postures (L, J) of a finger whose contact is carried through object poses (K, 4, 4), and what stops it.

    Joint limits are not looked at here; ``placement.q`` is the posture at the first pose.
    """
    description = hand.fingers[placement.finger]
    X_WF = X_WO @ placement.X_OF
    q = follow_tip(description.chain, X_WF, placement.q)
    if len(q) < len(X_WF):
        return q, f"{description.name} comes to the end of its workspace"
    return q, ""


def center_spin(hand: HandModel, placement: Placement, motion: ObjectMotion) -> Placement:
    """Return the landing with its spin chosen so that the tip's own joint stays around the middle of its range on the motion.

    ``placement`` stands where the motion begins.
    """
    chain = hand.fingers[placement.finger].chain
    if not chain.has_tip_roll or motion.is_still:
        return placement
    q, _ = follow_object(hand, placement, motion.poses())
    middle = 0.5 * (chain.lower[-1] + chain.upper[-1])
    return spin_tip(hand, placement, float(middle - 0.5 * (q[:, -1].min() + q[:, -1].max())))


def judge_carry(
    hand: HandModel,
    admissibility: Admissibility,
    states: dict[int, list[FingerState]],
    motion: ObjectMotion,
    poses: Array,
) -> tuple[list[Margins], str]:
    """Return the margins at ``poses`` (K, 4, 4) of a motion, fingers in ``states`` (K of each) holding; and the first refusal."""
    axis = np.sign(motion.angle) * motion.axis_W if abs(motion.angle) > 1e-9 else None
    rows: list[Margins] = []
    for k, X_WO in enumerate(poses):
        now = {finger: way[k] for finger, way in states.items()}
        q = hand.q_home
        for finger, state in now.items():
            q[finger] = state.q
        row = admissibility.compute_margins_of(now, q, X_WO, axis_W=axis, explain=False)
        if not row.is_admissible:
            return rows, row.refusal
        rows.append(row)
    return rows, ""


def plan_coordinated(
    hand: HandModel,
    admissibility: Admissibility,
    contacts: tuple[Placement | None, ...],
    motion: ObjectMotion,
    why: str,
) -> tuple[Action | None, str]:
    """Return the action that carries the object through ``motion`` with all ``contacts`` fixed, or why that is not possible."""
    poses = motion.poses()
    ways = {}
    for c in contacts:
        if c is None:
            continue
        ways[c.finger], refusal = follow_object(hand, c, poses)
        if refusal:
            return None, refusal
    states = {f: compute_finger_states(hand, f, way) for f, way in ways.items()}
    rows, refusal = judge_carry(hand, admissibility, states, motion, poses)
    if refusal:
        return None, refusal
    action = Action(
        kind="move_object",
        finger=None,
        grasping=tuple(sorted(ways)),
        X_WO_start=motion.X_WO_start,
        X_WO_end=poses[-1],
        axis_W=motion.axis_W,
        angle=motion.angle,
        contacts_end=tuple(None if c is None else replace(c, q=ways[c.finger][-1]) for c in contacts),
        phases=(PlannedPhase("move", tuple(MUST_NOT if c is None else MUST for c in contacts)),),
        why=why,
        margins=worst(rows),
    )
    return action, ""
