"""The paper's gamma: how far a tip goes round, and that nothing that is planned goes farther than the hand allows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dexplan.contact.rolling.candidates import RollLimits
from dexplan.contact.rolling.curves import RollingPath, roll_turning
from dexplan.contact.rolling.manoeuvre import RollingTriangle
from dexplan.contact.rolling.roll_to import RollEnd, roll_to
from dexplan.contact.surfaces.shapes import Sphere
from dexplan.planning.admissible.tip_rotation import measure_rotation, trace_on_tip
from dexplan.planning.rolling.roll_gait import follow_roll
from dexplan.planning.rolling.rolling_carry import build_carry_roll
from dexplan.planning.rolling.rolls import as_roll
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, make_pose, rotate_about
from dexplan.witness.rolling import Stand, build_roll_problem, compute_heading

TIP, BALL = 0.018, 0.035


def touch(lean: float = 0.0, around: float = 0.0) -> Array:
    """Return a tip pose on top of the ball, its pole off the contact by ``lean`` [deg]."""
    X = make_pose(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, TIP + BALL])
    axis = [np.cos(np.radians(around)), np.sin(np.radians(around)), 0.0]
    X[:3, :3] = rotate_about(axis, np.radians(lean)) @ X[:3, :3]
    return X


def rotation_of(path: RollingPath) -> float:
    return float(np.degrees(measure_rotation(trace_on_tip(as_roll(0, path)))[-1]))


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.floats(20.0, 90.0), st.floats(5.0, 140.0), st.booleans(), st.floats(0.0, 360.0))
def test_a_triangle_goes_round_by_its_apex(leg: float, apex: float, is_left: bool, heading: float) -> None:
    triangle = RollingTriangle(TIP, BALL, np.radians(leg), np.radians(apex if is_left else -apex))
    towards = [np.cos(np.radians(heading)), np.sin(np.radians(heading)), 0.0]
    path = triangle.roll(touch(), towards, 200)
    assert rotation_of(path) == pytest.approx(apex, abs=1e-6)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.floats(0.0, 80.0), st.floats(0.0, 360.0), st.floats(1.0, 150.0))
def test_a_straight_way_does_not_go_round(lean: float, around: float, far: float) -> None:
    """Wherever it begins, and however near it comes by the pole: its bound is the polar limit."""
    path = roll_turning(TIP, BALL, touch(lean, around), [1.0, 0.0, 0.0], [0.0], [TIP * np.radians(far)], 60)
    assert rotation_of(path) == pytest.approx(0.0, abs=1e-5)


def test_cycles_do_not_add_up() -> None:
    """Every cycle comes back to where it set out; the mirrored ones after it begin anew."""
    triangle = RollingTriangle(TIP, BALL, np.radians(60.0), np.radians(50.0))
    first = triangle.roll(touch(), [1.0, 0.0, 0.0], 60)
    again = triangle.roll(first.X_OF[-1], [1.0, 0.0, 0.0], 60)
    places = np.concatenate([trace_on_tip(as_roll(0, path)) for path in (first, again)])
    assert np.degrees(measure_rotation(places)[-1]) == pytest.approx(50.0, abs=1e-6)


@pytest.mark.parametrize("gamma", [15.0, 45.0, 75.0, 120.0])
@pytest.mark.parametrize("lean", [0.0, 35.0])
@pytest.mark.parametrize("end", ["free", "pole"])
def test_roll_to_keeps_the_limit(gamma: float, lean: float, end: RollEnd) -> None:
    limits = RollLimits(np.radians(80.0), np.radians(gamma), max_cycles=8)
    found, widest = 0, 0.0
    for angle in (5.0, 20.0, 45.0, 70.0):
        goal = rotate_about([0.3, 1.0, 0.0], np.radians(angle)) @ [0.0, 0.0, 1.0]
        plan = roll_to(touch(lean, 70.0), goal, Sphere(TIP), Sphere(BALL), limits, end=end)
        found += plan.is_found
        widest = max([widest, *(rotation_of(path) for path in plan.paths)])
    assert found >= 1
    assert widest <= gamma + 1e-4


@pytest.fixture(scope="module")
def stand() -> Stand:
    return Stand.build(build_roll_problem(place_deg=(226.0, 0.0)))


class TestHand:
    """A finger of the hand rolls triangles on the ball that it holds."""

    @staticmethod
    def legs(stand: Stand, leg: float, apex: float) -> list[TipRoll]:
        triangle = RollingTriangle(TIP, BALL, np.radians(leg), np.radians(apex))
        path = triangle.roll(stand.start.X_OF, compute_heading(stand.start, 0.0), 61)
        return [as_roll(stand.start.finger, path, k) for k in range(3)]

    @pytest.mark.parametrize(("gamma", "is_planned"), [(59.0, False), (60.0, True), (75.0, True)])
    def test_planned_cycles_keep_the_problems_limit(
        self, stand: Stand, gamma: float, is_planned: bool
    ) -> None:
        """One leg after the other is straight; together they go round."""
        hand = replace(stand.hand, tip_rotation_limit=np.radians(gamma))
        plan, why = replace(stand, hand=hand).plan_roll(self.legs(stand, 25.0, 60.0))
        assert (plan is not None) == is_planned, why
        if not is_planned:
            assert "60.0 deg round" in why
            assert "hand.tip_rotation_limit_deg is 59.0" in why

    def test_the_hand_has_the_limit_of_its_problem(self) -> None:
        stand = Stand.build(build_roll_problem(**{"hand.tip_rotation_limit_deg": 31.0}))
        assert np.degrees(stand.hand.tip_rotation_limit) == pytest.approx(31.0)

    def test_a_curved_way_ends_at_the_limit(self, stand: Stand) -> None:
        """A tip that keeps its attitude on a ball that turns about an axis near the contact rolls round a small circle."""
        axis = rotate_about([0.0, 0.0, 1.0], 0.5) @ stand.start.normal_O
        roll = build_carry_roll(stand.hand, stand.start, axis, np.radians(80.0), 1.0, 81)
        swept = np.degrees(measure_rotation(trace_on_tip(roll)))
        assert swept[-1] > 8.0
        hand = replace(stand.hand, tip_rotation_limit=np.radians(5.0))
        q, why = follow_roll(hand, stand.plan.X_WO_start, roll, stand.start.q)
        assert "hand.tip_rotation_limit_deg is 5.0" in str(why)
        assert swept[len(q) - 1] <= 5.0 < swept[len(q)]
