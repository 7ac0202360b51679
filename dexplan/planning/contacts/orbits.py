"""How far can each finger carry a contact along a leg?  Tables of contact orbits.

A contact fixed on an object that turns about an axis travels a circle around that axis: its *orbit*.  For every finger and
orbit the inverse kinematics is solved at all stations of the leg; `carry` is then the length of the run of stations through
which the finger can take the contact.  For a sphere, which looks the same from every side [paper §3: homogeneous with respect
to rotation], one table serves all contacts on a circle at all times.  The orbit of a shift is a straight line, passed once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.kinematics.chain import Chain, wrap_near
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_near, solve_tip_pose
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.lone_clearance import list_others, remember_clearances
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.stops import LAST_JOINT, SINGULAR, WORKSPACE_END, Stop, StopKind
from dexplan.spatial import Array, lock_arrays, make_pose, read_only

_JUMP = 0.30
"""Joint steps between neighbouring stations beyond this mean another branch [rad]."""
_SIGHT = float(np.radians(80.0))
"""Directions farther than this from a finger's own are not tried for landings."""
_LOOK = 3
"""Clearance of one finger alone is looked at at every so many stations."""


@dataclass(frozen=True, eq=False)
class Orbit:
    """One finger's contact going along with a leg.

    At station k the contact has the outward normal ``normals[k]`` (K, 3) in W and the finger the posture ``q[k]`` (K, J), NaN
    out of reach.  Turning the leg's way from station k the finger gets through ``carry[k]`` more stations, provided it landed
    with its tip spun by ``spin[k]`` [rad] about its pole from the table's posture; ``limit[k]`` says what ends it, or why there
    is none.
    """

    finger: int
    normals: Array
    q: Array
    is_reached: NDArray[np.bool_]
    carry: NDArray[np.intp]
    spin: Array
    limit: tuple[Stop, ...]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def run(self, hand: HandModel, leg: Leg, landed: int) -> Array:
        """Return the postures (carry + 1, J) of the finger that landed at station ``landed``, on one branch."""
        chain = hand.fingers[self.finger].chain
        q = self.q[(landed + leg.sense * np.arange(int(self.carry[landed]) + 1)) % len(self.q)].copy()
        step = np.diff(q[:, -1])
        q[1:, -1] = q[0, -1] + np.cumsum(step - 2.0 * np.pi * np.round(step / (2.0 * np.pi)))
        q[:, -1] += chain.roll_sign * self.spin[landed]
        return q


class _Postures(NamedTuple):
    """Postures (M, K, J) of contacts at stations, at which they are ``ok`` (M, K), and ``why`` not where they are not."""

    q: Array
    ok: NDArray[np.bool_]
    why: list[list[Stop]]


class _Runs(NamedTuple):
    """Per station (K,): how far a contact is carried from there, the landing spin that centres the tip's roll over that run, and
    what ends it, or why there is none.
    """

    carry: NDArray[np.intp]
    spin: Array
    limit: tuple[Stop, ...]


class _Windows(NamedTuple):
    """Per entry (N,): how many from there on stay together, and the least and greatest value among these."""

    many: NDArray[np.intp]
    low: Array
    high: Array


def build_orbits(
    hand: HandModel, leg: Leg, finger: int, X_first: Array, normals: Array, sight: float = _SIGHT
) -> list[Orbit]:
    """Return the orbits of contacts with the tip poses ``X_first`` (M, 4, 4) and ``normals`` (M, 3) at station 0.

    Stations farther than ``sight`` [rad] from the finger's own direction are not tried: there is little to be had there.  The
    spin of each landing is chosen so that the roll of the tip is centred over the run.
    """
    N, X_WF = _carry_along(leg, X_first, normals)
    q, ok, why = _solve(hand, finger, leg, N, X_WF, sight=sight)
    return [
        Orbit(
            finger,
            read_only(N[m]),
            read_only(q[m]),
            ok[m],
            *_measure_runs(hand, finger, leg, q[m], ok[m], why[m]),
        )
        for m in range(len(N))
    ]


def build_fixed_orbit(
    hand: HandModel, leg: Leg, finger: int, X_WF: Array, normal: Array, q: Array | None = None
) -> Orbit:
    """Return the orbit of a contact that stands already: the tip at ``X_WF`` (4, 4) keeps its spin and its tilt.

    ``q`` (J,) is a posture near by, if one is known.  Only station 0 has a run, none where the finger cannot hold the contact.
    """
    chain, limits = hand.fingers[finger].chain, hand.limits
    N, X = _carry_along(leg, X_WF[None], normal[None])
    if q is None and len(hand.workspaces[finger].postures):
        solved, found = solve_tip_pose(hand.workspaces[finger], X_WF[None], counts_spin=True)
        q = solved[0] if found[0] else None
    table, ok, why = _solve(hand, finger, leg, N, X, hand.fingers[finger].q_home if q is None else q)
    postures, reached, reasons = table[0].copy(), ok[0], why[0]
    lower, upper = chain.lower[-1] + limits.joint_margin, chain.upper[-1] - limits.joint_margin
    carry, spin = np.zeros(len(postures), dtype=np.intp), np.zeros(len(postures))
    end = [Stop(StopKind.WHOLE_TURN)] * len(postures)
    if q is not None and reached[0]:
        postures[0] = wrap_near(postures[0], q)
        if np.abs(q - postures[0]).max() > _JUMP:
            reached[0], reasons[0] = False, Stop(StopKind.BRANCH)
    if reached[0] and not lower - 1e-9 <= postures[0, -1] <= upper + 1e-9:
        reached[0], reasons[0] = False, LAST_JOINT
    here, last = 0, min(len(postures) - 1, leg.stations)
    for count in range(1, last + 1):
        there = leg.sense * count % len(postures)
        step = postures[there] - postures[here]
        step[-1] -= 2.0 * np.pi * np.round(step[-1] / (2.0 * np.pi))
        postures[there, -1] = postures[here, -1] + step[-1]
        if not reached[there]:
            end[0] = reasons[there]
        elif np.abs(step[:-1]).max() > _JUMP:
            end[0] = SINGULAR
        elif not lower <= postures[there, -1] <= upper:
            end[0] = LAST_JOINT
        else:
            here, carry[0] = there, count
            continue
        break
    only = np.zeros(len(postures), dtype=bool)
    only[0] = reached[0]
    lean = float(np.arccos(np.clip(-(X_WF[:3, 2] @ normal), -1.0, 1.0)))
    if lean > hand.tip_polar_limit:
        only[0], reasons[0] = False, Stop(StopKind.POLE, f"{np.degrees(lean):.0f}")
    end[0] = end[0] if only[0] else reasons[0]
    return Orbit(finger, read_only(N[0]), read_only(postures), only, carry, spin, tuple(end))


def _carry_along(leg: Leg, X_first: Array, normals: Array) -> tuple[Array, Array]:
    """Return normals (M, K, 3) and tip poses (M, K, 4, 4) of contacts at every station of the leg."""
    R, shift = leg.motions
    N = np.einsum("kij,mj->mki", R, normals)
    X = np.zeros((len(normals), len(R), 4, 4))
    X[..., :3, :3] = np.einsum("kij,mjl->mkil", R, X_first[:, :3, :3])
    X[..., :3, 3] = leg.center + np.einsum("kij,mj->mki", R, X_first[:, :3, 3] - leg.center) + shift
    X[..., 3, 3] = 1.0
    return N, X


def _solve(
    hand: HandModel,
    finger: int,
    leg: Leg,
    normals: Array,
    X_WF: Array,
    stands: Array | None = None,
    sight: float = np.pi,
) -> _Postures:
    """Return the postures of contacts at all stations.

    ``stands`` (J,): the finger is there already, in this posture, so that it stays on this branch and sees only this leg.
    """
    description, limits, workspace = hand.fingers[finger], hand.limits, hand.workspaces[finger]
    home = description.pose_at(description.q_home)[:3, 3] - leg.center - leg.motions[1]
    home /= np.linalg.norm(home, axis=-1, keepdims=True)
    near = np.einsum("mki,ki->mk", normals, home) >= np.cos(sight)
    if stands is not None:
        near[:, leg.sense * np.arange(leg.stations + 1, near.shape[1])] = False
    q = np.full((*near.shape, description.chain.n_joints), np.nan)
    ok = np.zeros(near.shape, dtype=bool)
    reason = np.full(near.shape, WORKSPACE_END, dtype=object)
    if near.any() and len(workspace.postures):
        if stands is None:
            solved, reached = solve_tip_pose(workspace, X_WF[near])
        else:
            solved, reached = solve_near(description.chain, X_WF[near], np.tile(stands, (near.sum(), 1)))
        fixed = solved[:, :-1] if description.chain.has_tip_roll else solved
        lower, upper = description.chain.lower[: fixed.shape[1]], description.chain.upper[: fixed.shape[1]]
        room = np.minimum(fixed - lower, upper - fixed)
        inside = room.min(axis=1) >= limits.joint_margin
        nearest = room.argmin(axis=1)
        if description.chain.has_tip_roll and measure_roll_room(description.chain, limits.joint_margin) < 0.0:
            # Whatever the spin, it comes too near to a limit.
            inside[:], nearest[:] = False, description.chain.n_joints - 1
        away = np.zeros(len(solved), dtype=bool)
        away[reached & inside] = (
            estimate_dexterity(description.chain, solved[reached & inside]) >= limits.dexterity
        )
        q[near], ok[near] = solved, reached & inside & away
        joints = np.array(
            [Stop(StopKind.JOINT, name.split("/")[-1]) for name in description.joint_names], dtype=object
        )
        why = np.where(inside, np.array(SINGULAR, dtype=object), joints[nearest])
        reason[near] = np.where(reached, why, np.array(WORKSPACE_END, dtype=object))
        if stands is None and not leg.is_shift:
            refusals = remember_clearances(hand).refuse_contact(finger, leg.center, normals[ok])
            blocked = np.array([refusal is not None for refusal in refusals], dtype=bool)
            ends = reason[ok]
            ends[blocked] = [
                Stop(StopKind.NEAR, " and ".join(refusal.subject))
                for refusal in refusals
                if refusal is not None
            ]
            reason[ok], ok[ok] = ends, ~blocked
        else:
            _look_around(hand, finger, leg, q, ok, reason, _LOOK if stands is None else 1)
    return _Postures(q, ok, [list(row) for row in reason])


def _look_around(
    hand: HandModel,
    finger: int,
    leg: Leg,
    q: Array,
    ok: NDArray[np.bool_],
    reason: NDArray[np.object_],
    every: int,
) -> None:
    """Take out the stations at which the finger comes too near to something, wherever the others are.

    One station in ``every`` is looked at and speaks for its neighbours: whatever a plan goes through is looked at again.
    """
    shifts = leg.motions[1]
    posture, others = hand.q_home.copy(), list_others(hand, finger)
    group = np.arange(ok.shape[1]) // every
    for row in range(len(ok)):
        for g in np.unique(group[ok[row]]):
            stations = np.flatnonzero(ok[row] & (group == g))
            k = int(stations[len(stations) // 2])
            posture[finger] = q[row, k]
            clearance, names = hand.probe.compute_clearance(
                posture, make_pose(p=leg.center + shifts[k]), (finger,), others
            )
            if clearance < hand.limits.clearance:
                ok[row, stations] = False
                reason[row, stations] = Stop(StopKind.NEAR, names)


def _measure_runs(
    hand: HandModel, finger: int, leg: Leg, q: Array, ok: NDArray[np.bool_], why: list[Stop]
) -> _Runs:
    """Return the runs of one contact with the postures ``q`` (K, J); where they are not ``ok`` (K,), ``why`` says so."""
    chain, count = hand.fingers[finger].chain, len(q)
    room = measure_roll_room(chain, hand.limits.joint_margin)
    middle = 0.5 * float(chain.upper[-1] + chain.lower[-1])
    rolls, sign = chain.has_tip_roll, chain.roll_sign
    carry, spin, limit = np.zeros(count, dtype=np.intp), np.zeros(count), list(why)
    if not ok.any():
        return _Runs(carry, read_only(spin), tuple(limit))
    # Twice around in the order in which stations are passed; a shift is passed once.
    order = np.arange(count) if leg.is_shift else leg.sense * np.arange(2 * count) % count
    step = np.diff(q[order], axis=0)
    turn = step[:, -1] - 2.0 * np.pi * np.round(step[:, -1] / (2.0 * np.pi))
    with np.errstate(invalid="ignore"):
        joined = np.abs(step[:, :-1]).max(axis=1) <= _JUMP
    passed = joined & ok[order[1:]] & ok[order[:-1]]
    value = np.concatenate([[0.0], np.cumsum(np.where(passed, turn, 0.0))])
    breaks = np.append(np.flatnonzero(~passed), len(order) - 1)
    first = 0
    for last in breaks.tolist():  # stations order[first] .. order[last] are one stretch
        if first < count and ok[order[first]]:
            if last < len(order) - 1:
                there = order[last + 1]
                end = SINGULAR if ok[there] else why[there]
            else:
                end = Stop(StopKind.SHIFT_END if leg.is_shift else StopKind.WHOLE_TURN)
            begun = np.arange(first, min(last + 1, count))
            many, low, high = _measure_windows(value[first : last + 1], len(begun), room, count)
            here = order[begun]
            carry[here] = many - 1
            whole = (begun + many == last + 1) | (many == count)
            for station, is_whole in zip(here.tolist(), whole.tolist(), strict=True):
                limit[station] = end if is_whole else LAST_JOINT
            if rolls:
                centred = 0.5 * (low + high) - value[begun]
                spin[here] = sign * (middle - q[here, -1] - centred)
        first = last + 1
    return _Runs(carry, read_only(spin), tuple(limit))


def measure_roll_room(chain: Chain, margin: float) -> float:
    """Return how far [rad] the last joint can turn while it keeps ``margin`` [rad] to its limits, -1 where it can be nowhere."""
    room = float(chain.upper[-1] - chain.lower[-1]) - 2.0 * margin
    return room if room > 1e-9 else -1.0


def _measure_windows(value: Array, starts: int, room: float, longest: int) -> _Windows:
    """Return the windows of the first ``starts`` entries: at most ``longest`` entries within ``room`` of one another."""
    if len(value) <= longest and np.ptp(value) <= room:  # all that follow do
        low = np.minimum.accumulate(value[::-1])[::-1]
        high = np.maximum.accumulate(value[::-1])[::-1]
        return _Windows(np.arange(len(value), len(value) - starts, -1), low[:starts], high[:starts])
    many, low, high = np.zeros(starts, dtype=np.intp), np.zeros(starts), np.zeros(starts)
    for j in range(starts):
        ahead = value[j : j + longest]
        most, least = np.maximum.accumulate(ahead), np.minimum.accumulate(ahead)
        fits = most - least <= room
        many[j] = len(ahead) if fits.all() else int(fits.argmin())
        low[j], high[j] = least[many[j] - 1], most[many[j] - 1]
    return _Windows(many, low, high)
