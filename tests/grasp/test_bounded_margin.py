"""The margin of a load with normal forces in bounds: closed forms on three fingers, and bounds that no force can keep."""

from __future__ import annotations

import numpy as np
import pytest

from dexplan.contact.friction import HardFinger
from dexplan.grasp.grasp import Grasp, contact_on_sphere
from dexplan.grasp.margin import solve_bounded_margin

MU, WEIGHT = 0.5, 0.4905
MODEL = HardFinger(MU)


def ring(*azimuths: float) -> Grasp:
    directions = [[np.cos(np.radians(a)), np.sin(np.radians(a)), 0.0] for a in azimuths]
    return Grasp(tuple(contact_on_sphere(f, d, 0.04, MODEL) for f, d in enumerate(directions)))


@pytest.mark.parametrize("squeeze", [0.2, 0.327, 1.0, 4.0])
def test_three_fingers_carry_a_weight(squeeze: float) -> None:
    """Each bears a third of the weight and needs mg / (3 mu) of normal force for it, a little more for a pyramid."""
    need = WEIGHT / (3.0 * MU)
    found = solve_bounded_margin(ring(0.0, 120.0, 240.0), np.array([0, 0, WEIGHT, 0, 0, 0]), squeeze, squeeze)
    assert squeeze - need / MODEL.facet_inradius - 1e-9 <= found <= squeeze - need + 1e-9


def test_bounds_that_cannot_be_kept() -> None:
    """Pushed sideways by 10 N, fingers of 4 to 5 N each cannot answer with their normal forces and friction."""
    wrench = np.array([10.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert solve_bounded_margin(ring(0.0, 120.0, 240.0), wrench, 4.0, 5.0) < 0.0
    assert solve_bounded_margin(ring(0.0, 120.0, 240.0), wrench, 4.0, 40.0) > 0.0


def test_the_floor_counts() -> None:
    """Contacts that are no even ring want unlike forces: a floor of the mean force takes the margin away."""
    wrench = np.array([0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])
    uneven = ring(0.0, 95.0, 225.0)
    assert solve_bounded_margin(uneven, wrench, 0.0, 12.0) > solve_bounded_margin(uneven, wrench, 12.0, 12.0)
