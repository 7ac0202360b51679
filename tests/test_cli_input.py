"""The outside of the command line: exit codes, one stderr line for bad input, nothing left behind."""

from __future__ import annotations

import errno
import io
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fake_run import FakePlan, FakeReport, make_older_run

from dexplan.cli import main
from dexplan.errors import ProblemError, RenderError
from dexplan.problems.problem import Problem


@pytest.fixture(autouse=True)
def cwd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Run every test in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


BAD_COMMAND_LINES = [
    "",
    "juggle",
    "--bogus",
    "plan",
    "plan hold_two extra",
    "plan hold_two --bogus 3",
    "plan hold_two --set",
    "plan hold_two --set seed",
    "plan hold_two --set seed=",
    "plan hold_two --set seed=x",
    "plan hold_two --set seed=-1",
    "plan hold_two --set sead=1",
    "plan hold_two --video",
    "run hold_two --seed x",
    "run hold_two --seed -1",
    "run hold_two --outt here",
    "run no_such_problem",
    "run ./no_such_file.toml",
    "run .",
    "inspect no_such_problem",
    "plan hold_two --out /dev/null",
    "list extra",
    "validate",
    "validate no_such_folder",
    "validate /dev/null",
    "render no_such_folder",
    "render . --size 12",
    "render . --quality best",
    "render . --fps 0",
    "render . --camera top --camera side --camera overview",
]


def _check_one_line(capsys: pytest.CaptureFixture[str], cwd: Path) -> str:
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1, err
    assert err.startswith("dexplan: ")
    assert "Traceback" not in err
    assert list(cwd.iterdir()) == []
    return err


@pytest.mark.parametrize("line", BAD_COMMAND_LINES)
def test_bad_command_lines(line: str, capsys: pytest.CaptureFixture[str], cwd: Path) -> None:
    assert main(line.split()) == 2
    _check_one_line(capsys, cwd)


TURN = b"[goal]\nrotation = { axis = [0, 0, 1], angle_deg = 1 }\n"

BAD_FILES = {
    "empty": b"",
    "binary": bytes(range(256)),
    "not text": b"\xff\xfe\x00",
    "not toml": b"format = 1\n[goal\n",
    "no goal": b"format = 1\n",
    "unknown key": b"format = 1\nmass = 2\n" + TURN,
    "line break in a key": b'format = 1\n"a\\nb" = 2\n' + TURN,
    "line break in a value": b'format = 1\nname = "a\\nb"\n' + TURN,
    "date": b"format = 1\nseed = 2020-01-01\n" + TURN,
    "zero axis": b"format = 1\n[goal]\nrotation = { axis = [0, 0, 0], angle_deg = 1 }\n",
    "nan": b"format = 1\n[goal]\nrotation = { axis = [0, 0, 1], angle_deg = nan }\n",
}


@pytest.mark.parametrize("content", BAD_FILES.values(), ids=list(BAD_FILES))
@pytest.mark.parametrize("command", ["plan", "run", "inspect"])
def test_bad_files(
    command: str,
    content: bytes,
    capsys: pytest.CaptureFixture[str],
    tmp_path_factory: pytest.TempPathFactory,
    cwd: Path,
) -> None:
    path = tmp_path_factory.mktemp("bad") / "bad.toml"
    path.write_bytes(content)
    assert main([command, str(path)]) == 2
    assert "bad.toml" in _check_one_line(capsys, cwd)


def test_help_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    for line in (
        "--help",
        "plan --help",
        "run --help",
        "list -h",
        "validate --help",
        "render --help",
        "--version",
    ):
        assert main(line.split()) == 0
        out, err = capsys.readouterr()
        assert "dexplan" in out
        assert err == ""


def test_list_names_problems_and_scenes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list"]) == 0
    out = capsys.readouterr().out
    assert "fig4_substitution" in out
    assert "scene    three_finger_sphere" in out


def test_plan_saves_problem_and_plan(pipeline: SimpleNamespace, cwd: Path) -> None:
    assert main(["plan", "hold_two", "--set", "name='mine'", "--set", "object.mass_kg=0.05"]) == 0
    assert sorted(f.name for f in (cwd / "runs" / "mine").iterdir()) == ["plan.json", "problem.toml"]
    assert Problem.load(cwd / "runs/mine/problem.toml").object.mass_kg == 0.05


def test_no_plan_is_an_honest_no(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    pipeline.plan = lambda problem: FakePlan("start_out_of_reach")
    old = cwd / "there"
    make_older_run(old)
    (old / "notes.txt").write_text("old")
    assert main(["run", "hold_two", "--out", "there"]) == 1
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "REFUSED start_out_of_reach: the reason"
    assert err.startswith("dexplan: replaces what is in there of an older run: problem.toml, plan.json, ")
    assert sorted(f.name for f in old.iterdir()) == ["notes.txt", "plan.json", "problem.toml"]
    assert main(["plan", "hold_two", "--out", "there"]) == 1
    assert "start_out_of_reach" in capsys.readouterr().out


@pytest.mark.parametrize(("verdict", "code"), [("pass", 0), ("fail", 1)])
def test_run_saves_everything_and_ends_with_the_verdict(
    verdict: str, code: int, pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    pipeline.validate_as_recorded = lambda problem, plan, trace: FakeReport(verdict)
    seeds = []
    pipeline.rollout = lambda problem, plan, *, progress: seeds.append((problem.seed, progress))
    assert main(["run", "hold_two", "--seed", "7", "--video"]) == code
    out, err = capsys.readouterr()
    assert out.splitlines()[-1].startswith(verdict.upper())
    assert err == ""
    assert seeds == [(7, None)]
    names = {"problem.toml", "plan.json", "model.xml", "trace.npz", "report.json", "video.mp4"}
    assert {f.name for f in (cwd / "runs" / "hold_two").iterdir()} == names
    assert main(["validate", "runs/hold_two"]) == code
    assert capsys.readouterr().out.splitlines()[-1].startswith(verdict.upper())
    assert main(["render", "runs/hold_two"]) == 0


def test_a_film_goes_where_it_is_asked_to_and_replaces_nothing_foreign(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    make_older_run(cwd / "old")
    assert main(["render", "old", "--out", "mine.mp4"]) == 0
    assert capsys.readouterr().out == "mine.mp4\n"
    assert main(["render", "old", "--out", "mine.mp4"]) == 0
    (cwd / "mine.mp4").write_text("a film of mine")
    assert main(["render", "old", "--out", "mine.mp4"]) == 2
    assert "was made by no run" in capsys.readouterr().err
    assert (cwd / "mine.mp4").read_text() == "a film of mine"


def test_a_machine_that_cannot_render_says_so_in_one_line(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    def refuse(folder: Path, *given: object) -> None:
        raise RenderError("no offscreen renderer; install libegl1 libgl1")

    pipeline.render_run = refuse
    assert main(["run", "hold_two", "--video"]) == 1
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "PASS all"
    assert err == "dexplan: no video: no offscreen renderer; install libegl1 libgl1\n"
    assert (cwd / "runs/hold_two/report.json").is_file()


def test_input_the_scene_refuses_leaves_nothing(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    def refuse(problem: Problem) -> None:
        raise ProblemError("hold_two", "hand", "does not fit", "accepted: another hand")

    pipeline.plan = refuse
    assert main(["run", "hold_two"]) == 2
    _check_one_line(capsys, cwd)


def test_a_folder_that_turns_out_not_to_be_writable_is_told_in_one_line(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    cwd: Path,
) -> None:
    """Permissions look right and yet nothing can be made there, as on a read-only disk or in /proc."""

    def refuse(self: Path, *given: Any, **options: Any) -> None:
        raise OSError(errno.EROFS, "Read-only file system", str(self))

    monkeypatch.setattr(Path, "mkdir", refuse)
    for command in ("plan", "run"):
        assert main([command, "hold_two", "--out", "there"]) == 2
        err = _check_one_line(capsys, cwd)
        assert "--out: 'there' cannot be written (Read-only file system)" in err
        assert "accepted: a folder that can be written" in err


def test_a_defect_keeps_its_evidence(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    def crash(problem: Problem, plan: Any, **options: Any) -> None:
        raise ZeroDivisionError("ours")

    pipeline.rollout = crash
    assert main(["run", "hold_two"]) == 70
    err = capsys.readouterr().err
    assert "Traceback" in err
    assert "ZeroDivisionError: ours" in err
    assert str(Path("runs/hold_two")) in err
    kept = {f.name for f in (cwd / "runs/hold_two").iterdir()}
    assert kept == {"problem.toml", "plan.json", "crash.txt"}


def test_interrupt_and_broken_pipe(
    pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(problem: Problem) -> None:
        raise KeyboardInterrupt

    pipeline.plan = interrupt
    assert main(["plan", "hold_two"]) == 130
    assert capsys.readouterr().err == "dexplan: interrupted\n"

    class Closed(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", Closed())
    assert main(["list"]) == 141
