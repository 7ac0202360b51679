"""A run folder that was cut, edited or mixed with another one is told: exit code 2 or FAIL, never a PASS."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dexplan import pipeline, run_folder
from dexplan.cli import main
from dexplan.problems.read import load_problem
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace

FILES = ("problem.toml", "plan.json", "model.xml", "trace.npz")
Edit = Callable[[Path], None]


def _make(folder: Path, **changes: Any) -> Path:
    """Plan, run and save holding still with two fingers, with keys of the problem replaced."""
    problem = load_problem("hold_two", changes)
    plan = pipeline.plan(problem)
    trace = pipeline.rollout(problem, plan)
    folder.mkdir()
    problem.save(folder / "problem.toml")
    plan.save(folder / "plan.json")
    (folder / "model.xml").write_text(trace.model_xml, encoding="utf-8")
    trace.save(folder / "trace.npz")
    return folder


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run that is tampered with."""
    return _make(tmp_path_factory.mktemp("honest") / "run")


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Other honest runs: of another seed, with other contacts, with another ball and friction."""
    home = tmp_path_factory.mktemp("others")
    return {
        "seed": _make(home / "seed", seed=7),
        "contacts": _make(home / "contacts", **{"start.contacts_deg": [[-38.0, 0.0], [103.0, 0.0], "free"]}),
        "ball": _make(home / "ball", **{"object.mass_kg": 0.05, "friction.sliding": 0.6}),
    }


@pytest.fixture
def folder(honest: Path, tmp_path: Path) -> Path:
    """A copy to change."""
    return Path(shutil.copytree(honest, tmp_path / "run"))


def _replace(file: str, pattern: str, text: str) -> Edit:
    """Return an edit that replaces the one place where ``pattern`` stands in a text file."""

    def edit(folder: Path) -> None:
        old = (folder / file).read_text(encoding="utf-8")
        new, count = re.subn(pattern, text, old, count=1)
        assert count == 1, pattern
        assert new != old, pattern
        (folder / file).write_text(new, encoding="utf-8")

    return edit


def _edit_model(pattern: str, text: str) -> Edit:
    """Return an edit of the model wherever it stands, in model.xml and in the trace."""

    def edit(folder: Path) -> None:
        _replace("model.xml", pattern, text)(folder)
        trace = Trace.load(folder / "trace.npz")
        changed = (folder / "model.xml").read_text(encoding="utf-8")
        Trace(changed, trace.columns, trace.meta).save(folder / "trace.npz")

    return edit


def _edit_plan(change: Callable[[dict[str, Any]], Any]) -> Edit:
    """Return an edit of the plan's data."""

    def edit(folder: Path) -> None:
        data = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
        change(data)
        (folder / "plan.json").write_text(json.dumps(data), encoding="utf-8")

    return edit


def _edit_trace(meta: dict[str, Any] | None = None, **columns: Callable[[np.ndarray], Any]) -> Edit:
    """Return an edit of the trace's columns and meta."""

    def edit(folder: Path) -> None:
        trace = Trace.load(folder / "trace.npz")
        changed = {name: np.asarray(change(np.array(trace[name]))) for name, change in columns.items()}
        Trace(trace.model_xml, {**trace.columns, **changed}, {**trace.meta, **(meta or {})}).save(
            folder / "trace.npz"
        )

    return edit


def _lack_finger(data: dict[str, Any]) -> None:
    """Rename the fingers everywhere."""
    text = json.dumps(data).replace("finger_3", "thumb")
    data.clear()
    data.update(json.loads(text))


PROBLEM_EDITS = {
    "name": ('name = "hold_two"', 'name = "another"'),
    "seed": (r"seed = 0", "seed = 1"),
    "summary": (r'summary = ".*"', 'summary = "another"'),
    "mass": (r"mass_kg = 0.06", "mass_kg = 0.05"),
    "radius": (r"radius_m = 0.035", "radius_m = 0.036"),
    "tip radius": (r"(tip_radii_m = \[\s*0.018,\s*)0.018", r"\g<1>0.017"),
    "polar limit": (r"tip_polar_limit_deg = 80.0", "tip_polar_limit_deg = 85.0"),
    "base": (r"(base_azimuths_deg = \[\s*0.0,\s*)120.0", r"\g<1>121.0"),
    "joint range": (r"(\[hand\.joint_ranges_deg\]\n)", '\\1"finger_1.joint_1" = [-80.0, 80.0]\n'),
    "friction": (r"sliding = 0.55", "sliding = 0.56"),
    "torsion": (r"torsional_m = 0.0025", "torsional_m = 0.0026"),
    "safety": (r"safety = 1.3", "safety = 1.2"),
    "angle": (r"angle_deg = 0.0", "angle_deg = 1.0"),
    "shift": (r"(translation_m = \[\s*)0.0", r"\g<1>0.001"),
    "budget": (r"node_budget = 2000", "node_budget = 2001"),
    "profile": (r'physics_profile = "firm"', 'physics_profile = "portable"'),
    "speed": (r"speed_deg_s = 30.0", "speed_deg_s = 300.0"),
    "start": (r"(contacts_deg = \[\s*\[\s*)-?\d+\.\d+", r"\g<1>-37.0"),
    "obstacle": (
        r"obstacles = \[\]",
        'obstacles = [{ kind = "box", pos_m = [0.5, 0.0, 0.1], size_m = [0.01, 0.01, 0.01] }]',
    ),
    "integrity": (r"physics_untouched = 0(\.0)?", "physics_untouched = 1000.0"),
    "negative": (r"penetration_max_um = 150.0", "penetration_max_um = -1.0"),
    "nan": (r"penetration_max_um = 150.0", "penetration_max_um = nan"),
}
MODEL_EDITS = {
    "mass": (r'mass="0.06"', 'mass="0.05"'),
    "friction": (r'friction="0.55 ', 'friction="0.75 '),
    "gravcomp": (r'(<body [^>]*)name="object/"', r'\1gravcomp="1" name="object/"'),
    "tip centre": (r'(<site name="finger_1/tip_center"[^>]*pos=")0.042', r"\g<1>0.041"),
    "timestep": (r'timestep="0.001"', 'timestep="0.0005"'),
}
EDITS: dict[str, Edit] = {
    **{f"{file} deleted": (lambda folder, file=file: (folder / file).unlink()) for file in FILES},
    **{f"{file} emptied": (lambda folder, file=file: (folder / file).write_bytes(b"")) for file in FILES},
    **{
        f"{file} cut": lambda folder, file=file: (folder / file).write_bytes(
            (folder / file).read_bytes()[: (folder / file).stat().st_size // 2]
        )
        for file in FILES
    },
    **{f"{file} no text": (lambda folder, file=file: (folder / file).write_bytes(b"\xff\xfe\x00")) for file in FILES},
    **{f"problem.toml: {name}": _replace("problem.toml", *pair) for name, pair in PROBLEM_EDITS.items()},
    "model.xml: mass": _replace("model.xml", *MODEL_EDITS["mass"]),
    "model.xml: a comment": _replace("model.xml", "<worldbody>", "<worldbody><!-- touched -->"),
    **{f"model everywhere: {name}": _edit_model(*pair) for name, pair in MODEL_EDITS.items()},
    "plan.json: no gait": _edit_plan(lambda data: data.update(status="no_gait")),
    "plan.json: no actions": _edit_plan(lambda data: data.update(actions=[])),
    "plan.json: one action less": _edit_plan(lambda data: data["actions"].pop()),
    "plan.json: fingers": _edit_plan(_lack_finger),
    "plan.json: why": _edit_plan(lambda data: data["actions"][0].update(why="because")),
    "plan.json: squeeze": _edit_plan(lambda data: data.update(normal_force_N=1.0)),
    "trace.npz: action_index": _edit_trace(action_index=lambda a: a + 1),
    "trace.npz: reference": _edit_trace(object_pose_reference=lambda a: a + 1e-3 * np.eye(7)[2]),
    "trace.npz: one sample less": _edit_trace(ctrl=lambda a: a[:-1]),
    "trace.npz: ctrl": _edit_trace(ctrl=lambda a: a + 1e-9),
    "trace.npz: not a number": _edit_trace(ctrl=lambda a: np.where(np.arange(len(a))[:, None] == 9, np.nan, a)),
    "trace.npz: seed": _edit_trace({"seed": 5, "problem_as_run": None}),
    "trace.npz: problem": _edit_trace({"problem": "another", "problem_as_run": None}),
    "trace.npz: steps": _edit_trace(physics_steps_per_sample=lambda a: a + 1),
    "trace.npz: many steps": _edit_trace(physics_steps_per_sample=lambda a: a * 10**12),
    "trace.npz: time stands still": _edit_trace(time=lambda a: np.where(np.arange(len(a)) == 9, a[8], a)),
}  # fmt: skip


def test_honest_run_passes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", str(folder)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("PASS hold_two: ")


def test_looser_limits_are_told_in_line_report_and_figure(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    _replace("problem.toml", "penetration_max_um = 150.0", "penetration_max_um = 400.0")(folder)
    # The figure of an earlier verdict: a picture of ours, which `validate` may replace.
    (folder / "summary.png").write_bytes(b"\x89PNG\r\n\x1a\n Software\0" + run_folder.MARK.encode())
    drawn: list[ValidationReport] = []
    monkeypatch.setattr(pipeline, "draw_run", lambda *run: drawn.append(run[-1]))
    for _ in range(2):
        assert main(["validate", str(folder)]) == 0
        line = capsys.readouterr().out.splitlines()[-1]
        assert line.startswith("PASS hold_two: ")
        assert line.endswith("; limits looser than default (1): penetration_max_um 400 instead of 150")
    assert list(ValidationReport.load(folder / "report.json").loose_limits) == ["penetration_max_um"]
    # Drawn anew with a new verdict only.
    assert [report.summary_line() for report in drawn] == [line]


def test_integrity_cannot_be_bought_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "hold_two", "--set", "acceptance.physics_untouched=1"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(
        "dexplan: hold_two: acceptance.physics_untouched: 1 is given for what cannot be set"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", EDITS)
def test_tampering_is_told(folder: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    EDITS[name](folder)
    _check_told(folder, capsys)


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("other", ["seed", "contacts", "ball"])
def test_file_of_another_run_is_told(
    folder: Path, others: dict[str, Path], other: str, file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    is_same = _read(folder / file) == _read(others[other] / file)
    assert is_same == ((other, file) in SHARED)
    shutil.copy(others[other] / file, folder / file)
    if is_same:
        assert main(["validate", str(folder)]) == 0
    else:
        _check_told(folder, capsys)


SHARED = {("seed", "plan.json"), ("seed", "model.xml"), ("ball", "plan.json")}
"""Files that two runs have in common: they are the run's own, whichever folder they come from."""


def _read(path: Path) -> Any:
    """Return what a file says; of a plan without the counts of its search."""
    if path.name == "plan.json":
        return {**json.loads(path.read_text(encoding="utf-8")), "statistics": None}
    return path.read_bytes()


def _check_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that validating says exit code 2 in one sentence, or FAIL with a verdict in the report."""
    code = main(["validate", str(folder)])
    out, err = capsys.readouterr()
    if code == 2:
        assert out == ""
        assert len(err.splitlines()) == 1, err
        assert not (folder / "report.json").exists()
        return
    assert code == 1, out.splitlines()[-1:]
    assert out.splitlines()[-1].startswith("FAIL ")
    assert not ValidationReport.load(folder / "report.json").is_passed
