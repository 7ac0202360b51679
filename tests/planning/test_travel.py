"""Free fingers go around the ball, from where they are to where they are wanted, within their limits."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin, compute_tip_pose, wrap_near
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, build_frame, direction_from_angles, invert_pose, make_pose

COUNT = 40


def hovering(hand: HandModel, finger: int, gap: float) -> Array:
    """Return postures (N, J) with the tip ``gap`` off the ball at the contacts that a planner would use."""
    rng = np.random.default_rng(finger)
    description, center = hand.fingers[finger], hand.object.X_WO_home[:3, 3]
    azimuths = 120.0 * finger + rng.uniform(-65.0, 65.0, COUNT)
    normals = direction_from_angles(azimuths, rng.uniform(-40.0, 40.0, COUNT))
    X = np.stack([make_pose(build_frame(-n)) for n in normals])
    X[:, :3, 3] = center + hand.object.surface.radial(normals) + (description.tip_radius + gap) * normals
    q, reached = hand.workspaces[finger].solve(X)
    q[:, -1] = rng.uniform(-1.0, 1.0, COUNT)
    fine = compute_joint_margin(description.chain, q) >= hand.limits.joint_margin
    return q[reached & fine & (compute_dexterity(description.chain, q) >= hand.limits.dexterity)]


@pytest.mark.parametrize("finger", [0, 1, 2])
def test_ways_between_home_and_the_contacts_stay_outside_the_ball(hand: HandModel, finger: int) -> None:
    description, center = hand.fingers[finger], hand.object.X_WO_home[:3, 3]
    postures = hovering(hand, finger, hand.hover)
    assert len(postures) > COUNT // 3
    for q in postures:
        for start, end in ((description.q_home, q), (q, description.q_home)):
            path = build_travel(description, start, end, center)
            assert np.array_equal(path[0], start)
            assert np.array_equal(path[-1], end)
            assert compute_joint_margin(description.chain, path).min() >= 0.0
            distance = np.linalg.norm(compute_tip_pose(description.chain, path)[:, :3, 3] - center, axis=1)
            assert distance.min() >= min(distance[0], distance[-1]) - 1e-3
            # Nothing jumps: the steps are of the size that the whole way asks for.
            assert np.abs(np.diff(path, axis=0)).max() <= 0.15 + 3.0 * np.abs(end - start).max() / (
                len(path) - 1
            )


def test_way_to_where_one_is_already(hand: HandModel) -> None:
    description = hand.fingers[1]
    path = build_travel(description, description.q_home, description.q_home, hand.object.X_WO_home[:3, 3])
    assert np.allclose(path, description.q_home, atol=1e-4)


@pytest.mark.parametrize("gap", [0.002, 0.008])
def test_hover_is_the_contact_lifted_along_its_normal(hand: HandModel, gap: float) -> None:
    description, X_WO = hand.fingers[0], hand.object.X_WO_home
    for q in hovering(hand, 0, 0.0)[:8]:
        X_WF = compute_tip_pose(description.chain, q)
        normal = X_WF[:3, 3] - X_WO[:3, 3]
        normal /= np.linalg.norm(normal)
        X_OF = invert_pose(X_WO) @ X_WF
        hover = compute_hover(description, X_WO, X_OF, X_WO[:3, :3].T @ normal, q, gap)
        X_hover = compute_tip_pose(description.chain, hover)
        assert np.allclose(X_hover[:3, 3], X_WF[:3, 3] + gap * normal, atol=1e-6)
        assert np.allclose(X_hover[:3, :3], X_WF[:3, :3], atol=1e-6)
        assert np.abs(hover - q).max() < 0.5


def test_wrapping_keeps_the_pose_and_comes_near() -> None:
    rng = np.random.default_rng(0)
    q, near = rng.uniform(-9.0, 9.0, (50, 6)), rng.uniform(-3.0, 3.0, (50, 6))
    wrapped = wrap_near(q, near)
    assert np.abs(wrapped - near).max() <= np.pi + 1e-12
    assert np.allclose(np.exp(1j * wrapped), np.exp(1j * q))
