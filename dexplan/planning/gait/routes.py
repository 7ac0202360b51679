"""The ways that an object may take to its goal, as legs."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.planning.contacts.legs import Leg
from dexplan.plans.goal import RotationGoal
from dexplan.spatial import VERTICAL, Array, rotate_about


def build_routes(goal: RotationGoal, swings: tuple[Array, ...] = ()) -> list[tuple[Leg, ...]]:
    """Return the routes to try, in this order.

    1. straight there: one turn about the goal's axis.
    2. where the goal is an attitude: the other way round; about the vertical and then about a horizontal axis; the same two the
       other way round; about the vertical, about one of the horizontal axes ``swings`` (3,), and about the vertical again.

    Each of them shifts the object last, and first if that comes to nothing: all routes with the shift last come before those
    with the shift first.
    """
    turns = [[(goal.axis_W, goal.angle)]]
    if goal.is_attitude and abs(goal.angle) > 1e-9:
        turns.append([(goal.axis_W, goal.angle - np.copysign(2.0 * np.pi, goal.angle))])
        R = rotate_about(goal.axis_W, goal.angle)
        turns += _split_at_vertical(R) + [way for swing in swings for way in _split_at_swing(R, swing)]
    orders = ("last", "first") if np.any(goal.shift_W) else ("none",)
    return [_build_legs(goal, way, order) for order in orders for way in turns]


def list_swings(homes: Array) -> tuple[Array, ...]:
    """Return horizontal axes (3,) about which the object turns easily: chords of pairs of fingers with tips ``homes`` (F, 3)."""
    swings = []
    for i in range(len(homes)):
        for j in range(i + 1, len(homes)):
            chord = (homes[j] - homes[i]) * [1.0, 1.0, 0.0]
            if np.linalg.norm(chord) > 1e-9:
                swings.append(chord / np.linalg.norm(chord))
    return tuple(swings)


def build_detours(goal: RotationGoal, axis_W: Array, angle: float) -> list[tuple[Leg, ...]]:
    """Return routes to the goal on which the object first turns by ``angle`` [rad] about the unit ``axis_W`` (3,).

    Where the goal is an attitude they go on from there; else the turn asked for comes next, and what was turned first is undone,
    never the other way round: that would make the turn about the goal's axis a whole one more, or less.
    """
    legs = [Leg(goal.X_WO_start, axis_W, angle)]
    if not goal.is_attitude:
        legs.append(Leg(legs[0].X_WO_end, goal.axis_W, goal.angle))
    rest = RotationGoal.from_attitude(legs[-1].X_WO_end, goal.X_WO_goal[:3, :3], goal.shift_W)
    routes = build_routes(rest)
    if not goal.is_attitude:
        routes = [route for route in routes if all(abs(leg.angle) <= np.pi for leg in route)]
    return [(*legs, *route) for route in routes]


def _build_legs(goal: RotationGoal, turns: list[tuple[Array, float]], shift: str) -> tuple[Leg, ...]:
    legs: list[Leg] = []
    X = goal.X_WO_start
    if shift == "first":
        legs.append(Leg(X, VERTICAL, 0.0, goal.shift_W))
        X = legs[-1].X_WO_end
    for axis, angle in turns:
        if abs(angle) > 1e-9:
            legs.append(Leg(X, axis, angle))
            X = legs[-1].X_WO_end
    if shift == "last":
        legs.append(Leg(X, VERTICAL, 0.0, goal.shift_W))
    return tuple(legs) or (Leg(X, goal.axis_W),)


def _split_at_vertical(R: Array) -> list[list[tuple[Array, float]]]:
    """Return R (3, 3) as a turn about the vertical followed by a tilt about a horizontal axis, and the other way round."""
    tilt = np.cross(VERTICAL, R @ VERTICAL)
    angle = float(np.arctan2(np.linalg.norm(tilt), VERTICAL @ R @ VERTICAL))
    if min(angle, np.pi - angle) < 1e-6:
        return []
    axis = tilt / np.linalg.norm(tilt)
    twist = Rotation.from_matrix(rotate_about(axis, -angle) @ R).as_rotvec()[2]
    back = rotate_about(VERTICAL, -twist) @ axis
    return [[(VERTICAL, float(twist)), (axis, angle)], [(back, angle), (VERTICAL, float(twist))]]


def _split_at_swing(R: Array, swing: Array) -> list[list[tuple[Array, float]]]:
    """Return R (3, 3) as turns about the vertical, about ``swing`` and about the vertical again; both choices of the middle."""
    frame = np.stack([swing, np.cross(VERTICAL, swing), VERTICAL], axis=1)
    # In this frame the swing is about x: R = Rz(a) Rx(b) Rz(c).
    E = frame.T @ R @ frame
    tilt = float(np.arctan2(np.hypot(E[0, 2], E[1, 2]), E[2, 2]))
    if min(tilt, np.pi - tilt) < 1e-6:
        return []
    ways = []
    for b in (tilt, -tilt):
        a = np.arctan2(np.sign(b) * E[0, 2], -np.sign(b) * E[1, 2])
        c = np.arctan2(np.sign(b) * E[2, 0], np.sign(b) * E[2, 1])
        ways.append([(VERTICAL, float(c)), (swing, b), (VERTICAL, float(a))])
    return ways
