"""Moving the object on rolling contacts: the tips turn less than the object does, and so reach further.

A fingertip that is carried with the object turns with it.  One that does not turn at all rolls backwards on the object, and its
contact goes round in the world by only R / (R + r) of the object's turn [MLS 1994, ch. 5].  ``share`` lies between: 0 carries
the contacts fixed, 1 leaves the tips' attitude as it is but for the spin about the contact normal, which follows the object:
soft fingers roll, they do not pivot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility, Margins, worst
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.rolling.roll_gait import follow_roll
from dexplan.planning.rolling.rolls import end_placement
from dexplan.plans.actions import MoveObject
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.phases import PlannedPhase, demand_touch
from dexplan.plans.refusal import Refusal
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, rotate_about

STEP = float(np.radians(1.0))
"""The motion is checked this often [rad of the object's turn]."""


@dataclass(frozen=True, eq=False)
class RollingTurn:
    """A turn of the object on rolling contacts: as far as it goes, and what ends it (``limit`` is None at the wanted angle)."""

    action: MoveObject | None
    angle: float
    limit: Refusal | None
    limiting_finger: int | None
    margins: dict[str, float] = field(default_factory=dict)


def build_carry_roll(
    hand: HandModel, placement: Placement, axis_O: Array, angle: float, share: float, count: int
) -> TipRoll:
    """Return how a tip rolls on a ball that turns by ``angle`` [rad] about ``axis_O`` (3,), the unit axis in object axes.

    In the object the tip turns at ``w = -share (a - (a . n) n)`` per radian, which has no part along the normal, and the contact
    at ``k w x n`` with ``k = r / (R + r)``: round the axis at the constant rate ``-share k``.  Seen from a frame that goes round
    with it, n and w stand still, hence

        R_OF(x) = Rot(a, -share k x) Rot(w + share k a, x) R_OF(0).
    """
    n, r = placement.normal_O, hand.fingers[placement.finger].tip_radius
    R = float(np.linalg.norm(placement.point_O))
    k = r / (R + r)
    x = np.linspace(0.0, angle, count)
    w = -share * (axis_O - (axis_O @ n) * n)
    rest = w + share * k * axis_O
    rate = float(np.linalg.norm(rest))
    around = rotate_about(axis_O, -share * k * x)
    inner = rotate_about(rest / rate, rate * x) if rate > 1e-12 else np.broadcast_to(np.eye(3), (count, 3, 3))
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = around @ inner @ placement.X_OF[:3, :3]
    normals = around @ n
    X[:, :3, 3] = (R + r) * normals
    return TipRoll(placement.finger, X, normals)


def plan_rolling_turn(
    hand: HandModel,
    admissibility: Admissibility,
    X_WO: Array,
    contacts: Contacts,
    axis_W: Array,
    angle: float,
    share: float,
) -> RollingTurn:
    """Return the turn of the object about the unit world axis ``axis_W`` (3,), as near to ``angle`` [rad] as the grasp can.

    All fingers in ``contacts`` hold and roll, and every sampled instant is admissible.
    """
    count = max(3, int(np.ceil(abs(angle) / STEP)) + 1)
    axis_O = X_WO[:3, :3].T @ axis_W
    turned = np.tile(X_WO, (count, 1, 1))
    turned[:, :3, :3] = rotate_about(axis_W, np.linspace(0.0, angle, count)) @ X_WO[:3, :3]
    held = [c for c in contacts if c is not None]
    rolls = [build_carry_roll(hand, c, axis_O, angle, share, count) for c in held]
    ways, finger, last = {}, None, count - 1
    limit: Refusal | None = None
    for placement, roll in zip(held, rolls, strict=True):
        q, refusal = follow_roll(hand, turned, roll, placement.q)
        ways[placement.finger] = q
        if len(q) - 1 < last or (refusal and not limit):
            last, limit, finger = min(last, len(q) - 1), refusal, placement.finger
    rows: list[Margins] = []
    for k in range(last + 1):
        q = hand.q_home.copy()
        for i, way in ways.items():
            q[i] = way[k]
        row = admissibility.compute_margins(q, turned[k], tuple(sorted(ways)), axis_W=np.sign(angle) * axis_W)
        if not row.is_admissible:
            limit, finger, last = row.refusal, None, k - 1
            break
        rows.append(row)
    if last < 2:
        return RollingTurn(None, 0.0, limit, finger)
    cut = [TipRoll(roll.finger, roll.X_OF[: last + 1], roll.normal_O[: last + 1]) for roll in rolls]
    after = list(contacts)
    for placement, roll in zip(held, cut, strict=True):
        after[placement.finger] = end_placement(hand, roll, placement, ways[placement.finger][last])
    reached = float(angle * last / (count - 1))
    names = " and ".join(hand.fingers[c.finger].name for c in held)
    action = MoveObject(
        motion=ObjectMotion(X_WO, axis_W, reached, np.zeros(3)),
        grasping=tuple(sorted(ways)),
        contacts_end=tuple(after),
        phases=(PlannedPhase("move", demand_touch(contacts)),),
        why=f"{names} roll on the object while it turns" + (f", until {limit}" if limit else ""),
        limiting_finger=finger,
        limit=None if limit is None else str(limit),
        margins=worst(rows),
        rolls=tuple(cut),
    )
    return RollingTurn(action, reached, limit, finger, worst(rows))
