"""Tables of landings: one for every axis, sense and place, and what they promise a finger can do."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.kinematics.chain import compute_tip_pose
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_tip_pose
from dexplan.planning.admissible.aligned import build_aligned
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.lone_clearance import LoneClearance
from dexplan.planning.contacts import candidates
from dexplan.planning.contacts.candidates import POLAR_SPACING, Landings, find_landings
from dexplan.planning.contacts.legs import CIRCLE, Leg
from dexplan.plans.motion import STEP
from dexplan.spatial import Array, make_pose, rotate_about

UP, SKEW = np.array([0.0, 0.0, 1.0]), np.array([0.48, -0.6, 0.64])
JUMP, SIGHT = 0.30, np.radians(80.0)
FEW = 150
"""Directions looked at for shifts, for the sake of time."""


def build_leg(hand: HandModel, axis: Array, angle: float, attitude: Array | None = None) -> Leg:
    return Leg(make_pose(attitude, hand.object.X_WO_home[:3, 3]), axis, angle)


def rows_of(landings: Landings) -> list[tuple[int, int, Array, int]]:
    """Return orbit, station, normal and carry of every row."""
    rows = landings.rows
    return list(
        zip(rows.orbit.tolist(), rows.station.tolist(), rows.normals, rows.carry.tolist(), strict=True)
    )


def test_tables_depend_on_axis_sense_and_place_alone(hand: HandModel) -> None:
    known = find_landings(hand, build_leg(hand, SKEW, 0.4))
    # Neither how far nor from which attitude the ball turns matters.
    tilted = rotate_about(np.array([0.6, 0.8, 0.0]), 1.3)
    assert find_landings(hand, build_leg(hand, SKEW.copy(), 2.9, tilted)) is known
    back = find_landings(hand, build_leg(hand, SKEW, -0.4))
    other = find_landings(hand, build_leg(hand, np.array([0.48, -0.6, -0.64]), 0.4))
    lifted = hand.object.X_WO_home[:3, 3] + np.array([0.0, 0.0, 0.004])
    above = find_landings(hand, Leg(make_pose(p=lifted), SKEW, 0.4))
    tables = [known, back, other, above]
    for k, one in enumerate(tables):
        for two in tables[:k]:
            assert one is not two
            assert not all(
                np.array_equal(a.rows.normals, b.rows.normals) and np.array_equal(a.rows.carry, b.rows.carry)
                for a, b in zip(one, two, strict=True)
            )
    # The other sense goes through the same places, the other way.
    for a, b in zip(known, back, strict=True):
        assert np.array_equal(a.rows.station, b.rows.station)
        assert np.array_equal(a.rows.normals, b.rows.normals)


def walk(hand: HandModel, leg: Leg, finger: int, normal: Array, q_landed: Array) -> int:
    """Return through how many stations a finger gets that landed along ``normal`` in the posture ``q_landed``, one by one."""
    chain, limits, lone = hand.fingers[finger].chain, hand.limits, LoneClearance(hand)
    lower, upper = chain.lower + limits.joint_margin, chain.upper - limits.joint_margin
    home = hand.p_WF_home[finger] - leg.center
    X_landed, q = compute_tip_pose(chain, q_landed), q_landed
    for count in range(1, CIRCLE):
        R = rotate_about(leg.axis_W, leg.sense * STEP * count)
        X = X_landed.copy()
        X[:3, :3], X[:3, 3] = R @ X[:3, :3], leg.center + R @ (X[:3, 3] - leg.center)
        n = R @ normal
        solved, reached = solve_tip_pose(hand.workspaces[finger], X[None])
        step = solved[0] - q
        step[-1] = np.mod(step[-1] + np.pi, 2.0 * np.pi) - np.pi
        there = q + step
        if (
            not reached[0]
            or n @ home <= np.cos(SIGHT) * np.linalg.norm(home)
            or np.abs(step[:-1]).max() > JUMP
            or (there < lower - 1e-9).any()
            or (there > upper + 1e-9).any()
            or estimate_dexterity(chain, there[None])[0] < limits.dexterity
            or lone.refuse_contact(finger, leg.center, n[None])[0]
        ):
            return count - 1
        q = there
    return CIRCLE - 1


@pytest.mark.parametrize(
    ("axis", "angle", "finger"), [(UP, 1.0, 0), (SKEW, -1.0, 2)], ids=["up", "skew, backwards"]
)
def test_a_finger_gets_as_far_as_its_row_says(
    hand: HandModel, axis: Array, angle: float, finger: int
) -> None:
    leg = build_leg(hand, axis, angle)
    landings = find_landings(hand, leg)[finger]
    rows, lone = rows_of(landings), LoneClearance(hand)
    assert len(rows) > 100
    normals = landings.rows.normals
    assert not any(lone.refuse_landing(finger, leg.center, normals))
    poses = build_aligned(hand, finger, leg.center, normals)
    _, reached = solve_tip_pose(hand.workspaces[finger], poses)
    assert reached.all()
    carries = []
    for orbit, station, normal, carry in rows[:: len(rows) // 8]:
        found = landings.orbits[orbit]
        assert found.finger == finger
        assert found.is_reached[station]
        assert np.allclose(found.normals[station], normal)
        q_landed = found.run(hand, leg, station)[0]
        X = compute_tip_pose(hand.fingers[finger].chain, q_landed)
        # It touches there with its pole along the normal.
        gap = hand.object.surface.radial(normal) + hand.fingers[finger].tip_radius * normal
        assert np.allclose(X[:3, 3], leg.center + gap, atol=1e-9)
        assert np.allclose(X[:3, 2], -normal, atol=1e-9)
        assert walk(hand, leg, finger, normal, q_landed) == carry
        carries.append(carry)
    assert len(set(carries)) > 4
    assert max(carries) > 5


def test_no_place_is_left_out(hand: HandModel) -> None:
    """Every direction that a finger reaches and gets to is within half an orbit's spacing of a row: seen from outside."""
    leg, finger = build_leg(hand, SKEW, 1.0), 1
    rows = find_landings(hand, leg)[finger].rows
    rng = np.random.default_rng(5)
    normals = rng.normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    q, reached = solve_tip_pose(hand.workspaces[finger], build_aligned(hand, finger, leg.center, normals))
    chain, limits = hand.fingers[finger].chain, hand.limits
    room = np.minimum(q - chain.lower, chain.upper - q)[:, :-1].min(axis=1)
    usable = reached & (room >= limits.joint_margin + 0.1)
    usable[usable] = estimate_dexterity(chain, q[usable]) >= limits.dexterity + 0.1
    refused = LoneClearance(hand).refuse_landing(finger, leg.center, normals)
    usable &= np.array([not r for r in refused])
    home = hand.p_WF_home[finger] - leg.center
    usable &= normals @ home > np.cos(SIGHT - 0.1) * np.linalg.norm(home)
    assert usable.sum() > 20
    nearest = np.arccos(np.clip((normals[usable] @ rows.normals.T).max(axis=1), -1.0, 1.0))
    # Those beside something in the way may have lost their neighbours; the poles of the axis are no place to land.
    assert np.percentile(nearest, 90) < 0.5 * POLAR_SPACING + STEP


def test_a_shift_is_looked_at_from_all_sides_and_never_remembered(
    hand: HandModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(candidates, "DIRECTIONS", FEW)
    leg = Leg(hand.object.X_WO_home, UP, 0.0, np.array([0.003, 0.0, 0.004]))
    one, two = find_landings(hand, leg), find_landings(hand, leg)
    assert one is not two
    for a, b in zip(one, two, strict=True):
        assert len(a.orbits) == FEW
        assert len(a.rows.orbit) > 20
        assert np.array_equal(a.rows.normals, b.rows.normals)
        assert np.array_equal(a.rows.carry, b.rows.carry)
        # A straight line is passed once: nobody is carried beyond its end, and normals stay as they are.
        assert (a.rows.station + a.rows.carry <= leg.stations).all()
        for orbit, station, normal, _ in rows_of(a)[::41]:
            assert np.allclose(a.orbits[orbit].normals, normal)
            assert a.orbits[orbit].is_reached[station]


def test_orbits_are_numbered_from_where_the_table_has_come_to(hand: HandModel) -> None:
    landings = find_landings(hand, build_leg(hand, UP, 1.0))[1]
    moved = landings.numbered_from(7)
    assert np.array_equal(moved.orbit, landings.rows.orbit + 7)
    assert np.array_equal(moved.station, landings.rows.station)
    assert landings.rows.orbit.max() < len(landings.orbits)
