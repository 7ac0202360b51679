"""Start contacts on bodies other than balls: refused by what is wrong with them, and taken where nothing is."""

from __future__ import annotations

from typing import Any

import pytest

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.read import build_problem

SHAPES: dict[str, dict[str, Any]] = {
    "box": {"kind": "box", "half_sizes_m": [0.03, 0.03, 0.03]},
    "egg": {"kind": "ellipsoid", "semi_axes_m": [0.03, 0.025, 0.04]},
    "cylinder": {"kind": "cylinder", "radius_m": 0.03, "half_length_m": 0.035},
}


def plan_from(name: str, *contacts: Any) -> Plan:
    """Return the plan of a small turn of a body from start contacts, azimuth and elevation [deg]."""
    return pipeline.plan(
        build_problem(
            {
                "format": 1,
                "name": name,
                "object": {"shape": SHAPES[name]},
                "hand": {"tip_radii_m": [0.012] * 3},
                "start": {"contacts_deg": list(contacts)},
                "goal": {"rotation": {"axis": [0.0, 0.0, 1.0], "angle_deg": 10.0}},
            }
        )
    )


@pytest.mark.parametrize("name", SHAPES)
def test_a_contact_on_the_far_side_is_out_of_reach(name: str) -> None:
    plan = plan_from(name, [180.0, 0.0], [0.0, 0.0], "free")
    assert plan.status is Status.START_UNREACHABLE
    assert "finger_1 cannot hold its start contact" in plan.reason


@pytest.mark.parametrize("name", SHAPES)
def test_contacts_beside_each_other_do_not_hold(name: str) -> None:
    """On the cube they are on neighbouring faces, which are never opposite."""
    plan = plan_from(name, [10.0, 5.0], [95.0, 0.0], "free")
    assert plan.status is Status.START_INADMISSIBLE
    assert "no line between two of them leaves both normals by less than" in plan.reason
    assert plan.refusal is not None
    assert "auto" in str(plan.refusal.cure)


@pytest.mark.parametrize("name", SHAPES)
def test_opposite_contacts_are_taken_as_given(name: str) -> None:
    plan = plan_from(name, [0.0, 5.0], [180.0, 5.0], "free")
    assert plan.is_solved, plan.reason
    first, second, third = plan.start_contacts
    assert first is not None
    assert second is not None
    assert third is None
    assert first.point_O[0] > 0.025
    assert second.point_O[0] < -0.025
