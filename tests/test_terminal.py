"""Any encoding, any environment, any signal: one sentence at worst, and what was made so far is kept."""

from __future__ import annotations

import io
import os
import signal
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_run import FakeReport

from dexplan import terminal
from dexplan.cli import main
from dexplan.errors import DexplanError
from dexplan.sim.trace import Trace

SIGNS = "µ ° – … × γ │ ≤ 球 \ud800"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252", "cp437", "utf-8", "utf-16"])
def test_every_text_can_be_printed(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding=encoding))
    terminal.make_printable()
    print(SIGNS)
    sys.stdout.flush()
    told = raw.getvalue().decode(encoding)
    assert "\\ud800" in told
    if encoding == "ascii":
        assert told == "u  deg - ... x gamma | <= \\u7403 \\ud800\n"


def test_validate_in_ascii(
    pipeline: SimpleNamespace,
    monkeypatch: pytest.MonkeyPatch,
    cwd: Path,
) -> None:
    monkeypatch.setattr(FakeReport, "table", lambda self: SIGNS)
    monkeypatch.setattr(FakeReport, "summary_line", lambda self: f"PASS {SIGNS}")
    assert main(["run", "hold_two"]) == 0
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(sys, name, io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
    assert main(["validate", "runs/hold_two"]) == 0
    assert main(["plan", "--help"]) == 0
    assert main(["plan", "größe"]) == 2


@pytest.mark.parametrize("value", ["foo", "EGLX", "1.0", "egl,osmesa"])
def test_a_gl_platform_that_does_not_exist_is_told(
    value: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    monkeypatch.setenv("MUJOCO_GL", value)
    assert main(["plan", "hold_two"]) == 2
    err = capsys.readouterr().err
    assert f"MUJOCO_GL={value!r}" in err
    assert "accepted: egl, glfw, osmesa" in err
    assert err.count("\n") == 1
    assert not list(cwd.iterdir())


@pytest.mark.parametrize("value", ["", "egl", "OSMesa", "glfw", "off", "disable"])
def test_nothing_is_drawn_in_this_process_whatever_is_asked_for(
    value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", value)
    monkeypatch.setenv("MPLBACKEND", "no_such_backend")
    terminal.prepare_environment()
    assert os.environ["MUJOCO_GL"] == "off"
    assert os.environ["MPLBACKEND"] == "agg"


def test_an_output_that_takes_nothing_more_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Full(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys, "stdout", Full())
    assert main(["list"]) == 2
    err = capsys.readouterr().err
    assert "No space left on device" in err
    assert err.count("\n") == 1


def _cut_short(problem: Any, plan: Any, **options: Any) -> None:
    try:
        os.kill(os.getpid(), _cut_short.signum)  # type: ignore[attr-defined]
        for _ in range(10**7):  # the handler runs between two of these
            pass
    except KeyboardInterrupt as error:
        columns = {"time": np.array([0.0, 0.25])}
        error.trace = Trace("<mujoco/>", columns, {"failure": "cut short: interrupted"})  # type: ignore[attr-defined]
        raise


@pytest.mark.parametrize(
    ("signum", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_a_signal_keeps_the_run_so_far(
    signum: int,
    code: int,
    word: str,
    request: pytest.FixtureRequest,
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    _cut_short.signum = signum  # type: ignore[attr-defined]
    pipeline.rollout = _cut_short
    # Started in the background, this process may have been told to ignore Ctrl-C.
    was = signal.signal(signal.SIGINT, signal.default_int_handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, was))
    before = signal.getsignal(signal.SIGTERM)
    assert main(["run", "hold_two"]) == code
    assert signal.getsignal(signal.SIGTERM) == before
    assert (
        capsys.readouterr().err == f"dexplan: {word}; the run so far (0.25 s) is in runs/hold_two/trace.npz\n"
    )
    kept = {p.name for p in (cwd / "runs/hold_two").iterdir()}
    assert kept == {"problem.toml", "plan.json", "model.xml", "trace.npz"}
    assert Trace.load(cwd / "runs/hold_two/trace.npz").meta["failure"] == "cut short: interrupted"
    assert main(["plan", "hold_two"]) == 0
    assert (cwd / "runs/hold_two/trace.npz").is_file()


def test_a_signal_while_judging_keeps_the_run(
    pipeline: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    cwd: Path,
) -> None:
    def interrupt(*given: Any) -> None:
        raise KeyboardInterrupt

    pipeline.rollout = lambda *given, **options: Trace("<mujoco/>", {"time": np.array([0.0, 2.0])}, {})
    pipeline.validate_as_recorded = interrupt
    assert main(["run", "hold_two"]) == 130
    assert "the run so far (2.00 s) is in runs/hold_two/trace.npz" in capsys.readouterr().err


def test_python_is_told_of_a_gl_platform_that_does_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    import dexplan

    monkeypatch.setenv("MUJOCO_GL", "foo")
    monkeypatch.delitem(vars(dexplan), "plan", raising=False)
    with pytest.raises(DexplanError, match="MUJOCO_GL='foo' is no GL platform"):
        _ = dexplan.plan


@pytest.mark.parametrize("name", ["stdout", "stderr"])
def test_a_closed_stream_is_no_defect(name: str, monkeypatch: pytest.MonkeyPatch, cwd: Path) -> None:
    monkeypatch.setattr(sys, name, None)
    assert main(["list"]) == 0
    assert main(["plan", "no_such_problem"]) == 2
