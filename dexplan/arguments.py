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
_Cameras = Annotated[
    tyro.conf.UseAppendAction[tuple[str, ...]],
    tyro.conf.arg(name="camera", metavar="NAME", help_behavior_hint="(default: overview and closeup)"),
]
_Out = Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: runs/NAME)")]
_Text = Annotated[str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: none)")]
_Controller = Annotated[
    str | None,
    tyro.conf.arg(metavar="MODULE:NAME", help_behavior_hint="(default: dexplan's own)"),
]
_Truths = Annotated[
    tyro.conf.UseAppendAction[tuple[str, ...]],
    tyro.conf.arg(name="true", metavar="KEY=VALUE", help_behavior_hint=""),
]
_Seed = Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the problem's)")]
_Camera = Annotated[
    str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: those that show most)")
]


@dataclass(frozen=True, kw_only=True)
class Speaking:
    """What every command that works takes: how much it says."""

    verbose: Annotated[bool, tyro.conf.arg(aliases=["-v"]), tyro.conf.FlagCreatePairsOff] = False
    """Also say on stderr what is being done and how long it takes."""
    quiet: Annotated[bool, tyro.conf.arg(aliases=["-q"]), tyro.conf.FlagCreatePairsOff] = False
    """Say nothing but the last line and what goes wrong."""


@dataclass(frozen=True)
class List:
    """List the built-in problems and scenes, one line each."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return problems.list_everything()


@dataclass(frozen=True)
class Show:
    """Print a problem: in words, and as its file with every default written out."""

    problem: _Problem
    """A built-in name (see `dexplan list`) or the path of a problem file."""
    sets: _Sets = ()
    """Replace a value of the problem file, e.g. goal.rotation.angle_deg=90; repeatable."""
    seed: _Seed = None
    """Replace the problem's seed."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return problems.show(self.problem, self.sets, self.seed)


@dataclass(frozen=True)
class New:
    """Write a problem file to start from, with every key, what it means and accepts, and its default."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The file to write, such as my_problem.toml; nothing is overwritten."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return problems.new(self.file)


@dataclass(frozen=True)
class Schema:
    """Print the JSON schema of problem files, with which editors complete and check them."""

    file: Annotated[
        Path | None,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: stdout)"),
    ] = None
    """The file to write instead, such as problem.schema.json."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return problems.write_schema(self.file)


@dataclass(frozen=True)
class Inspect(Speaking):
    """Show what the hand can do in a problem: workspaces, force-closure maps, loads (picture and numbers)."""

    problem: _Problem
    """A built-in name (see `dexplan list`) or the path of a problem file."""
    sets: _Sets = ()
    """Replace a value of the problem file, e.g. goal.rotation.angle_deg=90; repeatable."""
    out: _Out = None
    """Folder for the files."""
    seed: _Seed = None
    """Replace the problem's seed."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return problems.inspect(self.problem, self.sets, self.out, self.seed)


@dataclass(frozen=True)
class Plan(Speaking):
    """Plan a problem without simulating it; saves problem.toml and plan.json."""

    problem: _Problem
    """A built-in name (see `dexplan list`) or the path of a problem file."""
    sets: _Sets = ()
    """Replace a value of the problem file, e.g. goal.rotation.angle_deg=90; repeatable."""
    out: _Out = None
    """Folder for the files."""
    seed: _Seed = None
    """Replace the problem's seed."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return problems.plan(self.problem, self.sets, self.out, self.seed)


@dataclass(frozen=True)
class Run(Speaking):
    """Plan, simulate and judge a problem; the last line is PASS, FAIL with the first failing check, or REFUSED with why."""

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
    controller: _Controller = None
    """Run under a controller of yours: a module or a .py file, and a function or class in it."""
    truths: _Truths = ()
    """How the world truly is, which nobody is told, e.g. friction.sliding=0.5; repeatable."""

    def run(self) -> int:
        """Do it; return the exit code."""
        given = runs.Given(self.seed, self.controller, self.truths)
        return runs.run(self.problem, self.sets, self.out, self.video, given)


@dataclass(frozen=True)
class Validate(Speaking):
    """Judge a saved run again, by replaying it; reads nothing but its folder."""

    folder: _Folder
    """A folder written by `dexplan run`."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return runs.validate(self.folder)


@dataclass(frozen=True)
class Render(Speaking):
    """Make the film of a saved run."""

    folder: _Folder
    """A folder written by `dexplan run`."""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: video.mp4 in DIR)")
    ] = None
    """The film, .mp4 or .gif."""
    cameras: _Cameras = ()
    """One camera, or two side by side: overview, closeup, top, side; repeatable."""
    size: Annotated[str, tyro.conf.arg(metavar="WxH")] = "1280x720"
    """Width and height in pixels."""
    fps: Annotated[float, tyro.conf.arg(metavar="N")] = 25.0
    """Pictures per second, of a .gif at most 20."""
    quality: Annotated[str, tyro.conf.arg(metavar="NAME")] = "normal"
    """draft, normal (smooth edges) or fine (shadows, too)."""

    def run(self) -> int:
        """Do it; return the exit code."""
        from dexplan.viz.film import CAMERAS, FilmOptions, parse_size

        options = FilmOptions(parse_size(self.size), self.cameras or CAMERAS, self.fps, self.quality)
        return runs.render(self.folder, self.out, options)


@dataclass(frozen=True)
class Frames(Speaking):
    """Draw pictures of a saved run: its start and the end of every action, or one every so many seconds."""

    folder: _Folder
    """A folder written by `dexplan run`."""
    every: Annotated[
        float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(default: one per action)")
    ] = None
    """Time between two pictures."""
    camera: _Camera = None
    """The camera of the model to look through."""
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: frames in it)")
    ] = None
    """Folder for the pictures."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return runs.draw_stills(self.folder, self.out, self.every, self.camera)


@dataclass(frozen=True)
class Figures(Speaking):
    """Draw rows of numbered pictures, as in the paper's figures 3 to 5: frames.png in each run folder."""

    runs: Annotated[
        tuple[str, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="RUN", help_behavior_hint="(default: the three figures)"),
    ] = ()
    """Folders written by `dexplan run`; a problem is run first."""
    most: Annotated[int, tyro.conf.arg(metavar="N")] = 12
    """How many pictures a figure has at most."""
    camera: _Camera = None
    """The camera of the model to look through."""
    seed: _Seed = None
    """Replace the seed of the problems that are run."""

    def run(self) -> int:
        """Do it; return the exit code."""
        return runs.draw_figures(self.runs, self.most, self.camera, self.seed)


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
    "show": Show,
    "new": New,
    "schema": Schema,
    "inspect": Inspect,
    "plan": Plan,
    "run": Run,
    "validate": Validate,
    "render": Render,
    "frames": Frames,
    "figures": Figures,
    "doctor": Doctor,
    "stability": Stability,
}

Command = (
    Annotated[List, tyro.conf.subcommand(name="list")]
    | Annotated[Show, tyro.conf.subcommand(name="show")]
    | Annotated[New, tyro.conf.subcommand(name="new")]
    | Annotated[Schema, tyro.conf.subcommand(name="schema")]
    | Annotated[Inspect, tyro.conf.subcommand(name="inspect")]
    | Annotated[Plan, tyro.conf.subcommand(name="plan")]
    | Annotated[Run, tyro.conf.subcommand(name="run")]
    | Annotated[Validate, tyro.conf.subcommand(name="validate")]
    | Annotated[Render, tyro.conf.subcommand(name="render")]
    | Annotated[Frames, tyro.conf.subcommand(name="frames")]
    | Annotated[Figures, tyro.conf.subcommand(name="figures")]
    | Annotated[Doctor, tyro.conf.subcommand(name="doctor")]
    | Annotated[Stability, tyro.conf.subcommand(name="stability")]
)
