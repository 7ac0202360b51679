"""Which grips may carry an object, and which can only hold it: from ranks of contact rows, not from a rule."""

from __future__ import annotations

import numpy as np
import pytest
from real_fingers import TRIFINGER_TIP, build_trifinger

from dexplan.contact.bodies.smooth import BallBody
from dexplan.kinematics.carry import Carrier, carry_rolling
from dexplan.kinematics.chain import compute_tip_jacobian
from dexplan.kinematics.land import land
from dexplan.kinematics.may_carry import HeldContacts, Steering, compute_steering
from dexplan.scene.library import load_scene
from dexplan.spatial import Array, direction_from_angles, make_pose, rotate_about

BALL = BallBody(0.0325)
AT = np.array([0.0, 0.0, 0.10])
AZIMUTHS = {0: 100.0, 1: -20.0, 2: -140.0}
OWN = {0: 90.0, 1: -30.0, 2: -150.0}
REST, YAW, TILT, SHIFT = np.zeros(6), np.eye(6)[5], np.eye(6)[3], np.eye(6)[0]


def _hold(fingers: tuple[int, ...], elevation: float = 5.0) -> tuple[list[Array], Array]:
    postures, normals = [], []
    for f in fingers:
        normal = direction_from_angles(AZIMUTHS[f], elevation)
        carrier = Carrier(build_trifinger(OWN[f] - 90.0), TRIFINGER_TIP)
        postures.append(land(carrier, (AT + BALL.radius * normal)[None], normal[None]).q[0])
        normals.append(normal)
    return postures, np.array(normals)


def _ask(fingers: tuple[int, ...], twist: Array, is_soft: bool = True) -> Steering:
    postures, normals = _hold(fingers)
    chains = [build_trifinger(OWN[f] - 90.0) for f in fingers]
    J = tuple(compute_tip_jacobian(c, q) for c, q in zip(chains, postures, strict=True))
    radii = np.full(len(fingers), TRIFINGER_TIP)
    return compute_steering(HeldContacts(AT + BALL.radius * normals, normals, J, radii, is_soft), AT, twist)


@pytest.mark.parametrize("pair", [(0, 1), (1, 2), (0, 2)])
def test_two_contacts_that_pivot_leave_the_turn_about_their_chord(pair: tuple[int, int]) -> None:
    found = _ask(pair, TILT)
    assert not found.may_carry
    assert not found.is_kept.any()
    _, normals = _hold(pair)
    chord = normals[1] - normals[0]
    chord /= np.linalg.norm(chord)
    w = found.loose[3:] / np.linalg.norm(found.loose[3:])
    assert abs(w @ chord) == pytest.approx(1.0, abs=1e-9)
    # The two contact points stay where they are.
    moved = 0.06 * found.loose[:3] + np.cross(found.loose[3:], BALL.radius * normals)
    assert np.abs(moved).max() < 1e-9


def test_two_soft_contacts_hold_what_rests_and_two_points_do_not() -> None:
    assert _ask((0, 1), REST).may_carry
    assert not _ask((0, 1), REST, is_soft=False).may_carry


@pytest.mark.parametrize("twist", [YAW, TILT, SHIFT, REST])
@pytest.mark.parametrize("is_soft", [True, False])
def test_three_point_contacts_may_carry(twist: Array, is_soft: bool) -> None:
    assert _ask((0, 1, 2), twist, is_soft).may_carry


def test_fingers_of_six_joints_carry_in_pairs() -> None:
    """They follow the spin, so that soft contacts keep their fourth row; point contacts have none."""
    scene = load_scene()
    center, rng = scene.object.X_WO_home[:3, 3], np.random.default_rng(1)
    normals = np.stack([direction_from_angles(a, 0.0) for a in (-5.0, 160.0)])
    J, points = [], center + 0.035 * normals
    for finger, n in zip(scene.fingers[:2], normals, strict=True):
        carrier = Carrier(finger.chain, finger.tip_radius)
        J.append(compute_tip_jacobian(finger.chain, land(carrier, (center + 0.035 * n)[None], n[None]).q[0]))
    for _ in range(5):
        twist = rng.normal(size=6)
        held = [HeldContacts(points, normals, tuple(J), np.full(2, 0.018), soft) for soft in (True, False)]
        soft, hard = (compute_steering(contacts, center, twist) for contacts in held)
        assert np.abs(soft.pivots).max() < 1e-6
        assert soft.may_carry
        assert not hard.may_carry


def test_the_pivot_is_that_of_the_carry() -> None:
    """The rate said here, summed up, is how far a tip turns about the normal in a carry."""
    postures, _ = _hold((0,))
    carrier, step = Carrier(build_trifinger(), TRIFINGER_TIP), np.radians(1.0)
    X_WO = np.stack([make_pose(rotate_about([0.0, 0.0, 1.0], k * step), AT) for k in range(31)])
    found = carry_rolling(carrier, BALL, postures[0][None], X_WO)
    rates = []
    for X, q, n_O, p_O in zip(X_WO, found.q[:, 0], found.n_O[:, 0], found.p_O[:, 0], strict=True):
        J = compute_tip_jacobian(carrier.chain, q)
        held = HeldContacts(
            (AT + X[:3, :3] @ p_O)[None], (X[:3, :3] @ n_O)[None], (J,), np.full(1, TRIFINGER_TIP)
        )
        rates.append(compute_steering(held, AT, YAW).pivots[0])
    assert np.trapezoid(rates, dx=step) == pytest.approx(found.pivot[-1, 0], rel=0.02)
