"""Six plans stay what they are: status and actions by kind.  ``scripts/plan_digests`` compares 111, to the bit."""

from __future__ import annotations

import pytest

from dexplan.witness.digests import PlanQuestion, fingerprint, list_questions

EXPECTED: dict[str, tuple[str, dict[str, int]]] = {
    "any_attitude": ("solved", {"hold": 2, "lift": 1, "move_object": 2, "place": 1}),
    "fixed_contacts": ("solved", {"hold": 2, "move_object": 1}),
    "hold_two": ("solved", {"hold": 2}),
    "one_pair": ("solved", {"hold": 2, "lift": 5, "move_object": 6, "place": 5}),
    "refused: same base": ("blocked", {}),
    "refused: too heavy": ("no_force_closure_pair", {}),
}


@pytest.fixture(scope="module")
def questions() -> dict[str, PlanQuestion]:
    return {question.key: question for question in list_questions()}


@pytest.mark.parametrize("key", EXPECTED)
def test_plans_stay_what_they_are(questions: dict[str, PlanQuestion], key: str) -> None:
    row = fingerprint(questions[key])
    assert (row["status"], row["kinds"]) == EXPECTED[key]
