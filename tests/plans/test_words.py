"""Places of contacts in words: a direction says all on a ball, and not which of two contacts on one face is meant."""

from __future__ import annotations

import numpy as np

from dexplan.plans.contacts import GoalContact
from dexplan.plans.words import describe_goal_contacts
from dexplan.spatial import direction_from_angles


def test_on_a_ball_the_direction_is_the_place() -> None:
    normal = direction_from_angles(30.0, 10.0)
    words = describe_goal_contacts(("finger_1", "finger_2"), (GoalContact(0, 0.042 * normal, normal), None))
    assert (
        words == "goal contacts (on the object): finger_1 at azimuth 30.0, elevation 10.0 deg; finger_2 free"
    )


def test_two_contacts_on_one_face_are_told_apart() -> None:
    normal = np.array([0.0, 1.0, 0.0])
    places = ([0.011, 0.03, 0.0], [-0.013, 0.03, 0.002])
    contacts = tuple(GoalContact(k, np.array(p), normal) for k, p in enumerate(places))
    words = describe_goal_contacts(("finger_1", "finger_2"), contacts)
    assert (
        "finger_1 at (11.0, 30.0, 0.0) mm of the object, which faces azimuth 90.0, elevation 0.0 deg" in words
    )
    assert "finger_2 at (-13.0, 30.0, 2.0) mm" in words
