"""Why there is no gait on sites: the reason names the rule that says no, and what it proposes instead works."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.sites import build_sites
from dexplan.contact.bodies.smooth import EllipsoidBody
from dexplan.planning.regrasp.missing_chain import label_sides
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import RefusalKind
from dexplan.problems.read import build_problem

CUBE = {"kind": "box", "half_sizes_m": [0.03, 0.03, 0.03]}
OPPOSITE = [[0.0, 0.0], [180.0, 0.0], "free"]
HEXAGON = np.array(
    [[0.03 * np.cos(a), 0.03 * np.sin(a), z] for a in np.arange(6) * np.pi / 3 for z in (-0.03, 0.03)]
)


def turn(
    axis: list[float], angle: float, start: Any, shape: dict[str, Any] = CUBE, mass: float = 0.08
) -> Plan:
    data = {
        "format": 1,
        "name": "sides",
        "object": {"shape": shape, "mass_kg": mass},
        "hand": {"tip_radii_m": [0.012] * 3},
        "goal": {"rotation": {"axis": axis, "angle_deg": angle}},
        "start": {"contacts_deg": start},
    }
    return pipeline.plan(build_problem(data))


def shift(way: list[float]) -> Plan:
    asked = {"shape": CUBE, "mass_kg": 0.08}
    return pipeline.plan(
        build_problem({"format": 1, "name": "far", "object": asked, "goal": {"translation_m": way}})
    )


@pytest.mark.parametrize(
    ("body", "friction", "count"),
    [
        (BoxBody(0.02, 0.03, 0.04), 0.8, 3),
        (BoxBody(0.02, 0.03, 0.04), 1.05, 1),
        (EllipsoidBody(0.03, 0.03, 0.04), 0.5, 1),
        (CylinderBody(0.03, 0.03), 0.8, 2),
        (PolyhedronBody(HEXAGON), 0.5, 4),
        (PolyhedronBody(HEXAGON), 0.7, 2),
    ],
)
def test_sides_are_what_pairs_cannot_change_between(body: ConvexBody, friction: float, count: int) -> None:
    """A hexagonal prism's neighbouring pairs of faces are 60 degrees apart: they hang together from tan 30 deg on."""
    points = build_sites(body, 0.006).points
    sides = label_sides(body.normal_at(points), np.arctan(friction))
    assert len(set(sides.tolist())) == count
    opposite = label_sides(np.vstack([np.eye(3), -np.eye(3)]), np.arctan(0.9))
    assert opposite[:3].tolist() == opposite[3:].tolist()


@pytest.mark.parametrize("angle", [83.0, 97.0])
def test_a_cube_does_not_change_its_faces_and_theorem_1_says_so(angle: float) -> None:
    plan = turn([0.0, 1.0, 0.0], angle, OPPOSITE)
    assert plan.status == "no_gait"
    assert plan.refusal is not None
    assert plan.refusal.kind is RefusalKind.THEOREM_1
    assert "faces A (+x) and B (-x)" in plan.reason
    assert "faces C (+y) and D (-y)" in plan.reason
    assert 'set start.contacts_deg = "auto"' in plan.reason


@pytest.mark.parametrize("angle", [83.0, 97.0])
def test_the_planner_begins_on_faces_that_come_there(angle: float) -> None:
    plan = turn([0.0, 1.0, 0.0], angle, "auto")
    assert plan.is_solved, plan.reason
    assert all(abs(c.normal_O[1]) > 0.99 for c in plan.start_contacts if c is not None)


def test_where_nothing_holds_at_the_goal_that_is_said() -> None:
    plan = shift([0.0, 0.0, 0.5])
    assert plan.status == "goal_unreachable"
    assert "shorten goal.translation_m" in plan.reason
    assert "at the goal" in plan.reason


def test_where_the_weight_is_too_much_that_is_the_reason() -> None:
    plan = turn([0.0, 0.0, 1.0], 10.0, "auto", mass=1.6)
    assert plan.refusal is not None
    assert plan.refusal.kind is RefusalKind.NO_PAIR
    assert "bears the object's weight" in plan.reason


def test_tips_too_wide_for_a_bar_leave_no_exchange() -> None:
    """On a bar as wide as a tip two tips on one face are so far apart that no line to the opposite one is within friction."""
    bar = {"kind": "box", "half_sizes_m": [0.01, 0.01, 0.04]}
    plan = turn([0.0, 0.0, 1.0], 140.0, "auto", bar, 0.04)
    assert plan.status == "no_gait"
    assert plan.refusal is not None
    assert plan.refusal.kind is RefusalKind.NO_CHAIN
    assert "no third finger has room" in plan.reason
