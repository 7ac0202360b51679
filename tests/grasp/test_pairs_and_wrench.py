"""Pairs against the closure tests on sphere, ellipsoid and box; the wrench against MuJoCo's inverse dynamics."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import BallBody, EllipsoidBody
from dexplan.contact.friction import SoftFinger
from dexplan.grasp.closure import check_antipodal, check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.grasp.wrench import MassProperties, compute_wrench
from dexplan.spatial import Array, build_frame

SHAPES = {
    "ball": BallBody(0.035),
    "ellipsoid": EllipsoidBody(0.025, 0.035, 0.045),
    "box": BoxBody(0.03, 0.025, 0.02),
}
FRICTION = SoftFinger(0.55, 0.0025)


def _sample_pairs(body: ConvexBody, seed: int, count: int) -> Array:
    """Return points (count, 2, 3), half of the pairs nearly opposite so that both answers are frequent."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 2, 3))
    directions[::2, 1] = -directions[::2, 0] + rng.normal(scale=0.4, size=(len(directions[::2]), 3))
    return body.radial(directions)


@pytest.mark.parametrize("name", SHAPES)
def test_chords_inside_both_cones_are_antipodal_pairs(name: str) -> None:
    body = SHAPES[name]
    points = _sample_pairs(body, 1, 10_000)
    normals = body.normal_at(points)
    spare = np.arctan(FRICTION.sliding) - measure_chord_lean(points, normals)
    assert 0.1 < np.mean(spare > 0.0) < 0.9
    for k in range(len(points)):
        one = check_antipodal(points[k, 0], normals[k, 0], points[k, 1], normals[k, 1], FRICTION.sliding)
        assert one.margin == pytest.approx(spare[k], abs=1e-12)


@pytest.mark.parametrize("name", SHAPES)
def test_chords_inside_both_cones_are_force_closed(name: str) -> None:
    """Against the cone program, which knows nothing of chords; skew pairs may hold with the chord just outside."""
    body = SHAPES[name]
    points = _sample_pairs(body, 2, 300)
    normals = body.normal_at(points)
    spare = np.degrees(np.arctan(FRICTION.sliding) - measure_chord_lean(points, normals))
    for k in np.flatnonzero(np.abs(spare) > 0.5):
        contacts = (Contact(i, points[k, i], build_frame(-normals[k, i]), FRICTION) for i in range(2))
        assert check_force_closure(Grasp(tuple(contacts))).is_closed == (spare[k] > 0.0), spare[k]


def test_coincident_points_hold_nothing() -> None:
    points = np.zeros((2, 3))
    assert measure_chord_lean(points, np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])) == np.pi


def _bodies() -> dict[str, MassProperties]:
    box = BoxBody(0.03, 0.025, 0.02).solid
    rng = np.random.default_rng(4)
    stone = PolyhedronBody(0.03 * rng.normal(size=(30, 3)) / 2.0).solid
    return {
        "box": MassProperties(0.2, box.com, 0.2 / box.volume * box.inertia),
        "stone, its centre of mass off the origin": MassProperties(
            0.15, stone.com + np.array([0.004, 0.0, -0.006]), 0.15 / stone.volume * stone.inertia
        ),
    }


@pytest.mark.parametrize("name", _bodies())
def test_the_wrench_is_that_of_inverse_dynamics(name: str) -> None:
    body = _bodies()[name]
    I = body.inertia  # noqa: E741 - as in the formula
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><option><flag contact="disable"/></option><worldbody><body name="object"><freejoint/>
          <inertial pos="{body.com[0]} {body.com[1]} {body.com[2]}" mass="{body.mass}"
            fullinertia="{I[0, 0]} {I[1, 1]} {I[2, 2]} {I[0, 1]} {I[0, 2]} {I[1, 2]}"/>
        </body></worldbody></mujoco>""")
    data = mujoco.MjData(model)
    rng = np.random.default_rng(5)
    R = Rotation.random(200, rng=rng)
    w, a, alpha = rng.normal(scale=3.0, size=(3, 200, 3))
    ours = compute_wrench(body, R.as_matrix(), angular_velocity=w, acceleration=a, angular_acceleration=alpha)
    for k in range(200):
        data.qpos[3:] = R[k].as_quat(scalar_first=True)
        # MuJoCo's free joint: force in the world, torque and turning rates in the body.
        turn = R[k].as_matrix().T
        data.qvel[:3], data.qvel[3:] = rng.normal(size=3), turn @ w[k]
        data.qacc[:3], data.qacc[3:] = a[k], turn @ alpha[k]
        mujoco.mj_inverse(model, data)
        theirs = np.concatenate([data.qfrc_inverse[:3], turn.T @ data.qfrc_inverse[3:]])
        assert np.abs(theirs - ours[k]).max() < 1e-9


def test_gravity_may_point_anywhere_and_stacks_broadcast() -> None:
    body = MassProperties(2.0, [0.0, 0.0, 0.1], 0.01 * np.eye(3))
    held = compute_wrench(body, np.eye(3), gravity=[-9.81, 0.0, 0.0])
    assert np.allclose(held, [19.62, 0.0, 0.0, 0.0, 1.962, 0.0])
    many = compute_wrench(body, np.stack([np.eye(3)] * 4), gravity=[-9.81, 0.0, 0.0])
    assert np.array_equal(many, np.stack([held] * 4))


@pytest.mark.parametrize(
    ("mass", "inertia", "words"),
    [
        (0.0, np.eye(3), "mass is 0.0 kg"),
        (1.0, np.diag([1.0, 1.0, 3.0]), "sum of the other two"),
        (1.0, np.diag([-1.0, 1.0, 1.0]), "none may be negative"),
        (1.0, np.eye(3) + np.eye(3, k=1), "not symmetric"),
        (1.0, np.eye(2), "finite numbers"),
    ],
)
def test_bodies_that_cannot_be_are_refused(mass: float, inertia: Array, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        MassProperties(mass, np.zeros(3), inertia)
