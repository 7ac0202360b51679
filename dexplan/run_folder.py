"""Which files of a folder may be written: those that a run of ours made, never the input, never anything else.

A file counts as ours by what it holds, not by its name, so that runs of older versions are known, and a file of the user's own
that only has such a name is, too.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tomllib
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dexplan.errors import ProblemError, RunFolderError

if TYPE_CHECKING:
    from dexplan.problems.problem import Problem

OUTPUT = "--out"
PLAN_FILES = ("problem.toml", "plan.json")
"""What ``dexplan plan`` writes; a folder with more than these of ours holds a run."""
PAGE = "report.html"
RUN_FILES = (*PLAN_FILES, "model.xml", "trace.npz", "report.json", "summary.png", PAGE)
"""What ``dexplan run`` writes."""
LATER_FILES = ("frames.png", "video.mp4", "crash.txt")
"""What is made of a run afterwards, or left by a crash; they go with the run that they belong to."""
REFUSAL_FILES = ("refusal.png",)
"""What ``dexplan run`` writes beside problem, plan and page where there is no plan to run; a later plan may replace it."""
STILLS = "frames"
"""Folder in a run folder with pictures of the run."""
INSPECT_FILES = ("inspect.png",)

SEAL = "# Written by dexplan, sha256 of what follows: "
"""First line of a problem file in a run folder: whoever edits the file breaks the seal and owns the file from then on."""
MARK = "dexplan"
"""Stands in the metadata of pictures and films that are ours."""
_STILL = re.compile(r"frame_\d{3}\.png")
CRASH = "A defect of dexplan "
"""How a crash.txt begins."""


@dataclass(frozen=True)
class Target:
    """A folder that may be written: ``replaced`` are files of an older run in it, which make room."""

    folder: Path
    replaced: tuple[str, ...] = ()


def choose_run_folder(
    folder: Path, source: Path | None, problem: Problem, with_video: bool, is_asked: bool
) -> Target:
    """Return where a run of ``problem``, read from the file ``source``, may be written.

    Raises ProblemError where a file stands in the way that no run of ours made, and where that is the input; but an input that is
    the folder's problem.toml and says what would be written there is no obstacle, for it is not written.
    """
    names = (*RUN_FILES, "video.mp4") if with_video else RUN_FILES
    kept = _is_same(folder / "problem.toml", source) and _says_the_same(folder / "problem.toml", problem)
    _refuse_foreign(folder, [n for n in names if not (kept and n == "problem.toml")], source, is_asked)
    stills = [f"{STILLS}/{path.name}" for path in list_stills(folder / STILLS)]
    older = (*RUN_FILES, *LATER_FILES, *REFUSAL_FILES, *stills)
    ours = tuple(n for n in older if _is_ours_beside(folder, n, source))
    return Target(folder, ours)


def choose_plan_folder(folder: Path, source: Path | None, is_asked: bool) -> Target:
    """Return where a plan may be written: ``folder`` where it holds no run, else (unless asked for) ``folder.plan``,
    ``folder.plan.2`` and so on.

    Raises ProblemError for a folder that was asked for and holds a run, or files that are not ours.
    """
    if is_asked:
        held = find_run_files(folder)
        if held:
            fact = f"{str(folder)!r} holds a run ({', '.join(held)}), which plan does not touch"
            raise ProblemError(
                OUTPUT, "", fact, f"accepted: another folder such as {str(folder) + '.plan'!r}"
            )
        _refuse_foreign(folder, PLAN_FILES, source, is_asked)
    else:
        folder = next(place for place in _plan_places(folder) if not _is_taken(place, PLAN_FILES, source))
    told = (n for n in (*REFUSAL_FILES, PAGE) if is_ours(folder / n))
    return Target(folder, (*(n for n in PLAN_FILES if (folder / n).exists()), *told))


def choose_inspect_folder(folder: Path, source: Path | None, is_asked: bool) -> Target:
    """Return where ``inspect`` may draw.  Raises ProblemError where a picture stands there that is not ours."""
    _refuse_foreign(folder, INSPECT_FILES, source, is_asked)
    return Target(folder)


def choose_crash_folder(folder: Path) -> Path:
    """Return where to leave the evidence of a defect: ``folder`` if nothing of a problem is in it, else one beside it."""
    names = (*RUN_FILES, *LATER_FILES, *REFUSAL_FILES)
    places = [
        folder,
        *(folder.with_name(f"{folder.name}.crash{k}") for k in ("", *(f".{n}" for n in range(2, 100)))),
    ]
    return next((p for p in places if not any(os.path.lexists(p / n) for n in names)), places[-1])


def check_replaceable(path: Path, source: Path | None = None) -> None:
    """Raise RunFolderError where ``path`` is there and no run of ours made it, or where it is the file ``source``."""
    why = _why_not(path, source)
    if why:
        raise RunFolderError(str(path), why, "move it elsewhere first")


def check_film_replaceable(path: Path) -> None:
    """Raise RunFolderError where a film is to be written at ``path``, of whatever name, and what is there is no film of ours."""
    test = _FILM_TESTS.get(path.suffix.lower())
    if not os.path.lexists(path) or test is None:
        return
    try:
        is_film = path.is_file() and test(path)
    except (OSError, ValueError):
        is_film = False
    if not is_film:
        fact = "is there and was made by no run, so it is left alone"
        raise RunFolderError(str(path), fact, "move it elsewhere first")


def find_run_files(folder: Path) -> tuple[str, ...]:
    """Return the files of ours in ``folder`` that only a run, or what was made of one, leaves; a refusal is no run."""
    names = [n for n in (*RUN_FILES, *LATER_FILES) if n not in PLAN_FILES and is_ours(folder / n)]
    is_refusal = names == [PAGE] and any(is_ours(folder / n) for n in REFUSAL_FILES)
    return () if is_refusal else tuple(names)


def drop_told(folder: Path) -> None:
    """Remove what an older run or refusal left in ``folder`` that tells of it: it would speak of the next one."""
    for name in ("report.json", "summary.png", PAGE, *REFUSAL_FILES):
        if is_ours(folder / name):
            (folder / name).unlink()


def read_model(path: Path) -> str:
    """Return the text of model.xml; RunFolderError where there is none."""
    accepted = "the model.xml that `dexplan run` wrote beside trace.npz is needed"
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no text"
        raise RunFolderError(str(path), f"it cannot be read ({reason})", accepted) from error
    if not text.strip():
        raise RunFolderError(str(path), "it is empty", accepted)
    return text


def list_stills(folder: Path) -> tuple[Path, ...]:
    """Return the pictures of a run of ours in ``folder``, by number."""
    return tuple(sorted(path for path in folder.glob("frame_*.png") if is_ours(path)))


def is_ours(path: Path) -> bool:
    """Whether the file at ``path`` is one of a run of ours, judged by its content."""
    test = _is_picture if _STILL.fullmatch(path.name) else _TESTS.get(path.name)
    try:
        return test is not None and path.is_file() and test(path)
    except (OSError, ValueError, KeyError, RecursionError, zipfile.BadZipFile):
        return False


def save_problem(problem: Problem, path: Path) -> None:
    """Write ``problem`` with a first line that tells whether the file was edited since, whole or not at all; a file that says the
    same already is left alone.
    """
    if not _says_the_same(path, problem):
        text = problem.as_toml()
        write_whole(path, SEAL + _digest(text.encode()) + "\n" + text)


def write_whole(path: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    partial = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _plan_places(folder: Path) -> Iterable[Path]:
    yield folder
    yield folder.with_name(f"{folder.name}.plan")
    number = 2
    while True:
        yield folder.with_name(f"{folder.name}.plan.{number}")
        number += 1


def _is_taken(folder: Path, names: Iterable[str], source: Path | None) -> bool:
    """Whether ``folder`` holds a run, or files called ``names`` that may not be replaced."""
    if folder.exists() and not folder.is_dir():
        return True
    return bool(find_run_files(folder)) or any(_why_not(folder / n, source) for n in names)


def _refuse_foreign(folder: Path, names: Iterable[str], source: Path | None, is_asked: bool) -> None:
    for name in names:
        why = _why_not(folder / name, source)
        if why:
            other = f"{folder.absolute().name}.2" if str(folder) not in ("", ".") else "runs/another"
            place = str(folder.with_name(other)) if folder.name else other
            accepted = f"accepted: another folder{'' if is_asked else ' by --out'}, such as {OUTPUT} {place}"
            raise ProblemError(OUTPUT, "", f"{str(folder / name)!r} {why}", accepted)


def _why_not(path: Path, source: Path | None) -> str:
    """Return why the file at ``path`` may not be replaced; empty where it may."""
    if not os.path.lexists(path):
        return ""
    if _is_same(path, source):
        return "is the input file, which is never overwritten"
    return "" if is_ours(path) else "is there and was made by no run, so it is left alone"


def _is_ours_beside(folder: Path, name: str, source: Path | None) -> bool:
    path = folder / name
    return is_ours(path) and not _is_same(path, source)


def _is_same(path: Path, source: Path | None) -> bool:
    """Whether both are one file, by whatever path, link or hard link."""
    try:
        return source is not None and os.path.samefile(path, source)
    except OSError:
        return False


def _says_the_same(path: Path, problem: Problem) -> bool:
    """Whether the file says what ``problem`` says, every default written out."""
    try:
        return _is_text_of(path.read_bytes(), problem.as_toml())
    except OSError:
        return False


def _is_text_of(content: bytes, text: str) -> bool:
    head, _, rest = content.partition(b"\n")
    return text.encode() in (content, rest if head.startswith(SEAL.encode()) else content)


def _is_problem(path: Path) -> bool:
    """Sealed and unbroken; or, from before there were seals, written as only a program writes: every default, to the byte."""
    content = path.read_bytes()
    head, _, rest = content.partition(b"\n")
    if head.startswith(SEAL.encode()):
        return head == (SEAL + _digest(rest)).encode()
    return _is_written_out(content)


def _is_written_out(content: bytes) -> bool:
    import tomli_w

    data = tomllib.loads(content.decode("utf-8"))
    sections = {"format", "name", "goal", "object", "hand", "friction", "gait", "control", "acceptance"}
    return sections <= data.keys() and tomli_w.dumps(data).encode() == content


def _is_plan(path: Path) -> bool:
    return {"format", "status", "fingers", "actions"} <= _read_keys(path)


def _is_report(path: Path) -> bool:
    return {"format", "verdict", "checks"} <= _read_keys(path)


def _read_keys(path: Path) -> set[str]:
    data: Any = json.loads(path.read_text(encoding="utf-8"))
    return set(data) if isinstance(data, dict) else set()


def _is_model(path: Path) -> bool:
    text = path.read_text(encoding="utf-8")
    return text.startswith("<mujoco model=") and 'name="object/surface"' in text


def _is_trace(path: Path) -> bool:
    with zipfile.ZipFile(path) as archive:
        return {"meta_json.npy", "model_xml.npy"} <= set(archive.namelist())


def _is_picture(path: Path) -> bool:
    """A PNG that names us as its software; or matplotlib, from before we did, beside a trace of ours."""
    with path.open("rb") as stream:
        head = stream.read(4096)
    if not head.startswith(b"\x89PNG"):
        return False
    ours = b"Software\0" + MARK.encode() in head
    return ours or (
        b"Matplotlib" in head and (path.name in INSPECT_FILES or is_ours(path.with_name("trace.npz")))
    )


def _is_page(path: Path) -> bool:
    """A page that names us as its generator."""
    with path.open(encoding="utf-8") as stream:
        head = stream.read(4096)
    return head.startswith("<!doctype html>") and f'<meta name="generator" content="{MARK}">' in head


def _is_film(path: Path) -> bool:
    content = path.read_bytes()
    return content[4:8] == b"ftyp" and MARK.encode() in content


def _is_gif(path: Path) -> bool:
    with path.open("rb") as stream:
        head = stream.read(1024)
    return head.startswith(b"GIF89a") and MARK.encode() in head


_FILM_TESTS = {".mp4": _is_film, ".gif": _is_gif}


def _is_crash(path: Path) -> bool:
    text = path.read_text(encoding="utf-8")
    return text.startswith((CRASH, "Traceback"))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


_TESTS: dict[str, Callable[[Path], bool]] = {
    "problem.toml": _is_problem,
    "plan.json": _is_plan,
    "model.xml": _is_model,
    "trace.npz": _is_trace,
    "report.json": _is_report,
    "summary.png": _is_picture,
    "refusal.png": _is_picture,
    "report.html": _is_page,
    "frames.png": _is_picture,
    "inspect.png": _is_picture,
    "video.mp4": _is_film,
    "crash.txt": _is_crash,
}
