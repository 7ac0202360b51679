"""What each command does: reads, calls the pipeline, saves, prints, and returns the exit code.

Nothing is written before the problem has been read. A run folder is emptied of an older run's files before
the first new one is written, so what stands there belongs together.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dexplan.errors import DexplanError, ProblemError, RenderError, RunFolderError

if TYPE_CHECKING:
    from dexplan.problems.problem import Problem
    from dexplan.sim.validate import ValidationReport

CONFIRMED, HONEST_NO = 0, 1
"""Exit codes of a command that did its work: the physics confirms the plan, or there is a reason why not."""

RUN_FILES = (
    "problem.toml",
    "plan.json",
    "model.xml",
    "trace.npz",
    "report.json",
    "summary.png",
    "frames.png",
    "video.mp4",
    "crash.txt",
)
"""Every file that is made of a run in its folder; ``inspect`` has its own."""

Progress = Callable[[float], None]
"""``progress(share)``: how much of the work is done, 0 to 1."""


def list_everything() -> int:
    """Print the built-in problems and scenes, one line each."""
    from dexplan.problems.read import list_problems
    from dexplan.problems.rules import SCENES

    problems = list_problems()
    width = max(map(len, [*problems, *SCENES]))
    for name, summary in problems.items():
        print(f"problem  {name:<{width}}  {summary}")
    for name, facts in SCENES.items():
        print(f"scene    {name:<{width}}  {facts.summary}")
    return CONFIRMED


def inspect(name: str, assignments: Sequence[str], out: Path | None) -> int:
    """Show what the hand can do in a problem: numbers on stdout, a picture in the folder."""
    problem, folder = _read(name, assignments, out)
    from dexplan import pipeline

    with _keeping_evidence(folder, problem), _refusing_unwritable(folder):
        findings = pipeline.inspect(problem, folder)
    if findings is not None:
        print(findings)
    return CONFIRMED


def plan(name: str, assignments: Sequence[str], out: Path | None) -> int:
    """Plan, save problem and plan, print the plan in words."""
    problem, folder = _read(name, assignments, out)
    from dexplan import pipeline
    from dexplan.viz.timeline import gait_text

    with _keeping_evidence(folder, problem):
        planned = pipeline.plan(problem)
        _open_folder(folder)
        problem.save(folder / "problem.toml")
        planned.save(folder / "plan.json")
    print(planned.explain())
    if planned.actions:
        print(gait_text(planned))
    print(f"{planned.status}: {folder / 'plan.json'}")
    return CONFIRMED if planned.is_solved else HONEST_NO


def run(name: str, assignments: Sequence[str], out: Path | None, video: bool, seed: int | None) -> int:
    """Plan, simulate, judge and save; the last line on stdout is the verdict."""
    problem, folder = _read(name, assignments, out, seed)
    from dexplan import pipeline

    with _keeping_evidence(folder, problem):
        planned = pipeline.plan(problem)
        _open_folder(folder)
        problem.save(folder / "problem.toml")
        planned.save(folder / "plan.json")
        print(planned.explain(), flush=True)
        if not planned.is_solved:
            print(f"FAIL plan {planned.status}")
            return HONEST_NO
        with _progress_bar("simulating") as progress:
            trace = pipeline.rollout(problem, planned, seed=problem.seed, progress=progress)
        report = pipeline.validate(problem, planned, trace)
        pipeline.save_run(folder, problem, planned, trace, report)
        code = _judge(report)
        return max(code, _make_video(folder)) if video else code


def validate(folder: Path) -> int:
    """Judge a saved run again from its folder alone, and bring its report.json up to date."""
    _check_run_folder(folder)
    from dexplan import pipeline

    problem, plan, trace = pipeline.load_run(folder)
    report = pipeline.validate(problem, plan, trace)
    try:
        is_news = _read_verdict(folder) != report.summary_line()
        report.save(folder / "report.json")
        if is_news and (folder / "summary.png").exists():
            pipeline.draw_run(folder, problem, plan, trace, report)
    except OSError as error:
        print(f"dexplan: report or figure are left as they were ({error.strerror})", file=sys.stderr)
    return _judge(report)


def _read_verdict(folder: Path) -> str:
    """Return the verdict line of the report in ``folder``, which the figure shows; nothing where there is no report."""
    from dexplan.sim.validate import ValidationReport

    try:
        return ValidationReport.load(folder / "report.json").summary_line()
    except RunFolderError:
        return ""


def render(folder: Path) -> int:
    """Make the video of a saved run."""
    _check_run_folder(folder)
    code = _make_video(folder)
    if code == CONFIRMED:
        print(folder / "video.mp4")
    return code


def _read(
    name: str, assignments: Sequence[str], out: Path | None, seed: int | None = None
) -> tuple[Problem, Path]:
    """Return the problem, its ``--set`` and ``--seed`` applied, and the folder for what comes of it (not
    yet made).
    """
    from dexplan.problems.override import parse_assignment
    from dexplan.problems.read import load_problem

    overrides: Mapping[str, object] = dict(map(parse_assignment, assignments))
    if seed is not None:
        overrides = {**overrides, "seed": seed}
    problem = load_problem(name, overrides)
    folder = Path("runs") / problem.name if out is None else out
    _check_writable(folder)
    return problem, folder


def _check_writable(folder: Path) -> None:
    """Refuse a folder that could not be made or written, before any work is done for it."""
    accepted = "accepted: a folder that can be written"
    if folder.exists() and not folder.is_dir():
        raise ProblemError("--out", "", f"{str(folder)!r} is not a folder", accepted)
    nearest = next(place for place in [folder, *folder.absolute().parents] if place.exists())
    if not nearest.is_dir() or not os.access(nearest, os.W_OK | os.X_OK):
        raise ProblemError("--out", "", f"{str(folder)!r} cannot be written", accepted)


def _check_run_folder(folder: Path) -> None:
    if not folder.is_dir():
        fact = "is not a folder" if folder.exists() else "no such folder"
        raise RunFolderError(str(folder), fact, "accepted: a folder written by 'dexplan run'")


def _open_folder(folder: Path) -> None:
    """Make the folder, and take an older run's files out of it."""
    with _refusing_unwritable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in RUN_FILES:
            (folder / name).unlink(missing_ok=True)


@contextmanager
def _refusing_unwritable(folder: Path) -> Iterator[None]:
    """Turn an operating system's refusal to write ``folder``, or to make it or a folder above, into a sentence.

    Permissions, which were looked at before, do not tell everything: there are read-only places, and some that are no real
    folders.  A refusal elsewhere is a defect and stays what it is.
    """
    try:
        yield
    except OSError as error:
        place, asked = Path(str(error.filename)).absolute(), folder.absolute()
        if error.filename is None or not (place.is_relative_to(asked) or asked.is_relative_to(place)):
            raise
        fact = f"{str(folder)!r} cannot be written ({error.strerror})"
        raise ProblemError("--out", "", fact, "accepted: a folder that can be written") from error


def _judge(report: ValidationReport) -> int:
    """Print the checks and, last, the verdict."""
    print(report.table())
    print(report.summary_line(), flush=True)
    return CONFIRMED if report.verdict == "pass" else HONEST_NO


def _make_video(folder: Path) -> int:
    """Render the run in ``folder``; a machine that cannot render is an honest no, said in one line."""
    from dexplan import pipeline

    try:
        pipeline.render_run(folder)
    except RenderError as error:
        print(f"dexplan: no video: {' '.join(str(error).split())}", file=sys.stderr)
        return HONEST_NO
    return CONFIRMED


@contextmanager
def _keeping_evidence(folder: Path, problem: Problem) -> Iterator[None]:
    """On a defect of ours leave problem.toml and crash.txt in the folder, and say so below the traceback."""
    try:
        yield
    except (DexplanError, BrokenPipeError):
        raise
    except Exception as error:
        with suppress(OSError):
            problem.save(folder / "problem.toml")
            (folder / "crash.txt").write_text(traceback.format_exc(), encoding="utf-8")
            error.add_note(f"dexplan: a defect of ours; what was made so far is in {folder}")
        raise


@contextmanager
def _progress_bar(label: str) -> Iterator[Progress | None]:
    """Yield a callback that draws a bar on stderr, or None where stderr is not a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(total=1.0, desc=label, leave=False, bar_format="{l_bar}{bar}| {elapsed}<{remaining}") as bar:

        def advance(share: float) -> None:
            bar.update(share - bar.n)

        yield advance
