"""Runs: made, judged again, filmed."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dexplan import run_folder
from dexplan.commands.asked import CONFIRMED, HONEST_NO, check_run_folder, choose_folder, read
from dexplan.commands.output import Output, keep_trace
from dexplan.commands.progress import show_progress
from dexplan.errors import RenderError, RunFolderError

if TYPE_CHECKING:
    from dexplan.sim.judge.validate import ValidationReport


def run(name: str, assignments: Sequence[str], out: Path | None, video: bool, seed: int | None) -> int:
    """Plan, simulate, judge and save; the last line on stdout is the verdict."""
    problem, source = read(name, assignments, seed)
    folder = choose_folder(problem, out)
    output = Output(run_folder.choose_run_folder(folder, source, problem, video, out is not None), problem)
    from dexplan import pipeline

    with output.keeping_evidence():
        planned = pipeline.plan(problem)
        output.open()
        planned.save(folder / "plan.json")
        print(planned.explain(), flush=True)
        if not planned.is_solved:
            print(f"FAIL plan {planned.status}")
            return HONEST_NO
        trace = None
        try:
            with show_progress("simulating") as progress:
                trace = pipeline.rollout(problem, planned, seed=problem.seed, progress=progress)
            report = pipeline.validate(problem, planned, trace)
        except BaseException as error:
            keep_trace(trace or getattr(error, "trace", None), folder, error)
            raise
        try:
            pipeline.save_run(folder, problem, planned, trace, report)
        except OSError:
            # Whatever the disk says, the work is done; its answer is not kept back.
            _judge(report)
            raise
        code = _judge(report)
        return max(code, _make_video(folder)) if video else code


def validate(folder: Path) -> int:
    """Judge a saved run again from its folder alone, and bring its report.json up to date."""
    check_run_folder(folder)
    from dexplan import pipeline

    problem, plan, trace = pipeline.load_run(folder)
    report = pipeline.validate(problem, plan, trace)
    path = folder / "report.json"
    try:
        if path.exists() and not run_folder.is_ours(path):
            print("dexplan: report.json is left as it was (it is there and no run made it)", file=sys.stderr)
        else:
            is_news = _read_verdict(folder) != report.summary_line()
            report.save(path)
            if is_news and run_folder.is_ours(folder / "summary.png"):
                pipeline.draw_run(folder, problem, plan, trace, report)
    except (KeyError, ValueError) as error:
        # A record may lack what only the figure shows, or hold no numbers there; it is judged all the same.
        print(
            f"dexplan: summary.png is left as it was (not to be drawn from this trace: {error})",
            file=sys.stderr,
        )
    except OSError as error:
        print(f"dexplan: report or figure are left as they were ({error.strerror})", file=sys.stderr)
    return _judge(report)


def _read_verdict(folder: Path) -> str:
    """Return the verdict line of the report in ``folder``, which the figure shows; nothing where there is no report."""
    from dexplan.sim.judge.validate import ValidationReport

    try:
        return ValidationReport.load(folder / "report.json").summary_line()
    except RunFolderError:
        return ""


def render(folder: Path) -> int:
    """Make the video of a saved run."""
    check_run_folder(folder)
    run_folder.check_replaceable(folder / "video.mp4")
    code = _make_video(folder)
    if code == CONFIRMED:
        print(folder / "video.mp4")
    return code


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
