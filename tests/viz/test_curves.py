"""What the summary shows of a run: which stretches are judged, when goal contacts are reached, how near limits are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from other_bodies import BODIES, swap_trace
from turning_run import AZIMUTHS, make_plan, make_trace

from dexplan.plans.contacts import GoalContact
from dexplan.plans.plan import Plan
from dexplan.sim.judge.checks_case import Case, CheckResult
from dexplan.sim.judge.limits import load_default_limits
from dexplan.sim.judge.validate import CHECKS, ValidationReport
from dexplan.spatial import direction_from_angles
from dexplan.viz.check_words import GROUP_QUESTIONS, list_described, list_used_limits, spell, spell_beside
from dexplan.viz.curves import compute_curves, find_arrivals, find_quiet, read_limit
from dexplan.viz.palette import as_rgb, tint
from dexplan.viz.summary_panels import describe_briefly, find_stretches


def test_the_stretches_shaded_are_those_that_the_judge_leaves_out() -> None:
    """The figure's own count of quiet samples against the judge's, which shares no code with it."""
    plan, trace = make_plan(), make_trace(duration=3.0)
    world = SimpleNamespace(fingers=plan.fingers, timestep=0.02)
    seen = SimpleNamespace(world=world, time=trace["time"], contact_active=trace["contact_active"])
    columns = {**trace.columns, "physics_steps_per_sample": np.array(1)}
    case = Case({}, plan.as_dict(), columns, seen, load_default_limits())  # type: ignore[arg-type]
    quiet = find_quiet(plan, trace, load_default_limits()["quiet_distance_s"])
    assert np.array_equal(quiet, case.quiet)
    assert 0.5 < quiet.mean() < 0.9


def test_stretches_are_told_by_their_ends() -> None:
    time = np.arange(6) * 0.5
    mask = np.array([True, False, True, True, False, True])
    assert find_stretches(time, mask) == [(0.0, 0.5), (1.0, 2.0), (2.5, 2.5)]


def _with_goals(*offsets_deg: float | None) -> Plan:
    """Return the plan with goal contacts these angles beside where the fingers of the trace touch."""
    goals = []
    for finger, offset in enumerate(offsets_deg):
        if offset is None:
            goals.append(None)
            continue
        normal = direction_from_angles(AZIMUTHS[finger] + offset, 0.0)
        goals.append(GoalContact(finger, 0.035 * normal, normal))
    return replace(make_plan(), goal_contacts=tuple(goals))


def test_contacts_reach_their_goals_when_they_stay_within_the_limit() -> None:
    plan = _with_goals(None, 0.0, 1.0)
    curves = compute_curves(None, plan, make_trace())
    assert np.isnan(curves.goal_error[:, 0]).all()
    assert np.allclose(curves.goal_error[:, 1], 0.0, atol=1e-6)
    assert np.nanmax(np.abs(curves.goal_error[:, 2] - 1.0)) < 1e-6
    assert find_arrivals(curves, 1.5) == (None, 0.0, pytest.approx(0.86))
    assert find_arrivals(curves, 0.5) == (None, 0.0, None)


def test_on_a_box_contacts_are_off_their_goals_by_millimetres() -> None:
    """No angle from the centre says how far two contacts on one face are apart."""
    trace = swap_trace(make_trace(), BODIES["box"])
    curves = compute_curves(None, _with_goals(None, 0.0, 1.0), trace)
    assert curves.goal_unit == "mm"
    assert np.allclose(curves.goal_error[:, 1], 0.0, atol=1e-9)
    chord = 2.0 * 35.0 * np.sin(np.radians(0.5))
    assert np.nanmax(np.abs(curves.goal_error[:, 2] - chord)) < 1e-6
    assert find_arrivals(curves, 0.7) == (None, 0.0, pytest.approx(0.86))
    assert find_arrivals(curves, float("nan")) == (None, None, None)
    assert np.isnan(read_limit(None, "no_such_limit"))


def test_limits_are_the_problems_or_the_packaged_ones() -> None:
    assert read_limit(None, "friction_utilisation_max") == 0.9
    assert read_limit({"acceptance": {"friction_utilisation_max": 0.7}}, "friction_utilisation_max") == 0.7


def test_actions_are_named_briefly_with_fingers_counted_from_one() -> None:
    plan = make_plan()
    assert [describe_briefly(plan, k) for k in range(4)] == ["hold", "turn +90°", "place 3", "lift 1"]


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (0.03747, "mm", "0.037 mm"),
        (359.997, "deg", "360°"),
        (0.9, "–", "0.90"),
        (5.5, "N", "5.5 N"),
        (9.97, "mm", "10 mm"),
        (12.4, "µm/s", "12 µm/s"),
        (9.1e-05, "mm", "less than 0.001 mm"),
        (-9.1e-05, "mm", "more than -0.001 mm"),
        (0.0, "count", "0"),
        (None, "mm", "no value"),
        (float("nan"), "", "nan"),
    ],
)
def test_numbers_have_two_digits(value: float | None, unit: str, words: str) -> None:
    assert spell(value, unit) == words


@pytest.mark.parametrize(
    ("value", "limit", "words"),
    [
        (0.9003, 0.9, "0.9003 mm"),
        (0.8996, 0.9, "0.8996 mm"),
        (0.9, 0.9, "0.90 mm"),
        (0.78, 0.9, "0.78 mm"),
        (21.6, 22.0, "21.6 mm"),
        (21.4, 22.0, "21 mm"),
        (0.0004, 0.0, "less than 0.001 mm"),
        (None, 1.0, "no value"),
    ],
)
def test_a_number_is_seen_to_be_on_its_side_of_the_limit(
    value: float | None, limit: float, words: str
) -> None:
    assert spell_beside(value, limit, "mm") == words


def test_every_check_has_words() -> None:
    assert set(list_described()) == {name for name, _ in CHECKS}
    assert set(GROUP_QUESTIONS) == {"physics", "task", "contacts", "forces", "internals"}


def test_shares_of_limits_are_told_the_right_way_round() -> None:
    def check(name: str, status: str, value: float | None, limit: float | None) -> CheckResult:
        return CheckResult(name, status, value, limit, "mm")  # type: ignore[arg-type]

    checks = (
        check("penetration_max", "pass", 30.0, 150.0),
        check("free_finger_clearance_min", "pass", 4.0, 2.0),
        check("joint_limit_margin_min", "fail", 2.0, 3.0),
        check("friction_utilisation_max", "fail", 0.95, 0.9),
        check("replay_matches", "pass", 0.0, 0.0),
        check("turned_angle", "not_applicable", None, None),
        check("creep_rate_max", "not_recorded", None, 3.0),
        check("plan_load_margin", "fail", 0.0, 0.02),
    )
    used = list_used_limits(ValidationReport("a", "fail", checks, {}, {}, {}, 0))
    assert [(u.name, u.share, u.is_least, u.is_failed) for u in used] == [
        ("plan_load_margin", float("inf"), True, True),
        ("joint_limit_margin_min", 1.5, True, True),
        ("friction_utilisation_max", pytest.approx(0.95 / 0.9), False, True),
        ("free_finger_clearance_min", 0.5, True, False),
        ("penetration_max", 0.2, False, False),
    ]
    assert str(used[3]) == "4 mm, at least 2 mm"


def test_tints_are_mixed_with_white() -> None:
    assert tint("#000000", 1.0) == "#000000"
    assert tint("#FF0000", 0.0) == "#FFFFFF"
    assert np.allclose(as_rgb(tint("#000000", 0.4)), 0.6, atol=0.01)
