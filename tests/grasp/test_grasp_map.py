"""The grasp map and the hand Jacobian, against first principles and each other; quality measures."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.contact.friction import ContactModel, HardFinger, SoftFinger
from dexplan.grasp.grasp import Contact, Grasp, compute_grasp_map, compute_hand_jacobian, contact_on_sphere
from dexplan.grasp.quality import compute_ferrari_canny, compute_singular_value_min, compute_support
from dexplan.spatial import direction_from_angles, hat, make_pose, rotate_about

R = 0.03


def ring(azimuths: tuple[float, ...], model: ContactModel, radius: float = R) -> Grasp:
    return Grasp(
        tuple(
            contact_on_sphere(i, direction_from_angles(a, 0.0), radius, model) for i, a in enumerate(azimuths)
        )
    )


def test_grasp_map_is_the_sum_of_forces_and_moments() -> None:
    rng = np.random.default_rng(0)
    grasp = Grasp(
        tuple(
            contact_on_sphere(i, rng.normal(size=3), R, m)
            for i, m in enumerate([HardFinger(0.5), SoftFinger(0.5, 0.002)])
        )
    )
    f = rng.normal(size=7)
    a, b = grasp.contacts
    fa, fb = a.R_OC @ f[:3], b.R_OC @ f[3:6]
    torque = np.cross(a.p_OC, fa) + np.cross(b.p_OC, fb) + b.R_OC[:, 2] * f[6]
    assert np.allclose(compute_grasp_map(grasp) @ f, np.concatenate([fa + fb, torque]))


def test_normal_force_pushes_into_the_object() -> None:
    contact = contact_on_sphere(0, [2.0, 0.0, 0.0], R, HardFinger(0.5))
    assert np.allclose(contact.R_OC[:, 2], [-1.0, 0.0, 0.0])
    assert np.allclose(contact.n_O, [1.0, 0.0, 0.0])
    assert not contact.p_OC.flags.writeable


def test_singular_values_of_three_equatorial_hard_fingers() -> None:
    grasp = ring((0, 120, 240), HardFinger(0.5))
    values = np.linalg.svd(compute_grasp_map(grasp), compute_uv=False)
    expected = [np.sqrt(3)] * 3 + [R * np.sqrt(3)] + [R * np.sqrt(1.5)] * 2
    assert np.allclose(values, expected)
    assert compute_singular_value_min(grasp) == pytest.approx(R * np.sqrt(1.5))
    assert compute_singular_value_min(ring((0,), HardFinger(0.5))) == 0.0


def test_rolling_hand_obeys_the_fundamental_relation() -> None:
    """Tips that move rigidly with the object keep every contact: J_h qdot = G^T V."""
    rng = np.random.default_rng(1)
    grasp = Grasp(
        tuple(
            contact_on_sphere(i, rng.normal(size=3), R, m)
            for i, m in enumerate([HardFinger(0.5), SoftFinger(0.5, 0.002), SoftFinger(0.4, 0.001)])
        )
    )
    X_WO = make_pose(rotate_about([0.6, 0.0, 0.8], 0.7), [0.1, -0.2, 0.3])
    V_O = rng.normal(size=6)
    v_W, w_W = X_WO[:3, :3] @ V_O[:3], X_WO[:3, :3] @ V_O[3:]
    points = rng.normal(size=(3, 3))
    # qdot = the twists of the three tips: the Jacobians select them
    jacobians = [np.eye(18)[6 * i : 6 * i + 6] for i in range(3)]
    qdot = np.concatenate([[*(v_W + hat(w_W) @ (p - X_WO[:3, 3])), *w_W] for p in points])
    J_h = compute_hand_jacobian(grasp, jacobians, points, X_WO)
    assert J_h.shape == (11, 18)
    assert np.allclose(J_h @ qdot, compute_grasp_map(grasp).T @ V_O)
    # spinning a hard finger about its normal through the contact moves nothing it constrains
    c = grasp.contacts[0]
    n_W, p_W = X_WO[:3, :3] @ c.n_O, X_WO[:3, :3] @ c.p_OC + X_WO[:3, 3]
    spin = np.concatenate([np.cross(n_W, points[0] - p_W), n_W, np.zeros(12)])
    assert np.allclose(J_h @ spin, 0.0)


@pytest.mark.parametrize("mu", [0.3, 0.8])
def test_ferrari_canny_of_three_equatorial_fingers(mu: float) -> None:
    grasp = ring((0, 120, 240), HardFinger(mu))
    radius = compute_ferrari_canny(grasp, R)
    assert radius == pytest.approx(3.0 * mu / np.sqrt(5.0), rel=1e-5)
    rng = np.random.default_rng(2)
    for d in rng.normal(size=(200, 6)):
        assert compute_support(grasp, d / np.linalg.norm(d), R) >= radius - 1e-9


def test_ferrari_canny_is_zero_without_closure() -> None:
    assert compute_ferrari_canny(ring((0, 40, 80), HardFinger(0.5)), R, starts=10) == pytest.approx(
        0.0, abs=1e-6
    )


def test_refusals_name_the_cure() -> None:
    model = HardFinger(0.5)
    with pytest.raises(ValueError, match="is not a rotation"):
        Contact(0, np.zeros(3), -np.eye(3), model)
    with pytest.raises(ValueError, match="one contact each"):
        Grasp((contact_on_sphere(1, [1, 0, 0], R, model), contact_on_sphere(1, [0, 1, 0], R, model)))
    with pytest.raises(ValueError, match="direction of finger 2 is zero"):
        contact_on_sphere(2, [0, 0, 0], R, model)
