"""Protocols: goals come from their seeds and lie where they say, rows tell what the judge says, a drop is a drop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest

from dexplan.problems.problem import GoalSection, Problem
from dexplan.problems.read import load_problem
from dexplan.spatial import rotate_about
from dexplan.witness.protocol_rows import (
    Attempt,
    attempt,
    carry_out,
    is_met,
    measure_goals,
    record,
    summarise,
)
from dexplan.witness.protocols import (
    PROTOCOLS,
    Item,
    as_waypoints,
    draw_axis,
    draw_items,
    read_positions,
)

MANY = 300


def draw_turns(name: str) -> Rotation:
    protocol = PROTOCOLS[name]
    goals = [protocol.draw(np.random.default_rng(k)).orientation_wxyz for k in range(MANY)]
    return Rotation.from_quat(np.array(goals), scalar_first=True)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_items_come_from_their_seeds_alone(name: str) -> None:
    protocol = PROTOCOLS[name]
    items = list(draw_items(protocol, 3, 5))
    (again,) = draw_items(protocol, 1, 6)
    assert [item.key for item in items] == [f"{name}_{k}" for k in (5, 6, 7)]
    assert items[1].problem == again.problem
    assert items[0].problem.goal != items[1].problem.goal
    assert items[0].problem.start.is_auto
    # No limit is loosened.
    assert items[0].problem.acceptance == load_problem("egg").acceptance


def test_attitudes_are_those_of_gymnasium() -> None:
    about = draw_turns("block_z").as_rotvec()
    assert np.allclose(about[:, :2], 0.0)
    assert np.abs(about[:, 2]).max() <= np.pi
    assert np.histogram(about[:, 2], 4, (-np.pi, np.pi))[0].min() > MANY / 6
    parallel = draw_turns("block_parallel").as_matrix()
    # Some axis of the cube's stands upright, and each of the six ways is drawn.
    upright = parallel[:, 2, :]
    assert np.allclose(np.sort(np.abs(upright), axis=1), [0.0, 0.0, 1.0], atol=1e-9)
    assert len({tuple(row) for row in np.rint(upright).tolist()}) == 6
    angles = draw_turns("egg_xyz").magnitude()
    assert np.histogram(angles, 4, (0.0, np.pi))[0].min() > MANY / 6


def test_the_pen_takes_the_shortest_turn_to_the_drawn_direction() -> None:
    whole, axis_only = draw_turns("egg_xyz"), draw_turns("pen_xyz")
    upright = np.array([0.0, 0.0, 1.0])
    assert np.allclose(whole.apply(upright), axis_only.apply(upright), atol=1e-9)
    assert np.allclose(axis_only.as_rotvec()[:, 2], 0.0, atol=1e-9)
    assert draw_axis(np.random.default_rng(0)).orientation_wxyz is not None


@pytest.mark.parametrize(("name", "count", "far"), [("reach", 12, 0.020), ("sum", 10, 0.012)])
def test_waypoints_lie_within_their_cube_around_the_start(name: str, count: int, far: float) -> None:
    protocol = PROTOCOLS[f"cylinder_80_{name}"]
    positions = np.stack([read_positions(item.problem) for item in draw_items(protocol, 30)])
    assert positions.shape == (30, count, 3)
    assert np.abs(positions).max() <= far
    assert np.abs(positions).max() > 0.98 * far
    kept = replace(PROTOCOL_PROBLEM, goal=GoalSection(waypoints=as_waypoints(positions[0][[1, 4]])))
    assert np.allclose(read_positions(kept), positions[0][[1, 4]])


PROTOCOL_PROBLEM: Problem = next(draw_items(PROTOCOLS["cylinder_60_reach"], 1)).problem


def pose(positions: list[list[float]]) -> Item:
    """Return a row of waypoints [m] of the egg: that of the cylinders takes longer to plan."""
    (egg,) = draw_items(PROTOCOLS["egg_xyz"], 1)
    goal = GoalSection(waypoints=as_waypoints(np.array(positions)))
    return Item("cylinder_60_reach", 7, replace(egg.problem, name="row_7", goal=goal))


@pytest.fixture(scope="module")
def done() -> Attempt:
    """A row whose second goal is out of reach."""
    return attempt(pose([[0.0, 0.0, 0.004], [0.0, 0.0, 0.6], [0.003, 0.0, 0.004]]))


def test_a_goal_without_a_plan_is_counted_with_its_reason_and_the_next_is_asked(done: Attempt) -> None:
    assert list(done.refusals) == [1]
    assert done.plan.is_solved
    assert np.allclose(read_positions(done.asked), [[0.0, 0.0, 0.004], [0.003, 0.0, 0.004]])
    run = carry_out(done)
    row = record(done, run)
    assert row["goals"] == 3
    (kind,) = row["refused"].values()
    assert kind.startswith("goal_unreachable")
    assert row["met"] == [True, False, True]
    assert row["verdict"] == "pass"
    assert not row["dropped"]
    # Where the second goal is missed the object is still at the first.
    assert row["position_mm"][1] == pytest.approx(596.0, abs=0.1)
    misses = measure_goals(done, run.trace)
    for name, unit in (("position_error_final", "position_mm"), ("rotation_error_final", "rotation_deg")):
        judged = max(getattr(misses[k], unit) for k in (0, 2))
        assert run.report[name].value == pytest.approx(judged, abs=1e-9)


def test_a_dropped_object_is_a_drop_and_meets_nothing(done: Attempt) -> None:
    slippery = replace(done.asked, friction=replace(done.asked.friction, sliding=0.02, torsional_m=1e-4))
    run = carry_out(done, world=slippery)
    row = record(done, run)
    assert row["dropped"]
    assert row["failure"]
    assert not any(row["met"])
    assert row["position_mm"] == [None] * 3
    told = summarise(PROTOCOLS["cylinder_60_reach"], [row])
    assert (told["dropped"], told["passed_all_checks"], told["goals_met"]["count"]) == (1, 0, 0)
    assert told["position_mm"] is None


def test_a_start_that_does_not_hold_refuses_every_goal() -> None:
    item = pose([[0.0, 0.0, 0.004], [0.003, 0.0, 0.004]])
    start = replace(item.problem.start, contacts_deg=((0.0, 0.0), (40.0, 0.0), "free"))
    done = attempt(replace(item, problem=replace(item.problem, start=start)))
    assert sorted(done.refusals) == [0, 1]
    assert done.plan.status.is_about_start
    row = record(done, None)
    assert len(row["refused"]) == row["goals"] == 2


def test_the_pens_turn_about_its_own_axis_does_not_count(done: Attempt) -> None:
    from dexplan.witness.protocol_rows import _measure

    X = np.eye(4)
    X[:3, :3] = rotate_about(np.array([0.0, 0.0, 1.0]), 1.0)
    pose = np.array([0.0, 0.003, 0.0, 1.0, 0.0, 0.0, 0.0])
    pen, block = (_measure(PROTOCOLS[name], pose, X) for name in ("pen_xyz", "block_xyz"))
    assert (pen.position_mm, pen.rotation_deg) == (pytest.approx(3.0), pytest.approx(0.0))
    assert block.rotation_deg == pytest.approx(np.degrees(1.0))
    assert is_met(PROTOCOLS["pen_xyz"], pen)
    assert not is_met(PROTOCOLS["block_xyz"], block)


def make_row(seed: int, position: list[float], refused: dict[str, str], **changes: Any) -> dict[str, Any]:
    row = {
        "key": f"row_{seed}",
        "seed": seed,
        "goals": len(position),
        "refused": refused,
        "reasons": [],
        "planning_s": 2.0,
        "nodes": 5.0,
        "placements": 1,
        "position_mm": position,
        "rotation_deg": [0.1] * len(position),
        "met": [str(k) not in refused and p <= 5.0 for k, p in enumerate(position)],
        "dropped": False,
        "failure": None,
        "verdict": "pass",
        "failed": {},
        "friction_used": 0.5,
        "simulated_s": 10.0,
        "run_s": 5.0,
        "judge_s": 2.5,
    }
    return row | changes


def test_a_summary_counts_every_goal_that_was_asked() -> None:
    rows = [
        make_row(0, [0.1, 0.2, 0.3], {}),
        make_row(1, [0.4, 9.0, 6.0], {"1": "no_gait: load"}, verdict="fail", failed={"x": [1, 2, "mm"]}),
        {key: make_row(2, [0.0] * 3, {"0": "a", "1": "a", "2": "a"})[key]
         for key in ("key", "seed", "goals", "refused", "reasons", "planning_s", "nodes", "placements")},
        {"key": "row_3", "seed": 3, "error": "ProblemError: none"},
    ]  # fmt: skip
    told = summarise(PROTOCOLS["cylinder_60_reach"], rows)
    assert (told["items"], told["items_planned"], told["goals"], told["goals_planned"]) == (4, 1, 9, 5)
    assert told["refused"] == {"no_gait: load": 1, "a": 3}
    assert told["errors"] == ["ProblemError: none"]
    assert told["items_met"]["count"] == 1
    met = told["goals_met"]
    assert (met["count"], met["of"]) == (4, 9)
    interval = binomtest(4, 9).proportion_ci(method="wilson")
    assert met["wilson_95"] == pytest.approx([interval.low, interval.high], abs=1e-6)
    assert told["passed_all_checks"] == 1
    assert told["failed_checks"] == {"x": 1}
    # The refused goal's distance is no error of a plan, but it counts in the sum.
    assert told["position_mm"]["largest"] == 6.0
    assert told["position_mm"]["median"] == pytest.approx(0.3)
    assert told["sum_of_errors_mm"]["largest"] == pytest.approx(15.4)
    assert told["friction_used_peak"] == 0.5
    assert told["computed_s_per_simulated_s"] == {"planning": 0.2, "run": 0.5, "judge": 0.25}
