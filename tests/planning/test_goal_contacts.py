"""A plan names the goal contacts: in its file, exactly, and in words."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.grasp_adjustment import plan_grasp_adjustment
from dexplan.plans.plan import Plan
from dexplan.spatial import Array, direction_from_angles

GOAL: tuple[Array | None, ...] = (
    direction_from_angles(-38.0, 0.0),
    direction_from_angles(102.0, 7.0),
    None,
)


@pytest.fixture(scope="module")
def plan(hand: HandModel) -> Plan:
    """A plan that puts finger 2 a little higher."""
    start = (GOAL[0], direction_from_angles(102.0, 0.0), None)
    return plan_grasp_adjustment(hand, hand.object.X_WO_home, start, GOAL, SearchOptions(500))


def test_goal_contacts_survive_a_file(hand: HandModel, plan: Plan, tmp_path: Path) -> None:
    assert plan.is_solved, plan.reason
    assert plan.goal_contacts is not None
    plan.save(tmp_path / "first.json")
    loaded = Plan.load(tmp_path / "first.json")
    assert loaded.goal_contacts is not None
    for before, after, asked in zip(plan.goal_contacts, loaded.goal_contacts, GOAL, strict=True):
        assert (before is None) == (after is None) == (asked is None)
        if before is not None and after is not None and asked is not None:
            assert before.finger == after.finger
            np.testing.assert_array_equal(before.normal_O, after.normal_O)
            np.testing.assert_array_equal(before.point_O, after.point_O)
            np.testing.assert_allclose(before.point_O, hand.object.surface.radial(asked), atol=1e-15)
    loaded.save(tmp_path / "second.json")
    assert (tmp_path / "first.json").read_bytes() == (tmp_path / "second.json").read_bytes()


def test_a_refusal_names_them_too(hand: HandModel) -> None:
    goal = (direction_from_angles(0.0, 0.0), direction_from_angles(90.0, 0.0), None)
    refused = plan_grasp_adjustment(hand, hand.object.X_WO_home, GOAL, goal, SearchOptions(500))
    assert not refused.is_solved
    assert refused.as_dict()["goal"]["contacts"]["finger_3"] is None
    np.testing.assert_allclose(
        refused.as_dict()["goal"]["contacts"]["finger_2"]["normal_O"], [0, 1, 0], atol=1e-15
    )


@pytest.mark.parametrize("has_null", [True, False])
def test_files_without_goal_contacts_load(plan: Plan, tmp_path: Path, has_null: bool) -> None:
    """As files were written before plans named them."""
    data = plan.as_dict()
    if has_null:
        data["goal"]["contacts"] = None
    else:
        del data["goal"]["contacts"]
    (tmp_path / "plan.json").write_text(json.dumps(data))
    loaded = Plan.load(tmp_path / "plan.json")
    assert loaded.goal_contacts is None
    assert len(loaded.actions) == len(plan.actions)


def test_words_say_where_on_the_object(plan: Plan, full_turn: Plan) -> None:
    line = plan.explain().splitlines()[1]
    assert line == (
        "goal contacts (on the object): finger_1 at azimuth -38.0, elevation 0.0 deg; "
        "finger_2 at azimuth 102.0, elevation 7.0 deg; finger_3 free"
    )
    assert "goal contacts" not in full_turn.explain()
