"""Runs of contacts along orbits: windows against a plain loop, and orbits against postures gone through one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.kinematics.chain import compute_dexterity, compute_joint_margin, compute_tip_pose
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.contacts.orbits import Orbit, _measure_windows, build_fixed_orbit, build_orbits
from dexplan.planning.contacts.stops import StopKind
from dexplan.plans.motion import STEP
from dexplan.spatial import Array, direction_from_angles, make_pose, rotate_about

UP = np.array([0.0, 0.0, 1.0])


@given(
    steps=st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=40),
    room=st.floats(0.0, 6.0),
    starts=st.integers(1, 40),
    longest=st.integers(1, 60),
)
@settings(max_examples=300, deadline=None, derandomize=True, database=None)
def test_windows_are_those_of_a_plain_loop(
    steps: list[float], room: float, starts: int, longest: int
) -> None:
    value = np.cumsum(steps)
    starts = min(starts, len(value))
    many, low, high = _measure_windows(value, starts, room, longest)
    assert len(many) == len(low) == len(high) == starts
    for j in range(starts):
        window: list[float] = []
        for v in value[j:]:
            if len(window) == longest or max([*window, v]) - min([*window, v]) > room:
                break
            window.append(float(v))
        assert many[j] == len(window)
        assert low[j] == min(window)
        assert high[j] == max(window)


def build_leg(hand: HandModel, axis: Array, angle: float) -> Leg:
    return Leg(make_pose(p=hand.object.X_WO_home[:3, 3]), axis, angle)


def follow(hand: HandModel, leg: Leg, orbit: Orbit, landed: int) -> Array:
    """Return the run from ``landed``, having checked that all of it can be done and keeps to one contact on the ball."""
    chain, limits = hand.fingers[orbit.finger].chain, hand.limits
    q = orbit.run(hand, leg, landed)
    assert len(q) == orbit.carry[landed] + 1
    assert compute_joint_margin(chain, q).min() >= limits.joint_margin - 1e-6
    assert compute_dexterity(chain, q).min() >= limits.dexterity - 3e-3
    assert np.abs(np.diff(q, axis=0)).max(initial=0.0) <= 0.30
    X = compute_tip_pose(chain, q)
    # Seen from the ball the tip stays where it landed, spin and all.
    back = rotate_about(leg.axis_W, -leg.sense * STEP * np.arange(len(q)))
    seen = back @ X[:, :3, :3]
    assert np.allclose(seen, seen[0], atol=1e-7)
    arms = np.einsum("kij,kj->ki", back, X[:, :3, 3] - leg.center)
    assert np.allclose(arms, arms[0], atol=1e-8)
    return q


@pytest.mark.parametrize("axis", [UP, np.array([0.6, 0.0, 0.8])], ids=["upright", "tilted"])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_finger_gets_through_all_of_its_run_and_not_farther(
    hand: HandModel, axis: Array, sense: float
) -> None:
    leg, normal = build_leg(hand, axis, sense), direction_from_angles(10.0, 20.0)[None]
    (orbit,) = build_orbits(hand, leg, 0, build_aligned(hand, 0, leg.center, normal), normal)
    assert orbit.is_reached.any()
    count, chain, limits = len(orbit.q), hand.fingers[0].chain, hand.limits
    room = chain.upper[-1] - chain.lower[-1] - 2.0 * limits.joint_margin
    for landed in np.flatnonzero(orbit.is_reached)[::5].tolist():
        q = follow(hand, leg, orbit, landed)
        # The roll of the tip is centred: equal room at both ends.
        below, above = q[:, -1].min() - chain.lower[-1], chain.upper[-1] - q[:, -1].max()
        assert below == pytest.approx(above, abs=1e-9)
        # One station more would not do, for the reason that is given.
        here = (landed + leg.sense * int(orbit.carry[landed])) % count
        beyond = (here + leg.sense) % count
        if orbit.limit[landed].kind is StopKind.LAST_JOINT:
            step = orbit.q[beyond, -1] - orbit.q[here, -1]
            ends = np.append(q[:, -1], q[-1, -1] + np.mod(step + np.pi, 2.0 * np.pi) - np.pi)
            assert np.ptp(ends) > room - 1e-9
        elif orbit.limit[landed].kind is StopKind.SINGULAR and orbit.is_reached[beyond]:
            turn = np.abs(orbit.q[beyond, :-1] - orbit.q[here, :-1]).max()
            assert turn > 0.30
        elif orbit.limit[landed].kind is not StopKind.WHOLE_TURN:
            assert not orbit.is_reached[beyond]
    for landed in np.flatnonzero(~orbit.is_reached).tolist():
        assert orbit.carry[landed] == 0


@pytest.mark.parametrize("angle", [0.5, -0.9])
def test_a_contact_that_stands_sees_only_its_leg_and_stays_on_its_branch(
    hand: HandModel, angle: float
) -> None:
    leg, normal = build_leg(hand, UP, angle), direction_from_angles(0.0, 10.0)
    X_WF = build_aligned(hand, 0, leg.center, normal[None])[0]
    chain = hand.fingers[0].chain
    free = build_fixed_orbit(hand, leg, 0, X_WF, normal)
    assert free.is_reached[0]
    assert not free.is_reached[1:].any()
    assert 0 < free.carry[0] <= leg.stations
    q = follow(hand, leg, free, 0)
    assert np.allclose(compute_tip_pose(chain, q[0]), X_WF, atol=1e-7)
    # Told where the finger is, the answer is the same; a whole turn of the last joint away it is out of its range.
    known = build_fixed_orbit(hand, leg, 0, X_WF, normal, q[0])
    assert known.carry[0] == free.carry[0]
    assert np.allclose(known.run(hand, leg, 0), q, atol=1e-9)
    wound = q[0] + 2.0 * np.pi * np.eye(6)[-1]
    there = build_fixed_orbit(hand, leg, 0, X_WF, normal, wound)
    assert not there.is_reached[0]
    assert str(there.limit[0]) == "the limit of its last joint"
    # Beyond the leg's own stations nothing was asked, so nothing is known.
    behind = leg.sense * np.arange(leg.stations + 1, len(free.q))
    assert np.isnan(free.q[behind]).all()
