"""Several ends of gaits: they differ, and are where the object should be."""

from __future__ import annotations

import numpy as np

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.rolling.roll_to_goal import measure_angle
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.ends import Ends, choose_beginnings
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.plans.goal import RotationGoal
from dexplan.spatial import VERTICAL, direction_from_angles

RING = tuple(direction_from_angles(azimuth, 0.0) for azimuth in (0.0, 120.0, 240.0))


def test_ends_differ_and_are_where_the_object_should_be(hand: HandModel) -> None:
    X_WO = hand.object.X_WO_home
    hold = plan_rotation(hand, RotationGoal(X_WO, VERTICAL, 0.0), RING, 500)
    beginnings = choose_beginnings(hand, hold, RING, Admissibility(hand))
    assert [a.name for a in beginnings[0].actions] == ["roll", "lift"]
    goal = RotationGoal(X_WO, np.array([0.6, 0.0, 0.8]), 1.0, is_attitude=True)
    ends = Ends(hand, goal, beginnings, hold.start_contacts, SearchOptions(500))
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
