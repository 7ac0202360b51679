"""Contacts that fingers carry: rolling against contact kinematics, six joints against the fixed tip, and what ends a carry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike
from real_fingers import TRIFINGER_TIP, build_trifinger
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody
from dexplan.contact.bodies.sites import build_sites
from dexplan.contact.bodies.smooth import BallBody, EllipsoidBody
from dexplan.kinematics.carry import Carrier, CarryEnd, carry_fixed, carry_rolling
from dexplan.kinematics.chain import Chain, compute_joint_margin, compute_tip_pose
from dexplan.kinematics.land import Landings, land
from dexplan.scene.library import load_scene
from dexplan.spatial import Array, make_pose, rotate_about

BALL = BallBody(0.0325)
AT = np.array([0.0, 0.0, 0.10])
OWN = np.array([0.0, 1.0, 0.0])
"""Where TriFinger's first finger is, seen from the object."""
TRIFINGER = Carrier(build_trifinger(), TRIFINGER_TIP, joint_margin=np.radians(3.0))


def _turn(axis: Array, degrees: float, step: float = 2.0, center: Array = AT) -> Array:
    """Return poses (K, 4, 4) of an object at ``center`` that turns about an axis."""
    count = round(abs(degrees) / step)
    angles = np.radians(np.linspace(0.0, degrees, count + 1))
    return np.stack([make_pose(rotate_about(axis, a), center) for a in angles])


def _land_on(carrier: Carrier, body: ConvexBody, normal: ArrayLike, center: Array = AT) -> Landings:
    point = body.radial(normal)
    return land(carrier, (center + point)[None], body.normal_at(point)[None])


@pytest.mark.parametrize("axis", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.6, 0.0, 0.8]])
def test_a_tip_on_a_ball_rolls_as_contact_kinematics_say(axis: list[float]) -> None:
    """dn_O = r / (R + r) w x n_O for the turn w of the tip against the object, and nothing else moves the contact."""
    start = _land_on(TRIFINGER, BALL, [0.0, 1.0, 0.1])
    X_WO = _turn(np.array(axis), 30.0, step=0.25)
    found = carry_rolling(TRIFINGER, BALL, start.q, X_WO)
    assert (found.until == len(X_WO) - 1).all()
    R_OF = Rotation.from_matrix(found.X_OF[:, 0, :3, :3])
    turns = (R_OF[1:] * R_OF[:-1].inv()).as_rotvec()
    n = found.n_O[0, 0].copy()
    for turn in turns:
        n = Rotation.from_rotvec(TRIFINGER_TIP / (TRIFINGER_TIP + BALL.radius) * turn).apply(n)
    assert np.degrees(np.linalg.norm(found.n_O[-1, 0] - found.n_O[0, 0])) > 1.0
    assert np.linalg.norm(n - found.n_O[-1, 0]) * BALL.radius < 2e-6
    # What turns about the normal is the pivot.
    middle = 0.5 * (found.n_O[1:, 0] + found.n_O[:-1, 0])
    assert np.sum(turns * middle, axis=1).sum() == pytest.approx(found.pivot[-1, 0], abs=2e-4)


def test_tips_touch_all_along_and_steps_do_not_matter() -> None:
    body = EllipsoidBody(0.03, 0.03, 0.04)
    start = _land_on(TRIFINGER, body, OWN)
    ends = []
    for step in (0.5, 4.0):
        X_WO = _turn(np.array([0.0, 0.3, 1.0]) / np.hypot(0.3, 1.0), 40.0, step)
        found = carry_rolling(TRIFINGER, body, start.q, X_WO)
        centers = (X_WO[:, None] @ found.X_OF)[..., :3, 3]
        assert np.allclose(centers, compute_tip_pose(TRIFINGER.chain, found.q)[..., :3, 3], atol=1e-12)
        gap = np.linalg.norm(found.X_OF[..., :3, 3] - found.p_O, axis=-1) - TRIFINGER_TIP
        assert np.abs(gap).max() < 1e-9
        ends.append(found.p_O[-1, 0])
    assert np.linalg.norm(ends[0] - ends[1]) < 1e-6


def test_on_a_plane_the_contact_drifts_by_radius_times_turn() -> None:
    """A face that turns about an axis in it, under a tip that does not turn with it [BODIES: 5 mm per 30 deg at 10 mm]."""
    box, axis = BoxBody(0.0325, 0.0325, 0.0325), np.array([0.0, 0.0, 1.0])
    start = _land_on(TRIFINGER, box, OWN)
    X_WO = _turn(axis, 30.0)
    found = carry_rolling(TRIFINGER, box, start.q, X_WO)
    R_OF = Rotation.from_matrix(found.X_OF[:, 0, :3, :3])
    turn = (R_OF[-1] * R_OF[0].inv()).as_rotvec()
    moved = found.p_O[-1, 0] - found.p_O[0, 0]
    assert np.allclose(moved, TRIFINGER_TIP * np.cross(turn, OWN), atol=1.5e-4)
    assert 2.0e-3 < np.linalg.norm(moved) < 5.5e-3


def test_a_closed_way_moves_the_contact() -> None:
    """Rolling is not holonomic: out and back on the same way changes nothing, around a loop something."""
    start = _land_on(TRIFINGER, BALL, OWN)
    x, y = _turn(np.array([1.0, 0.0, 0.0]), 20.0), _turn(np.array([0.0, 0.0, 1.0]), 20.0)
    back = carry_rolling(TRIFINGER, BALL, start.q, np.concatenate([x, x[::-1][1:]]))
    assert np.linalg.norm(back.p_O[-1, 0] - back.p_O[0, 0]) < 1e-6
    out = [make_pose(b[:3, :3] @ x[-1, :3, :3], AT) for b in y[1:]]
    over = [make_pose(y[-1, :3, :3] @ a[:3, :3], AT) for a in x[::-1][1:]]
    loop = carry_rolling(TRIFINGER, BALL, start.q, np.stack([*x, *out, *over, *y[::-1][1:]]))
    assert np.linalg.norm(loop.p_O[-1, 0] - loop.p_O[0, 0]) > 1e-5


@pytest.mark.parametrize("name", ["ball", "box", "ellipsoid"])
def test_six_joints_that_roll_keep_the_contact_where_it_is(name: str) -> None:
    scene = load_scene()
    finger, center = scene.fingers[0], scene.object.X_WO_home[:3, 3]
    body = {
        "ball": BallBody(0.035),
        "box": BoxBody(0.03, 0.03, 0.03),
        "ellipsoid": EllipsoidBody(0.03, 0.035, 0.04),
    }[name]
    carrier = Carrier(finger.chain, finger.tip_radius, joint_margin=np.radians(2.0))
    toward = finger.pose_at(finger.q_home)[:3, 3] - center
    if name == "box":
        toward = np.eye(3)[np.abs(toward).argmax()] * np.sign(toward[np.abs(toward).argmax()])
    start = _land_on(carrier, body, toward, center)
    q = start.q[[compute_joint_margin(carrier.chain, start.q).argmax()]]
    X_WO = _turn(np.array([0.0, 0.6, 0.8]), 20.0, center=center)
    rolled = carry_rolling(carrier, body, q, X_WO)
    fixed = carry_fixed(carrier, body, q, X_WO)
    both = min(rolled.until[0], fixed.until[0])
    assert both >= 5
    assert np.abs(rolled.p_O[:both, 0] - fixed.p_O[:both, 0]).max() < 1e-6
    assert np.abs(rolled.X_OF[:both, 0] - fixed.X_OF[:both, 0]).max() < 2e-4
    assert np.abs(rolled.pivot[:both]).max() < 2e-4


def _end(carrier: Carrier, body: ConvexBody, X_WO: Array, normal: Array = OWN) -> tuple[CarryEnd, int]:
    start = _land_on(carrier, body, normal)
    found = carry_rolling(carrier, body, start.q[:1], X_WO)
    until = int(found.until[0])
    if until >= 0:
        assert compute_joint_margin(carrier.chain, found.q[until, 0]) >= carrier.joint_margin
    return found.ends[0], until


def test_what_ends_a_carry_is_named() -> None:
    yaw = _turn(np.array([0.0, 0.0, 1.0]), 150.0)
    end, until = _end(TRIFINGER, BALL, yaw)
    assert end is CarryEnd.POLE
    # It ends exactly where the contact crosses the limit, not before.
    found = carry_rolling(TRIFINGER, BALL, _land_on(TRIFINGER, BALL, OWN).q[:1], yaw)
    lean = np.arccos(-np.sum(found.X_OF[:, 0, :3, 2] * found.n_O[:, 0], axis=1))
    assert lean[until] <= TRIFINGER.polar_limit < lean[until + 1]
    assert _end(replace(TRIFINGER, polar_limit=np.radians(60.0)), BALL, yaw)[1] < until
    assert _end(TRIFINGER, BALL, yaw[:20]) == (CarryEnd.GOAL, 19)
    assert _end(replace(TRIFINGER, pivot_limit=np.radians(2.0)), BALL, yaw)[0] is CarryEnd.PIVOT
    box = BoxBody(0.0325, 0.0325, 0.0325)
    end, until = _end(replace(TRIFINGER, edge_band=0.030), box, yaw)
    assert end is CarryEnd.EDGE
    # 2.5 mm from the middle of the face are left: a quarter of the tip's radius in turn.
    assert 2.0 * until == pytest.approx(np.degrees(0.25), abs=6.0)
    assert _end(replace(TRIFINGER, joint_margin=np.radians(25.0)), BALL, yaw)[0] is CarryEnd.JOINT
    away = np.stack([make_pose(p=AT - np.array([0.0, 0.0, z])) for z in np.linspace(0.0, 0.3, 61)])
    assert _end(replace(TRIFINGER, joint_margin=-9.0, polar_limit=9.0), BALL, away)[0] in {
        CarryEnd.REACH,
        CarryEnd.SINGULAR,
    }


def test_fewer_than_three_joints_carry_nothing() -> None:
    whole = build_trifinger()
    short = Chain(whole.offsets[:2], whole.axes[:2], whole.X_JF, whole.lower[:2], whole.upper[:2])
    with pytest.raises(ValueError, match="three or more are accepted"):
        carry_rolling(Carrier(short, 0.01), BALL, np.zeros((1, 2)), _turn(OWN, 10.0))


@pytest.mark.parametrize("name", ["ball", "box"])
def test_landings_touch_and_none_is_missed(name: str) -> None:
    """Against a dense sample of the finger's postures: a place that one of them touches has a landing."""
    body = {"ball": BALL, "box": BoxBody(0.0325, 0.0325, 0.0325)}[name]
    carrier = replace(TRIFINGER, polar_limit=np.radians(80.0))
    sites = build_sites(body, 0.008, 0.006)
    found = land(carrier, sites.points + AT, sites.normals)
    poses = compute_tip_pose(carrier.chain, found.q)
    touch = body.project(poses[:, :3, 3] - AT)
    assert np.abs(touch.distance - TRIFINGER_TIP).max() < 1e-8
    assert np.abs(touch.point - sites.points[found.site]).max() < 1e-8
    assert (found.lean <= carrier.polar_limit).all()
    rng = np.random.default_rng(0)
    q = rng.uniform(carrier.chain.lower, carrier.chain.upper, (400_000, 3))
    q = q[compute_joint_margin(carrier.chain, q) > carrier.joint_margin + 0.05]
    X = compute_tip_pose(carrier.chain, q)
    centers = sites.points + TRIFINGER_TIP * sites.normals + AT
    distance, site = cKDTree(centers).query(X[:, :3, 3])
    lean = np.arccos(-np.sum(X[:, :3, 2] * sites.normals[site], axis=1))
    reachable = np.unique(site[(distance < 2e-3) & (lean < carrier.polar_limit - 0.2)])
    assert len(reachable) > 20
    missed = set(reachable) - set(found.site.tolist())
    assert not missed


def test_more_joints_land_with_the_pole_on_the_contact() -> None:
    scene = load_scene()
    finger, center = scene.fingers[0], scene.object.X_WO_home[:3, 3]
    carrier = Carrier(finger.chain, finger.tip_radius, joint_margin=np.radians(5.0))
    toward = finger.pose_at(finger.q_home)[:3, 3] - center
    found = _land_on(carrier, BALL, toward, center)
    assert len(found)
    assert found.lean[0] < 1e-3
    again = land(
        carrier,
        (center + BALL.support(toward))[None],
        toward[None] / np.linalg.norm(toward),
        near=found.q[:1],
    )
    assert len(again) >= len(found)
