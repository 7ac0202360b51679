"""What a newcomer types wrongly: the answer speaks of the command that was asked for, and says what it accepts."""

from __future__ import annotations

from pathlib import Path

import pytest

from dexplan.cli import main

TURN = "format = 1\n[goal]\nrotation = { axis = [0, 0, 1], angle_deg = 1 }\n"

LINES = {
    "plan hold_two --seed 3": "plan has no option --seed (an option of run); plan accepts: --set KEY=VALUE, --out DIR,",
    "plan hold_two --video": "plan has no option --video (an option of run)",
    "inspect hold_two --no-video": "inspect has no option --no-video (an option of run)",
    "validate there --out here": "validate has no option --out (an option of inspect, plan, run); validate accepts: no options",
    "render there --video": "render has no option --video (an option of run)",
    "list --json": "list has no option --json",
    "run hold_two --vidoe": "did you mean --video?",
    "run hold_two --sed 3": "did you mean --seed?",
    "run hold_two -o there": "run has no option -o; run accepts: --set KEY=VALUE, --out DIR, --video, --no-video, --report, "
    "--no-report, --seed N",
    "run hold_two --video=yes": "--video takes no value, 'yes' was given",
    "run hold_two --seed": "--seed needs a value; accepted: --seed N",
    "run hold_two --seed --video": "--seed needs a value",
    "run hold_two --seed 1.5": "--seed: '1.5' is no whole number",
    "run hold_two --seed=three": "--seed: 'three' is no whole number",
    "run hold_two --seed=-1": "seed: -1 is out of range",
    "run hold_two --out": "--out needs a value; accepted: --out DIR",
    "run hold_two --out=": "--out: '' says nothing",
    "run": "PROBLEM is missing; accepted: dexplan run PROBLEM",
    "run --video": "PROBLEM is missing",
    "validate": "DIR is missing; accepted: dexplan validate DIR, a folder written by `dexplan run`",
    "run hold_two hold_three": "'hold_three' is one argument too many",
    "run hold_two --set friction.sliding=0.5 friction.safety=1.2": "each KEY=VALUE needs its own --set",
    "run hold_two --set friction.sliding 0.5": "'0.5' is one argument too many",
    "--seed 3 run hold_two": "'--seed' stands before the command; accepted: dexplan run ... --seed",
    "hold_two": "unknown command 'hold_two'; accepted: list, inspect, plan, run",
    "my.toml": "no command before 'my.toml'; accepted: dexplan run my.toml",
    "runn hold_two": "unknown command 'runn'; did you mean 'run'?",
    "Plan hold_two": "did you mean 'plan'?",
    "run hold_tow": "did you mean 'hold_two'?",
    "run HOLD_TWO": "did you mean 'hold_two'?",
    "run hold_two.toml": "accepted: hold_two, the built-in problem of that name",
    "run folder": "is a directory; accepted: a problem file in TOML, such as 'folder/problem.toml'",
    "validate folder/problem.toml": "is not a folder; accepted: a folder written by 'dexplan run'",
    "validate a_run": "no such folder; accepted: a folder written by 'dexplan run', such as 'runs/a_run'",
    "run hold_two --set sliding=0.3": "did you mean 'friction.sliding'?",
    "run hold_two --set friction.sliding=0,3": "'0,3' is no value",
    "run hold_two --set goal.rotation.angle_deg=90deg": "'90deg' is no value",
    "run hold_two --set hand.tip_radii_m=0.01": "accepted: a list with one number of metres per finger",
    "run hold_two --set hand.tip_radii_m.3=0.01": "accepted: 0 to 2",
    'run hold_two --set hand.joint_ranges_deg."finger_1.joint_1"=[-340,340]': "both from -85.94 to 85.94",
}


@pytest.mark.parametrize("line", LINES, ids=lambda line: line.replace(" ", "_"))
def test_wrong_lines(line: str, cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("folder", "runs/a_run"):
        (cwd / name).mkdir(parents=True)
    (cwd / "folder/problem.toml").write_text(TURN)
    (cwd / "runs/a_run/trace.npz").write_bytes(b"")
    before = sorted(cwd.rglob("*"))
    assert main(line.split(" ")) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("dexplan: ")
    assert err.count("\n") == 1
    assert LINES[line] in err
    assert sorted(cwd.rglob("*")) == before


@pytest.mark.parametrize("odd", ["", " ", "a\0b"])
@pytest.mark.parametrize(
    "command", [["plan"], ["validate"], ["run", "hold_two", "--out"], ["run", "hold_two", "--set"]]
)
def test_words_that_say_nothing(
    command: list[str], odd: str, cwd: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, odd]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(cwd.iterdir())


@pytest.mark.parametrize("line", ["help", "help run", "run --help", "run -h", "plan hold_two --help"])
def test_help_is_given_wherever_it_is_asked_for(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line.split()) == 0
    assert "usage: dexplan" in capsys.readouterr().out


FILES = {
    "unclosed table": (TURN.encode() + b"[friction\nsliding = 0.5\n", "line 4, column 10"),
    "no quotes": (b"format = 1\nname = " + 200 * b"x" + b"\n", "line 2, column 8"),
    "long key": (TURN.encode() + 300 * b"x" + b" 3\n", "line 4, column"),
    "twice": (TURN.encode() + b"[goal]\n", "line 4"),
    "json": (b'{"format": 1}', "line 1, column 1"),
    "latin-1": (TURN.encode() + "# größe\n".encode("latin-1"), "byte 69 (line 4) is not text"),
    "utf-16": (TURN.encode("utf-16"), "is not text; accepted: a problem file in TOML, UTF-8"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_are_no_toml_say_where(name: str, cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, message = FILES[name]
    (cwd / "p.toml").write_bytes(content)
    assert main(["plan", "p.toml"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("dexplan: p.toml: ")
    assert err.count("\n") == 1
    assert message in err
    assert len(err) < 300
