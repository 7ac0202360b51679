"""The command line: from arguments to a command, from what it raises to an exit code.

0 the physics confirms the plan; 1 an honest no; 2 the input cannot be read, or the output not be written (one line on stderr); 70
a defect of ours (traceback); 130 interrupted, 143 terminated (128 and the signal's number); 141 the reader of stdout went away.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dexplan import commands
from dexplan.errors import DexplanError
from dexplan.terminal import (
    Terminated,
    describe_refusal,
    ending_on_signals,
    make_printable,
    prepare_environment,
)
from dexplan.testing.scene_run import SceneRun
from dexplan.usage import UsageError, check_usage

BAD_INPUT, DEFECT, INTERRUPTED, BROKEN_PIPE = 2, 70, 130, 141
SIGNALLED = 128
"""Added to the number of the signal that ended the process."""


_Problem = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROBLEM")]
_Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
_Sets = Annotated[
    tyro.conf.UseAppendAction[tuple[str, ...]],
    tyro.conf.arg(name="set", metavar="KEY=VALUE", help_behavior_hint=""),
]
_Out = Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: runs/NAME)")]
_Text = Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: none)")]
_Seed = Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the problem's)")]


@dataclass(frozen=True)
class List:
    """List the built-in problems and scenes, one line each."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return commands.list_everything()


@dataclass(frozen=True)
class Inspect:
    """Show what the hand can do in a problem: workspaces, force-closure maps, loads (picture and numbers)."""

    problem: _Problem
    """A built-in name (see `dexplan list`) or the path of a problem file."""
    sets: _Sets = ()
    """Replace a value of the problem file, e.g. goal.rotation.angle_deg=90; repeatable."""
    out: _Out = None
    """Folder for the files."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return commands.inspect(self.problem, self.sets, self.out)


@dataclass(frozen=True)
class Plan:
    """Plan a problem without simulating it; saves problem.toml and plan.json."""

    problem: _Problem
    """A built-in name (see `dexplan list`) or the path of a problem file."""
    sets: _Sets = ()
    """Replace a value of the problem file, e.g. goal.rotation.angle_deg=90; repeatable."""
    out: _Out = None
    """Folder for the files."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return commands.plan(self.problem, self.sets, self.out)


@dataclass(frozen=True)
class Run:
    """Plan, simulate and judge a problem; the last line is PASS or FAIL with the first failing check."""

    problem: _Problem
    """A built-in name (see `dexplan list`) or the path of a problem file."""
    sets: _Sets = ()
    """Replace a value of the problem file, e.g. goal.rotation.angle_deg=90; repeatable."""
    out: _Out = None
    """Folder for the files."""
    video: bool = False
    """Also make video.mp4."""
    seed: _Seed = None
    """Replace the problem's seed."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return commands.run(self.problem, self.sets, self.out, self.video, self.seed)


@dataclass(frozen=True)
class Validate:
    """Judge a saved run again, by replaying it; reads nothing but its folder."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return commands.validate(self.folder)


@dataclass(frozen=True)
class Render:
    """Make the video of a saved run."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return commands.render(self.folder)


@dataclass(frozen=True)
class Doctor:
    """Why does it slip? Judge the contacts of any MuJoCo scene; without a scene, check this machine."""

    scene: Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")] = None
    """An MJCF file, or an .mjb of it."""
    state: _Text = None
    """The keyframe to start from."""
    ctrl: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: held)")] = None
    """Controls: an .npz with ctrl (T, nu), or an .npy of it."""
    object: _Text = None
    """The body or geom that is held."""
    tips: _Text = None
    """The bodies or geoms that hold it, with commas between."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 2.0
    """How long controls are held where no file has them."""
    trying: Annotated[bool, tyro.conf.arg(name="try")] = False
    """Also run the scene under each setting that may cure it, and show before and after."""

    def run(self) -> int:
        """Do it; return the exit code."""
        given = self.state, self.ctrl, self.object, self.tips
        if self.scene is None:
            return commands.check_machine(is_bare=not self.trying and all(value is None for value in given))
        run = SceneRun(self.scene, self.state, self.ctrl, self.object, _split(self.tips), self.seconds)
        return commands.doctor(run, self.trying)


@dataclass(frozen=True)
class Stability:
    """Record how contacts behave, or check it against what was recorded: of a run folder or of any MuJoCo scene."""

    action: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ACTION")]
    """record or check"""
    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """A folder written by `dexplan run`, or an MJCF file."""
    baselines: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("contact_baselines")
    """Folder of the baselines."""
    name: _Text = None
    """Name of the baseline."""
    state: _Text = None
    """The keyframe to start from."""
    ctrl: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: held)")] = None
    """Controls: an .npz with ctrl (T, nu), or an .npy of it."""
    object: _Text = None
    """The body or geom that is held."""
    tips: _Text = None
    """The bodies or geoms that hold it, with commas between."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 2.0
    """How long controls are held where no file has them."""
    junit: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: none)")] = None
    """Also write the outcome as a JUnit report."""

    def run(self) -> int:
        """Do it; return the exit code."""
        run = SceneRun(self.source, self.state, self.ctrl, self.object, _split(self.tips), self.seconds)
        return commands.stability(self.action, run, self.baselines, self.name, self.junit)


def _split(names: str | None) -> tuple[str, ...]:
    return tuple(name.strip() for name in names.split(",") if name.strip()) if names else ()


COMMANDS = {
    "list": List,
    "inspect": Inspect,
    "plan": Plan,
    "run": Run,
    "validate": Validate,
    "render": Render,
    "doctor": Doctor,
    "stability": Stability,
}

Command = (
    Annotated[List, tyro.conf.subcommand(name="list")]
    | Annotated[Inspect, tyro.conf.subcommand(name="inspect")]
    | Annotated[Plan, tyro.conf.subcommand(name="plan")]
    | Annotated[Run, tyro.conf.subcommand(name="run")]
    | Annotated[Validate, tyro.conf.subcommand(name="validate")]
    | Annotated[Render, tyro.conf.subcommand(name="render")]
    | Annotated[Doctor, tyro.conf.subcommand(name="doctor")]
    | Annotated[Stability, tyro.conf.subcommand(name="stability")]
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line (``sys.argv`` by default) and return its exit code."""
    make_printable()
    try:
        with ending_on_signals():
            prepare_environment()
            code = _run(sys.argv[1:] if argv is None else list(argv))
            sys.stdout.flush()
        return code
    except DexplanError as error:
        return _complain(str(error), BAD_INPUT)
    except KeyboardInterrupt as error:
        told = [
            "terminated" if isinstance(error, Terminated) else "interrupted",
            *getattr(error, "__notes__", []),
        ]
        code = SIGNALLED + error.signum if isinstance(error, Terminated) else INTERRUPTED
        return _complain("; ".join(told), code)
    except BrokenPipeError:
        _drop_output()
        return BROKEN_PIPE
    except OSError as error:
        sentence = describe_refusal(error)
        if sentence is None:
            traceback.print_exc()
            return DEFECT
        if error.filename is None:
            # It may have been stdout itself, which Python would flush once more.
            _drop_output()
        return _complain(sentence, BAD_INPUT)
    except Exception:
        traceback.print_exc()
        return DEFECT


def _complain(text: str, code: int) -> int:
    """Say in one line on stderr what was wrong, and return the exit code."""
    with contextlib.suppress(OSError):
        print(f"dexplan: {' '.join(text.split())}", file=sys.stderr)
    return code


def _drop_output() -> None:
    """Let what Python flushes at its exit go nowhere: there is nobody to read it."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _run(argv: list[str]) -> int:
    if argv == ["--version"]:
        from dexplan import __version__

        print(f"dexplan {__version__}")
        return 0
    command = _parse([*argv[1:], "--help"] if argv[:1] == ["help"] else argv)
    return 0 if command is None else int(command.run())


def _parse(argv: list[str]) -> List | Inspect | Plan | Run | Validate | Render | Doctor | Stability | None:
    """Return the command in ``argv``, None when help was asked for and given.

    What can be wrong is looked for first, for tyro draws its complaints in a box that suggests other commands' options.
    """
    if not {"-h", "--help"} & set(argv):
        check_usage(argv, COMMANDS)
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.cli(
                Command,
                prog="dexplan",
                description="Dexterous manipulation by rolling and finger gaiting, judged by MuJoCo.",
                args=argv,
            )
    except SystemExit as exit_:
        if not exit_.code:
            return None
    raise UsageError(f"the arguments {' '.join(argv)!r} cannot be read (see dexplan --help)")


if __name__ == "__main__":
    raise SystemExit(main())
