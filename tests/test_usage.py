"""What a newcomer types wrongly: the answer speaks of the command that was asked for, and says what it accepts."""

from __future__ import annotations

from pathlib import Path

import pytest

from dexplan.cli import main

TURN = "format = 1\n[goal]\nrotation = { axis = [0, 0, 1], angle_deg = 1 }\n"

LINES = {
    "validate there --seed 3": "validate has no option --seed (an option of show, inspect, plan, run, figures)",
    "list --seed 3": "list has no option --seed (an option of show, inspect, plan, run, figures); list accepts: no options",
    "plan hold_two --seed 1.5": "--seed: '1.5' is no whole number",
    "inspect hold_two --seed=-3": "seed: -3 is out of range",
    "show hold_two --seed": "--seed needs a value; accepted: --seed N",
    "show": "PROBLEM is missing; accepted: dexplan show PROBLEM",
    "show hold_two --out here": "show has no option --out (an option of inspect, plan, run, render, frames)",
    "show hold_tow": "did you mean 'hold_two'?",
    "show folder": "is a directory; accepted: a problem file in TOML, such as 'folder/problem.toml'",
    "show hold_two -q": "show has no option -q (an option of",
    "new": "FILE is missing; accepted: dexplan new FILE, a new file such as my_problem.toml",
    "new mine": "'mine' does not end in .toml; accepted: a new problem file, such as my_problem.toml",
    "new mine.TOML": "'mine.TOML' does not end in .toml",
    "new .toml": "'.toml' does not end in .toml",
    "new folder": "'folder' does not end in .toml",
    "new folder/problem.toml": "'folder/problem.toml' is there and is not overwritten",
    "new nowhere/mine.toml": "there is no folder 'nowhere'",
    "new folder/problem.toml/mine.toml": "there is no folder 'folder/problem.toml'",
    "new mine.toml yours.toml": "'yours.toml' is one argument too many",
    "new mine.toml --force": "new has no option --force; new accepts: no options",
    "schema folder/problem.toml": "'folder/problem.toml' does not end in .json",
    "schema runs": "'runs' does not end in .json",
    "schema nowhere/a.json": "there is no folder 'nowhere'",
    "schema other.json": "'other.json' is there and is not overwritten",
    "frames": "DIR is missing; accepted: dexplan frames DIR, a folder written by `dexplan run`",
    "frames nowhere": "nowhere: no such folder; accepted: a folder written by 'dexplan run'",
    "frames folder": "trace.npz: there is no such file",
    "frames folder/problem.toml": "is not a folder",
    "frames runs/a_run --every 0": "--every: 0 is no time between pictures; accepted: seconds, more than 0",
    "frames runs/a_run --every=-1": "--every: -1 is no time between pictures",
    "frames runs/a_run --every nan": "--every: 'nan' is no number; accepted: --every S",
    "frames runs/a_run --every soon": "--every: 'soon' is no number",
    "frames runs/a_run --every inf": "--every: 'inf' is no number",
    "frames runs/a_run --out folder/problem.toml": "'folder/problem.toml' is not a folder",
    "frames runs/a_run": "plan.json: there is no such file",
    "figures nowhere": "unknown problem 'nowhere'",
    "figures nowhere.toml": "nowhere.toml: no such file",
    "figures hold_two nowhere": "unknown problem 'nowhere'",
    "figures folder": "trace.npz: there is no such file",
    "figures --most 0": "--most: 0 pictures make no row; accepted: a whole number, 1 or more",
    "figures --most many": "--most: 'many' is no whole number",
    "figures --most=-2": "--most: -2 pictures make no row",
    "figures hold_two --seed x": "--seed: 'x' is no whole number",
    "figures --video": "figures has no option --video (an option of run)",
    "run hold_two -v -q": "--verbose and --quiet contradict each other; accepted: one of the two",
    "run hold_two --verbose=2": "--verbose takes no value, '2' was given",
    "-q run hold_two": "'-q' stands before the command; accepted: dexplan run ... -q",
    "plan hold_two --video": "plan has no option --video (an option of run)",
    "inspect hold_two --no-video": "inspect has no option --no-video (an option of run)",
    "validate there --out here": "validate has no option --out (an option of inspect, plan, run, render, frames); "
    "validate accepts: --verbose, --quiet",
    "render there --video": "render has no option --video (an option of run)",
    "list --json": "list has no option --json",
    "run hold_two --vidoe": "did you mean --video?",
    "run hold_two --sed 3": "did you mean --seed?",
    "run hold_two -o there": "run has no option -o; run accepts: --set KEY=VALUE, --out DIR, --video, --no-video, "
    "--seed N, --controller MODULE:NAME, --true KEY=VALUE, --verbose, --quiet",
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
    "hold_two": "unknown command 'hold_two'; accepted: list, show, new, schema, inspect, plan, run",
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
    (cwd / "other.json").write_text("{}")
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
