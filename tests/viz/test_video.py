"""Films and stills through the real renderer and encoder, and what is said where there is none."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from matplotlib.image import imread
from turning_run import make_plan, make_trace

from dexplan.errors import RenderError, RunFolderError
from dexplan.sim.trace import Trace
from dexplan.viz import video
from dexplan.viz.timeline import build_captions, choose_axis, read_caption

SIZE = (320, 240)


def _run_ffmpeg(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", *arguments]
    return subprocess.run(command, capture_output=True, check=False)


def _read_pictures(path: Path) -> np.ndarray:
    """Return the pictures of a film (N, H, W, 3)."""
    raw = _run_ffmpeg("-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-")
    return np.frombuffer(raw.stdout, dtype=np.uint8).reshape(-1, SIZE[1], SIZE[0], 3)


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of a second in which the ball makes a quarter turn, made from a run folder."""
    folder = tmp_path_factory.mktemp("run")
    make_trace().save(folder / "trace.npz")
    make_plan().save(folder / "plan.json")
    shares: list[float] = []
    path = video.render_run(folder, size=SIZE, progress=shares.append)
    assert shares == pytest.approx(np.arange(1, 31) / 30)
    return path


def test_film_is_h264_in_limited_range_of_the_right_size(film: Path) -> None:
    told = _run_ffmpeg("-i", str(film)).stderr.decode()
    stream = next(line for line in told.splitlines() if "Video:" in line)
    assert "h264" in stream
    assert re.search(r"yuv420p\(tv, bt709[,)]", stream)
    assert f"{SIZE[0]}x{SIZE[1]}" in stream
    assert "30 fps" in stream


def test_film_lasts_as_long_as_the_run_and_leaves_nothing_else(film: Path) -> None:
    assert len(_read_pictures(film)) == 30
    assert sorted(p.name for p in film.parent.iterdir()) == ["plan.json", "trace.npz", "video.mp4"]


def test_film_can_start_before_it_is_loaded_completely(film: Path) -> None:
    data = film.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_ball_is_seen_to_turn_and_the_caption_to_change(film: Path) -> None:
    pictures = _read_pictures(film).astype(int)
    height, width = pictures.shape[1:3]
    ball = np.s_[int(0.38 * height) : int(0.50 * height), int(0.45 * width) : int(0.55 * width)]
    held = np.abs(pictures[6][ball] - pictures[0][ball]).mean()
    turned = np.abs(pictures[15][ball] - pictures[0][ball]).mean()
    assert turned > 10.0
    assert held < 0.2 * turned
    caption = np.s_[-16:, : width // 2]
    assert np.abs(pictures[15][caption] - pictures[0][caption]).mean() > 1.0


def test_stills_show_forces_in_the_fingers_colours_and_repeat_exactly(tmp_path: Path) -> None:
    trace, plan = make_trace(), make_plan()
    paths = video.render_frames(trace, [0.1, 0.95, 0.1], tmp_path, plan=plan, size=SIZE)
    assert [p.name for p in paths] == ["frame_001.png", "frame_002.png", "frame_003.png"]
    assert sorted(tmp_path.iterdir()) == list(paths)
    first, last, again = (imread(p)[..., :3] for p in paths)
    assert first.shape == (SIZE[1], SIZE[0], 3)
    assert np.array_equal(first, again)
    # The first finger's blue arrow is there while it holds and gone after it has been lifted.
    ball = np.s_[90:125, 140:180]
    blue = [int((p[ball][..., 2] > p[ball][..., :2].max(axis=-1) + 0.1).sum()) for p in (first, last)]
    assert blue[0] > 20
    assert blue[1] == 0


def test_single_still_from_another_camera(tmp_path: Path) -> None:
    path = video.render_frame(make_trace(), 0.5, tmp_path / "new" / "top.png", size=(161, 121), camera="top")
    assert imread(path).shape[:2] == (121, 161)


def test_unknown_camera_is_told_with_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match=r"unknown camera 'moon'; known: .*overview.*top"):
        video.render_frame(make_trace(), 0.0, tmp_path / "a.png", camera="moon")
    assert list(tmp_path.iterdir()) == []


def test_odd_size_is_refused_for_films(tmp_path: Path) -> None:
    with pytest.raises(RenderError, match="even width and height"):
        video.render_video(make_trace(), None, tmp_path / "a.mp4", size=(321, 240))


def test_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"trace\.npz"):
        video.render_run(tmp_path)


def test_where_egl_does_not_start_the_next_platform_is_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A platform that MuJoCo does not know fails as one that is not installed does: while it is imported.
    monkeypatch.setattr(video, "BACKENDS", ("none_such", "egl"))
    path = video.render_video(make_trace(duration=0.2), None, tmp_path / "a.mp4", size=SIZE)
    assert len(_read_pictures(path)) == 6


def test_no_renderer_is_one_sentence_with_the_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The GL dispatch library finds no driver in an empty list: EGL is there and gives no display.
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", str(tmp_path / "none.json"))
    monkeypatch.setattr(video, "BACKENDS", ("egl", "none_such"))
    with pytest.raises(RenderError) as caught:
        video.render_video(make_trace(), None, tmp_path / "a.mp4", size=SIZE)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert "apt-get install libegl1 libgl1" in sentence
    assert "libosmesa6" in sentence
    assert [note.split(":")[0] for note in caught.value.__notes__] == ["egl", "none_such"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["film.avi", "film", "film.mp4.txt", "film.webm", ".gif"])
def test_other_suffixes_are_refused_before_any_work(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "_run_job", None)
    with pytest.raises(RenderError, match=r"accepted: \.mp4 or \.gif"):
        video.render_video(make_trace(), None, tmp_path / name)
    with pytest.raises(RenderError, match=r"accepted: \.png"):
        video.render_frame(make_trace(), 0.5, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_gif_is_one_and_keeps_the_time_of_the_run(tmp_path: Path) -> None:
    path = video.render_video(make_trace(), None, tmp_path / "film.GIF", size=SIZE)
    data = path.read_bytes()
    assert data.startswith(b"GIF89a")
    assert b"NETSCAPE2.0" in data
    assert len(_read_pictures(path)) == pytest.approx(20, abs=1)
    assert [p.name for p in tmp_path.iterdir()] == ["film.GIF"]


def test_a_trace_carries_its_captions(tmp_path: Path) -> None:
    """With the plan and without, the same strip is drawn."""
    plan, trace = make_plan(), make_trace()
    told = Trace(trace.model_xml, trace.columns, {**trace.meta, "captions": build_captions(plan)})
    strips = []
    for k, (source, given) in enumerate([(trace, plan), (told, None)]):
        path = video.render_frame(source, 0.5, tmp_path / f"{k}.png", plan=given, size=SIZE)
        strips.append(imread(path)[-14:])
    np.testing.assert_array_equal(strips[0], strips[1])
    # The caption is on the left: light on dark.
    assert strips[0][:, : SIZE[0] // 3, :3].max() > 0.6


@pytest.mark.parametrize(
    "captions", [None, 3, [], {}, {"actions": 3}, {"actions": [3]}, {"actions": [[]], "axis_W": [0, 0]}]
)
def test_odd_captions_are_none(captions: object) -> None:
    trace = make_trace()
    told = Trace(trace.model_xml, trace.columns, {"captions": captions})
    assert read_caption(told, 0, 0) == ""
    np.testing.assert_array_equal(choose_axis(None, told), [0.0, 0.0, 1.0])


def test_an_encoder_that_is_no_program_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "none"))
    with pytest.raises(RenderError, match="unset IMAGEIO_FFMPEG_EXE"):
        video.render_video(make_trace(), None, tmp_path / "film.mp4")


def test_a_trace_without_poses_is_refused_in_one_sentence(tmp_path: Path) -> None:
    trace = make_trace()
    columns = {k: v for k, v in trace.columns.items() if k != "qpos"}
    with pytest.raises(RenderError, match="the trace lacks qpos"):
        video.render_frame(Trace(trace.model_xml, columns, trace.meta), 0.5, tmp_path / "a.png", size=SIZE)
