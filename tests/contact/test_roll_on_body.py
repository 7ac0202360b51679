"""Rolling on any smooth body: the closed form on a ball, and no sliding and no spin on others."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.smooth import BallBody, CapsuleBody, EllipsoidBody
from dexplan.contact.rolling.curves import roll_turning
from dexplan.contact.rolling.on_body import roll_on_body
from dexplan.spatial import Array, build_frame, rotate_about

TIP = 0.013


def sweep(start: Array, angle: float, count: int) -> Array:
    axis = np.cross(start, [0.3, -0.2, 0.9])
    axis /= np.linalg.norm(axis)
    return np.stack([rotate_about(axis, a) @ start for a in np.linspace(0.0, angle, count)])


def stand(body: ConvexBody, direction: Array) -> Array:
    """Return the pose (4, 4) of a tip that touches along a direction, leaning a little."""
    point = body.radial(direction)
    normal = body.normal_at(point)
    X = np.eye(4)
    X[:3, :3] = rotate_about([0.0, 0.6, 0.8], 0.2) @ build_frame(-normal)
    X[:3, 3] = point + TIP * normal
    return X


def test_on_a_ball_it_is_the_closed_form() -> None:
    body, start = BallBody(0.034), np.array([0.8, 0.6, 0.0])
    ways = sweep(start, 0.5, 31)
    mine = roll_on_body(body, TIP, stand(body, start), ways)
    closed = roll_turning(TIP, 0.034, stand(body, start), ways[-1], [0.0], [0.5 * 0.034], 31)
    np.testing.assert_allclose(mine.X_OF[-1], closed.X_OF[-1], atol=2e-7)
    np.testing.assert_allclose(mine.total_length, 0.5 * 0.034, rtol=1e-5)


@pytest.mark.parametrize(
    "body", [EllipsoidBody(0.026, 0.034, 0.041), CapsuleBody(0.022, 0.02), CylinderBody(0.03, 0.03, 0.006)]
)
def test_the_contact_neither_slides_nor_spins(body: ConvexBody) -> None:
    """What the tip turns by between two samples moves its material point at the contact not at all."""
    start = np.array([0.9, 0.2, -0.3]) / np.linalg.norm([0.9, 0.2, -0.3])
    path = roll_on_body(body, TIP, stand(body, start), sweep(start, 0.6, 400))
    turns = Rotation.from_matrix(path.X_OF[1:, :3, :3]) * Rotation.from_matrix(path.X_OF[:-1, :3, :3]).inv()
    w, n = turns.as_rotvec(), path.n_O[:-1] + path.n_O[1:]
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    slides = np.diff(path.X_OF[:, :3, 3], axis=0) - TIP * np.cross(w, n)
    assert np.linalg.norm(slides, axis=1).sum() < 1e-6
    assert np.abs(np.sum(w * n, axis=1)).sum() < 1e-5
    # The way on the tip is as long as that on the body.
    on_tip = np.linalg.norm(np.diff(path.p_F, axis=0), axis=1).sum()
    assert on_tip == pytest.approx(path.total_length, rel=1e-4)
    assert np.abs(body.project(path.p_O).distance).max() < 1e-12


def test_a_tip_that_does_not_touch_is_refused() -> None:
    body, start = EllipsoidBody(0.03, 0.03, 0.04), np.array([1.0, 0.0, 0.0])
    X = stand(body, start)
    X[0, 3] += 1e-4
    with pytest.raises(ValueError, match=r"0\.1 mm off the point"):
        roll_on_body(body, TIP, X, sweep(start, 0.2, 5))


def test_which_bodies_are_smooth() -> None:
    smooth = [
        BallBody(0.03),
        EllipsoidBody(0.02, 0.03, 0.04),
        CapsuleBody(0.02, 0.02),
        CylinderBody(0.03, 0.03, 0.002),
    ]
    assert all(body.is_smooth for body in smooth)
    assert not any(body.is_smooth for body in (BoxBody(0.03, 0.03, 0.03), CylinderBody(0.03, 0.03)))
