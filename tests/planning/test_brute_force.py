"""The brute-force gait search against the closed-form gait oracle of a three-fold ring."""

from __future__ import annotations

import pytest
from brute_force import COUNT, Ring, find_gait

THIRD = COUNT // 3
TURN = 100
"""Grid steps: more than a whole turn."""


@pytest.mark.parametrize("half_width", [1, 2, 3, 5, 7, 9])
def test_substitution_turns_the_ring_iff_the_excess_is_at_most_the_half_width(half_width: int) -> None:
    for excess in {0, half_width - 1, half_width, half_width + 1, half_width + 2}:
        ring = Ring(half_width, THIRD + excess)
        assert (find_gait(ring.spots, TURN, ring) is not None) == (excess <= half_width)


@pytest.mark.parametrize("half_width", [2, 5, 8])
@pytest.mark.parametrize("sense", [1, -1])
def test_best_turn_per_placement_is_the_half_width(half_width: int, sense: int) -> None:
    # Two lengths of turn, so that what the first and the last run give in addition cancels.
    ring = Ring(half_width, THIRD + half_width)
    short = find_gait(ring.spots, 4 * half_width, ring, sense=sense)
    long = find_gait(ring.spots, 16 * half_width, ring, sense=sense)
    assert short is not None
    assert long is not None
    assert long.placements - short.placements == 12


def test_gait_is_a_way_through_allowed_states() -> None:
    ring = Ring(6, THIRD + 4)
    gait = find_gait(ring.spots, TURN, ring, starts=[((0, 0), (1, THIRD + 4))])
    assert gait is not None
    assert gait.way[0] == (((0, 0), (1, THIRD + 4)), 0)
    assert gait.way[-1][1] == TURN
    exchanges = 0
    for (before, done), (after, later) in zip(gait.way, gait.way[1:], strict=False):
        assert ring(after)
        if later > done:
            turn = later - done
            assert tuple((f, (k + turn) % COUNT) for f, k in before) == after
        else:
            assert len(set(before) & set(after)) == 1
            exchanges += 1
    assert exchanges == gait.placements


def test_there_is_no_gait_from_a_start_that_is_not_allowed() -> None:
    ring = Ring(6, THIRD + 4)
    assert find_gait(ring.spots, TURN, ring, starts=[((0, 0), (1, THIRD))]) is None
