"""How far can each finger carry a contact while the object turns?  Tables of contact orbits around the axis of rotation.

A contact fixed on an object that turns about an axis travels a circle around that axis: its *orbit*, given by the polar angle
from the axis.  For every finger and orbit the inverse kinematics is solved at stations ``STEP`` apart; `carry` is then the
length of the run of stations through which the finger can take the contact.  For a sphere, which looks the same from every
side [paper §3: homogeneous with respect to rotation], one table serves all contacts on an orbit at all times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.hand import HandModel
from dexplan.scene.chain import compute_dexterity, compute_joint_margin
from dexplan.scene.workspace import Workspace
from dexplan.spatial import Array, build_frame, make_pose, read_only, rotate_about

STEP = float(np.radians(2.0))
"""Spacing of stations along an orbit, and of the samples at which a motion is checked [rad]."""
STATIONS = 180
_JUMP = 0.30
"""Joint steps between neighbouring stations beyond this mean another branch [rad]."""
_SIGHT = float(np.radians(80.0))
"""Directions farther than this from a finger's own are not tried."""


@dataclass(frozen=True, eq=False)
class Orbit:
    """One finger's contact going round the axis.

    Station k has the outward normal ``normals[k]`` (K, 3) and the tip pose ``X_WF[k]`` (K, 4, 4) at a reference spin that is
    carried along; ``q`` (K, J) are the postures, NaN out of reach.  Turning one way from station k the finger gets through
    ``carry[k]`` more stations, provided it landed with its tip spun by ``spin[k]`` [rad] about its pole from the reference;
    ``limit[k]`` says what ends it.
    """

    finger: int
    polar: float
    normals: Array
    X_WF: Array
    q: Array
    is_reached: NDArray[np.bool_]
    carry: NDArray[np.intp]
    spin: Array
    limit: tuple[str, ...]

    def posture(self, k: int, spin: float, roll_sign: float) -> Array:
        """Return the posture (J,) at station ``k`` with the tip spun by ``spin`` [rad]."""
        q = self.q[k % STATIONS].copy()
        q[-1] += roll_sign * spin
        return q


def build_orbits(
    hand: HandModel, axis_W: Array, center: Array, sense: int, orbits: list[tuple[int, float, float]]
) -> list[Orbit]:
    """Return the orbits (finger, polar angle [rad], azimuth of station 0 about the axis [rad]) around ``center`` (3,) [m].

    ``sense`` is +1 where the object turns positively about ``axis_W``, -1 otherwise: the direction of `carry`.
    """
    built: list[Orbit] = []
    for finger, workspace in enumerate(hand.workspaces):
        chosen = [(polar, start) for f, polar, start in orbits if f == finger]
        if not chosen:
            continue
        polars = np.array([c[0] for c in chosen])
        angles = np.array([c[1] for c in chosen])[:, None] + STEP * np.arange(STATIONS)
        normals, X_WF = _build_poses(hand, finger, axis_W, center, polars, angles)
        q, ok, why = _solve(hand, finger, workspace, center, normals, X_WF)
        for row, polar in enumerate(polars):
            carry, spin, limit = _measure_runs(hand, finger, q[row], ok[row], why[row], sense)
            built.append(
                Orbit(
                    finger,
                    float(polar),
                    read_only(normals[row]),
                    read_only(X_WF[row]),
                    read_only(q[row]),
                    ok[row],
                    carry,
                    read_only(spin),
                    limit,
                )
            )
    return built


def _build_poses(
    hand: HandModel, finger: int, axis_W: Array, center: Array, polars: Array, angles: Array
) -> tuple[Array, Array]:
    """Return normals (M, K, 3) and reference tip poses (M, K, 4, 4), poles along the inward normals, carried around the axis."""
    frame = build_frame(axis_W)
    turns = rotate_about(axis_W, angles)
    surface, radius = hand.object.surface, hand.fingers[finger].tip_radius
    normals = np.empty((*angles.shape, 3))
    X = np.zeros((*angles.shape, 4, 4))
    X[..., 3, 3] = 1.0
    for row, polar in enumerate(polars):
        first = np.cos(polar) * frame[:, 2] + np.sin(polar) * frame[:, 0]
        reach = np.linalg.norm(surface.closest(first)) + radius
        normals[row] = turns[row] @ first
        X[row, :, :3, :3] = turns[row] @ build_frame(-first)
        X[row, :, :3, 3] = center + reach * normals[row]
    return normals, X


def _solve(
    hand: HandModel, finger: int, workspace: Workspace, center: Array, normals: Array, X_WF: Array
) -> tuple[Array, NDArray[np.bool_], list[list[str]]]:
    """Return postures (M, K, J), which stations the finger can hold (M, K), and why not where it cannot."""
    description, limits = hand.fingers[finger], hand.limits
    home = description.pose_at(description.q_home)[:3, 3] - center
    near = normals @ (home / np.linalg.norm(home)) > np.cos(_SIGHT)
    q = np.full((*near.shape, description.chain.n_joints), np.nan)
    ok = np.zeros(near.shape, dtype=bool)
    reason = np.full(near.shape, "the end of its workspace", dtype=object)
    if near.any() and len(workspace.postures):
        solved, reached = workspace.solve(X_WF[near])
        fixed = solved[:, :-1] if description.chain.has_tip_roll else solved
        lower, upper = description.chain.lower[: fixed.shape[1]], description.chain.upper[: fixed.shape[1]]
        room = np.minimum(fixed - lower, upper - fixed)
        inside = room.min(axis=1) >= limits.joint_margin
        away = compute_dexterity(description.chain, solved) >= limits.dexterity
        fine = reached & inside & away
        q[near], ok[near] = solved, fine
        texts = np.array(
            [f"the limit of {name.split('/')[-1]}" for name in description.joint_names], dtype=object
        )
        why = np.where(away, texts[room.argmin(axis=1)], "a singular posture")
        reason[near] = np.where(reached, why, "the end of its workspace")
        for row, k in np.argwhere(ok):
            clearance, names = _clear_alone(hand, finger, q[row, k], center)
            if clearance < limits.clearance:
                ok[row, k], reason[row, k] = False, f"{names} too near"
    return q, ok, [list(row) for row in reason]


def _clear_alone(hand: HandModel, finger: int, q: Array, center: Array) -> tuple[float, str]:
    """Return the clearance of one finger touching the object, all others at home; its own tip's spin does not matter."""
    posture = hand.q_home
    posture[finger] = q
    return hand.probe.compute_clearance(posture, make_pose(p=center), (finger,))


def _measure_runs(
    hand: HandModel, finger: int, q: Array, ok: NDArray[np.bool_], why: list[str], sense: int
) -> tuple[NDArray[np.intp], Array, tuple[str, ...]]:
    """Return carry (K,), the landing spin (K,) that centres the tip's roll over the run, and what ends each run."""
    chain = hand.fingers[finger].chain
    room = float(chain.upper[-1] - chain.lower[-1]) - 2.0 * hand.limits.joint_margin
    middle = 0.5 * float(chain.upper[-1] + chain.lower[-1])
    carry, spin, limit = np.zeros(STATIONS, dtype=np.intp), np.zeros(STATIONS), [""] * STATIONS
    # What the step from each station to the next one asks: is it continuous, and how far does the last joint turn?
    step = np.roll(q, -sense, axis=0) - q
    joined: NDArray[np.bool_] = np.abs(step[:, :-1]).max(axis=1) <= _JUMP
    turn = step[:, -1] - 2.0 * np.pi * np.round(step[:, -1] / (2.0 * np.pi))
    reached, joined_list, turn_list = list(ok), list(joined), turn.tolist()
    rolls = chain.has_tip_roll
    for k in np.flatnonzero(ok):
        value = low = high = float(q[k, -1])
        here, count, end = int(k), 0, "a whole turn"
        while count < STATIONS - 1:
            there = (here + sense) % STATIONS
            if not reached[there]:
                end = why[there]
                break
            if not joined_list[here]:
                end = "a singular posture"
                break
            value += turn_list[here]
            if max(high, value) - min(low, value) > room:
                end = "the limit of its last joint"
                break
            low, high = min(low, value), max(high, value)
            here, count = there, count + 1
        carry[k], limit[k] = count, end
        if rolls:
            spin[k] = chain.roll_sign * (middle - 0.5 * (low + high))
    return carry, spin, tuple(limit)


def carried_posture(hand: HandModel, orbit: Orbit, landed: int, steps: int, sense: int) -> Array:
    """Return the posture (J,) of a finger that landed at station ``landed`` and was carried ``steps`` stations on."""
    chain = hand.fingers[orbit.finger].chain
    k = (landed + sense * steps) % STATIONS
    q = orbit.posture(k, float(orbit.spin[landed]), chain.roll_sign)
    if compute_joint_margin(chain, q) < 0.0:
        # The table wraps the last joint to one turn; the run it belongs to decides which turn is meant.
        turns = np.array([q + 2.0 * np.pi * n * np.eye(chain.n_joints)[-1] for n in (-1, 0, 1)])
        q = turns[int(np.argmax(compute_joint_margin(chain, turns)))]
    return q
