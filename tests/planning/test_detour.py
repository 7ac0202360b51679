"""A finger's way around what is in the arc's way: clear at every posture, the same on every run, or a refusal with a name."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.control.reference import build_reference
from dexplan.kinematics.arcs import build_travel, compute_hover, interpolate
from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin, compute_tip_pose
from dexplan.planning.actions.gaits import build_actions
from dexplan.planning.actions.schedule import time_plan
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.gait.steps import Step
from dexplan.planning.ways.detour import Surroundings, find_detour
from dexplan.planning.ways.travel import find_way
from dexplan.plans.contacts import Placement
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.plans.timing import Timing
from dexplan.problems.read import load_problem
from dexplan.spatial import Array, direction_from_angles

BAR = {"kind": "box", "pos_m": [0.075, -0.03, 0.136], "size_m": [0.002, 0.06, 0.002]}
"""A bar under the home of finger 1, between it and the lower part of the ball."""
GRATE = [{"kind": "box", "pos_m": [x, 0.0, 0.136], "size_m": [0.002, 0.3, 0.002]} for x in (0.075, 0.11)]
"""Two long bars, so near to each other that a tip does not fit between them, though the link behind it does."""


@dataclass(frozen=True, eq=False)
class Landing:
    """Finger 1 at home and about to land low on the ball, among ``obstacles``; finger 2 holds."""

    hand: HandModel
    around: Surroundings
    arc: Array
    contacts: tuple[Placement, Placement, Placement]


def build_landing(*obstacles: dict[str, object]) -> Landing:
    problem = load_problem("fig4_substitution", {"obstacles": list(obstacles)})
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    X_WO, finger = hand.object.X_WO_home, hand.fingers[0]
    found = [
        build_landings(hand, X_WO, f, direction_from_angles(np.array([a]), np.array([e])))[0]
        for f, a, e in ((0, 0.0, -36.0), (1, 140.0, 0.0), (2, -100.0, 0.0))
    ]
    low, other, third = (c for c in found if c is not None)
    q = hand.q_home.copy()
    q[1] = other.q
    hover = compute_hover(finger, X_WO, low.X_OF, low.normal_O, low.q, hand.hover)
    arc = build_travel(finger, finger.q_home, hover, X_WO[:3, 3])
    return Landing(hand, Surroundings(hand, q, X_WO, 0, (1,)), arc, (low, other, third))


@pytest.fixture(scope="module")
def barred() -> Landing:
    return build_landing(BAR)


def test_a_clear_arc_is_taken_as_it_is() -> None:
    landing = build_landing()
    way = find_way(landing.around, landing.arc)
    assert np.array_equal(way.postures, landing.arc)
    assert not way.around


def test_detour_is_clear_at_every_posture(barred: Landing) -> None:
    hand, around, arc = barred.hand, barred.around, barred.arc
    assert around.compute_way_clearance(arc)[0] < -0.001
    way = find_way(around, arc)
    assert "obstacle_1" in way.around
    # The reference goes from the very home to the very hover, through a spline; looked at five times as finely as planned.
    assert np.array_equal(way.postures[[0, -1]], arc[[0, -1]])
    fine = interpolate(way.postures, np.linspace(0.0, 1.0, 1200))
    assert np.abs(np.diff(fine, axis=0)).max() < 0.02
    clearances = [around.compute_clearance(q)[0] for q in fine]
    assert min(clearances) >= hand.limits.clearance - 5e-5
    assert way.clearance == pytest.approx(min(clearances), abs=1e-4)
    chain = hand.fingers[0].chain
    assert compute_joint_margin(chain, fine).min() >= hand.limits.joint_margin
    assert compute_dexterity(chain, fine).min() >= hand.limits.dexterity - 1e-3
    assert all(around.keeps_order(X[:3, 3]) for X in compute_tip_pose(chain, fine))
    # It is no tour: at most twice what the fastest joint has to do along the arc.
    length, straight = (np.abs(np.diff(w, axis=0)).max(axis=1).sum() for w in (way.postures, arc))
    assert length < 2.0 * straight


def test_what_blocks_every_way_is_named() -> None:
    landing = build_landing(*GRATE)
    around, arc = landing.around, landing.arc
    ends = around.compute_way_clearance(arc[[0, -1]])
    assert ends[0] >= landing.hand.limits.clearance, ends
    found = find_detour((around,), arc[0], arc[-1])
    assert found.way is None
    assert "finger_1" in found.names
    assert "obstacle" in found.names
    assert found.clearance < landing.hand.limits.clearance
    way = find_way(around, arc)
    assert way.clearance < landing.hand.limits.clearance
    assert not way.around


def test_an_end_that_is_not_clear_is_refused_at_once(barred: Landing) -> None:
    inside = barred.arc[len(barred.arc) // 2]
    found = find_detour((barred.around,), barred.arc[0], inside)
    assert found.way is None
    assert "obstacle_1" in found.names
    assert found.checks == 1


def test_a_detour_keeps_clear_of_all_surroundings_at_once(barred: Landing) -> None:
    """The object, and with it the finger that holds it, may move while the finger travels."""
    around = barred.around
    moved = around.X_WO.copy()
    moved[:3, 3] += [0.0, 0.002, 0.001]
    other = Surroundings(around.hand, around.q, moved, around.finger, around.touching)
    found = find_detour((around, other), barred.arc[0], barred.arc[-1])
    assert found.way is not None
    for each in (around, other):
        clearance = each.compute_way_clearance(found.way)[0]
        assert clearance >= barred.hand.limits.clearance
        assert clearance >= found.clearance - 1e-9


PRINT_DETOUR = f"""
import hashlib, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_detour import BAR, build_landing, find_way
landing = build_landing(BAR)
assert "ompl" not in sys.modules
way = find_way(landing.around, landing.arc)
assert "ompl" in sys.modules
print(hashlib.sha256(way.postures.tobytes()).hexdigest())
"""


def test_detours_are_the_same_in_every_process_and_ompl_is_loaded_for_them_only(barred: Landing) -> None:
    # Other detours before must not matter either.
    find_detour((barred.around,), barred.arc[-1], barred.arc[0])
    here = hashlib.sha256(find_way(barred.around, barred.arc).postures.tobytes()).hexdigest()
    done = subprocess.run([sys.executable, "-c", PRINT_DETOUR], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [here]
    assert not done.stderr


@pytest.fixture(scope="module")
def plan(barred: Landing) -> Plan:
    """Return a plan in which finger 1 lands by a detour, finger 3 leaves by an arc, and finger 1 goes home by the detour."""
    way = find_way(barred.around, barred.arc)
    X_WO = barred.around.X_WO
    one, two, three = barred.contacts
    still = {"X_WO_start": X_WO, "X_WO_end": X_WO, "angle": 0.0, "limit": (None, "the goal")}
    steps = [
        Step((two, three), placed=None, lifted=None, **still),
        Step((one, two), placed=one, lifted=2, ways={0: way}, **still),
        Step((two, three), placed=three, lifted=0, ways={0: way}, **still),
    ]
    actions = build_actions(steps, (None, two, three), np.array([0.0, 0.0, 1.0]))
    names = tuple(f.name for f in barred.hand.fingers)
    axis = np.array([0.0, 0.0, 1.0])
    plan = Plan(
        Status.SOLVED,
        "",
        names,
        "object_manipulation",
        X_WO,
        X_WO,
        axis,
        0.0,
        (None, two, three),
        actions,
        5.5,
    )
    return time_plan(plan, barred.hand.fingers, Timing())


def test_ways_are_written_into_the_actions_as_they_are_walked(barred: Landing, plan: Plan) -> None:
    way = find_way(barred.around, barred.arc)
    assert [(a.name, a.finger, a.ways[0].is_detour) for a in plan.actions[1:-1]] == [
        ("place", 0, True),
        ("lift", 2, False),
        ("place", 2, False),
        ("lift", 0, True),
    ]
    there, back = plan.actions[1], plan.actions[4]
    assert np.array_equal(there.ways[0].postures, way.postures)
    assert np.array_equal(back.ways[0].postures, way.postures[::-1])
    assert not there.ways[0].postures.flags.writeable
    for action in (there, back):
        assert f"a detour keeps {way.around} apart" in action.why


def test_ways_survive_the_file(plan: Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "plan.json")
    again = Plan.load(tmp_path / "plan.json")
    assert again.as_dict() == plan.as_dict()
    for a, b in zip(plan.actions, again.actions, strict=True):
        for way, same in zip(a.ways, b.ways, strict=True):
            assert (way.finger, way.is_detour) == (same.finger, same.is_detour)
            assert np.array_equal(way.postures, same.postures)


def test_the_reference_goes_where_the_plan_says(barred: Landing, plan: Plan) -> None:
    reference = build_reference(plan)
    walked = {p.action_index: p.postures for p in reference.phases if p.name == "travel"}
    assert sorted(walked) == [1, 2, 3, 4]
    for index in walked:
        assert np.array_equal(walked[index], plan.actions[index].ways[0].postures)
    # The others take the arc, from home or to it.
    home = barred.hand.fingers[2].q_home
    assert np.allclose(walked[2][-1], home)
    assert np.allclose(walked[3][0], home)
    # No joint is asked to turn faster than it should, however far the way around is.
    for phase in reference.phases:
        if phase.name == "travel":
            q = interpolate(
                phase.postures, np.array([phase.travelled(t) for t in np.linspace(0, phase.duration, 400)])
            )
            speed = np.abs(np.diff(q, axis=0)).max() / (phase.duration / 399)
            assert speed < 1.3 * Timing().joint_speed


def test_timing_a_plan_again_changes_nothing(barred: Landing, plan: Plan) -> None:
    """Detours stay, arcs are made again, and both are as they were."""
    assert time_plan(plan, barred.hand.fingers, Timing()).as_dict() == plan.as_dict()
    forgotten = replace(plan, actions=tuple(replace(a, ways=()) for a in plan.actions))
    arcs = time_plan(forgotten, barred.hand.fingers, Timing())
    assert not any(way.is_detour for action in arcs.actions for way in action.ways)
    assert np.array_equal(arcs.actions[2].ways[0].postures, plan.actions[2].ways[0].postures)
    assert not np.array_equal(arcs.actions[1].ways[0].postures, plan.actions[1].ways[0].postures)
