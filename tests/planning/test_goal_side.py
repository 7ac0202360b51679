"""Ways into a goal grasp, looked at from its own side: what they promise holds."""

from __future__ import annotations

from itertools import combinations

import pytest

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.contacts.still import change_stand
from dexplan.planning.regrasp.goal_side import GoalSide
from dexplan.spatial import Array, direction_from_angles

PAIR: tuple[Array | None, ...] = (
    direction_from_angles(-38.0, 0.0),
    direction_from_angles(102.0, 0.0),
    None,
)
RING = tuple(direction_from_angles(azimuth, 0.0) for azimuth in (0.0, 120.0, 240.0))
WIDE = tuple(direction_from_angles(azimuth, 0.0) for azimuth in (-35.0, 120.0, 200.0))


def find_side(hand: HandModel, goal: tuple[Array | None, ...]) -> GoalSide:
    X_WO = hand.object.X_WO_home
    contacts = tuple(
        None if n is None else build_landings(hand, X_WO, f, n[None])[0] for f, n in enumerate(goal)
    )
    return GoalSide(hand, Admissibility(hand), X_WO, contacts)


@pytest.mark.parametrize("goal", [PAIR, RING, WIDE])
def test_the_last_finger_can_come_wherever_it_is_promised(
    hand: HandModel, goal: tuple[Array | None, ...]
) -> None:
    side = find_side(hand, goal)
    assert side.refusal is None
    assert side.roots
    still = side.still
    for stand, pairs in side.roots.items():
        assert still.judge(stand).is_admissible
        assert pairs
        if None in stand:
            continue
        for a, b in pairs:
            last = 3 - a - b
            before = change_stand(stand, last, None)
            assert still.forms_pair(*(s for s in before if s is not None))
            assert still.judge(before).is_admissible
            assert still.find_change(before, stand).clearance >= hand.limits.clearance


def test_only_what_is_promised_can_come_last(hand: HandModel) -> None:
    side = find_side(hand, WIDE)
    (stand, pairs), still = next(iter(side.roots.items())), side.still
    for a, b in combinations(range(3), 2):
        before = change_stand(stand, 3 - a - b, None)
        possible = (
            still.has_pair(before)
            and still.judge(before).is_admissible
            and still.find_change(before, stand).clearance >= hand.limits.clearance
        )
        assert possible == ((a, b) in pairs)


def test_a_goal_without_a_pair_is_entered_by_rolling(hand: HandModel) -> None:
    side = find_side(hand, RING)
    assert not side.still.has_pair(tuple(range(3)))
    assert set(side.options) == set(side.roots)
    assert all(option is not None for option in side.options.values())
    assert find_side(hand, WIDE).options[next(iter(find_side(hand, WIDE).roots))] is None
