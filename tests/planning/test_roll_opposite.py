"""Three fingers evenly around the ball: the third one stands exactly opposite the other two, with no side to which to follow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dexplan.planning.admissible.admissibility import Admissibility, FingerState, Margins
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.rolling.roll_gait import FOLLOW, RollToPair
from dexplan.plans.contacts import Placement
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import direction_from_angles

TOO_MANY = Refusal(RefusalKind.LOAD, words="too many fingers")
WIDER = float(np.radians(20.0))


class Crowded(Admissibility):
    """Lets pairs hold and says no to all three fingers at once, so that the third one is asked to follow."""

    def compute_margins_of(self, states: dict[int, FingerState], *rest: Any, **named: Any) -> Margins:
        found = super().compute_margins_of(states, *rest, **named)
        return replace(found, refusal=TOO_MANY) if len(states) > 2 else found


def place(hand: HandModel, third: float) -> list[Placement]:
    """Return exact contacts at azimuths 0, 120 and ``third`` degrees."""
    found = []
    for finger, azimuth in enumerate((0.0, 120.0, third)):
        normal = direction_from_angles(azimuth, 0.0)
        placement = build_landings(hand, hand.object.X_WO_home, finger, normal[None])[0]
        assert placement is not None
        found.append(placement)
    return found


@pytest.mark.parametrize(("third", "tried"), [(240.0, 1), (238.0, len(FOLLOW)), (242.0, len(FOLLOW))])
def test_a_finger_exactly_opposite_has_no_side_to_follow(hand: HandModel, third: float, tried: int) -> None:
    """All great circles through it and the middle of the pair are alike: it only stays; a little aside it is tried everywhere."""
    contacts = place(hand, third)
    toward = -contacts[0].normal_O - contacts[1].normal_O
    is_opposite = np.linalg.norm(np.cross(toward, contacts[2].normal_O)) < 1e-9
    assert is_opposite == (tried == 1)
    search = RollToPair(hand, hand.object.X_WO_home, tuple(contacts), Crowded(hand))
    assert search.open_pair(contacts[0], contacts[1], contacts[2], WIDER) is None
    assert search.refusals.counts == [(TOO_MANY, tried)]


def test_it_stays_where_that_is_admissible(hand: HandModel) -> None:
    contacts = place(hand, 240.0)
    search = RollToPair(hand, hand.object.X_WO_home, tuple(contacts), Admissibility(hand))
    way = search.open_pair(contacts[0], contacts[1], contacts[2], WIDER)
    assert way is not None
    assert sorted(roll.finger for roll in way.rolls) == [0, 1]
