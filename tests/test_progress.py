"""How far work has come, on stderr: bars on terminals alone, and how much a command says."""

from __future__ import annotations

import io
import logging
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from dexplan.cli import main
from dexplan.commands import progress
from dexplan.commands.progress import draw_bar, show_progress, show_work
from dexplan.commands.voice import Voice, speaking


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Put a terminal in the place of stderr, with bars that come at once."""
    stream = Terminal()
    monkeypatch.setattr(progress, "sys", SimpleNamespace(stderr=stream))
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(progress, "PERIOD", 0.005)
    return stream


def wait_for(stream: Terminal, text: str) -> None:
    deadline = time.monotonic() + 5.0
    while text not in stream.getvalue():
        assert time.monotonic() < deadline, stream.getvalue()
        time.sleep(0.005)


def test_a_bar_shows_share_time_and_what_is_left() -> None:
    text = draw_bar("filming", 0.25, 20.0, 200)
    assert text == "filming [#######.......................]  25 % 0:20, 1:00 to go"
    assert draw_bar("filming", 1.0, 80.0, 200).endswith("100 % 1:20")
    assert draw_bar("filming", 7.0, 80.0, 200).endswith("100 % 1:20")
    assert "%" not in draw_bar("planning", None, 80.0, 200)


@pytest.mark.parametrize("columns", [0, 1, 10, 80])
@pytest.mark.parametrize("share", [None, 0.0, 0.5])
def test_a_bar_never_fills_the_line(columns: int, share: float | None) -> None:
    """A full line would be wrapped, and could not be taken back."""
    assert len(draw_bar("planning", share, 1e5, columns)) <= max(columns - 1, 0)


@pytest.mark.parametrize("seconds", range(0, 200, 7))
def test_a_bar_without_a_share_keeps_its_length(seconds: int) -> None:
    bar = draw_bar("", None, float(seconds), 200).split("]")[0]
    assert len(bar) == len(" [") + progress.BAR_WIDTH
    assert bar.count("#") == progress.WANDERER


def test_a_bar_is_drawn_and_taken_away(terminal: Terminal) -> None:
    with show_progress("simulating") as advance:
        assert advance is not None
        advance(0.5)
        wait_for(terminal, " 50 %")
    assert terminal.getvalue().endswith(progress.CLEAR)


def test_work_tells_what_it_is_doing(terminal: Terminal) -> None:
    with show_work("planning"):
        logging.getLogger("dexplan.kinematics.workspace").info("measuring what %s reaches", "finger_1")
        wait_for(terminal, "0:00  measuring what finger_1 reaches")
    assert not logging.getLogger("dexplan").handlers


def test_a_bar_goes_where_the_work_breaks(terminal: Terminal) -> None:
    def work() -> None:
        with show_work("planning"):
            wait_for(terminal, "planning [")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert terminal.getvalue().endswith(progress.CLEAR)


def test_quick_work_shows_no_bar(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 60.0)
    with show_work("planning"):
        pass
    assert terminal.getvalue() == ""


def test_nobody_sees_a_bar_where_stderr_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with show_progress("simulating") as advance:
        assert advance is None
    with show_work("planning"):
        pass
    assert capsys.readouterr().err == ""


def test_quiet_commands_draw_no_bar(terminal: Terminal) -> None:
    with speaking(Voice.QUIET), show_progress("simulating") as advance:
        assert advance is None
    assert terminal.getvalue() == ""


def test_quiet_says_the_last_line_alone(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    for line, last in {
        "run hold_two -q": "PASS all",
        "validate runs/hold_two --quiet": "PASS all",
        "plan hold_two -q": "solved: runs/hold_two.plan/plan.json",
        "inspect hold_two -q": "written: runs/hold_two/inspect.png",
        "render runs/hold_two -q": "runs/hold_two/video.mp4",
    }.items():
        assert main(line.split()) == 0
        assert capsys.readouterr() == (f"{last}\n", "")


def test_quiet_still_says_what_goes_wrong(capsys: pytest.CaptureFixture[str], cwd: Path) -> None:
    assert main(["run", "hold_tow", "-q"]) == 2
    assert "did you mean 'hold_two'?" in capsys.readouterr().err


def test_verbose_says_what_is_done_and_how_long_it_takes(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    assert main(["run", "hold_two", "-v"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "PASS all"
    for work in ("planning", "simulating", "judging"):
        assert f"dexplan: {work} ..." in err
        assert f"dexplan: {work}: 0.0" in err
    assert not logging.getLogger("dexplan").handlers


def test_a_run_says_where_its_files_are(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    assert main(["run", "hold_two"]) == 0
    names = "problem.toml, plan.json, model.xml, trace.npz, report.json, report.html"
    assert f"written to runs/hold_two: {names}" in capsys.readouterr().out.splitlines()
    assert main(["validate", "runs/hold_two"]) == 0
    assert "written to runs/hold_two: report.json, report.html" in capsys.readouterr().out.splitlines()
