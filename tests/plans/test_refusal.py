"""Refusals are values: equal where they are alike, counted by kind and subject, spelled when asked, read back whole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal, RefusalCount, RefusalKind
from dexplan.problems.read import load_problem

NEAR = Refusal(RefusalKind.NEAR_FINGER, ("finger_1/tip", "finger_2/tip"), 0.00123, 0.002)
JOINT = Refusal(RefusalKind.JOINT_LIMIT, ("finger_2",), 0.0349, 0.0873)


@pytest.mark.parametrize("kind", RefusalKind)
def test_every_kind_makes_a_sentence_without_gaps(kind: RefusalKind) -> None:
    because = (JOINT,) if "{because}" in kind.sentence else ()
    for refusal in (
        Refusal(kind, ("finger_1",), 0.01, because=because),
        Refusal(kind, ("finger_1",), because=because),
    ):
        assert str(refusal).split()
        assert not set(str(refusal)) & set("{}")
    assert Refusal.from_dict(json.loads(json.dumps(refusal.as_dict()))).as_dict() == refusal.as_dict()


def test_sentences_are_made_of_what_a_refusal_follows_from() -> None:
    on_way = Refusal(RefusalKind.ON_WAY, because=(NEAR,))
    whole = Refusal(RefusalKind.CANNOT_RELOCATE, ("finger_3",), because=(on_way,))
    assert (
        str(whole)
        == "finger_3 cannot be relocated, finger_1/tip and finger_2/tip come within 1.2 mm on the way"
    )
    assert str(whole.without_numbers).endswith("finger_1/tip and finger_2/tip come too near on the way")
    assert whole.root is NEAR
    assert whole.chain == (RefusalKind.CANNOT_RELOCATE, RefusalKind.ON_WAY, RefusalKind.NEAR_FINGER)


def test_like_refusals_are_counted_together_whatever_their_numbers_and_words() -> None:
    count = RefusalCount()
    assert not count
    for refusal in (JOINT, NEAR, replace(NEAR, measured=-0.001), replace(NEAR, words="they meet")):
        count.add(refusal)
    count.add(replace(JOINT, subject=("finger_1",)))
    assert [(r.kind, n) for r, n in count.counts] == [
        (RefusalKind.NEAR_FINGER, 3),
        (RefusalKind.JOINT_LIMIT, 1),
        (RefusalKind.JOINT_LIMIT, 1),
    ]
    assert list(map(str, count.list_common(2))) == [
        "finger_1/tip and finger_2/tip come too near",
        "a joint of finger_2 comes near its limit",
    ]


def test_numbers_are_written_in_the_unit_of_the_kind() -> None:
    data = replace(JOINT, cure=Cure("widen hand.joint_ranges_deg", is_checked=True)).as_dict()
    assert data["kind"] == "joint_limit"
    assert (data["measured"], data["needed"], data["unit"]) == (
        pytest.approx(2.0, abs=0.01),
        pytest.approx(5.0, abs=0.01),
        "deg",
    )
    assert (data["cure"], data["checked"]) == ("widen hand.joint_ranges_deg", True)
    assert NEAR.as_dict()["measured"] == pytest.approx(1.23)
    assert NEAR.as_dict()["checked"] is False


def test_a_plan_carries_what_stood_in_its_way(tmp_path: Path) -> None:
    far = load_problem("hold_two", {"goal": {"translation_m": [0.0, 0.3, 0.0]}})
    plan = pipeline.plan(far)
    assert plan.refusal is not None
    assert plan.refusal.kind is RefusalKind.OUT_OF_REACH
    assert str(plan.refusal) in plan.reason
    plan.save(tmp_path / "plan.json")
    loaded = Plan.load(tmp_path / "plan.json")
    assert loaded.as_dict() == plan.as_dict()
    assert loaded.refusal is not None
    assert loaded.refusal.key == plan.refusal.key
    assert pipeline.plan(load_problem("hold_two")).refusal is None
