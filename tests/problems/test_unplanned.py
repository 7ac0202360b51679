"""What is asked of an object and not planned yet is refused in one sentence, never left out of a plan in silence."""

from __future__ import annotations

from typing import Any

import pytest

from dexplan import pipeline
from dexplan.errors import ProblemError
from dexplan.problems.read import build_problem
from dexplan.problems.unplanned import refuse_unplanned

SHAPES = (
    {"kind": "box", "half_sizes_m": [0.03, 0.03, 0.03]},
    {"kind": "cylinder", "radius_m": 0.03, "half_length_m": 0.04},
)
TURN = {"rotation": {"axis": [0, 0, 1], "angle_deg": 20}}
CONTACTS = {"kind": "dextrous_manipulation", "contacts_deg": [[0, 0], [180, 0], "free"]}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"goal": {**TURN, **CONTACTS}}, "goal.contacts_deg: planned for an object that is a ball alone"),
    ],
)  # fmt: skip
def test_bodies_are_not_planned_as_if_less_were_asked(
    shape: dict[str, Any], asked: dict[str, Any], words: str
) -> None:
    problem = build_problem({"format": 1, "object": {"shape": shape}, "goal": TURN, **asked}, "p.toml", "p")
    with pytest.raises(ProblemError) as caught:
        pipeline.plan(problem)
    assert words in str(caught.value)


@pytest.mark.parametrize("primitives", [[], ["rewind"], ["substitution"], ["substitution", "rewind"]])
@pytest.mark.parametrize("body", [{}, *({"shape": shape} for shape in SHAPES)])
def test_all_gaits_are_planned_for_any_body(body: dict[str, Any], primitives: list[str]) -> None:
    asked = {"format": 1, "object": body, "goal": TURN, "gait": {"primitives": primitives}}
    refuse_unplanned(build_problem(asked, "p.toml", "p"))
