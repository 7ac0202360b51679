"""Run folders that version 0.1.0 wrote are judged by this version as they were by that one.

The folders hold what ``dexplan run`` leaves, without the picture; ``trace.npz`` is packed tighter, its columns are the same
bytes.  Commands: ``hold_two``; ``hold_three --set control.physics_profile=portable``; ``fig4_substitution --set
goal.rotation.angle_deg=4``.
"""

from __future__ import annotations

import json
import shutil
from importlib.metadata import version
from pathlib import Path

import pytest

from dexplan import pipeline
from dexplan.cli import main

FOLDERS = sorted(path for path in (Path(__file__).parent / "old_runs").iterdir() if path.is_dir())
MACHINE_BOUND = {"replay_matches"}
"""Checks whose status depends on the machine: they compare bit by bit."""
RELEASE_BOUND = MACHINE_BOUND | {"trace_consistent"}
"""Checks whose status depends on the release of MuJoCo: what another one recorded is not compared column by column."""
MOST_BYTES = 1_000_000


def test_three_small_folders_are_kept() -> None:
    assert len(FOLDERS) >= 3
    for folder in FOLDERS:
        assert sum(file.stat().st_size for file in folder.iterdir()) < MOST_BYTES / 2, folder.name


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_checks_say_what_they_said(folder: Path) -> None:
    problem, plan, trace = pipeline.load_run(folder)
    report = pipeline.validate(problem, plan, trace)
    written = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    said = {check["name"]: check["status"] for check in written["checks"]}
    says = {check.name: str(check.status) for check in report.checks}
    assert report.verdict == written["verdict"] == "pass"
    is_same_release = written["versions"]["mujoco"] == version("mujoco")
    bound = MACHINE_BOUND if is_same_release else RELEASE_BOUND
    assert {name: says.get(name) for name in said.keys() - bound} == {
        name: status for name, status in said.items() if name not in bound
    }


def test_the_command_validates_such_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(FOLDERS[0], "run")
    assert main(["validate", "run"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("PASS ")
