"""What a command was asked for: its problem, and the folder it reads or writes; its exit codes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dexplan.errors import ProblemError, RunFolderError

if TYPE_CHECKING:
    from dexplan.problems.problem import Problem

CONFIRMED, HONEST_NO = 0, 1
"""Exit codes of a command that did its work: the physics confirms the plan, or there is a reason why not."""


def read(name: str, assignments: Sequence[str], seed: int | None = None) -> tuple[Problem, Path | None]:
    """Return the problem, its ``--set`` and ``--seed`` applied, and the file it was read from (None: a built-in one)."""
    from dexplan.problems.override import parse_assignment
    from dexplan.problems.read import find_source, load_problem

    overrides: Mapping[str, object] = dict(map(parse_assignment, assignments))
    if seed is not None:
        overrides = {**overrides, "seed": seed}
    return load_problem(name, overrides), find_source(name)


def choose_folder(problem: Problem, out: Path | None) -> Path:
    """Return the folder asked for, or the one of the problem's name (not yet made)."""
    folder = Path("runs") / problem.name if out is None else out
    check_writable(folder)
    return folder


def check_writable(folder: Path) -> None:
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


def check_run_folder(folder: Path) -> None:
    """Raise RunFolderError, with a hint at what may have been meant, for what is no folder."""
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


def check_new_file(path: Path, suffix: str, accepted: str) -> None:
    """Raise ProblemError, which says what is ``accepted``, for what is no place for a new file with this suffix."""
    accepted = f"accepted: {accepted}"
    if path.suffix != suffix:
        raise ProblemError("FILE", "", f"{str(path)!r} does not end in {suffix}", accepted)
    if os.path.lexists(path):
        raise ProblemError("FILE", "", f"{str(path)!r} is there and is not overwritten", accepted)
    if not path.parent.is_dir():
        raise ProblemError(
            "FILE", "", f"there is no folder {str(path.parent)!r}", f"{accepted}, in a folder that is there"
        )
