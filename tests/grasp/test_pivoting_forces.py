"""Forces while contacts pivot: they balance, torsion has the sign of the turn, and the floor gives way before the balance."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.contact.friction import SoftFinger
from dexplan.grasp.force.pivoting import PivotingContacts, PivotingForces, PivotingLimits, PivotingSolver
from dexplan.spatial import Array, direction_from_angles

NOMINAL = SoftFinger(0.55, 1.65e-3)
RADIUS, WEIGHT = 0.0325, np.array([0.0, 0.0, 0.06 * 9.81, 0.0, 0.0, 0.0])
SOLVER = PivotingSolver(NOMINAL.scaled(1.0 / 1.3), NOMINAL, RADIUS)


def _solve(
    azimuths: list[float], pivots: list[float], wrench: Array = WEIGHT, reach: float = 9.0, floor: float = 2.0
) -> PivotingForces | None:
    n = np.stack([direction_from_angles(a, 5.0) for a in azimuths])
    count = len(n)
    # Joints that push along x, y and z, 100 mm away from the tips' centres: torque bounds are bounds on force.
    J = np.tile(np.concatenate([0.1 * np.eye(3), np.zeros((3, 3))]), (count, 1, 1))
    contacts = PivotingContacts(RADIUS * n, n, -0.01 * n, J, np.array(pivots))
    bound = np.full((count, 3), 0.1 * reach)
    limits = PivotingLimits(
        np.full(count, floor), np.full(count, 9.0), np.full(count, 2.5), -bound, bound, np.zeros((count, 3))
    )
    found = SOLVER.solve(contacts, wrench, limits)
    if found is not None:
        moments = np.cross(contacts.arms, found.force_W) + found.moment_W
        assert np.allclose(found.force_W.sum(0), wrench[:3], atol=1e-6)
        assert np.allclose(moments.sum(0), wrench[3:], atol=1e-7)
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pivots_drag_the_object_along_with_all_their_friction(sign: float) -> None:
    found = _solve([90.0, 210.0, 330.0], [sign] * 3)
    assert found is not None
    n = np.stack([direction_from_angles(a, 5.0) for a in (90.0, 210.0, 330.0)])
    torsion = np.sum(found.moment_W * n, axis=1)
    share = np.hypot(found.tangential, np.abs(torsion) / (1.65e-3 * found.forces[:, 2]))
    assert (np.sign(torsion) == sign).all()
    assert np.allclose(share, 1.0, atol=2e-3)
    # Little sideways force, for it costs slip by the law.
    assert (found.tangential < 0.35).all()
    u = found.tangential
    assert np.allclose(found.slip_per_turn, 3e-3 * u / np.sqrt(1.0 - u**2))


@pytest.mark.parametrize(("gap", "holds"), [(165.0, True), (155.0, True), (130.0, False), (115.0, False)])
def test_how_far_apart_a_pair_has_to_be_follows_from_the_forces(gap: float, holds: bool) -> None:
    found = _solve([0.0, gap], [0.0, 0.0], floor=3.0)
    assert (found is not None) is holds
    if found is not None:
        assert (found.used <= 1.0 + 1e-9).all()


def test_a_pair_that_pivots_holds_nothing_against_a_turn_about_its_chord() -> None:
    across = np.array([0.0, 0.0, 0.588, 1.2e-2, 0.0, 0.0])
    assert _solve([0.0, 180.0], [0.0, 0.0], across, floor=3.0) is not None
    assert _solve([0.0, 180.0], [1.0, 1.0], across, floor=3.0) is None


def test_balance_comes_before_the_floor() -> None:
    easy, hard = _solve([90.0, 210.0, 330.0], [0.0] * 3), _solve([90.0, 210.0, 330.0], [0.0] * 3, reach=1.2)
    assert easy is not None
    assert easy.floor == 1.0
    assert hard is not None
    assert hard.floor < 1.0
    assert (np.abs(hard.torque) <= 0.12 + 1e-6).all()
