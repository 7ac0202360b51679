"""Rows of numbered frames: which moments they show, what stands under them, and that a picture comes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from turning_run import make_plan, make_trace

from dexplan.errors import RunFolderError
from dexplan.viz.frames import choose_frames, describe_step, draw_frames, draw_run_frames


def test_a_frame_for_the_start_and_for_every_action_that_does_something() -> None:
    trace, plan = make_trace(), make_plan()
    frames = choose_frames(trace, plan)
    assert [f.number for f in frames] == [1, 2, 3, 4]
    assert [f.caption for f in frames] == ["start", "turned by 90°", "finger 3 placed", "finger 1 lifted"]
    assert [f.fingers for f in frames] == [(0, 1), (0, 1), (0, 1, 2), (1, 2)]


def test_a_frame_shows_the_end_of_its_action() -> None:
    trace, plan = make_trace(), make_plan()
    for frame, index in zip(choose_frames(trace, plan)[1:], (1, 2, 3), strict=True):
        last = np.flatnonzero(trace["action_index"] == index)[-1]
        assert frame.time == trace["time"][last]


def test_no_more_frames_than_asked_for() -> None:
    assert [f.number for f in choose_frames(make_trace(), make_plan(), most=2)] == [1, 2]
    with pytest.raises(ValueError, match="1 or more"):
        choose_frames(make_trace(), make_plan(), most=0)
    with pytest.raises(ValueError, match="1 or more"):
        draw_frames(make_trace(), make_plan(), "nowhere.png", columns=0)


def test_holding_is_called_so() -> None:
    plan = make_plan()
    assert describe_step(plan, plan.actions[0]) == "hold"


def test_a_run_folder_gets_its_picture(tmp_path: Path) -> None:
    make_trace().save(tmp_path / "trace.npz")
    make_plan().save(tmp_path / "plan.json")
    path = draw_run_frames(tmp_path, most=3)
    picture = imread(path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["frames.png", "plan.json", "trace.npz"]
    assert picture.shape[1] > 2.5 * picture.shape[0]
    # The ball has turned between the first frame and the second.
    third = picture.shape[1] // 3
    assert np.abs(picture[:, :third, :3] - picture[:, third : 2 * third, :3]).mean() > 0.005


def test_no_run_folder(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="there is no such file"):
        draw_run_frames(tmp_path)
