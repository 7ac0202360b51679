"""A pipeline that does nothing and files that look like a run, for tests of the command line."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from dexplan import run_folder
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.trace import Trace
from dexplan.viz.canvas import write_picture

FILM = b"\0\0\0\x20ftypisom dexplan"


class FakePlan:
    def __init__(self, status: str) -> None:
        self.status, self.is_solved = status, status == "solved"
        self.actions: tuple[object, ...] = ()
        self.reason = "the reason"

    def explain(self, limits: object = None) -> str:
        return "the plan in words"

    def save(self, path: Path) -> None:
        path.write_text('{"format": 1, "status": "", "fingers": [], "actions": []}')


class FakeReport:
    def __init__(self, verdict: str) -> None:
        self.verdict = verdict
        self.physics = self.timing = self.versions = {"timestep_s": 0.001}

    def table(self) -> str:
        return "the table"

    def summary_line(self) -> str:
        return "PASS all" if self.verdict == "pass" else "FAIL not_dropped 12 mm"

    def save(self, path: Path) -> None:
        path.write_text('{"format": 1, "verdict": "", "checks": []}')


def save_run(folder: Path, problem: Problem, *given: Any) -> None:
    """Write what a run always writes, but its picture, as files that are recognised as ours and are as small as they can be."""
    folder.mkdir(parents=True, exist_ok=True)
    run_folder.save_problem(problem, folder / "problem.toml")
    FakePlan("solved").save(folder / "plan.json")
    FakeReport("pass").save(folder / "report.json")
    (folder / "model.xml").write_text('<mujoco model="m"><geom name="object/surface"/></mujoco>')
    Trace("<mujoco/>", {"time": np.zeros(1)}, {}).save(folder / "trace.npz")


def make_older_run(folder: Path) -> None:
    """Fill a folder with a run of ours, pictures and film included."""
    save_run(folder, load_problem("hold_three"))
    for name in ("summary.png", "frames.png"):
        write_picture(FigureCanvasAgg(Figure(figsize=(1, 1))), folder / name)
    (folder / "video.mp4").write_bytes(FILM)


def make_pipeline() -> SimpleNamespace:
    """Return a pipeline that does nothing, in place of the real one; tests replace its parts."""
    return SimpleNamespace(
        plan=lambda problem: FakePlan("solved"),
        rollout=lambda problem, plan, *, progress=None, **ways: "trace",
        validate=lambda problem, plan, trace: FakeReport("pass"),
        validate_as_recorded=lambda problem, plan, trace: FakeReport("pass"),
        inspect=lambda problem, folder: "the numbers",
        save_run=save_run,
        load_run=lambda folder: ("problem", "plan", "trace"),
        render_run=lambda folder, path=None, options=None, progress=None: (
            path or folder / "video.mp4"
        ).write_bytes(FILM),
    )
