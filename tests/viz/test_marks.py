"""What pictures show beside the run: where fingers have to touch in the end, tips on their stems, and that there is more."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imread
from turning_run import make_plan, make_trace

from dexplan.plans.contacts import GoalContact
from dexplan.spatial import Array
from dexplan.viz.frames import draw_frames
from dexplan.viz.palette import as_rgb, get_finger_color
from dexplan.viz.render_process import join_tips
from dexplan.viz.video import render_frame

UP = np.array([0.0, 0.0, 1.0])
RADIUS = 0.035


def draw(path: Path, *goals: GoalContact | None) -> Array:
    """Return the middle of the picture (H, W, 3) from above at the start of the run, with these goal contacts."""
    plan = replace(make_plan(), goal_contacts=goals or None)
    render_frame(make_trace(), 0.0, path, plan=plan, size=(240, 240), camera="top")
    return np.asarray(imread(path)[80:160, 80:160, :3], dtype=float)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Array:
    return draw(tmp_path_factory.mktemp("plain") / "plain.png")


def test_a_goal_on_top_of_the_ball_is_seen_from_above_in_its_fingers_colour(
    plain: Array, tmp_path: Path
) -> None:
    # The ball is all orange and yellow.
    ball = np.argwhere((plain[..., 0] > 0.6) & (plain[..., 2] < 0.4))
    for finger in (0, 1):
        goals = [GoalContact(f, RADIUS * UP, UP) if f == finger else None for f in range(3)]
        marked = draw(tmp_path / f"{finger}.png", *goals)
        changed = np.abs(marked - plain).max(axis=2) > 0.1
        rows, columns = np.nonzero(changed)
        assert 20 < changed.sum() < 400
        # A knob where the ball's top is, of about its share of the ball's width.
        middle = 0.5 * (ball.min(axis=0) + ball.max(axis=0))
        assert np.array([rows.mean(), columns.mean()]) == pytest.approx(middle, abs=3.0)
        assert np.ptp(columns) < 0.4 * np.ptp(ball[:, 1])
        # Dark, and of the finger's hue.
        colour, own = marked[changed].mean(axis=0), np.array(as_rgb(get_finger_color(finger)))
        assert colour.max() < 0.75 * own.max()
        assert np.argmax(colour) == np.argmax(own)


def test_a_goal_below_the_ball_is_hidden(plain: Array, tmp_path: Path) -> None:
    below = draw(tmp_path / "below.png", GoalContact(0, -RADIUS * UP, -UP), None, None)
    assert np.array_equal(plain, below)


def test_stems_reach_the_middle_of_their_tips() -> None:
    trace = make_trace()
    model = mujoco.MjModel.from_xml_string(trace.model_xml)
    before = mujoco.MjModel.from_xml_string(trace.model_xml)
    join_tips(model, ("finger_1", "finger_2", "finger_3"))

    def ends(of: mujoco.MjModel, name: str) -> Array:
        geom, axis = of.geom(name), np.zeros(9)
        mujoco.mju_quat2Mat(axis, geom.quat)
        reach = geom.size[1] * axis.reshape(3, 3)[:, 2]
        return np.stack([geom.pos - reach, geom.pos + reach])

    for k in (1, 2, 3):
        old, new = (ends(of, f"finger_{k}/stem") for of in (before, model))
        tip = before.geom(f"finger_{k}/tip").pos
        nearest = np.linalg.norm(new - tip, axis=1)
        assert nearest.min() == pytest.approx(0.0, abs=1e-9)
        # The other end stays.
        assert new[nearest.argmax()] == pytest.approx(old[np.linalg.norm(old - tip, axis=1).argmax()])
        assert np.linalg.norm(old - tip, axis=1).min() > 0.005
    moved = [
        model.geom(g).name
        for g in range(model.ngeom)
        if not np.array_equal(model.geom_pos[g], before.geom_pos[g])
    ]
    assert moved == ["finger_1/stem", "finger_2/stem", "finger_3/stem"]


def test_a_row_that_stops_early_says_how_much_there_is_more(tmp_path: Path) -> None:
    """A word in the lower right corner under the last picture, and none under a row that ends with the run."""
    corners = []
    for most in (2, 4):
        picture = imread(
            draw_frames(make_trace(), make_plan(), tmp_path / f"{most}.png", most=most, columns=2)
        )
        height, width = picture.shape[:2]
        line = 0.25 * 110 / max(1, most // 2)
        corners.append(picture[int(height - line) :, int(0.85 * width) :, :3])
    ink = [(corner < 0.5).any(axis=2).sum() for corner in corners]
    assert ink[0] > 15
    assert ink[1] == 0
