"""How far a fingertip can roll straight along the ball from its own place in front of the finger, whichever way it rolls.

The contact starts on the horizontal line from the ball to the finger's base with the tip's pole on it, and follows a great
circle.  Joint limits and collisions bound the roll.  Azimuth 0 of a roll is sideways, 90 degrees is upwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from dexplan.kinematics.chain import compute_tip_pose, solve_ik
from dexplan.scene.library import load_scene
from dexplan.scene.probe import HandProbe
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, build_frame, make_pose, rotate_about

AZIMUTHS = np.arange(0, 360, 15)
DEMANDED = 30
"""Degrees along the ball; the tip then turns by 30 (1 + R / r) = 88 degrees."""
SPINS = np.radians(np.arange(-360, 360, 30))
"""Where the last joint may start, relative to upright: twelve spins, each on either turn of the joint."""


@dataclass(frozen=True)
class Roll:
    """How many degrees each azimuth reached, and what ended the roll ("" where nothing did)."""

    reached: NDArray[np.int_]
    ends: list[str]


def _roll_everywhere(scene: Scene, finger: int, is_flipped: bool) -> Roll:
    """Roll in all azimuths at once, in steps of 1 degree, from one of the two wrist branches of the start pose."""
    description, chain = scene.fingers[finger], scene.fingers[finger].chain
    center, n_azimuths = scene.object.X_WO_home[:3, 3], len(AZIMUTHS)
    R, r = scene.object.surface.radius, description.tip_radius  # type: ignore[attr-defined]
    outward = np.array([*(chain.offsets[0][:2, 3] - center[:2]), 0.0])
    outward /= np.linalg.norm(outward)
    frame = build_frame(-outward)
    start = make_pose(frame, center + (R + r) * outward)
    q, reached = solve_ik(chain, start[None], description.q_home[None], iterations=60)
    assert reached.all()
    q = np.repeat(q, n_azimuths, axis=0)
    if is_flipped:
        # Half a turn of both rolls and the mirrored pitch give the wrist's other answer to the same pose.
        q[:, 3], q[:, 4], q[:, 5] = q[:, 3] + np.pi, -q[:, 4], q[:, 5] + np.pi
    angles = np.radians(AZIMUTHS)[:, None]
    tangents = np.cos(angles) * frame[:, 0] + np.sin(angles) * frame[:, 1]
    axes = np.cross(outward, tangents)
    R_start = compute_tip_pose(chain, q)[:, :3, :3]
    path, exact = (
        np.full((DEMANDED + 1, n_azimuths, 6), np.nan),
        np.ones((DEMANDED + 1, n_azimuths), dtype=bool),
    )
    path[0] = q
    for k in range(1, DEMANDED + 1):
        s = np.radians(k)
        X = np.zeros((n_azimuths, 4, 4))
        X[:, 3, 3] = 1.0
        X[:, :3, 3] = center + (R + r) * (np.cos(s) * outward + np.sin(s) * tangents)
        # Rolling: the tip turns by (1 + R / r) s while its centre goes round by s.
        turns = np.stack([rotate_about(axis, s * (1.0 + R / r)) for axis in axes])
        X[:, :3, :3] = turns @ R_start
        path[k], reached = solve_ik(chain, X, path[k - 1])
        jumped = np.abs(path[k] - path[k - 1]).max(axis=1) > 0.6
        exact[k] = exact[k - 1] & reached & ~jumped
    outcome = [_measure(scene, finger, path[:, a], exact[:, a]) for a in range(n_azimuths)]
    return Roll(np.array([far for far, _ in outcome]), [end for _, end in outcome])


def _measure(scene: Scene, finger: int, path: Array, exact: NDArray[np.bool_]) -> tuple[int, str]:
    """Return the degrees (-1: not even the start) that one path (K, 6) gets with its best initial spin, and what ends it."""
    chain = scene.fingers[finger].chain
    best, best_inside = -1, np.zeros(path.shape, dtype=bool)
    for spin in SPINS:
        # Spin turns the tip about its own axis: it changes the last joint alone, and no distance.
        turned = path + spin * np.eye(6)[5]
        inside = (turned >= chain.lower) & (turned <= chain.upper)
        good = inside.all(axis=1) & exact
        far = int(np.argmin(good)) - 1 if not good.all() else len(path) - 1
        if far > best:
            best, best_inside = far, inside
    if best < 0:
        return -1, "the start is beyond a joint limit"
    end = "" if best == len(path) - 1 else "out of reach"
    if end and not best_inside[best + 1].all():
        end = scene.fingers[finger].joint_names[int(np.argmin(best_inside[best + 1]))]
    probe, q = HandProbe(scene), np.stack([f.q_home for f in scene.fingers])
    for k in range(best + 1):
        q[finger] = path[k]
        clearance, names = probe.compute_clearance(q, scene.object.X_WO_home, (finger,))
        if clearance <= 0.0:
            return k - 1, names
    return best, end


def _combine(scene: Scene, finger: int) -> Roll:
    both = [_roll_everywhere(scene, finger, is_flipped) for is_flipped in (False, True)]
    better = [0 if a >= b else 1 for a, b in zip(both[0].reached, both[1].reached, strict=True)]
    return Roll(
        np.maximum(both[0].reached, both[1].reached),
        [both[branch].ends[k] for k, branch in enumerate(better)],
    )


@pytest.fixture(scope="module")
def roll() -> Roll:
    return _combine(load_scene(), 0)


def test_a_straight_roll_of_thirty_degrees_in_every_direction(roll: Roll) -> None:
    table = {int(a): int(far) for a, far in zip(AZIMUTHS, roll.reached, strict=True)}
    assert (roll.reached == DEMANDED).all(), f"azimuth: reached {table}; ended by {set(roll.ends)}"
