"""Are the files in a run folder those of the run?  The record knows the problem and the plan it was made with."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dexplan.errors import RunFolderError
from dexplan.problems.problem import Problem
from dexplan.problems.rules import spell
from dexplan.sim.judge.true_world import META, find_untrue, join_world

PROBLEM, PLAN = "problem_as_run", "plan_digest"
"""Where the record's meta holds the problem's data, and a digest of the plan's."""
LAST_LINE = ("acceptance", "plan_normal_force_max_N")
"""Every problem.toml of a run has ended with this key since there have been run folders: without it the file was cut."""
UNTOLD = frozenset({"format", "acceptance"})
"""Limits are what a saved run may be judged by anew; looser ones are told by themselves."""


def describe_run(problem: Problem, plan: Mapping[str, Any], world: Problem | None = None) -> dict[str, Any]:
    """Return what a record keeps of the problem, of the plan (as the data of its file) that it was made with, and of the true
    ``world`` where that is not as the problem has it.
    """
    believed = problem.as_dict()
    told = {PROBLEM: believed, PLAN: compute_digest(plan)}
    if world is not None and find_untrue(believed, world.as_dict()):
        told[META] = join_world(believed, world.as_dict())
    return told


def compute_digest(plan: Mapping[str, Any]) -> str:
    """Return a digest of a plan's data; statistics of the search, which may be times, do not count."""
    data = {key: value for key, value in plan.items() if key != "statistics"}
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


def check_whole(path: Path, meta: Mapping[str, Any]) -> None:
    """Raise RunFolderError where a run folder's problem.toml lacks keys that it was written with.

    A key that is left out of a problem file has its default, so a file that was cut would be another problem.
    """
    data = _read(path)
    recorded = meta.get(PROBLEM)
    keys = [LAST_LINE, *(key for key, _ in _walk(recorded if isinstance(recorded, Mapping) else {}))]
    missing = [".".join(key) for key in keys if _get(data, key) is None]
    if missing:
        raise RunFolderError(
            str(path),
            f"it lacks {', '.join(missing[:3])}{' and more' if len(missing) > 3 else ''}, so it was cut or edited",
            "the file as `dexplan run` wrote it, with all defaults written out, is needed",
        )


def find_differences(path: Path, plan: Mapping[str, Any], meta: Mapping[str, Any]) -> Iterator[str]:
    """Yield one sentence per thing in which problem.toml or the plan differ from what the record was made with.

    A record from before these were kept says its problem's name and seed only.
    """
    data, recorded = _read(path), meta.get(PROBLEM)
    if isinstance(recorded, Mapping):
        made_with = dict(_walk({key: value for key, value in recorded.items() if key not in UNTOLD}))
        for key, _ in _walk({key: value for key, value in data.items() if key not in UNTOLD}):
            if key not in made_with:
                yield f"problem.toml has {'.'.join(key)}, the run was made without"
    else:
        made_with = {
            (key,): meta[word] for key, word in (("name", "problem"), ("seed", "seed")) if word in meta
        }
    for key, then in made_with.items():
        if (now := _get(data, key)) != then:
            yield f"problem.toml has {'.'.join(key)} = {spell(now)}, the run was made with {spell(then)}"
    if PLAN in meta and meta[PLAN] != compute_digest(plan):
        yield "plan.json is not the plan that was run"


def _read(path: Path) -> dict[str, Any]:
    """Return a problem file's data; RunFolderError where it is no TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise RunFolderError(
            str(path), f"it cannot be read ({error})", "a problem.toml of a run is needed"
        ) from error


def _walk(table: Mapping[str, Any], above: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield (key, value) of everything in a table and the tables below it; an empty table is nothing."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from _walk(value, (*above, name))
        else:
            yield (*above, name), value


def _get(table: Any, key: tuple[str, ...]) -> Any:
    """Return the value at ``key``, None where there is none."""
    for name in key:
        table = table.get(name) if isinstance(table, Mapping) else None
    return table
