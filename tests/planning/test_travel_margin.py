"""Free fingers keep off their joint limits along their whole ways, as the controller's spline goes through them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from dexplan.kinematics.arcs import build_travel, compute_hover
from dexplan.kinematics.chain import compute_joint_margin
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.carry import spin_tip
from dexplan.planning.admissible.hand import HandModel, compute_travel_margin
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.ways.detour import Surroundings
from dexplan.planning.ways.travel import find_way
from dexplan.sim.judge.validate import load_default_limits

JUDGED = float(np.radians(load_default_limits()["joint_limit_margin_min_deg"]))
EXECUTION = float(np.radians(0.5))
"""What a run may add [rad]: measured 0.01 degrees where a finger hovers, and a third of a degree in its fastest travel."""


def executed_margin(hand: HandModel, finger: int, way: np.ndarray) -> float:
    """Return the least distance [rad] to a joint limit along the controller's spline through ``way`` (K, J)."""
    path = CubicSpline(np.linspace(0.0, 1.0, len(way)), way)(np.linspace(0.0, 1.0, 400))
    return float(compute_joint_margin(hand.fingers[finger].chain, path).min())


@pytest.mark.parametrize("finger", [0, 1, 2])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.01, -0.02, 0.01), (-0.015, 0.01, -0.02)])
def test_ways_that_are_taken_keep_what_the_judge_asks(
    hand: HandModel, finger: int, shift: tuple[float, float, float]
) -> None:
    X_WO = hand.object.X_WO_home.copy()
    X_WO[:3, 3] += shift
    who, home = hand.fingers[finger], hand.q_home
    normals = spread_directions(120)
    found = [p for p in build_landings(hand, X_WO, finger, normals) if p is not None]
    # The tip turned about its pole as far as a landing may be, as it is where a contact is carried far.
    room = hand.limits.joint_margin + 1e-6
    ends = who.chain.lower[-1] + room, who.chain.upper[-1] - room
    landings = [spin_tip(hand, p, end - p.q[-1]) for k, p in enumerate(found) for end in ends[k % 2 :][:1]]
    taken, narrow = 0, 0
    for landing in landings:
        hover = compute_hover(who, X_WO, landing.X_OF, landing.normal_O, landing.q, hand.hover)
        arc = build_travel(who, who.q_home, hover, X_WO[:3, 3])
        narrow += executed_margin(hand, finger, arc) < hand.limits.travel_margin
        way = find_way(Surroundings(hand, home, X_WO, finger, ()), arc, looks_around=False)
        if way.clearance >= hand.limits.clearance:
            taken += 1
            assert executed_margin(hand, finger, way.postures) >= JUDGED + EXECUTION
    assert taken > 5
    # Landings keep 5 degrees; the hover over some of them, or the arc to it, would not have kept 4.
    assert narrow > 0


def test_a_hover_at_a_joint_limit_is_named(hand: HandModel) -> None:
    who = hand.fingers[0]
    q = who.q_home.copy()
    q[-1] = who.chain.upper[-1] - np.radians(2.0)
    way = find_way(
        Surroundings(hand, hand.q_home, hand.object.X_WO_home, 0, ()), np.linspace(who.q_home, q, 17)
    )
    assert way.clearance == -np.inf
    assert way.names == f"{who.name} and its joint limits"


def test_an_arc_that_swings_into_a_joint_limit_is_gone_around(hand: HandModel) -> None:
    who, chain = hand.fingers[0], hand.fingers[0].chain
    swing = np.zeros((17, chain.n_joints))
    swing[:, 0] = chain.upper[0] - np.radians(3.0) - who.q_home[0]
    arc = who.q_home + np.sin(np.linspace(0.0, np.pi, 17))[:, None] * swing
    around = Surroundings(hand, hand.q_home, hand.object.X_WO_home, 0, ())
    assert executed_margin(hand, 0, arc) < np.radians(3.1)
    way = find_way(around, arc)
    assert way.around
    assert executed_margin(hand, 0, way.postures) >= compute_travel_margin(hand, 0)
