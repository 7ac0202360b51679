"""How a fingertip rolls: along great circles of a ball in closed form, along geodesics of any body by integration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from dexplan.contact.kinematics.coordinates import ContactCoordinates, compute_relative_pose
from dexplan.contact.kinematics.integration import integrate_legs
from dexplan.contact.rolling.path import RollingPath, join_paths
from dexplan.contact.rolling.turning import any_tangent, build_turn, make_tangent
from dexplan.contact.surfaces.surface import AbstractSurface
from dexplan.errors import spell_apart
from dexplan.spatial import Array

__all__ = [
    "RollingPath",
    "join_paths",
    "roll_along",
    "roll_over",
    "roll_turning",
    "solve_two_finger_goals",
    "split_start",
]

_TOUCHING = 0.01  # of the sum of the radii: what a start may be off before it is no contact
_ANTIPODAL = 1e-9

SAMPLES = 201
"""Samples of a path unless told otherwise."""


def roll_along(
    tip_radius: float,
    object_radius: float,
    X_OF_start: ArrayLike,
    waypoints: ArrayLike,
    samples: int = SAMPLES,
) -> RollingPath:
    """Roll a spherical tip on a ball along great circles through ``waypoints``, closed form.

    Along a leg of length s about the axis a, the contact turns by s / R on the ball, the tip by s / R + s / r in space, and
    the contact by s / r on the tip: great circles both (Theory 2) [paper §3].

    Args:
        tip_radius: r [m].
        object_radius: R [m].
        X_OF_start: (4, 4) pose of the tip touching the ball; a start that is up to 1 % of r + R off is moved along the
            normal until it touches.
        waypoints: (M, 3) directions from the ball's centre, in O, to go to one after the other; M >= 1.
        samples: about how many samples K; every waypoint is one of them.

    Raises:
        ValueError: the tip does not touch, or a waypoint is opposite the one before, where all ways are as long.
    """
    R_OF, n = split_start(tip_radius, object_radius, X_OF_start)
    axes, lengths = [], []
    for goal in np.asarray(waypoints, dtype=np.float64).reshape(-1, 3):
        if not (np.all(np.isfinite(goal)) and goal.any()):
            raise ValueError(f"waypoint {goal} is no direction; finite vectors other than zero are accepted")
        goal = goal / np.linalg.norm(goal)
        cross = np.cross(n, goal)
        sine = float(np.linalg.norm(cross))
        if sine < _ANTIPODAL and n @ goal < 0.0:
            raise ValueError("a waypoint is opposite the one before; one more between them is accepted")
        axes.append(cross / sine if sine > 0.0 else any_tangent(n))
        lengths.append(object_radius * float(np.arctan2(sine, n @ goal)))
        n = goal
    return _roll_legs(tip_radius, object_radius, X_OF_start, axes, lengths, samples, R_OF)


def roll_turning(
    tip_radius: float,
    object_radius: float,
    X_OF_start: ArrayLike,
    heading_O: ArrayLike,
    turns: Sequence[float],
    lengths: Sequence[float],
    samples: int = SAMPLES,
) -> RollingPath:
    """Roll a spherical tip on a ball in legs along great circles, each after a turn, closed form.

    Args:
        tip_radius: r [m].
        object_radius: R [m].
        X_OF_start: (4, 4) pose of the tip touching the ball, as in :func:`roll_along`.
        heading_O: (3,) direction in O whose tangential part is the heading before the first turn.
        turns: (L,) [rad] to the left, seen from outside the ball, before each leg.
        lengths: (L,) [m], not negative.
        samples: about how many samples K; every corner is one of them.

    Raises:
        ValueError: the tip does not touch, or the heading is along the normal.
    """
    R_OF, n = split_start(tip_radius, object_radius, X_OF_start)
    h = make_tangent(n, heading_O)
    axes = []
    for turn, length in zip(turns, lengths, strict=True):
        h = build_turn(n, turn) @ h
        axis = np.cross(n, h)
        axes.append(axis)
        go = build_turn(axis, length / object_radius)
        n, h = go @ n, go @ h
    return _roll_legs(tip_radius, object_radius, X_OF_start, axes, list(lengths), samples, R_OF)


def roll_over(
    tip: AbstractSurface,
    body: AbstractSurface,
    start: ContactCoordinates,
    heading_O: ArrayLike,
    turns: Sequence[float],
    lengths: Sequence[float],
    steps: int = SAMPLES,
) -> RollingPath:
    """Roll any tip on any body in legs along geodesics, each after a turn, by integration (sixth order in 1 / steps).

    Args:
        tip: surface of F.
        body: surface of O.
        start: one contact (shape ()).
        heading_O: (3,) direction in O whose tangential part is the heading before the first turn.
        turns: (L,) [rad] to the left, seen from outside the body, before each leg.
        lengths: (L,) [m].
        steps: Runge-Kutta steps, and samples, per leg.

    Raises:
        ValueError: more than one contact, steps too long, or contact along a line (see ``integrate_legs``).
    """
    if start.shape != ():
        raise ValueError(
            f"a path of {start.shape} contacts; one contact is accepted, and integrate_legs takes many"
        )
    at, rolled = integrate_legs(tip, body, start, heading_O, turns, lengths, steps)
    on_f = tip.geometry(at.u_f, at.v_f, at.chart_f)
    on_o = body.geometry(at.u_o, at.v_o, at.chart_o)
    return RollingPath(
        n_O=on_o.normal,
        n_F=on_f.normal,
        X_OF=compute_relative_pose(tip, body, at),
        p_O=on_o.point,
        p_F=on_f.point,
        length=rolled,
        corners=steps * np.arange(len(turns) + 1),
    )


def solve_two_finger_goals(n_1: ArrayLike, n_2: ArrayLike, angle_min: float) -> tuple[Array, Array]:
    """Return where two contacts on a ball have to roll to form a two-finger grasp, the shortest way [paper §3, figure 1].

    Contacts at a central angle phi < phi_min each move (phi_min - phi) / 2 along their great circle towards each other's
    opposite point; the sum of both ways is the least, and so is the longer one.  Contacts that grasp already stay.

    Args:
        n_1: direction (3,) of the first contact from the ball's centre, in O.
        n_2: of the second.
        angle_min: central angle phi_min that closes the grasp [rad], pi - 2 atan(mu), with whatever margin is wanted; at
            most pi.

    Raises:
        ValueError: both contacts are in the same place, where no great circle is distinguished.
    """
    a, b = (np.asarray(n, dtype=np.float64) / np.linalg.norm(n) for n in (n_1, n_2))
    if not 0.0 < angle_min <= np.pi:
        raise ValueError(f"smallest central angle is {angle_min} rad; more than 0 and at most pi is accepted")
    cross = np.cross(a, b)
    sine = float(np.linalg.norm(cross))
    move = 0.5 * (angle_min - np.arctan2(sine, a @ b))
    if move <= 0.0:
        return a, b
    if sine < _ANTIPODAL:
        raise ValueError(
            "both contacts are in the same place; contacts on a common great circle are accepted"
        )
    return build_turn(cross / sine, -move) @ a, build_turn(cross / sine, move) @ b


def split_start(tip_radius: float, object_radius: float, X_OF_start: ArrayLike) -> tuple[Array, Array]:
    """Return the tip's rotation (3, 3) and the outward normal (3,) of the contact; raises ValueError without contact."""
    X = np.asarray(X_OF_start, dtype=np.float64)
    reach, distance = tip_radius + object_radius, float(np.linalg.norm(X[:3, 3]))
    if not abs(distance - reach) <= _TOUCHING * reach:
        given, touches = spell_apart(1e3 * distance, 1e3 * reach)
        raise ValueError(
            f"the tip's centre is {given} mm from the ball's; {touches} mm touches, 1 % off is accepted"
        )
    return X[:3, :3], X[:3, 3] / distance


def _roll_legs(
    tip_radius: float,
    object_radius: float,
    X_OF_start: ArrayLike,
    axes: Sequence[Array],
    lengths: Sequence[float],
    samples: int,
    R_OF: Array,
) -> RollingPath:
    """Return the path of legs about axes (3,) in O, each perpendicular to the normal where it starts."""
    if not lengths:
        raise ValueError("a path without a leg; one waypoint or leg, or more, is accepted")
    if not all(length >= 0.0 for length in lengths):
        raise ValueError(f"leg lengths are {lengths} m; lengths that are not negative are accepted")
    _, n = split_start(tip_radius, object_radius, X_OF_start)
    total = max(float(np.sum(lengths)), 1e-300)
    normals, turns, rolled, corners = [n[None]], [R_OF[None]], [np.zeros(1)], [0]
    for axis, length in zip(axes, lengths, strict=True):
        count = max(1, round((samples - 1) * length / total))
        s = length * np.arange(1, count + 1) / count
        normals.append(build_turn(axis, s / object_radius) @ n)
        turns.append(build_turn(axis, s / object_radius + s / tip_radius) @ R_OF)
        rolled.append(rolled[-1][-1] + s)
        corners.append(corners[-1] + count)
        n, R_OF = normals[-1][-1], turns[-1][-1]
    n_O, R = np.concatenate(normals), np.concatenate(turns)
    n_F = -np.einsum("kji,kj->ki", R, n_O)
    X = np.zeros((len(n_O), 4, 4))
    X[:, :3, :3], X[:, :3, 3], X[:, 3, 3] = R, (tip_radius + object_radius) * n_O, 1.0
    return RollingPath(
        n_O=n_O,
        n_F=n_F,
        X_OF=X,
        p_O=object_radius * n_O,
        p_F=tip_radius * n_F,
        length=np.concatenate(rolled),
        corners=np.array(corners),
    )
