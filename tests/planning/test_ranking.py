"""The search's heuristic: nothing is missing at the goal, and contacts that get far on the next leg go first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.gait.exchange import GaitNode
from dexplan.planning.gait.ranking import Ranking
from dexplan.planning.gait.search import GaitSearch
from dexplan.planning.search.cost import CostWeights
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.spatial import direction_from_angles

UP, SIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def route(hand: HandModel) -> tuple[Leg, Leg]:
    """Return a turn about the vertical and then one about a horizontal axis."""
    first = Leg(hand.object.X_WO_home, UP, 0.35)
    return first, Leg(first.X_WO_end, SIDE, 1.2)


@pytest.fixture(scope="module")
def tables(hand: HandModel, route: tuple[Leg, Leg]) -> list[ContactTable]:
    return [ContactTable(hand, leg) for leg in route]


def build_node(
    leg: int, done: int, lefts: tuple[int, int], placements: int = 0, load: float = 0.5
) -> GaitNode:
    """Return a node of two contacts that can be carried so far; where they are matters only where a leg follows."""
    held = (Held(0, 0, 0, 0, lefts[0]), Held(1, 0, 0, 0, lefts[1]))
    return Node(Progress(leg, done), held, placements, promise=min(lefts), strain=load)


def estimate(ranking: Ranking, node: GaitNode) -> GaitNode:
    """Return a node with its bound."""
    return replace(node, bound=ranking.estimate_missing(node))


def rank_of(ranking: Ranking, node: GaitNode) -> float:
    """Return the priority of a node, its bound known."""
    return ranking.rank(estimate(ranking, node))


@pytest.mark.parametrize("rewinds_only", [False, True])
def test_nothing_is_missing_where_the_goal_is_reached(tables: list[ContactTable], rewinds_only: bool) -> None:
    ranking, last = Ranking(tables, rewinds_only), tables[1].stations
    for done in (0, last - 3, last):
        there = build_node(1, done, (last - done, last - done + 9))
        assert ranking.estimate_missing(there) == 0.0
        assert rank_of(ranking, there) == pytest.approx(there.strain)
        assert ranking.foresee_cost(estimate(ranking, there), CostWeights(1.0, 0.0, 0.0, 0.0)) == 0.0
        if done < last:
            short = build_node(1, done, (last - done - 1, last - done + 9))
            assert ranking.estimate_missing(short) > 0.5
    # A grasp that will not hold so long, though its fingers reach.
    weak = replace(build_node(1, 0, (last, last)), promise=last // 2)
    assert ranking.estimate_missing(weak) > 0.5


@given(
    done=st.integers(0, 20),
    lefts=st.tuples(st.integers(0, 60), st.integers(0, 60)),
    more=st.integers(1, 10),
    which=st.integers(0, 1),
)
@settings(max_examples=100, deadline=None, derandomize=True, database=None)
def test_estimates_fall_with_progress_and_with_what_fingers_have_left(
    tables: list[ContactTable], done: int, lefts: tuple[int, int], more: int, which: int
) -> None:
    ranking = Ranking(tables, rewinds_only=False)
    here = build_node(1, done, lefts)
    on = build_node(1, done + more, lefts)
    grown = (lefts[0] + more * (which == 0), lefts[1] + more * (which == 1))
    missing = ranking.estimate_missing(here)
    assert ranking.estimate_missing(on) <= missing
    assert ranking.estimate_missing(build_node(1, done, grown)) <= missing
    # One leg more to go is never less, placements and loads come on top.
    assert rank_of(ranking, build_node(1, done, lefts, placements=2)) == pytest.approx(
        rank_of(ranking, here) + 2.0
    )
    heavy = build_node(1, done, lefts, load=0.95)
    assert rank_of(ranking, heavy) > rank_of(ranking, here) + 0.45
    # Rewinds take two placements where a substitution takes one.
    assert Ranking(tables, rewinds_only=True).estimate_missing(here) >= 2.0 * missing


def test_a_pair_to_be_rewound_counts_who_is_away_or_used_up(tables: list[ContactTable]) -> None:
    """Half a placement for every one that is missing: away, its own; used up, another finger's and its own."""
    ranking = Ranking(tables, rewinds_only=True)

    def miss(fingers: tuple[int, int], lefts: tuple[int, int]) -> float:
        held = tuple(Held(f, 0, 0, 0, left) for f, left in zip(fingers, lefts, strict=True))
        return ranking.estimate_missing(Node(Progress(1, 0), held, promise=0, movers=(0, 1)))

    fresh = 170
    away, used, both = miss((0, 2), (fresh, 0)), miss((0, 1), (fresh, 0)), miss((0, 2), (0, 0))
    at_home = ranking.estimate_missing(
        Node(Progress(1, 0), (Held(0, 0, 0, 0, fresh), Held(1, 0, 0, 0, 0)), promise=0)
    )
    assert away == pytest.approx(at_home + 0.5)
    assert used == pytest.approx(at_home + 1.0)
    assert both > used


def test_contacts_that_get_far_on_the_next_leg_go_first(
    hand: HandModel, route: tuple[Leg, Leg], tables: list[ContactTable]
) -> None:
    """Grasps that reach the end of the first leg alike: ranked by how far they would get on the second, foreseen truly."""
    first, after = tables
    ranking, rows = Ranking(tables, rewinds_only=False), []
    for azimuth in range(-58, -21, 6):
        for elevation in (-20.0, 0.0, 20.0):
            n = direction_from_angles(float(azimuth), elevation)
            held = [first.start_along(0, n), first.start_along(1, -n)]
            if any(h is None or h.left < first.stations for h in held):
                continue
            one, two = (replace(h, left=first.stations) for h in held if h is not None)
            node = Node(Progress(0, 0), (one, two), promise=first.stations, strain=0.5)
            missing = ranking.estimate_missing(node)
            # What really comes of it: both contacts as they stand at the second leg's start.
            ends = [h.carried(first.stations) for h in (one, two)]
            foreseen = [after.foresee_carry(h.finger, first.normal(h)) for h in ends]
            real = [after.start_along(h.finger, first.normal(h)) for h in ends]
            reached = min(-1 if h is None else h.left for h in real)
            rows.append((rank_of(ranking, node), missing, min(foreseen), reached))
    assert len(rows) > 8
    rank, missing_all, foreseen_all, reached_all = (
        np.array(column, dtype=float) for column in zip(*rows, strict=True)
    )
    assert np.ptp(foreseen_all) > 5
    # Who is foreseen to get farther never ranks behind; who gets to the end of the route misses nothing.
    for a in range(len(rows)):
        assert (missing_all[a] == 0.0) == (foreseen_all[a] >= after.stations)
    far, near = np.argmax(foreseen_all), np.argmin(foreseen_all)
    assert rank[far] < rank[near]
    # And it comes true: to 3 stations for most, though what is foreseen is the carry of a landing a few degrees off.
    off = np.abs(np.minimum(foreseen_all, after.stations) - np.clip(reached_all, 0.0, after.stations))
    assert (off <= 3.0).mean() > 0.8
    assert np.median(off) <= 1.0


def test_a_shift_that_follows_misses_nothing(hand: HandModel, route: tuple[Leg, Leg]) -> None:
    shift = Leg(route[0].X_WO_end, UP, 0.0, np.array([0.0, 0.0, 0.005]))
    tables = [ContactTable(hand, leg) for leg in (route[0], shift)]
    stations = tables[0].stations
    assert Ranking(tables, False).estimate_missing(build_node(0, 0, (stations, stations))) == 0.0


def test_a_way_that_was_found_is_not_foreseen_to_cost_more(hand: HandModel) -> None:
    """What is left out for its cost must not be the very plan: the bound holds at every node of the way."""
    leg = Leg(hand.object.X_WO_home, UP, np.pi)
    search = GaitSearch(hand, (leg,), Admissibility(hand))
    held = [
        search.tables[0].start_along(f, direction_from_angles(a, 0.0)) for f, a in ((0, -38.0), (1, 102.0))
    ]
    search.begin(tuple(h for h in held if h is not None))
    node = search.run(200)
    assert node is not None
    weights, ranking = CostWeights(), Ranking(search.tables, False)
    cost = search.compute_cost(node, weights)
    foreseen = [ranking.foresee_cost(n, weights) for n in trace_back(node)]
    assert max(foreseen) <= cost
    assert foreseen[-1] > 0.5 * cost
