"""Why this finger and this place: the runner-up is another placement, and what is said of it is what the search knew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dexplan.plans.actions import Relocate
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.plans.runner_up import RunnerUp
from dexplan.spatial import direction_from_angles

OTHER = RunnerUp(2, direction_from_angles(30.0, -10.0), None, 2.0, 2.0, 0.5, 0.5, 0.0)
WORDS = {
    "promises about as much, and its turn never came": {},
    "seems to leave 3.2 placements to the goal, this one 2.0": {"missing": 3.2},
    "uses 0.93 of the believed cone, this one 0.50": {"used": 0.93},
    "has a way that counts 2 placements more": {"extra": 2.0},
    "cannot: a joint of finger_3 comes near its limit": {
        "refusal": Refusal(RefusalKind.JOINT_LIMIT, ("finger_3",))
    },
}


@pytest.mark.parametrize("words", WORDS)
def test_it_is_told_in_words_and_kept_in_files(words: str) -> None:
    other = replace(OTHER, **WORDS[words])  # type: ignore[arg-type]
    assert str(other) == f"finger 3 at azimuth 30.0, elevation -10.0 deg (world) {words}"
    names = ("finger_1", "finger_2", "finger_3")
    data = other.as_dict(names)
    assert RunnerUp.from_dict(data, names).as_dict(names) == data


def test_every_placement_of_a_gait_has_one(full_turn: Plan) -> None:
    places = [a for a in full_turn.actions if isinstance(a, Relocate) and a.is_placing]
    assert places
    for action in places:
        other, contact = action.runner_up, action.contacts_end[action.finger]
        assert other is not None
        assert contact is not None
        here = action.X_WO_end[:3, :3] @ contact.normal_O
        apart = np.degrees(np.arccos(np.clip(here @ other.normal_W, -1.0, 1.0)))
        assert other.finger != action.finger or apart >= 10.0
        if other.refusal is None:
            # Nothing that promised more was passed over.
            dearer = other.extra + 3.0 * (other.missing - other.missing_here) + (other.used - other.used_here)
            assert dearer > -0.2
        assert f"     runner-up: {other}\n" in full_turn.explain()


def test_lifts_have_none(full_turn: Plan) -> None:
    lifts = [a for a in full_turn.actions if isinstance(a, Relocate) and not a.is_placing]
    assert lifts
    assert all(a.runner_up is None for a in lifts)


def test_older_files_have_none(full_turn: Plan) -> None:
    data = full_turn.as_dict()
    for action in data["actions"]:
        action.pop("runner_up", None)
    assert "runner-up" not in Plan.from_dict(data).explain()
