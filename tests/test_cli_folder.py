"""``dexplan inspect`` into a folder that cannot be made: one sentence and exit code 2, as for the other commands."""

from __future__ import annotations

import errno
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import dexplan
from dexplan.cli import main


@pytest.fixture
def refusal(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[OSError]:
    """What a pipeline that does nothing else raises where it would write."""
    monkeypatch.chdir(tmp_path)
    raised: list[OSError] = []

    def inspect(problem: Any, folder: Path) -> str:
        raise raised[0]

    fake = SimpleNamespace(inspect=inspect)
    monkeypatch.setitem(sys.modules, "dexplan.pipeline", fake)
    monkeypatch.setattr(dexplan, "pipeline", fake, raising=False)
    return raised


@pytest.mark.parametrize("place", ["there/deep", "there", "there/deep/inspect.png"])
def test_inspect_tells_an_unwritable_folder_in_one_sentence(
    refusal: list[OSError], capsys: pytest.CaptureFixture[str], tmp_path: Path, place: str
) -> None:
    refusal.append(OSError(errno.EROFS, "Read-only file system", place))
    assert main(["inspect", "hold_two", "--out", "there/deep"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err == (
        "dexplan: --out: 'there/deep' cannot be written (Read-only file system); accepted: a folder that can be written\n"
    )
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_missing_elsewhere_stays_a_defect(
    refusal: list[OSError], capsys: pytest.CaptureFixture[str]
) -> None:
    for filename in ("elsewhere/mesh.stl", None):
        refusal[:] = [OSError(errno.ENOENT, "No such file or directory", filename)]
        assert main(["inspect", "hold_two", "--out", "there"]) == 70
        assert "Traceback" in capsys.readouterr().err


def test_inspect_refuses_before_it_draws(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The whole way, with the real pipeline, into a place that looks writable and is not, as /proc does to root."""

    def refuse(self: Path, *given: Any, **options: Any) -> None:
        raise FileNotFoundError(errno.ENOENT, "No such file or directory", str(self))

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Path, "mkdir", refuse)
    assert main(["inspect", "hold_two", "--out", "x"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("dexplan: --out: 'x' cannot be written")
    assert err.count("\n") == 1
