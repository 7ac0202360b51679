"""Nothing that a run of ours did not make is ever replaced, and the input file is never written."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fake_run import FILM, FakePlan, make_older_run

from dexplan import run_folder
from dexplan.cli import main
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem

TURN = "format = 1\n[goal]\nrotation = { axis = [0, 0, 1], angle_deg = 1 }\n"
NAMES = (*run_folder.RUN_FILES, "video.mp4")


def _read_all(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_plan_leaves_a_run_alone(pipeline: SimpleNamespace, cwd: Path) -> None:
    assert main(["plan", "hold_two"]) == 0
    assert main(["plan", "hold_two"]) == 0
    assert sorted(p.name for p in (cwd / "runs").iterdir()) == ["hold_two"]
    assert main(["run", "hold_two"]) == 0
    before = _read_all(cwd / "runs/hold_two")
    assert main(["plan", "hold_two"]) == 0
    assert sorted(p.name for p in (cwd / "runs").iterdir()) == ["hold_two", "hold_two.plan"]
    make_older_run(cwd / "runs/hold_two.plan")
    assert main(["plan", "hold_two"]) == 0
    assert sorted(_read_all(cwd / "runs/hold_two.plan.2")) == ["plan.json", "problem.toml"]
    assert _read_all(cwd / "runs/hold_two") == before


@pytest.mark.parametrize(
    "name", sorted({*run_folder.RUN_FILES, *run_folder.LATER_FILES} - set(run_folder.PLAN_FILES))
)
def test_any_file_that_only_a_run_makes_keeps_plan_out(
    name: str,
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    make_older_run(cwd / "there")
    (cwd / "there/crash.txt").write_text(run_folder.CRASH)
    for other in (*run_folder.RUN_FILES, *run_folder.LATER_FILES):
        if other != name:
            (cwd / "there" / other).unlink()
    if name == "frames.png" or name == "summary.png":
        assert run_folder.is_ours(cwd / "there" / name)
    before = _read_all(cwd)
    assert main(["plan", "hold_two", "--out", "there"]) == 2
    assert f"holds a run ({name})" in capsys.readouterr().err
    assert _read_all(cwd) == before


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "content", [b"", b"mine", b"{}", b"[goal]\n", FILM.replace(b"dexplan", b"Lavf58."), b"\x89PNG\r\n"]
)
def test_run_stops_before_the_users_own_files(
    name: str,
    content: bytes,
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    (cwd / name).write_bytes(content)
    assert main(["run", "hold_two", "--out", ".", "--video"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert f"--out: '{name}' is there and was made by no run" in err
    assert err.count("\n") == 1
    assert _read_all(cwd) == {name: content}


def test_a_film_that_is_not_made_anew_is_left_if_it_is_the_users(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    (cwd / "video.mp4").write_bytes(b"holiday")
    assert main(["run", "hold_two", "--out", "."]) == 0
    assert main(["render", "."]) == 2
    assert "move it elsewhere first" in capsys.readouterr().err
    assert (cwd / "video.mp4").read_bytes() == b"holiday"


@pytest.mark.parametrize("command", ["run", "plan"])
@pytest.mark.parametrize("how", ["itself", "symlink", "hardlink", "dots", "folder link"])
def test_the_input_is_never_written(
    how: str,
    command: str,
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    (cwd / "mine").mkdir()
    source, asked = cwd / "mine/problem.toml", "mine"
    source.write_text(TURN)
    name = "mine/problem.toml"
    if how in ("symlink", "hardlink"):
        asked = "other"
        (cwd / "other").mkdir()
        link = os.symlink if how == "symlink" else os.link
        link(source, cwd / "other/problem.toml")
    elif how == "dots":
        asked = "mine/../mine/."
    elif how == "folder link":
        os.symlink(cwd / "mine", cwd / "alias")
        asked = "alias"
    assert main([command, name, "--out", asked]) == 2
    assert "is the input file, which is never overwritten" in capsys.readouterr().err
    assert source.read_text() == TURN
    assert main(["run", name, "--out", "elsewhere"]) == 0
    assert source.read_text() == TURN


def test_a_run_is_repeated_from_its_own_copy_of_the_problem(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    """The copy says what would be written there, so it is not written; asked for something else, there is no room."""
    assert main(["run", "hold_two"]) == 0
    before = (cwd / "runs/hold_two/problem.toml").stat()
    assert main(["run", "runs/hold_two/problem.toml"]) == 0
    after = (cwd / "runs/hold_two/problem.toml").stat()
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)
    assert main(["run", "runs/hold_two/problem.toml", "--seed", "3"]) == 2
    assert "is the input file" in capsys.readouterr().err


def test_run_says_what_it_replaces_and_takes_all_of_the_older_run_away(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    make_older_run(cwd / "there")
    (cwd / "there/notes.txt").write_text("mine")
    assert main(["run", "hold_two", "--out", "there"]) == 0
    err = capsys.readouterr().err
    assert err.startswith(
        "dexplan: replaces what is in there of an older run: problem.toml, plan.json, model.xml, trace.npz"
    )
    assert set(_read_all(cwd / "there")) == {*run_folder.RUN_FILES, "notes.txt"} - {"summary.png"}
    assert Problem.load(cwd / "there/problem.toml") == load_problem("hold_two")


def test_a_problem_file_that_was_edited_is_the_users(tmp_path: Path) -> None:
    path = tmp_path / "problem.toml"
    run_folder.save_problem(load_problem("hold_two"), path)
    assert run_folder.is_ours(path)
    path.write_text(path.read_text().replace("0.06", "0.05"))
    assert not run_folder.is_ours(path)
    # Files of versions that did not seal theirs are known by having every default written out.
    load_problem("hold_two").save(path)
    assert run_folder.is_ours(path)
    path.write_text(TURN)
    assert not run_folder.is_ours(path)


def test_inspect_keeps_to_its_own_picture(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    (cwd / "inspect.png").write_bytes(b"mine")
    assert main(["inspect", "hold_two", "--out", "."]) == 2
    assert _read_all(cwd) == {"inspect.png": b"mine"}


def test_validate_leaves_a_report_that_is_none(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    make_older_run(cwd / "there")
    (cwd / "there/report.json").write_text("my notes")
    assert main(["validate", "there"]) == 0
    assert (cwd / "there/report.json").read_text() == "my notes"
    assert "left as it was" in capsys.readouterr().err


@pytest.mark.parametrize("where", ["plan", "rollout"])
def test_a_defect_leaves_an_older_run_alone_until_there_is_a_new_plan(
    where: str,
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    assert main(["run", "hold_two"]) == 0
    before = _read_all(cwd / "runs/hold_two")

    def crash(*given: Any, **options: Any) -> None:
        raise ZeroDivisionError("ours")

    setattr(pipeline, where, crash)
    assert main(["run", "hold_two"]) == 70
    folder = cwd / ("runs/hold_two.crash" if where == "plan" else "runs/hold_two")
    assert str(folder.relative_to(cwd)) in capsys.readouterr().err
    assert run_folder.is_ours(folder / "crash.txt")
    if where == "plan":
        assert _read_all(cwd / "runs/hold_two") == before
    else:
        assert set(_read_all(folder)) == {"crash.txt", "plan.json", "problem.toml"}


REFUSALS = [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EIO, errno.EFBIG]


@pytest.mark.parametrize("number", REFUSALS, ids=[errno.errorcode[n] for n in REFUSALS])
@pytest.mark.parametrize("filename", [None, "there/trace.npz"])
def test_a_full_disk_is_no_defect(
    number: int,
    filename: str | None,
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    def refuse(folder: Path, *given: Any) -> None:
        raise OSError(number, os.strerror(number), filename)

    pipeline.save_run = refuse
    assert main(["run", "hold_two", "--out", "there"]) == 2
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "PASS all"
    assert err.count("\n") == 1
    assert os.strerror(number) in err
    assert "what was made so far is in there" in err
    assert set(_read_all(cwd / "there")) == {"plan.json", "problem.toml"}

    def refuse_plan(self: FakePlan, path: Path) -> None:
        raise OSError(number, os.strerror(number), filename)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FakePlan, "save", refuse_plan)
        assert main(["plan", "hold_two", "--out", "there2"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("error", [KeyError("qpos"), ValueError("Found zero norm quaternions")])
def test_a_figure_that_cannot_be_drawn_keeps_no_verdict_back(
    error: Exception, pipeline: SimpleNamespace, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    """Derived columns may be left out of a trace, and a foreign one may hold anything in them."""

    def refuse(*given: Any) -> None:
        raise error

    make_older_run(cwd / "there")
    pipeline.draw_run = refuse
    assert main(["validate", "there"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[-1] == "PASS all"
    assert err.startswith("dexplan: summary.png is left as it was")
    assert err.count("\n") == 1
