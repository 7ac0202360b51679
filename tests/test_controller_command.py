"""``dexplan run PROBLEM --controller ... --true ...``: another controller and another world from the command line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dexplan.cli import main
from dexplan.control.named import load_controller
from dexplan.errors import DexplanError
from dexplan.sim.judge.groups import OWN_COLUMNS
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "foreign_controller.py"

MINE = """
import dataclasses
import sys

import numpy as np

LIMIT = 5


@dataclasses.dataclass
class Stay:
    ticks: int = 0

    def step(self, observation):
        self.ticks += 1
        if self.ticks > LIMIT:
            raise RuntimeError("I am tired")
        return observation.q.ravel()


class Needs:
    def __init__(self, squeeze):
        self.squeeze = squeeze


def degrees(observation):
    return np.degrees(observation.q.ravel())


def leave(observation):
    sys.exit(0)
"""


@pytest.fixture
def mine(cwd: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module of the user's in the current folder; what importing it leaves behind is undone."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(sys, "modules", {**sys.modules})
    (cwd / "mine_in_tests.py").write_text(MINE, encoding="utf-8")
    return cwd


def read_lines(capsys: pytest.CaptureFixture[str]) -> tuple[list[str], list[str]]:
    out, err = capsys.readouterr()
    return out.splitlines(), err.splitlines()


def test_another_controller_runs_is_judged_and_judged_again(
    cwd: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "hold_three", "--controller", f"{EXAMPLE}:Hold", "--true", "object.mass_kg=0.1"]) == 0
    (*_, verdict), _ = read_lines(capsys)
    assert verdict.startswith("PASS hold_three: ")
    assert verdict.endswith(
        "run by foreign_controller.Hold; judged: physics, task, contacts, forces; not recorded: internals; "
        "the world is not as believed: object.mass_kg 0.1 instead of 0.06"
    )
    folder = cwd / "runs" / "hold_three"
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert report["groups"] == ["physics", "task", "contacts", "forces"]
    assert report["untrue"] == {"object.mass_kg": {"believed": 0.06, "true": 0.1}}
    assert "mass_kg = 0.06" in (folder / "problem.toml").read_text(encoding="utf-8")
    assert (folder / "summary.png").is_file()
    assert main(["validate", str(folder)]) == 0
    assert read_lines(capsys)[0][-1] == verdict


def test_one_that_lets_go_fails(cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "hold_three", "--controller", f"{EXAMPLE}:LetGo"]) == 1
    assert read_lines(capsys)[0][-1].startswith("FAIL not_dropped ")
    assert not ValidationReport.load(cwd / "runs" / "hold_three" / "report.json").is_passed


def test_an_error_of_the_controllers_is_one_sentence_and_keeps_the_run(
    mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "hold_three", "--controller", "mine_in_tests:Stay"]) == 2
    _, err = read_lines(capsys)
    assert err == [
        "dexplan: controller mine_in_tests.Stay: its step raised RuntimeError: I am tired (mine_in_tests.py, line 17) "
        "at 0.020 s; it has to return; the run so far (0.02 s) is in runs/hold_three/trace.npz"
    ]
    folder = mine / "runs" / "hold_three"
    assert {path.name for path in folder.iterdir()} == {"problem.toml", "plan.json", "model.xml", "trace.npz"}
    assert Trace.load(folder / "trace.npz").sample_count == 5
    assert main(["validate", str(folder)]) == 1
    assert read_lines(capsys)[0][-1].startswith("FAIL phases_in_order ")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("degrees", "a joint angle in radians, and from"),
        ("leave", "its step raised SystemExit: 0"),
    ],
)
def test_what_is_wrong_from_the_first_tick_is_told(
    name: str, words: str, mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "hold_three", "--controller", f"mine_in_tests:{name}"]) == 2
    _, (err,) = read_lines(capsys)
    assert words in err
    assert " at 0.000 s; " in err


def test_a_run_of_ours_that_lost_its_internals_is_not_let_off(
    cwd: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "hold_three"]) == 0
    path = cwd / "runs" / "hold_three" / "trace.npz"
    whole = Trace.load(path)
    kept = {name: column for name, column in whole.columns.items() if name not in OWN_COLUMNS}
    Trace(whole.model_xml, kept, whole.meta).save(path)
    capsys.readouterr()
    assert main(["validate", str(path.parent)]) == 1
    lines = read_lines(capsys)[0]
    assert lines[-1].startswith("FAIL force_qp_feasible without a value")
    assert not any("not recorded" in line for line in lines)
    # Under another controller's name it claims no more than its controls show, and every line says so.
    Trace(whole.model_xml, kept, {**whole.meta, "controller": "mine"}).save(path)
    assert main(["validate", str(path.parent)]) == 0
    assert read_lines(capsys)[0][-1].endswith(
        "run by mine; judged: physics, task, contacts, forces; not recorded: internals"
    )


BAD = {
    "nothing": "controller 'nothing': it is no name of a controller; accepted: MODULE:NAME or FILE.py:NAME",
    "mine_in_tests": "it is no name of a controller",
    "mine_in_tests:": "it is no name of a controller",
    ":Stay": "it is no name of a controller",
    "mine_in_tests:Stay()": "it is no name of a controller",
    "mine_in_tests:Stey": "unknown controller in mine_in_tests 'Stey'; known: Needs, Stay, degrees, leave; did you mean 'Stay'?",
    "mine_in_tests:LIMIT": "controller builtins.int: it has no step and cannot be called",
    "mine_in_tests:Needs": "Needs() raised TypeError: ",
    "no_such_module:Stay": "importing no_such_module raised ModuleNotFoundError: No module named 'no_such_module'",
    "no such module:Stay": "importing no such module raised ModuleNotFoundError",
    "..mine_in_tests:Stay": "importing ..mine_in_tests raised ",
    "no_such_file.py:Stay": "there is no file no_such_file.py",
    "broken.py:Stay": "importing broken.py raised SyntaxError: ",
    "leaves.py:Stay": "importing leaves.py raised SystemExit: 3",
    "folder.py:Stay": "there is no file folder.py",
    "binary.py:Stay": "importing binary.py raised ",
}


@pytest.mark.parametrize("name", BAD)
def test_what_names_no_controller_is_refused_before_anything_is_done(
    name: str, mine: Path, capsys: pytest.CaptureFixture[str], pipeline: SimpleNamespace
) -> None:
    (mine / "broken.py").write_text("def step(:\n", encoding="utf-8")
    (mine / "leaves.py").write_text("raise SystemExit(3)\n", encoding="utf-8")
    (mine / "binary.py").write_bytes(b"\xff\x00\xfe")
    (mine / "folder.py").mkdir()
    assert main(["run", "hold_three", "--controller", name]) == 2
    out, err = read_lines(capsys)
    assert out == []
    assert len(err) == 1
    assert BAD[name] in err[0]
    assert not (mine / "runs").exists()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("friction.sliding", "--true: 'friction.sliding' is no assignment"),
        ("friction.sliding=", "--true: 'friction.sliding=' is no assignment"),
        ("friction.sliding=[", "--true: friction.sliding: '[' is no value"),
        ("friction.sliding=-1", "hold_three: friction.sliding: -1.0 is out of range"),
        ("friction.sleding=1", "hold_three: friction.sleding"),
        (
            "friction.safety=1.0",
            "world: friction.safety: 1 is given where the problem has 1.3; a world may differ in",
        ),
        ("goal.rotation.angle_deg=9", "world: goal.rotation"),
        ("acceptance.penetration_max_um=1000", "world: acceptance.penetration_max_um"),
    ],
)
def test_what_is_no_world_is_refused_before_anything_is_done(
    given: str, words: str, cwd: Path, capsys: pytest.CaptureFixture[str], pipeline: SimpleNamespace
) -> None:
    assert main(["run", "hold_three", "--true", given]) == 2
    out, err = read_lines(capsys)
    assert out == []
    assert len(err) == 1
    assert err[0].startswith(f"dexplan: {words}")
    assert not (cwd / "runs").exists()


def test_controllers_are_found_by_module_and_by_file(mine: Path) -> None:
    assert type(load_controller("mine_in_tests:Stay")).__name__ == "Stay"
    assert callable(load_controller("./mine_in_tests.py:degrees"))
    assert load_controller("numpy:sin") is np.sin
    with pytest.raises(DexplanError, match="no name of a controller"):
        load_controller("")
