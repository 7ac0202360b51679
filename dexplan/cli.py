"""The command line: from arguments to a command, from what it raises to an exit code.

0 the physics confirms the plan; 1 an honest no; 2 the input cannot be read (one line on stderr); 70 a
defect of ours (traceback); 130 interrupted; 141 the reader of stdout went away.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dexplan import commands
from dexplan.errors import DexplanError

BAD_INPUT, DEFECT, INTERRUPTED, BROKEN_PIPE = 2, 70, 130, 141


class UsageError(DexplanError):
    """The arguments are no command."""


_Problem = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROBLEM")]
_Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
_Sets = Annotated[
    tyro.conf.UseAppendAction[tuple[str, ...]],
    tyro.conf.arg(name="set", metavar="KEY=VALUE", help_behavior_hint=""),
]
_Out = Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: runs/NAME)")]
_Seed = Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the problem's)")]


@dataclass(frozen=True)
class List:
    """List the built-in problems and scenes, one line each."""

    def run(self) -> int:
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
        return commands.run(self.problem, self.sets, self.out, self.video, self.seed)


@dataclass(frozen=True)
class Validate:
    """Judge a saved run again, by replaying it; reads nothing but its folder."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        return commands.validate(self.folder)


@dataclass(frozen=True)
class Render:
    """Make the video of a saved run."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        return commands.render(self.folder)


Command = (
    Annotated[List, tyro.conf.subcommand(name="list")]
    | Annotated[Inspect, tyro.conf.subcommand(name="inspect")]
    | Annotated[Plan, tyro.conf.subcommand(name="plan")]
    | Annotated[Run, tyro.conf.subcommand(name="run")]
    | Annotated[Validate, tyro.conf.subcommand(name="validate")]
    | Annotated[Render, tyro.conf.subcommand(name="render")]
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line (``sys.argv`` by default) and return its exit code."""
    # The matrices here are small: threads of the linear-algebra library only get in each other's way.  Set before numpy loads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        code = _run(sys.argv[1:] if argv is None else list(argv))
        sys.stdout.flush()
        return code
    except DexplanError as error:
        print(f"dexplan: {' '.join(str(error).split())}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("dexplan: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # Python flushes stdout once more at exit; let that go nowhere.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except Exception:
        traceback.print_exc()
        return DEFECT


def _run(argv: list[str]) -> int:
    if argv == ["--version"]:
        from dexplan import __version__

        print(f"dexplan {__version__}")
        return 0
    command = _parse(argv)
    return 0 if command is None else int(command.run())


def _parse(argv: list[str]) -> List | Inspect | Plan | Run | Validate | Render | None:
    """Return the command in ``argv``, None when help was asked for and given.

    tyro draws its complaints in a box; here each becomes one sentence.
    """
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
    raise UsageError(_as_sentence(complaint.getvalue(), argv))


def _as_sentence(box: str, argv: list[str]) -> str:
    """Return what tyro's box says, up to its first blank line or rule, and where to read on."""
    names = [kind.__name__.lower() for kind in (List, Inspect, Plan, Run, Validate, Render)]
    command = next((word for word in argv[:1] if word in names), None)
    if command is None:
        first = next((word for word in argv if not word.startswith("-")), None)
        fact = (
            f"unknown command {first!r}"
            if first
            else f"no command in {' '.join(argv)!r}"
            if argv
            else "no command"
        )
        return f"{fact}; accepted: {', '.join(names)} (see dexplan --help)"
    missing = re.search(r"Missing from dexplan \w+:\s*│\s*│\s*(\w+)", box)
    if missing:
        return f"{missing[1]} is missing (see dexplan {command} --help)"
    lines = [re.sub(r"^[│|]\s?|\s*[│|]$", "", line) for line in box.splitlines()]
    body: list[str] = []
    for line in lines[1:]:
        if not line.strip(" ─"):
            break
        body.append(line.strip())
    suggestion = re.search(r"Perhaps you meant:\s*│?\s*│?\s*(--\S+)", box)
    fact = " ".join(body) or "the arguments cannot be read"
    fact = fact.rstrip(".") + (f"; did you mean {suggestion[1]}?" if suggestion else "")
    return f"{fact} (see dexplan {command} --help)"


if __name__ == "__main__":
    raise SystemExit(main())
