"""A refusal counts as a failure unless brute force finds no gait either, and a detour unless brute force needs it too."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

from brute_force import EquatorialHand, find_gait
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from recheck import Recheck

from dexplan import pipeline
from dexplan.problems.problem import ContactSpec, Problem, Rotation, StartSection

FULL_TURN = 90
"""Grid steps of the brute force."""


def perturb(
    problem: Problem,
    shifts_deg: tuple[float, ...],
    sliding: float,
    order: tuple[int, ...],
    start_deg: tuple[int, int] | None,
    angle_deg: float,
) -> Problem:
    """Return the full turn with bases shifted, friction changed, and the k-th finger around called ``order[k]``."""
    azimuths = [0.0] * 3
    contacts: list[ContactSpec] = ["free"] * 3
    for k, finger in enumerate(order):
        azimuths[finger] = 120.0 * k + shifts_deg[k]
        if start_deg is not None and k < 2:
            contacts[finger] = (float(start_deg[k]), 0.0)
    return replace(
        problem,
        hand=replace(problem.hand, base_azimuths_deg=tuple(azimuths)),
        friction=replace(problem.friction, sliding=sliding),
        start=StartSection("auto" if start_deg is None else tuple(contacts)),
        goal=replace(problem.goal, rotation=Rotation((0.0, 0.0, 1.0), angle_deg)),
    )


@settings(
    derandomize=True,
    max_examples=2,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@example((0.0, 0.0, 0.0), 0.55, (0, 1, 2), (-38, 102), 360.0)
@example((4.0, -7.0, 5.0), 0.42, (1, 0, 2), (-36, 112), 360.0)
@example((-6.0, 3.0, 8.0), 0.60, (2, 0, 1), None, -360.0)
@given(
    st.tuples(*[st.integers(-8, 8).map(float)] * 3),
    st.integers(42, 80).map(lambda percent: percent / 100.0),
    st.permutations(range(3)).map(tuple),
    st.integers(-42, -34).flatmap(lambda a: st.tuples(st.just(a), st.sampled_from([a + 140, a + 148]))),
    st.sampled_from([360.0, -360.0]),
)
def test_planner_finds_a_gait_where_brute_force_does_and_needs_no_more_placements(
    problem: Problem,
    shifts_deg: tuple[float, ...],
    sliding: float,
    order: tuple[int, ...],
    start_deg: tuple[int, int] | None,
    angle_deg: float,
) -> None:
    assert order in set(permutations(range(3)))
    perturbed = perturb(problem, shifts_deg, sliding, order, start_deg, angle_deg)
    plan = pipeline.plan(perturbed)

    hand = pipeline.build_hand(perturbed, pipeline.build_scene(perturbed))
    sense = 1 if angle_deg > 0.0 else -1
    oracle = EquatorialHand(hand, 0.0 if start_deg is None else float(start_deg[0] % 4), sense)
    starts = None
    if start_deg is not None:
        starts = [tuple(sorted((order[k], oracle.index(start_deg[k])) for k in range(2)))]
    gait = find_gait(oracle.spots, FULL_TURN, oracle, starts=starts, follows=oracle.follows, sense=sense)

    if gait is None:
        # The planner is not bound to the equator and may still find one: then it has to be a real one.
        assert not plan.is_solved or Recheck(hand, plan).faults == []
        return
    assert plan.is_solved, plan.reason
    # One more is granted: the grid takes sharper corners than a hand, whose tips have to get past one another.
    assert sum(a.name == "place" for a in plan.actions) <= gait.placements + 1
