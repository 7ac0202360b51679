"""What each command takes, as dataclasses that tyro reads: the one list of commands and their options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dexplan.commands import problems, runs, scenes
from dexplan.testing.scene_run import SceneRun

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
        return problems.list_everything()


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
        return problems.inspect(self.problem, self.sets, self.out)


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
        return problems.plan(self.problem, self.sets, self.out)


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
        return runs.run(self.problem, self.sets, self.out, self.video, self.seed)


@dataclass(frozen=True)
class Validate:
    """Judge a saved run again, by replaying it; reads nothing but its folder."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return runs.validate(self.folder)


@dataclass(frozen=True)
class Render:
    """Make the video of a saved run."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return runs.render(self.folder)


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
            return scenes.check_machine(is_bare=not self.trying and all(value is None for value in given))
        run = SceneRun(self.scene, self.state, self.ctrl, self.object, _split(self.tips), self.seconds)
        return scenes.doctor(run, self.trying)


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
        return scenes.stability(self.action, run, self.baselines, self.name, self.junit)


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
