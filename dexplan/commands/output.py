"""The folder that a command writes: opened once, emptied of an older run's files, kept as evidence where something breaks."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from dexplan import run_folder
from dexplan.commands.voice import note
from dexplan.errors import DexplanError, OutputError, ProblemError
from dexplan.terminal import describe_refusal

if TYPE_CHECKING:
    from dexplan.problems.problem import Problem
    from dexplan.sim.trace import Trace


class Output:
    """The folder that one command writes, and whether it has begun to."""

    def __init__(self, target: run_folder.Target, problem: Problem) -> None:
        self.target, self.folder, self.problem = target, target.folder, problem
        self.is_open = False

    def open(self) -> None:
        """Make the folder, take an older run's files out of it and say so, and save the problem."""
        with refusing_unwritable(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            self.is_open = True
            if self.target.replaced:
                names = self.target.replaced
                kind = "plan" if set(names) <= set(run_folder.PLAN_FILES) else "run"
                stills = [name for name in names if "/" in name]
                told = [name for name in names if name not in stills]
                told += [f"{len(stills)} pictures in {run_folder.STILLS}"] if stills else []
                what = f"what is in {self.folder} of an older {kind}: {', '.join(told)}"
                note(f"replaces {what}")
            for name in self.target.replaced:
                (self.folder / name).unlink(missing_ok=True)
            with suppress(OSError):
                (self.folder / run_folder.STILLS).rmdir()  # kept where anything else is in it
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
def refusing_unwritable(folder: Path) -> Iterator[None]:
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


def keep_trace(trace: Trace | None, folder: Path, error: BaseException) -> None:
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


def write_new(path: Path, text: str) -> None:
    """Write a text file that must not be there yet, whole or not at all."""
    try:
        stream = path.open("x", encoding="utf-8")
    except OSError as error:
        fact = f"{str(path)!r} cannot be written ({error.strerror})"
        raise ProblemError(
            "FILE", "", fact, "accepted: a file that is not there, in a folder that can be written"
        ) from error
    try:
        with stream:
            stream.write(text)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
