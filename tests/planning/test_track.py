"""The object's way as motions one after another: stops near one another, steps that join, carries merged about one axis only."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from dexplan.planning.actions.joining import build_move_actions
from dexplan.planning.contacts.track import STOP_ANGLE, STOP_SHIFT, Track
from dexplan.planning.regrasp.moves import Move
from dexplan.plans.contacts import Contacts
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.spatial import VERTICAL, make_pose

HOME = make_pose(p=np.array([0.0, 0.0, 0.15]))
SIDE = np.array([1.0, 0.0, 0.0])


def build_track() -> Track:
    """Return a turn about the vertical, one about a horizontal axis, and a shift."""
    first = ObjectMotion(HOME, VERTICAL, 0.5, np.zeros(3))
    second = ObjectMotion(first.X_WO_end, SIDE, -0.9, np.zeros(3))
    return Track((first, second, ObjectMotion(second.X_WO_end, SIDE, 0.0, np.array([0.0, 0.02, 0.0]))))


def test_steps_join_the_poses_and_are_short() -> None:
    track = build_track()
    assert len(track.poses) == len(track.steps) + 1
    for before, step, after in zip(track.poses, track.steps, track.poses[1:], strict=False):
        np.testing.assert_allclose(step.X_WO_start, before, atol=1e-12)
        np.testing.assert_allclose(step.X_WO_end, after, atol=1e-12)
        assert abs(step.angle) <= STOP_ANGLE + 1e-9
        assert np.linalg.norm(step.shift_W) <= STOP_SHIFT + 1e-12
    np.testing.assert_allclose(track.poses[-1], track.motions[-1].X_WO_end, atol=1e-12)
    assert track.turned == pytest.approx(1.4)


def test_an_object_at_rest_has_one_stop() -> None:
    track = Track((rest_at(HOME),))
    assert track.steps == ()
    assert len(track.poses) == 1
    np.testing.assert_array_equal(track.poses[0], HOME)


def test_carries_about_different_axes_are_motions_of_their_own() -> None:
    nobody: Contacts = (None, None, None)
    margins = {"load": 0.5, "torque_share": 0.1}
    carries = [
        Move("carry", None, nobody, step.X_WO_end, margins, motion=step) for step in build_track().steps
    ]
    actions = build_move_actions(tuple(carries), nobody, VERTICAL)
    assert [(round(a.motion.angle, 9), a.motion.axis_W.tolist()) for a in actions] == [
        (0.5, VERTICAL.tolist()),
        (-0.9, SIDE.tolist()),
        (0.0, SIDE.tolist()),
    ]
    for before, after in pairwise(actions):
        np.testing.assert_allclose(before.X_WO_end, after.X_WO_start, atol=1e-12)
