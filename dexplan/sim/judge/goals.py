"""Where the problem wants the object, and when: one pose per waypoint, the last of them the goal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from dexplan.sim.judge.checks_case import Case
from dexplan.spatial import Array, direction_from_angles

NEAR_POSITION, NEAR_ANGLE = 1e-6, 1e-5
"""A planned hold marks a waypoint where it differs from it by less, in position [m] and angle [rad]."""


def compute_goal_poses(case: Case) -> Array:
    """Return the poses (N, 7) that the problem asks for one after another, from the model's home pose; the plan has no say."""
    pose, poses = case.replay.world.home_pose, []
    for asked in case.problem["goal"].get("waypoints") or [case.problem["goal"]]:
        pose = _follow(asked, pose)
        poses.append(pose)
    return np.array(poses)


def compute_goal_pose(case: Case) -> Array:
    """Return the goal (7,): the last pose that the problem asks for."""
    last: Array = compute_goal_poses(case)[-1]
    return last


def find_marks(case: Case) -> list[int | None]:
    """Return per waypoint but the last the number of the planned hold that marks it, None where the plan has none.

    It is the first hold at that pose after the mark of the waypoint before; the hold that begins the plan is none.
    """
    marks: list[int | None] = []
    after = 0
    for pose in compute_goal_poses(case)[:-1]:
        holds = (
            k
            for k, action in enumerate(case.plan["actions"])
            if k > after and action["kind"] == "hold" and _is_near(action["object_pose_end"], pose)
        )
        mark = next(holds, None)
        marks.append(mark)
        after = after if mark is None else mark
    return marks


def find_moments(case: Case) -> list[int | None]:
    """Return per waypoint the sample at which it is judged: the last of its hold, and of the run for the last waypoint.

    None where no sample claims such a hold.
    """
    action_of = np.array([a for a, _ in case.phases] + [-1])[case.claimed_phase]
    moments: list[int | None] = []
    for mark in find_marks(case):
        samples = [] if mark is None else np.flatnonzero(action_of == mark).tolist()
        moments.append(samples[-1] if samples else None)
    return [*moments, case.sample_count - 1 if case.sample_count else None]


def _follow(asked: Mapping[str, Any], before: Array) -> Array:
    """Return the pose (7,) that one goal asks for, from the pose (7,) ``before`` it."""
    attitude = Rotation.from_quat(before[3:], scalar_first=True)
    if asked.get("rotation"):
        axis = np.asarray(asked["rotation"]["axis"], dtype=np.float64)
        turn = np.radians(float(asked["rotation"]["angle_deg"]))
        attitude = Rotation.from_rotvec(turn * axis / np.linalg.norm(axis)) * attitude
    elif asked.get("orientation_wxyz"):
        attitude = Rotation.from_quat(
            np.asarray(asked["orientation_wxyz"], dtype=np.float64), scalar_first=True
        )
    position = before[:3] + np.asarray(asked.get("translation_m", (0.0, 0.0, 0.0)), dtype=np.float64)
    return np.concatenate([position, attitude.as_quat(scalar_first=True)])


def _is_near(planned: ArrayLike, wanted: Array) -> bool:
    """Return whether a planned pose (7,) is the one ``wanted`` (7,)."""
    pose = np.asarray(planned, dtype=np.float64)
    if not (np.isfinite(pose).all() and pose[3:].any()):
        return False
    first, second = (Rotation.from_quat(one[3:], scalar_first=True) for one in (pose, wanted))
    is_there = np.linalg.norm(pose[:3] - wanted[:3]) <= NEAR_POSITION
    return bool(is_there and (first * second.inv()).magnitude() <= NEAR_ANGLE)


def as_direction(contact: Mapping[str, Sequence[float]] | Sequence[float]) -> Array:
    """Return the direction (3,) of a contact of a problem: [azimuth, elevation] in degrees or {"point_m": [...]}."""
    if isinstance(contact, Mapping):
        return np.asarray(contact["point_m"], dtype=np.float64)
    return direction_from_angles(contact[0], contact[1])
