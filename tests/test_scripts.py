"""Every script answers --help with its docstring and its options, and wrong input in one line with exit code 2."""

from __future__ import annotations

import ast
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "scripts"
SCRIPTS = sorted(
    path for path in FOLDER.iterdir() if path.is_file() and path.suffix == "" and os.access(path, os.X_OK)
)
PYTHON = [path for path in SCRIPTS if "python" in path.read_text(encoding="utf-8").splitlines()[0]]
SHELL = [path for path in SCRIPTS if path not in PYTHON]

WRONG = [
    "closure_sweep many",
    "closure_sweep 0",
    "closure_sweep 10 -1",
    "audit_sweep 1",
    "audit_sweep 10 1.5",
    "bench nosuch",
    "bench --fast",
    "regions_bench few",
    "rolling_bench 3",
    "adjustment_sweep nosuch",
    "adjustment_sweep --set foo",
    "adjustment_sweep --count -3",
    "attitude_sweep nosuch",
    "attitude_sweep --count many",
    "endurance nosuch",
    "endurance --goals -1",
    "jitter --workers 0",
    "jitter --problem nosuch",
    "rolling_sweep --step 0",
    "rolling_sweep --legs nan",
    "shift_sweep nosuch",
    "shift_sweep --furthest-mm 0",
    "three_to_two --radii-mm -4",
]


def run(monkeypatch: pytest.MonkeyPatch, path: Path, *arguments: str) -> object:
    """Run a Python script in this process, as its own folder's, and return its exit code."""
    monkeypatch.setattr(sys, "argv", [str(path), *arguments])
    monkeypatch.setattr(sys, "path", [str(FOLDER), *sys.path])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(path), run_name="__main__")
    return end.value.code or 0


@pytest.fixture(autouse=True)
def cwd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Run every test in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("path", PYTHON, ids=lambda path: path.name)
def test_help_is_the_docstring_and_the_options(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    assert run(monkeypatch, path, "--help") == 0
    out, err = capsys.readouterr()
    source = path.read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source), clean=False)
    assert docstring is not None
    assert docstring.strip() in out
    for option in [part.split('"')[1] for part in source.split("add_argument(")[1:]]:
        assert option in out
    assert err == ""
    assert not list(cwd.iterdir())


@pytest.mark.parametrize("path", SHELL, ids=lambda path: path.name)
def test_help_of_a_shell_script_is_its_comment_and_sets_nothing_up(path: Path, cwd: Path) -> None:
    comment = []
    for line in path.read_text(encoding="utf-8").splitlines()[1:]:
        if not line.startswith("#"):
            break
        comment.append(line.removeprefix("# "))
    for word in ("--help", "-h"):
        answer = subprocess.run(
            ["bash", str(path), word],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "DEXPLAN_VENV": str(cwd / "none")},
        )
        assert answer.stdout.splitlines() == comment
        assert answer.stderr == ""
    assert not list(cwd.iterdir())


@pytest.mark.parametrize("line", WRONG)
def test_wrong_input_is_told_in_one_line(
    line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], cwd: Path
) -> None:
    name, *arguments = line.split()
    assert run(monkeypatch, FOLDER / name, *arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"{name}: ")
    assert err.count("\n") == 1
    assert not list(cwd.iterdir())


@pytest.mark.parametrize("path", PYTHON, ids=lambda path: path.name)
def test_an_unknown_option_is_refused(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, path, "--no-such-option") == 2
    err = capsys.readouterr().err
    assert "--no-such-option" in err.splitlines()[-1]
    assert "Traceback" not in err


def start(path: Path, python: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Start a script as a shell would, with a Python that has nothing installed."""
    names = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "MUJOCO_GL", "DEXPLAN_RESTARTED")}
    # -S hides what is installed, as on a machine where only the environment has it.
    command = [python, "-S", str(path), "--help"]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=cwd, env={**names, **environment}
    )


def test_without_an_environment_a_script_says_how_to_make_one(cwd: Path) -> None:
    answer = start(FOLDER / "three_to_two", sys.executable, cwd, DEXPLAN_VENV=str(cwd / "none"))
    assert answer.returncode == 2
    assert answer.stdout == ""
    assert answer.stderr.startswith("three_to_two: dexplan is not installed for ")
    assert "run scripts/setup once" in answer.stderr
    assert answer.stderr.count("\n") == 1


def test_a_script_starts_again_with_the_python_of_the_environment(cwd: Path) -> None:
    folder = cwd / "venv/bin"
    folder.mkdir(parents=True)
    python = folder / "python"
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{FOLDER.parent}" exec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    answer = start(FOLDER / "three_to_two", sys.executable, cwd, DEXPLAN_VENV=str(cwd / "venv"))
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith("usage: three_to_two")
    assert answer.stderr == ""


@pytest.mark.parametrize("path", PYTHON, ids=lambda path: path.name)
def test_every_script_looks_for_its_environment_before_it_imports_anything_else(path: Path) -> None:
    outside = [
        node.names[0].name if isinstance(node, ast.Import) else str(node.module)
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Import | ast.ImportFrom)
    ]
    first = next(name for name in outside if name.split(".")[0] not in sys.stdlib_module_names)
    assert first == "_environment"
