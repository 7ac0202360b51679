"""Both oracles answer the same questions, and what they promise holds; without symmetry gaits are found all the same."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pytest
from recheck import Recheck

from dexplan import pipeline
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.contacts.layers import Layers
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.oracle import Contacts, Landfall, Progress
from dexplan.planning.contacts.orbit_contacts import OrbitContacts
from dexplan.planning.contacts.rolling_contacts import RollingContacts
from dexplan.planning.contacts.site_contacts import SiteContacts
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.ends import AnyEnd
from dexplan.planning.search.engine import Engine, Patience
from dexplan.planning.search.moves import Go, Place
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.planning.search.stepwise import StepProblem
from dexplan.planning.tasks.object_manipulation import plan_rotation
from dexplan.planning.tasks.on_sites import plan_rotation_on_sites
from dexplan.plans.actions import count_placements
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.status import Status
from dexplan.problems.read import load_problem
from dexplan.spatial import VERTICAL, direction_from_angles

START = (direction_from_angles(-38.0, 0.0), direction_from_angles(102.0, 0.0), None)
ANGLE = float(np.radians(46.0))
"""A whole number of stations, so that the last of them is where the leg ends."""
FIRST = Progress(0, 0)


@pytest.fixture(scope="module")
def orbits(hand: HandModel) -> OrbitContacts:
    table = ContactTable(hand, Leg(hand.object.X_WO_home, VERTICAL, ANGLE))
    return OrbitContacts([table], Admissibility(hand))


@pytest.fixture(scope="module")
def sites(hand: HandModel) -> SiteContacts:
    motion = ObjectMotion(hand.object.X_WO_home, VERTICAL, ANGLE, np.zeros(3))
    return SiteContacts(Layers(hand, Admissibility(hand), Track((motion,))))


@pytest.fixture(params=["orbits", "sites"])
def begun(request: pytest.FixtureRequest, hand: HandModel) -> tuple[Any, Any]:
    """Return an oracle, and the start grip as it knows it."""
    oracle = request.getfixturevalue(request.param)
    if request.param == "orbits":
        held = [oracle.tables[0].start_along(f, n) for f, n in enumerate(START) if n is not None]
        return oracle, tuple(held)
    first = oracle.layers.poses[0]
    landed = [
        None if n is None else build_landings(hand, first.X_WO, f, n[None])[0] for f, n in enumerate(START)
    ]
    return oracle, tuple(None if c is None else first.add(c) for c in landed)


@pytest.mark.parametrize("oracle", [OrbitContacts, SiteContacts, RollingContacts])
def test_an_oracle_answers_every_question_of_the_protocol(oracle: type) -> None:
    asked = {name: member for name, member in vars(Contacts).items() if inspect.isfunction(member)}
    for name, question in asked.items():
        if not name.startswith("_"):
            answer = getattr(oracle, name)
            assert list(inspect.signature(answer).parameters) == list(inspect.signature(question).parameters)
    assert isinstance(vars(oracle)["hand"], property)


def test_what_an_oracle_promises_holds(begun: tuple[Any, Any]) -> None:
    oracle, grip = begun
    assert oracle.list_touching(grip) == (0, 1)
    assert oracle.judge(grip, FIRST).is_admissible
    assert oracle.key_of(grip, FIRST) == oracle.key_of(grip, FIRST)
    assert not oracle.list_rests(grip, FIRST)
    reach = oracle.go(grip, FIRST)
    assert reach.stops > 0
    assert oracle.go(grip, FIRST, most=0).stops == 0
    assert oracle.refuse_carry(grip, FIRST, reach.stops) is None
    verdict = oracle.judge_carry(grip, FIRST, reach.stops)
    assert verdict.refusal is None
    assert verdict.margins["load"] > 0.0
    # A carried contact stays where it is on the object, tip pose and all.
    after = oracle.advance(grip, FIRST, reach.stops)
    there = Progress(0, reach.stops)
    assert oracle.judge(after, there).is_admissible
    for before, now in zip(grip, after, strict=True):
        if before is not None:
            np.testing.assert_allclose(
                oracle.place(now, there).X_OF, oracle.place(before, FIRST).X_OF, atol=1e-5
            )


def test_landings_hold_with_one_of_those_that_hold(begun: tuple[Any, Any]) -> None:
    oracle, grip = begun
    keep = grip[0]
    found = oracle.land(0, [Landfall(2, keep, grip, 0)])[0]
    assert found
    for landing in found[:5]:
        one, other = (oracle.place(touch, FIRST).normal_O for touch in (keep, landing.held))
        assert one @ other < -0.5
        assert landing.load < 2.0


class Runs:
    """A bound for contacts on orbits: how often what is left of a turn uses up a contact of so many stations."""

    run = 45

    def __init__(self, orbits: OrbitContacts) -> None:
        self._stations = orbits.count_stops(0)

    def count_moves(self, stop: int, grip: tuple[Held, ...]) -> float:
        ahead, (short, long) = self._stations - stop, sorted(h.left for h in grip)[-2:]
        missing = 0.6 + 0.5 * (ahead - short + max(0, ahead - long)) / self.run if ahead > short else 0.0
        return 2.0 * missing + (len(grip) > 2)

    def refuse(self, stop: int, grip: tuple[Held, ...]) -> None:
        """Nothing is learnt."""


def test_one_problem_serves_both_oracles(hand: HandModel) -> None:
    """Moves one at a time, on orbits as on sites: a turn of 150 degrees, every carry and every grip of it judged exactly."""
    orbits = OrbitContacts(
        [ContactTable(hand, Leg(hand.object.X_WO_home, VERTICAL, float(np.radians(150.0))))],
        Admissibility(hand),
    )
    held = [orbits.tables[0].start_along(f, n) for f, n in enumerate(START) if n is not None]
    shares = (1.0, 0.85, 0.7, 0.5, 0.3)
    problem = StepProblem(orbits, AnyEnd(), Runs(orbits), shares=shares, stop_cost=0.05)
    engine = Engine(problem, Patience(0.5, 0.5))
    engine.push(Node(FIRST, tuple(h for h in held if h is not None)))
    last = engine.run(100)
    assert last is not None
    way = trace_back(last)
    assert sum(go.stops for node in way if (go := node.find_move(Go)) is not None) == orbits.count_stops(0)
    assert 0 < sum(node.find_move(Place) is not None for node in way) <= 3
    for node in way:
        row = orbits.judge(node.grip, node.at)
        assert row.is_admissible
        assert len(orbits.list_touching(node.grip)) >= 2


@pytest.mark.parametrize("angle_deg", [60.0, -150.0])
def test_gaits_on_sites_need_hardly_more(hand: HandModel, angle_deg: float) -> None:
    """The ball without its symmetry: the same turn, at most one placement more than on orbits."""
    goal = RotationGoal(hand.object.X_WO_home, VERTICAL, float(np.radians(angle_deg)))
    fast, slow = plan_rotation(hand, goal, START, 2000), plan_rotation_on_sites(hand, goal, START, 400)
    assert fast.is_solved
    assert slow.is_solved, slow.reason
    assert Recheck(hand, slow).faults == []
    assert count_placements(slow.actions) <= count_placements(fast.actions) + 1


@pytest.mark.parametrize("name", ["any_attitude", "fig4_substitution", "shelf"])
def test_problems_are_solved_without_the_fast_path(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Built-in problems, orbits out of the way: solved all the same, and sound to a second opinion."""
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(pipeline, "plan_object_manipulation", lambda *given: asked.append(given))
    monkeypatch.setattr(OrbitContacts, "go", None)
    problem = load_problem(name)
    pipeline._find_plan(
        problem,
        pipeline.build_scene(problem),
        hand := pipeline.build_hand(problem, pipeline.build_scene(problem)),
    )
    _, goal, start, *_ = asked[0]
    plan = plan_rotation_on_sites(hand, goal, start, 600)
    assert plan.is_solved, plan.reason
    assert Recheck(hand, plan).faults == []


def test_a_start_out_of_reach_is_refused_as_on_orbits(hand: HandModel) -> None:
    goal = RotationGoal(hand.object.X_WO_home, VERTICAL, 1.0)
    start = (direction_from_angles(180.0, 0.0), direction_from_angles(0.0, 0.0), None)
    plans = [plan_rotation(hand, goal, start, 100), plan_rotation_on_sites(hand, goal, start, 100)]
    assert [plan.status for plan in plans] == [Status.START_UNREACHABLE] * 2
    assert not plan_rotation_on_sites(hand, goal, START, 1).is_solved
