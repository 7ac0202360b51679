"""Rows of numbered frames: which moments they show, what stands under them, and that a picture comes of it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fake_run import FakePlan
from matplotlib.image import imread
from turning_run import make_plan, make_trace

from dexplan.cli import main
from dexplan.errors import RunFolderError
from dexplan.problems.read import load_problem
from dexplan.run_folder import is_ours
from dexplan.viz import frames
from dexplan.viz.frames import choose_frames, describe_step, draw_frames, draw_run_frames


def test_a_frame_for_the_start_and_for_every_action_that_does_something() -> None:
    trace, plan = make_trace(), make_plan()
    chosen = choose_frames(trace, plan)
    assert [f.number for f in chosen] == [1, 2, 3, 4]
    assert [f.caption for f in chosen] == ["start", "turned by 90°", "finger 3 placed", "finger 1 lifted"]
    assert [f.fingers for f in chosen] == [(0, 1), (0, 1), (0, 1, 2), (1, 2)]


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


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A folder with what pictures are made of."""
    make_trace().save(tmp_path / "run/trace.npz")
    make_plan().save(tmp_path / "run/plan.json")
    return tmp_path / "run"


def test_pictures_of_a_run_stand_in_its_folder(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["frames", str(run)]) == 0
    names = [f"frame_{k:03d}.png" for k in range(1, 5)]
    assert capsys.readouterr().out.splitlines() == [str(run / "frames" / name) for name in names]
    assert sorted(p.name for p in (run / "frames").iterdir()) == names
    assert all(is_ours(run / "frames" / name) for name in names)
    # Fewer make room for themselves; what is not ours stays.
    (run / "frames/notes.txt").write_text("mine")
    assert main(["frames", str(run), "--every", "10", "--camera", "top", "-q"]) == 0
    assert capsys.readouterr().out == f"{run / 'frames' / names[0]}\n"
    assert sorted(p.name for p in (run / "frames").iterdir()) == [names[0], "notes.txt"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--camera", "nosuch"], "unknown camera 'nosuch'; known: "),
        (["--every", "1e-300"], "1000000001 pictures would be drawn"),
        (["--out", "/proc/nowhere"], "--out: '/proc/nowhere' cannot be written"),
        (["--every", "1e-4"], "01 pictures would be drawn; at most 999 are; take more time between them"),
    ],
)
def test_pictures_that_cannot_be_drawn(
    run: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert main(["frames", str(run), *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1
    assert not [path for path in run.rglob("*") if path.suffix not in (".npz", ".json", "")]


def test_a_picture_of_the_users_own_is_not_replaced(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "frames").mkdir()
    (run / "frames/frame_002.png").write_bytes(b"mine")
    assert main(["frames", str(run)]) == 2
    assert "frame_002.png: is there and was made by no run" in capsys.readouterr().err
    assert [p.read_bytes() for p in (run / "frames").iterdir()] == [b"mine"]


def test_figures_of_run_folders_and_problems(
    run: Path,
    pipeline: SimpleNamespace,
    cwd: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    drawn = []

    def draw(folder: Path, most: int, camera: str) -> Path:
        drawn.append((folder, most, camera))
        return folder / "frames.png"

    monkeypatch.setattr(frames, "draw_run_frames", draw)
    assert main(["figures", str(run), "hold_two", "--most", "2", "--seed", "4", "-q"]) == 0
    assert drawn == [(run, 2, "top"), (Path("runs/hold_two"), 2, "top")]
    assert load_problem(cwd / "runs/hold_two/problem.toml").seed == 4
    pipeline.plan = lambda problem: FakePlan("no_gait")
    assert main(["figures", "hold_three", str(run)]) == 1
    out = capsys.readouterr().out
    assert "REFUSED no_gait: the reason" in out
    assert out.splitlines()[-1] == str(run / "frames.png")
