"""A plan.json that somebody else wrote, or broke, is told in one sentence, wherever it is wrong."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from dexplan.control.reference import build_reference
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


@pytest.mark.parametrize("number", [1, 2])
def test_whatever_is_odd_is_a_plan_or_is_told(number: int, full_turn: Plan, tmp_path: Path) -> None:
    """In both formats; what is read as a plan that can be run makes a reference, or says why not."""
    saved = SAVED / "full_turn.json"
    data = json.loads(saved.read_text(encoding="utf-8")) if number == 1 else full_turn.as_dict()
    assert data["format"] == number
    data["actions"] = data["actions"][:3]
    path, refused, told = tmp_path / "plan.json", 0, []
    for number, place in enumerate(_walk(data)):
        changed = copy.deepcopy(data)
        inside = changed
        for key in place[:-1]:
            inside = inside[key]
        inside[place[-1]] = ODD[number % len(ODD)]
        path.write_text(json.dumps(changed), encoding="utf-8")
        try:
            plan = Plan.load(path)
            if plan.is_timed:
                build_reference(plan)
        except RunFolderError:
            refused += 1
        except ValueError as error:
            told.append(str(error))
    assert all("accepted" in sentence for sentence in told)
    assert refused > 50


@pytest.mark.parametrize(
    "text", ["", "[]", "3", "null", "{}", '{"format": 1}', '{"format": 2}', "[" * 100_000, "\0"]
)
def test_other_files_are_no_plans(text: str, tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(RunFolderError, match="cannot be read as a plan"):
        Plan.load(tmp_path / "plan.json")
