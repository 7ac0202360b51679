"""The gait diagram as data, as text and as a picture; the curves of the summary."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from turning_run import AXIS, make_plan, make_trace

from dexplan.sim.judge.checks_case import CheckResult
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.spatial import as_pose7, make_pose, rotate_about
from dexplan.viz.curves import compute_curves, compute_utilisation
from dexplan.viz.figure import draw_summary
from dexplan.viz.timeline import (
    build_action_spans,
    build_gait_rows,
    choose_axis,
    compute_turned_angle,
    gait_text,
)


def _with_contacts(trace: Trace, active: np.ndarray) -> Trace:
    return Trace(trace.model_xml, {**trace.columns, "contact_active": active}, trace.meta)


def test_gait_rows_are_the_spans_of_touch() -> None:
    rows = build_gait_rows(make_trace())
    assert [row.finger for row in rows] == ["finger_1", "finger_2", "finger_3"]
    assert rows[0].holding == (pytest.approx((0.0, 0.9)),)
    assert rows[1].holding == (pytest.approx((0.0, 1.0)),)
    assert rows[2].holding == (pytest.approx((0.86, 1.0)),)


def test_gait_rows_tell_separate_touches_apart() -> None:
    trace = make_trace(duration=0.1)
    active = np.zeros((6, 3), dtype=bool)
    active[[1, 2, 4], 0] = True
    rows = build_gait_rows(_with_contacts(trace, active))
    assert np.allclose(rows[0].holding, [(0.02, 0.06), (0.08, 0.10)])
    assert rows[1].holding == rows[2].holding == ()


def test_action_spans_cover_the_run_without_gaps() -> None:
    spans = build_action_spans(make_trace())
    assert [span.action_index for span in spans] == [0, 1, 2, 3]
    assert all(a.end == b.start for a, b in pairwise(spans))
    assert (spans[0].start, spans[-1].end) == (0.0, pytest.approx(1.0))


def test_gait_text_of_a_plan_has_a_column_per_phase_and_marks_the_limiting_finger() -> None:
    lines = gait_text(make_plan()).splitlines()
    assert lines[:4] == [
        "action    1 2  3   4",
        "finger_1  # #  ### +.",
        "finger_2  # #! ### ##",
        "finger_3  . .  .+# ##",
    ]
    assert "limit" in lines[-1]


def test_gait_text_of_a_long_plan_is_folded() -> None:
    plan = make_plan()
    long = replace(plan, actions=plan.actions * 20)
    lines = gait_text(long, width=60).splitlines()
    assert max(map(len, lines)) <= 60
    assert " ".join(line for line in lines if line.startswith("action")).split().count("80") == 1


def test_gait_text_of_a_trace_has_a_character_per_stretch_of_time() -> None:
    lines = gait_text(make_trace(), width=40).splitlines()
    first, second, third, ruler = lines[:4]
    assert max(map(len, lines)) <= 40
    assert second == "finger_2  " + "#" * 30
    assert first.startswith("finger_1  ########")
    assert first.endswith("...")
    assert third.startswith("finger_3  ........")
    assert third.endswith("###")
    assert ruler.split() == ["0.0", "s", "1.0", "s"]


def test_turned_angle_counts_whole_turns_and_leaves_wobble_out() -> None:
    angles = np.radians(np.linspace(0.0, -800.0, 200))
    wobble = rotate_about([1.0, 0.0, 0.0], 0.05 * np.sin(np.arange(200)))
    poses = as_pose7(
        np.stack([make_pose(w @ rotate_about(AXIS, a)) for w, a in zip(wobble, angles, strict=True)])
    )
    assert np.degrees(compute_turned_angle(poses, AXIS)[-1]) == pytest.approx(-800.0, abs=0.2)


def test_the_turn_is_counted_about_the_goals_axis() -> None:
    plan = make_plan()
    assert np.allclose(choose_axis(plan), AXIS)
    assert np.allclose(choose_axis(None), AXIS)
    tilted = replace(plan, axis_W=None, X_WO_goal=make_pose(rotate_about([1.0, 0.0, 0.0], 0.5)))
    assert np.allclose(choose_axis(tilted), [1.0, 0.0, 0.0])


def test_utilisation_is_one_at_the_friction_limit() -> None:
    sliding, torsional = 0.5, 0.002
    force = np.array(
        [[0.5, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.002], [0.3, 0.0, 1.0, 0.0016], [0.0, 0.0, 0.0, 0.0]]
    )
    used = compute_utilisation(force, sliding, torsional)
    assert np.allclose(used[:3], 1.0)
    assert np.isnan(used[3])


def test_curves_read_the_frictions_from_the_model_where_no_problem_is_given() -> None:
    problem = {"friction": {"sliding": 0.55, "torsional_m": 0.0025}}
    given, read = (compute_curves(p, make_plan(), make_trace()) for p in (problem, None))
    assert np.array_equal(given.utilisation, read.utilisation, equal_nan=True)
    assert np.max(read.position_error_mm) == 0.0
    assert read.turned_deg[-1] == pytest.approx(90.0)


def test_summary_is_one_picture_of_the_promised_size(tmp_path: Path) -> None:
    path = draw_summary(None, make_plan(), make_trace(), None, tmp_path / "new" / "summary.png")
    picture = imread(path)
    assert picture.shape[:2] == (1200, 1400)
    assert picture[..., :3].std() > 0.05
    assert [p.name for p in path.parent.iterdir()] == ["summary.png"]


def test_summary_of_a_run_that_diverged_can_be_drawn(tmp_path: Path) -> None:
    trace = make_trace()
    qpos = trace["qpos"].copy()
    qpos[-5:] = np.nan
    broken = Trace(trace.model_xml, {**trace.columns, "qpos": qpos}, {"failure": "the simulation diverged"})
    assert draw_summary(None, make_plan(), broken, None, tmp_path / "summary.png").is_file()


def test_summary_says_what_the_verdict_rests_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Looser limits and a record from elsewhere have lines of their own, whatever is cut off the verdict."""
    said: list[str] = []
    write = Figure.text

    def spy(self: Figure, x: float, y: float, s: str, **given: object) -> object:
        said.append(s)
        return write(self, x, y, s, **given)  # type: ignore[arg-type]

    monkeypatch.setattr(Figure, "text", spy)
    report = ValidationReport(
        name="a",
        verdict="pass",
        checks=(CheckResult("turned_angle", "pass", 0.1, 0.5, "deg"),),
        physics={},
        timing={},
        versions={},
        seed=0,
        recorded={"differences": ["processor 'A', here 'B'"]},
        loose_limits={"penetration_max_um": {"value": 400.0, "default": 150.0}},
    )
    draw_summary(None, make_plan(), make_trace(), report, tmp_path / "summary.png")
    assert "PASS a: turn off by 0.1 deg" in said
    assert "limits looser than default (1): penetration_max_um 400 instead of 150" in said
    assert "recorded elsewhere (processor 'A', here 'B'), judged from the replay" in said
