"""A plan.json that somebody else wrote, or broke, is told in one sentence, wherever it is wrong."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dexplan.errors import RunFolderError
from dexplan.plans.plan import Plan

SAVED = Path(__file__).parents[1] / "baselines" / "plans"
ODD: tuple[Any, ...] = (None, -1, 3.5, "x", [], [[]], {}, {"a": 1}, ["a", "b"], 10**30)


def _walk(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of everything below ``value``, of lists the first two entries."""
    inside = (
        value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    )
    for key, item in inside:
        yield (*place, key)
        yield from _walk(item, (*place, key))


def test_whatever_is_odd_is_a_plan_or_is_told(tmp_path: Path) -> None:
    data = json.loads(sorted(SAVED.glob("*.json"))[0].read_text(encoding="utf-8"))
    data["actions"] = data["actions"][:2]
    path, refused = tmp_path / "plan.json", 0
    for number, place in enumerate(_walk(data)):
        changed = copy.deepcopy(data)
        inside = changed
        for key in place[:-1]:
            inside = inside[key]
        inside[place[-1]] = ODD[number % len(ODD)]
        path.write_text(json.dumps(changed), encoding="utf-8")
        try:
            Plan.load(path)
        except RunFolderError:
            refused += 1
    assert refused > 50


@pytest.mark.parametrize(
    "text", ["", "[]", "3", "null", "{}", '{"format": 1}', '{"format": 2}', "[" * 100_000, "\0"]
)
def test_other_files_are_no_plans(text: str, tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(RunFolderError, match="cannot be read as a plan"):
        Plan.load(tmp_path / "plan.json")
