"""Runs: made, judged again, filmed, shown in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dexplan import run_folder
from dexplan.commands.asked import (
    CONFIRMED,
    HONEST_NO,
    check_run_folder,
    check_writable,
    choose_folder,
    read,
)
from dexplan.commands.output import Output, keep_trace, refusing_unwritable
from dexplan.commands.progress import show_progress, show_work
from dexplan.commands.voice import Voice, complain, conclude, explain, get_voice, note, say
from dexplan.errors import ProblemError, RenderError, RunFolderError

if TYPE_CHECKING:
    from dexplan.problems.problem import Problem
    from dexplan.sim.judge.validate import ValidationReport
    from dexplan.viz.film import FilmOptions


@dataclass(frozen=True)
class Given:
    """What else a run may be given: a seed, the name of a controller, and assignments of what is true of the world."""

    seed: int | None = None
    controller: str | None = None
    truths: Sequence[str] = ()


def run(name: str, assignments: Sequence[str], out: Path | None, video: bool, given: Given = Given()) -> int:
    """Plan, simulate, judge and save; the last line on stdout is the verdict."""
    problem, source = read(name, assignments, given.seed)
    ways = _read_ways(name, assignments, problem, given)
    folder = choose_folder(problem, out)
    output = Output(run_folder.choose_run_folder(folder, source, problem, video, out is not None), problem)
    from dexplan import pipeline
    from dexplan.builders import build_margin_limits

    with output.keeping_evidence():
        with show_work("planning"):
            planned = pipeline.plan(problem)
        output.open()
        planned.save(folder / "plan.json")
        say(planned.explain(build_margin_limits(problem)))
        if not planned.is_solved:
            _tell_files(folder)
            conclude(f"REFUSED {planned.status}: {' '.join(planned.reason.split())}")
            return HONEST_NO
        trace = None
        try:
            with show_progress("simulating") as progress:
                trace = pipeline.rollout(problem, planned, progress=progress, **ways)
            with show_work("judging"):
                report = pipeline.validate_as_recorded(problem, planned, trace)
        except BaseException as error:
            keep_trace(trace or getattr(error, "trace", None), folder, error)
            raise
        try:
            pipeline.save_run(folder, problem, planned, trace, report)
        except OSError:
            # Whatever the disk says, the work is done; its answer is not kept back.
            _judge(report)
            raise
        _tell_files(folder)
        code = _judge(report)
        return max(code, _make_video(folder)) if video else code


def validate(folder: Path) -> int:
    """Judge a saved run again from its folder alone, and bring its report.json up to date."""
    check_run_folder(folder)
    from dexplan import pipeline

    problem, plan, trace = pipeline.load_run(folder)
    with show_work("judging"):
        report = pipeline.validate_as_recorded(problem, plan, trace)
    path = folder / "report.json"
    try:
        if path.exists() and not run_folder.is_ours(path):
            note("report.json is left as it was (it is there and no run made it)")
        else:
            is_news = _read_verdict(folder) != report.summary_line()
            report.save(path)
            if is_news and run_folder.is_ours(folder / "summary.png"):
                pipeline.draw_run(folder, problem, plan, trace, report)
    except (KeyError, ValueError) as error:
        # A record may lack what only the figure shows, or hold no numbers there; it is judged all the same.
        note(f"summary.png is left as it was (not to be drawn from this trace: {error})")
    except OSError as error:
        note(f"report or figure are left as they were ({error.strerror})")
    return _judge(report)


def _read_ways(name: str, assignments: Sequence[str], problem: Problem, given: Given) -> dict[str, Any]:
    """Return what a rollout is told beside problem and plan; refused before anything is written."""
    ways: dict[str, Any] = {}
    if given.truths:
        from dexplan.problems.override import parse_assignment
        from dexplan.problems.read import load_problem
        from dexplan.problems.true_world import check_world

        true = [parse_assignment(text, "--true") for text in given.truths]
        ways["world"] = load_problem(name, dict([*map(parse_assignment, assignments), *true]))
        check_world(problem, ways["world"])
    if given.controller is not None:
        from dexplan.control.named import load_controller

        ways["controller"] = load_controller(given.controller)
    return ways


def _read_verdict(folder: Path) -> str:
    """Return the verdict line of the report in ``folder``, which the figure shows; nothing where there is no report."""
    from dexplan.sim.judge.validate import ValidationReport

    try:
        return ValidationReport.load(folder / "report.json").summary_line()
    except RunFolderError:
        return ""


def render(folder: Path, out: Path | None = None, options: FilmOptions | None = None) -> int:
    """Make the film of a saved run, ``video.mp4`` in its folder or ``out``."""
    check_run_folder(folder)
    path = folder / "video.mp4" if out is None else out
    run_folder.check_film_replaceable(path)
    code = _make_video(folder, path, options)
    if code == CONFIRMED:
        conclude(path)
    return code


def draw_stills(folder: Path, out: Path | None, every: float | None, camera: str | None) -> int:
    """Draw pictures of a saved run: its start and the end of every action, or one every so many seconds."""
    check_run_folder(folder)
    from dexplan.viz.frames import draw_stills as draw

    if every is not None and not every > 0.0:
        raise ProblemError(
            "--every", "", f"{every:g} is no time between pictures", "accepted: seconds, more than 0"
        )
    place = folder / run_folder.STILLS if out is None else out
    check_writable(place)
    with refusing_unwritable(place), show_progress("drawing") as progress:
        paths = draw(folder, place, every=every, camera=camera, progress=progress)
    for path in paths[:-1]:
        say(path)
    conclude(paths[-1])
    return CONFIRMED


def draw_figures(runs: Sequence[str], most: int, camera: str | None, seed: int | None) -> int:
    """Draw rows of numbered frames, as in the paper's figures 3 to 5, of run folders; a problem that is named is run first.

    The exit code of a problem whose run was not confirmed is passed on; its frames are drawn all the same.
    """
    from dexplan.viz.frames import CAMERA, FIGURES, check_drawable, draw_run_frames

    if most < 1:
        raise ProblemError(
            "--most", "", f"{most} pictures make no row", "accepted: a whole number, 1 or more"
        )
    asked = list(runs) or list(FIGURES)
    # What is neither a problem nor a run is told before anything is run.
    for name in asked:
        if Path(name).is_dir():
            check_drawable(Path(name))
        else:
            read(name, [], seed)
    code = CONFIRMED
    for name in asked:
        folder = Path(name)
        if not folder.is_dir():
            folder = choose_folder(read(name, [], seed)[0], None)
            code = max(code, run(name, [], None, False, Given(seed=seed)))
            if not (folder / "trace.npz").is_file():
                continue
        with show_work("drawing"):
            path = draw_run_frames(folder, most, camera or CAMERA)
        conclude(path)
    return code


def _tell_files(folder: Path) -> None:
    """Say where a run has left its files."""
    names = [name for name in (*run_folder.RUN_FILES, *run_folder.LATER_FILES) if (folder / name).is_file()]
    say(f"written to {folder}: {', '.join(names)}")


def _judge(report: ValidationReport) -> int:
    """Print the checks and, last, the verdict."""
    say(report.table())
    if get_voice() is Voice.VERBOSE:
        for title, facts in (
            ("physics", report.physics),
            ("timing", report.timing),
            ("versions", report.versions),
        ):
            explain(f"{title}: {', '.join(f'{key} {value}' for key, value in facts.items())}")
    conclude(report.summary_line())
    return CONFIRMED if report.verdict == "pass" else HONEST_NO


def _make_video(folder: Path, path: Path | None = None, options: FilmOptions | None = None) -> int:
    """Render the run in ``folder``; a machine that cannot render is an honest no, said in one line."""
    from dexplan import pipeline

    try:
        with show_progress("filming") as progress:
            pipeline.render_run(folder, path, options, progress)
    except RenderError as error:
        complain(f"no video: {' '.join(str(error).split())}")
        return HONEST_NO
    return CONFIRMED
