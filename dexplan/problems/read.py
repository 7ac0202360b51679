"""From a name, a file or a dict to a checked :class:`~dexplan.problems.problem.Problem`.

Anything that cannot be read as a problem ends as one ``ProblemError`` (or ``UnknownNameError`` for a name nothing answers to)
of one line: source, key, value, and what would be accepted.
"""

from __future__ import annotations

import importlib.resources
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dexplan.errors import ProblemError, UnknownNameError
from dexplan.problems.override import set_override
from dexplan.problems.parse import Origin, parse_data, parse_file, parse_text
from dexplan.problems.problem import Problem

__all__ = [
    "build_problem",
    "find_source",
    "list_problems",
    "load_problem",
    "read_problem_file",
    "set_override",
]


def load_problem(name_or_path: str | Path, overrides: Mapping[str, object] = {}) -> Problem:
    """Return the built-in problem of this name, or the one in this file.

    ``overrides`` maps dotted keys to values that replace the file's (``{"goal.rotation.angle_deg": 90}``);
    they pass the same checks as the file.
    """
    name = str(name_or_path)
    built_in = _built_in_files()
    if name in built_in:
        file = built_in[name]
        return parse_text(file.read_bytes(), Problem, Origin(name, name, Path(str(file)).parent), overrides)
    path = Path(name)
    if path.suffix != ".toml" and len(path.parts) == 1 and not _exists(path):
        raise UnknownNameError("problem", name, [*built_in, "a path to a .toml file"])
    if path.suffix == ".toml" and len(path.parts) == 1 and path.stem in built_in and not _exists(path):
        raise ProblemError(
            name, "", "no such file", f"accepted: {path.stem}, the built-in problem of that name"
        )
    return read_problem_file(path, overrides)


def find_source(name_or_path: str | Path) -> Path | None:
    """Return the file that :func:`load_problem` reads, None for a built-in problem."""
    return None if str(name_or_path) in _built_in_files() else Path(name_or_path)


def list_problems() -> dict[str, str]:
    """Return the built-in problems, name -> one line about it, sorted by name."""
    return {name: load_problem(name).summary for name in sorted(_built_in_files())}


def read_problem_file(path: Path, overrides: Mapping[str, object] = {}) -> Problem:
    """Return the problem in the file at ``path``."""
    return parse_file(path, Problem, overrides)


def build_problem(data: Mapping[str, Any], source: str = "problem", default_name: str = "") -> Problem:
    """Return the checked problem that ``data``, the dict of a problem file, describes; ``source`` names it
    in messages.
    """
    return parse_data(data, Problem, Origin(source, default_name))


def _built_in_files() -> dict[str, Any]:
    """Return name -> resource of each packaged problem."""
    files = importlib.resources.files("dexplan.problems").iterdir()
    return {file.name.removesuffix(".toml"): file for file in files if file.name.endswith(".toml")}


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False
