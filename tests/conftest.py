"""What tests of the command line share: an empty folder to stand in, and a pipeline that does nothing."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_run import make_pipeline

import dexplan


@pytest.fixture
def cwd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, in which the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A pipeline that does nothing, in place of the real one."""
    fake = make_pipeline()
    monkeypatch.setitem(sys.modules, "dexplan.pipeline", fake)  # type: ignore[arg-type]
    monkeypatch.setattr(dexplan, "pipeline", fake, raising=False)
    return fake
