"""Ways into a goal grasp found from its own side, and several ends of gaits: what they promise holds."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.planning.admissible import Admissibility
from dexplan.planning.ends import Ends, choose_beginnings
from dexplan.planning.entrances import ENOUGH, GoalSide
from dexplan.planning.goal import VERTICAL, RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.planner import plan_rotation
from dexplan.planning.roll_to_goal import measure_angle
from dexplan.planning.still import build_landings
from dexplan.spatial import Array, direction_from_angles

PAIR: tuple[Array | None, ...] = (
    direction_from_angles(-38.0, 0.0),
    direction_from_angles(102.0, 0.0),
    None,
)
RING = tuple(direction_from_angles(azimuth, 0.0) for azimuth in (0.0, 120.0, 240.0))


def find_side(hand: HandModel, goal: tuple[Array | None, ...]) -> GoalSide:
    X_WO = hand.object.X_WO_home
    contacts = tuple(
        None if n is None else build_landings(hand, X_WO, f, n[None])[0] for f, n in enumerate(goal)
    )
    return GoalSide(hand, Admissibility(hand), X_WO, contacts)


@pytest.mark.parametrize("goal", [PAIR, RING])
def test_every_way_in_is_admissible_step_by_step(hand: HandModel, goal: tuple[Array | None, ...]) -> None:
    side = find_side(hand, goal)
    assert side.refusal == ""
    wanted = tuple(None if n is None else 0 for n in goal)
    away = 0
    for labels, entrance in side.entrances.items():
        assert side.still.label(entrance.stands[0]) == labels
        last = side.still.label(entrance.stands[-1])
        if entrance.option is None:
            assert last == wanted
        else:
            assert all(label is not None and label < 7 for label in last)
        for stand in entrance.stands:
            assert side.still.judge(stand).is_admissible
        for before, after in zip(entrance.stands, entrance.stands[1:], strict=False):
            assert sum(a != b for a, b in zip(before, after, strict=True)) == 1
            way = side.still.find_change(before, after)
            assert way.clearance >= hand.limits.clearance
        away += not any(n == 0 for n in labels) and entrance.stands[0] != entrance.stands[-1]
    # From some of them on no finger is at its goal contact any more.
    assert away >= min(2, ENOUGH)


def test_a_goal_without_a_pair_is_entered_by_rolling(hand: HandModel) -> None:
    side = find_side(hand, RING)
    rolled = [e for e in side.entrances.values() if len(e.stands) > 1]
    assert rolled
    assert all(e.option is not None for e in rolled)


def test_ends_differ_and_are_where_the_object_should_be(hand: HandModel) -> None:
    X_WO = hand.object.X_WO_home
    hold = plan_rotation(hand, RotationGoal(X_WO, VERTICAL, 0.0), RING, 500)
    beginnings = choose_beginnings(hand, hold, RING, Admissibility(hand))
    assert [a.kind for a in beginnings[0].actions] == ["roll", "lift"]
    goal = RotationGoal(X_WO, np.array([0.6, 0.0, 0.8]), 1.0, is_attitude=True)
    ends = Ends(hand, goal, beginnings, hold.start_contacts, 500, ("substitution",))
    found = [end for k in range(3) if (end := ends.get(k, 200)) is not None]
    assert len(found) >= 2
    assert ends.opened > 0
    for k, end in enumerate(found):
        np.testing.assert_allclose(end.actions[-1].X_WO_end, goal.X_WO_goal, atol=1e-9)
        for finger, contact in enumerate(end.contacts):
            if contact is not None:
                reached = hand.fingers[finger].pose_at(contact.q)
                np.testing.assert_allclose(reached, goal.X_WO_goal @ contact.X_OF, atol=1e-5)
        for other in found[:k]:
            pairs = list(zip(end.contacts, other.contacts, strict=True))
            assert any(
                (a is None) != (b is None)
                or (
                    a is not None
                    and b is not None
                    and measure_angle(a.normal_O, b.normal_O) > np.radians(15.0)
                )
                for a, b in pairs
            )
