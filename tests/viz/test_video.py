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
from dexplan.run_folder import check_film_replaceable
from dexplan.sim.trace import Trace
from dexplan.viz import video
from dexplan.viz.film import FilmOptionError, FilmOptions
from dexplan.viz.story import build_captions

SIZE = (480, 352)
SMALL = FilmOptions(SIZE, ("closeup",))
DRAFT = FilmOptions(SIZE, ("overview",), quality="draft")


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
    path = video.render_run(folder, SMALL, progress=shares.append).path
    assert shares == pytest.approx(np.arange(1, 26) / 25)
    return path


def test_film_is_h264_in_limited_range_of_the_right_size(film: Path) -> None:
    told = _run_ffmpeg("-i", str(film)).stderr.decode()
    stream = next(line for line in told.splitlines() if "Video:" in line)
    assert "h264" in stream
    assert re.search(r"yuv420p\(tv, bt709[,)]", stream)
    assert f"{SIZE[0]}x{SIZE[1]}" in stream
    assert "25 fps" in stream


def test_film_lasts_as_long_as_the_run_and_leaves_nothing_else(film: Path) -> None:
    assert len(_read_pictures(film)) == 25
    assert sorted(p.name for p in film.parent.iterdir()) == ["plan.json", "trace.npz", "video.mp4"]


def test_film_can_start_before_it_is_loaded_completely(film: Path) -> None:
    data = film.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_ball_is_seen_to_turn_and_the_words_to_change(film: Path) -> None:
    pictures = _read_pictures(film).astype(int)
    height, width = pictures.shape[1:3]
    ball = np.s_[int(0.3 * height) : int(0.5 * height), int(0.42 * width) : int(0.58 * width)]
    held = np.abs(pictures[5][ball] - pictures[0][ball]).mean()
    turned = np.abs(pictures[13][ball] - pictures[0][ball]).mean()
    assert turned > 10.0
    assert held < 0.2 * turned
    header = np.s_[:20, : width // 2]
    assert np.abs(pictures[13][header] - pictures[0][header]).mean() > 1.0


def test_stills_of_one_trace_are_the_same_bytes(tmp_path: Path) -> None:
    """In one process and in two."""
    trace, plan = make_trace(), make_plan()
    paths = video.render_frames(trace, [0.1, 0.95, 0.1], tmp_path, plan=plan, options=SMALL)
    assert [p.name for p in paths] == ["frame_001.png", "frame_002.png", "frame_003.png"]
    assert sorted(tmp_path.iterdir()) == list(paths)
    first, last, again = (p.read_bytes() for p in paths)
    alone = video.render_frame(trace, 0.1, tmp_path / "alone.png", plan=plan, options=SMALL)
    assert first == again == alone.read_bytes()
    assert first != last
    assert imread(paths[0]).shape[:2] == (SIZE[1], SIZE[0])


def test_single_still_from_another_camera(tmp_path: Path) -> None:
    options = FilmOptions((161, 121), ("top",), quality="fine")
    path = video.render_frame(make_trace(), 0.5, tmp_path / "new" / "top.png", options=options)
    assert imread(path).shape[:2] == (121, 161)


def test_unknown_camera_is_told_with_those_there_are(tmp_path: Path) -> None:
    options = FilmOptions(SIZE, ("moon",))
    with pytest.raises(FilmOptionError, match=r"unknown camera 'moon'; known: closeup, overview, side, top"):
        video.render_frame(make_trace(), 0.0, tmp_path / "a.png", options=options)
    assert list(tmp_path.iterdir()) == []


def test_odd_size_is_refused_for_films(tmp_path: Path) -> None:
    with pytest.raises(FilmOptionError, match="even width and height"):
        video.render_video(make_trace(), None, tmp_path / "a.mp4", FilmOptions((321, 240)))


def test_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"trace\.npz"):
        video.render_run(tmp_path)


def test_where_egl_does_not_start_the_next_platform_is_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A platform that MuJoCo does not know fails as one that is not installed does: while it is imported.
    monkeypatch.setattr(video, "BACKENDS", ("none_such", "egl"))
    path = video.render_video(make_trace(duration=0.2), None, tmp_path / "a.mp4", DRAFT)
    assert len(_read_pictures(path.path)) == 5


def test_no_renderer_is_one_sentence_with_the_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The GL dispatch library finds no driver in an empty list: EGL is there and gives no display.
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", str(tmp_path / "none.json"))
    monkeypatch.setattr(video, "BACKENDS", ("egl", "none_such"))
    with pytest.raises(RenderError) as caught:
        video.render_video(make_trace(), None, tmp_path / "a.mp4", DRAFT)
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


def test_gif_is_one_keeps_the_time_of_the_run_and_may_be_replaced(tmp_path: Path) -> None:
    made = video.render_video(make_trace(), None, tmp_path / "film.GIF", DRAFT)
    data = made.path.read_bytes()
    assert data.startswith(b"GIF89a")
    assert b"NETSCAPE2.0" in data
    assert len(_read_pictures(made.path)) == pytest.approx(20, abs=1)
    assert made.fps == 20.0
    assert [p.name for p in tmp_path.iterdir()] == ["film.GIF"]
    check_film_replaceable(made.path)
    made.path.write_bytes(b"GIF89a" + 64 * b"a")
    with pytest.raises(RunFolderError, match="made by no run"):
        check_film_replaceable(made.path)


def test_a_film_shows_itself_in_a_notebook(film: Path) -> None:
    made = video.render_video(make_trace(duration=0.1), None, film.parent / "short.mp4", DRAFT)
    html = made._repr_html_()
    assert html.startswith("<video controls")
    assert 'src="data:video/mp4;base64,AAAA' in html
    assert made.duration == pytest.approx(0.1, abs=0.05)
    made.path.unlink()
    assert "is gone" in made._repr_html_()


def test_a_trace_carries_its_words(tmp_path: Path) -> None:
    """With the plan and without, the same picture is drawn; a trace that carries none is drawn without."""
    plan, trace = make_plan(), make_trace()
    told = Trace(trace.model_xml, trace.columns, {**trace.meta, "captions": build_captions(plan)})
    pictures = []
    for k, (source, given) in enumerate([(trace, plan), (told, None), (trace, None)]):
        path = video.render_frame(source, 0.5, tmp_path / f"{k}.png", plan=given, options=DRAFT)
        pictures.append(path.read_bytes())
    assert pictures[0] == pictures[1]
    assert pictures[0] != pictures[2]


def test_an_encoder_that_is_no_program_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path / "none"))
    with pytest.raises(RenderError, match="unset IMAGEIO_FFMPEG_EXE"):
        video.render_video(make_trace(), None, tmp_path / "film.mp4")


def test_a_trace_without_poses_is_refused_in_one_sentence(tmp_path: Path) -> None:
    trace = make_trace()
    columns = {k: v for k, v in trace.columns.items() if k != "qpos"}
    with pytest.raises(RenderError, match="the trace lacks qpos"):
        video.render_frame(
            Trace(trace.model_xml, columns, trace.meta), 0.5, tmp_path / "a.png", options=DRAFT
        )


def test_a_bare_trace_is_drawn_without_what_it_lacks(tmp_path: Path) -> None:
    trace = make_trace()
    bare = Trace(trace.model_xml, {k: trace[k] for k in ("time", "qpos")}, {})
    for options in (DRAFT, FilmOptions((960, 540), quality="draft")):
        path = video.render_frame(bare, 0.5, tmp_path / "a.png", options=options)
        assert imread(path)[..., :3].std() > 0.05
