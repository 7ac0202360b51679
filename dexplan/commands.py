"""What each command does: reads, calls the pipeline, saves, prints, and returns the exit code.

Nothing is written before the problem has been read, and nothing but files that a run of ours made is replaced
(``dexplan.run_folder``).  A run folder is emptied of an older run's files before the first new one is written, so what stands
there belongs together.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dexplan import run_folder
from dexplan.errors import (
    DexplanError,
    OutputError,
    ProblemError,
    RenderError,
    RunFolderError,
    UnknownNameError,
)
from dexplan.terminal import describe_refusal

if TYPE_CHECKING:
    from dexplan.problems.problem import Problem
    from dexplan.sim.judge.validate import ValidationReport
    from dexplan.sim.trace import Trace
    from dexplan.testing.scene_run import SceneRun

CONFIRMED, HONEST_NO = 0, 1
"""Exit codes of a command that did its work: the physics confirms the plan, or there is a reason why not."""

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
    problem, source = _read(name, assignments)
    folder = _choose_folder(problem, out)
    output = _Output(run_folder.choose_inspect_folder(folder, source, out is not None), problem)
    from dexplan import pipeline

    with output.keeping_evidence(), _refusing_unwritable(output.folder):
        findings = pipeline.inspect(problem, output.folder)
    if findings is not None:
        print(findings)
    return CONFIRMED


def plan(name: str, assignments: Sequence[str], out: Path | None) -> int:
    """Plan, save problem and plan, print the plan in words.  A folder that holds a run is not touched."""
    problem, source = _read(name, assignments)
    folder = _choose_folder(problem, out)
    output = _Output(run_folder.choose_plan_folder(folder, source, out is not None), problem)
    from dexplan import pipeline
    from dexplan.viz.timeline import gait_text

    with output.keeping_evidence():
        planned = pipeline.plan(problem)
        output.open()
        planned.save(output.folder / "plan.json")
    print(planned.explain())
    if planned.actions:
        print(gait_text(planned))
    print(f"{planned.status}: {output.folder / 'plan.json'}")
    return CONFIRMED if planned.is_solved else HONEST_NO


def run(name: str, assignments: Sequence[str], out: Path | None, video: bool, seed: int | None) -> int:
    """Plan, simulate, judge and save; the last line on stdout is the verdict."""
    problem, source = _read(name, assignments, seed)
    folder = _choose_folder(problem, out)
    output = _Output(run_folder.choose_run_folder(folder, source, problem, video, out is not None), problem)
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
            with _progress_bar("simulating") as progress:
                trace = pipeline.rollout(problem, planned, seed=problem.seed, progress=progress)
            report = pipeline.validate(problem, planned, trace)
        except BaseException as error:
            _keep_trace(trace or getattr(error, "trace", None), folder, error)
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
    _check_run_folder(folder)
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
    _check_run_folder(folder)
    run_folder.check_replaceable(folder / "video.mp4")
    code = _make_video(folder)
    if code == CONFIRMED:
        print(folder / "video.mp4")
    return code


def check_machine(is_bare: bool) -> int:
    """Say in one line each whether this machine has what dexplan needs; ``is_bare``: no option of a scene was given."""
    if not is_bare:
        raise ProblemError("doctor", "", "SCENE is missing", "accepted: dexplan doctor SCENE, an MJCF file")
    from platformdirs import user_cache_dir

    from dexplan.testing.environment import check_environment

    cache = Path(os.environ.get("DEXPLAN_CACHE") or user_cache_dir("dexplan"))
    findings = check_environment(cache, Path.cwd())
    for finding in findings:
        print(finding)
    return CONFIRMED if all(finding.is_well for finding in findings) else HONEST_NO


def doctor(run: SceneRun, with_trials: bool) -> int:
    """Run any MuJoCo scene, say what became of its contacts and why; the last line is the verdict."""
    from dexplan.testing.doctor import diagnose

    diagnosis = diagnose(run, with_trials=with_trials)
    print(diagnosis)
    return CONFIRMED if diagnosis.is_well else HONEST_NO


def stability(action: str, run: SceneRun, folder: Path, name: str | None, junit: Path | None) -> int:
    """Record how contacts behave, or check it; the last line is the verdict."""
    if action not in {"record", "check"}:
        raise UnknownNameError("action", action, ["record", "check"])
    from dexplan.testing import stability as contacts

    if action == "record":
        print(contacts.record(run, name, folder))
        return CONFIRMED
    checked = contacts.check(run, name, folder)
    print(checked.table())
    if junit is not None:
        checked.save_junit(junit)
    print(f"{'PASS' if checked.is_passed else 'FAIL'} {checked.name}")
    return CONFIRMED if checked.is_passed else HONEST_NO


def _read(name: str, assignments: Sequence[str], seed: int | None = None) -> tuple[Problem, Path | None]:
    """Return the problem, its ``--set`` and ``--seed`` applied, and the file it was read from (None: a built-in one)."""
    from dexplan.problems.override import parse_assignment
    from dexplan.problems.read import find_source, load_problem

    overrides: Mapping[str, object] = dict(map(parse_assignment, assignments))
    if seed is not None:
        overrides = {**overrides, "seed": seed}
    return load_problem(name, overrides), find_source(name)


def _choose_folder(problem: Problem, out: Path | None) -> Path:
    """Return the folder asked for, or the one of the problem's name (not yet made)."""
    folder = Path("runs") / problem.name if out is None else out
    _check_writable(folder)
    return folder


def _check_writable(folder: Path) -> None:
    """Refuse a folder that could not be made or written, before any work is done for it."""
    accepted = "accepted: a folder that can be written"
    try:
        if folder.exists() and not folder.is_dir():
            raise ProblemError("--out", "", f"{str(folder)!r} is not a folder", accepted)
        nearest = next(place for place in [folder, *folder.absolute().parents] if place.exists())
        is_writable = nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ProblemError("--out", "", f"{str(folder)!r} cannot be written ({reason})", accepted) from error
    if not is_writable:
        raise ProblemError("--out", "", f"{str(folder)!r} cannot be written", accepted)


def _check_run_folder(folder: Path) -> None:
    accepted = "accepted: a folder written by 'dexplan run'"
    if folder.is_file():
        near = folder.parent
        hint = f", such as {str(near)!r}" if (near / "trace.npz").is_file() else ""
        raise RunFolderError(str(folder), "is not a folder", accepted + hint)
    if not folder.is_dir():
        near = Path("runs") / folder
        hint = f", such as {str(near)!r}" if (near / "trace.npz").is_file() else ""
        fact = "is not a folder" if os.path.lexists(folder) else "no such folder"
        raise RunFolderError(str(folder), fact, accepted + hint)


class _Output:
    """The folder that one command writes, and whether it has begun to."""

    def __init__(self, target: run_folder.Target, problem: Problem) -> None:
        self.target, self.folder, self.problem = target, target.folder, problem
        self.is_open = False

    def open(self) -> None:
        """Make the folder, take an older run's files out of it and say so, and save the problem."""
        with _refusing_unwritable(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self.is_open = True
            if self.target.replaced:
                names = self.target.replaced
                kind = "plan" if set(names) <= set(run_folder.PLAN_FILES) else "run"
                what = f"what is in {self.folder} of an older {kind}: {', '.join(names)}"
                print(f"dexplan: replaces {what}", file=sys.stderr)
            for name in self.target.replaced:
                (self.folder / name).unlink(missing_ok=True)
            run_folder.save_problem(self.problem, self.folder / "problem.toml")

    @contextmanager
    def keeping_evidence(self) -> Iterator[None]:
        """On a defect of ours leave problem.toml and crash.txt, and say where below the traceback; never in the folder of an
        older run.  What the operating system refuses is no defect: one sentence, and where to find what was made so far.
        """
        try:
            yield
        except (DexplanError, BrokenPipeError):
            raise
        except OSError as error:
            sentence = describe_refusal(error)
            if sentence is None:
                self._leave_evidence(error)
                raise
            is_left = self.is_open and any(self.folder.iterdir())
            kept = f"; what was made so far is in {self.folder}" if is_left else ""
            raise OutputError(sentence + kept) from error
        except Exception as error:
            self._leave_evidence(error)
            raise

    def _leave_evidence(self, error: Exception) -> None:
        with suppress(OSError):
            folder = self.folder if self.is_open else run_folder.choose_crash_folder(self.folder)
            folder.mkdir(parents=True, exist_ok=True)
            run_folder.save_problem(self.problem, folder / "problem.toml")
            text = f"{run_folder.CRASH}in this run.\n\n{traceback.format_exc()}"
            run_folder.write_whole(folder / "crash.txt", text)
            error.add_note(f"dexplan: a defect of ours; what was made so far is in {folder}")


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


def _keep_trace(trace: Trace | None, folder: Path, error: BaseException) -> None:
    """Save the run so far after ``error`` cut it short, and add to the error where it is."""
    if trace is None:
        return
    try:
        run_folder.write_whole(folder / "model.xml", trace.model_xml)
        trace.save(folder / "trace.npz")
    except Exception as refused:
        # The first error is the one to tell; this one only explains what is missing.
        error.add_note(f"the run so far could not be saved ({refused})")
        return
    seconds = float(trace["time"][-1]) if trace.sample_count else 0.0
    error.add_note(f"the run so far ({seconds:.2f} s) is in {folder / 'trace.npz'}")


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
