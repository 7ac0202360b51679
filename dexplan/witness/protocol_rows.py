"""A protocol's items planned, run in MuJoCo and judged; each as one line of a file, and the numbers that come out of them.

A goal without a plan counts as not met, with the kind of its refusal.  In a row of goals the ones after it are asked all the
same, of the object where the last one that has a plan leaves it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.errors import DexplanError
from dexplan.plans.actions import Hold, count_placements
from dexplan.plans.plan import Plan
from dexplan.problems.problem import GoalSection, Problem
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.spatial import VERTICAL, Array
from dexplan.witness.protocols import PROTOCOLS, Item, Protocol, as_waypoints, read_positions

Row = dict[str, Any]

NEAR_POSE = 1e-6
"""A planned hold is at a goal where no entry of their poses [m, -] differs by more."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """An item with its plan: ``asked`` is the problem with the goals that have one, all of them where none has.

    ``refusals`` has per goal that has no plan, by its number, what was answered; ``planning_s`` is processor time [s].
    """

    item: Item
    asked: Problem
    plan: Plan
    refusals: Mapping[int, Plan]
    planning_s: float

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class Run:
    """What became of an attempt that was carried out; ``run_s`` and ``judge_s`` are processor time [s]."""

    trace: Trace
    report: ValidationReport
    run_s: float
    judge_s: float

    __repr__ = brief_repr


@dataclass(frozen=True)
class Miss:
    """How far the object is from one goal when that is judged, None where the run did not come so far."""

    position_mm: float | None = None
    rotation_deg: float | None = None


def attempt(item: Item) -> Attempt:
    """Plan an item; of a row of goals as many as there are plans for."""
    begun = time.process_time()
    asked, plan = item.problem, pipeline.plan(item.problem)
    refusals: dict[int, Plan] = {}
    left = list(range(len(item.problem.goal.waypoints or (item.problem.goal,))))
    while not plan.is_solved:
        if plan.status.is_about_start or len(left) == 1:
            refusals |= dict.fromkeys(left, plan)
            break
        refusals[left.pop(int(plan.statistics.get("waypoints", 0)))] = plan
        positions = read_positions(item.problem)[left]
        asked = replace(item.problem, goal=GoalSection(waypoints=as_waypoints(positions)))
        plan = pipeline.plan(asked)
    if not plan.is_solved:
        asked = item.problem
    return Attempt(item, asked, plan, refusals, time.process_time() - begun)


def carry_out(done: Attempt, world: Problem | None = None) -> Run:
    """Run the plan of an attempt and judge it; ``world`` as for :func:`dexplan.pipeline.rollout`."""
    begun = time.process_time()
    trace = pipeline.rollout(done.asked, done.plan, world=world)
    between = time.process_time()
    report = pipeline.validate(done.asked, done.plan, trace, world=world)
    return Run(trace, report, between - begun, time.process_time() - between)


def measure_goals(done: Attempt, trace: Trace) -> tuple[Miss, ...]:
    """Return per goal of the item how far the object is from it: at the last sample of the hold that marks it, and at the end of
    the run for the last one; for a goal without a plan, where the goal before is judged, and for the first at the start.

    The judge takes the same samples for ``position_error_final`` and ``rotation_error_final``, and tells the worst.
    """
    protocol, home = PROTOCOLS[done.item.protocol], done.plan.X_WO_start
    address = pipeline.build_scene(done.asked).object_qpos
    poses = trace["qpos"][:, address : address + 7]
    goals = [goal.X_WO_goal for goal in pipeline.build_goals(done.item.problem, home)]
    # A goal is asked of the object where it is then, so the poses of goals after a refused one stay what they are.
    planned = [k for k in range(len(goals)) if k not in done.refusals]
    marks = _find_marks(done.plan, [goals[k] for k in planned])
    misses, at = list[Miss](), 0
    is_cut = bool(trace.meta["failure"])
    for k, goal in enumerate(goals):
        if k in planned:
            samples = np.flatnonzero(trace["action_index"] == marks[planned.index(k)])
            # A hold that nothing follows was cut off, unless it is the last.
            is_whole = len(samples) > 0 and not (is_cut and samples[-1] == len(poses) - 1)
            at = int(samples[-1]) if is_whole else -1
        misses.append(_measure(protocol, poses[at], goal) if at >= 0 else Miss())
    return tuple(misses)


def _find_marks(plan: Plan, goals: Sequence[Array]) -> list[int]:
    """Return per goal (4, 4) the number of the hold at it; that of the last is the last action."""
    marks, after = list[int](), 0
    for goal in goals[:-1]:
        for k, action in enumerate(plan.actions):
            is_there = np.allclose(action.X_WO_end, goal, rtol=0.0, atol=NEAR_POSE)
            if k > after and isinstance(action, Hold) and is_there:
                after = k
                break
        marks.append(after)
    return [*marks, len(plan.actions) - 1]


def _measure(protocol: Protocol, pose: Array, goal: Array) -> Miss:
    """Return how far the object at ``pose`` (7,) is from ``goal`` (4, 4)."""
    turn = Rotation.from_quat(pose[3:], scalar_first=True)
    wanted = Rotation.from_matrix(goal[:3, :3])
    if protocol.own_axis_counts:
        angle = float((turn * wanted.inv()).magnitude())
    else:
        one, other = turn.apply(VERTICAL), wanted.apply(VERTICAL)
        angle = float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
    return Miss(1e3 * float(np.linalg.norm(pose[:3] - goal[:3, 3])), float(np.degrees(angle)))


# -- rows ------------------------------------------------------------------------------------------------------------------


def answer(item: Item, *, is_run: bool) -> Row:
    """Return what comes of an item as one line of a file; without ``is_run`` it is planned only.

    An error is an answer, too: its sentence stands under ``error``.
    """
    try:
        done = attempt(item)
        run = carry_out(done) if is_run and done.plan.is_solved else None
    except DexplanError as error:
        return {"key": item.key, "seed": item.number, "error": f"{type(error).__name__}: {error}"}
    return record(done, run)


def record(done: Attempt, run: Run | None) -> Row:
    """Return an attempt, and its run if there is one, as one line of a file."""
    item, plan = done.item, done.plan
    count = len(item.problem.goal.waypoints or (item.problem.goal,))
    row: Row = {
        "key": item.key,
        "seed": item.number,
        "goals": count,
        "refused": {str(k): _name_refusal(no) for k, no in sorted(done.refusals.items())},
        "reasons": sorted({no.reason for no in done.refusals.values()}),
        "planning_s": round(done.planning_s, 3),
        "nodes": plan.statistics.get("nodes"),
        "placements": count_placements(plan.actions) if plan.is_solved else None,
    }
    if run is None:
        return row
    report, protocol = run.report, PROTOCOLS[item.protocol]
    misses = measure_goals(done, run.trace)
    return row | {
        "position_mm": [_round(miss.position_mm) for miss in misses],
        "rotation_deg": [_round(miss.rotation_deg) for miss in misses],
        "met": [k not in done.refusals and is_met(protocol, miss) for k, miss in enumerate(misses)],
        "dropped": report["not_dropped"].status == "fail",
        "failure": run.trace.meta["failure"],
        "verdict": report.verdict,
        "failed": {check.name: [check.value, check.limit, check.unit] for check in report.failures},
        "friction_used": _round(report["friction_utilisation_max"].value),
        "simulated_s": round(float(run.trace["time"][-1]), 3),
        "run_s": round(run.run_s, 3),
        "judge_s": round(run.judge_s, 3),
    }


def is_met(protocol: Protocol, miss: Miss) -> bool:
    """Return whether a goal is met that the object misses by so much."""
    if miss.position_mm is None or miss.rotation_deg is None:
        return False
    is_turned = protocol.near_deg is None or miss.rotation_deg <= protocol.near_deg
    return miss.position_mm <= protocol.near_mm and is_turned


def summarise(protocol: Protocol, rows: Sequence[Row]) -> Row:
    """Return what came out of a protocol's rows: of goals and of items counts and shares met with Wilson's 95 % interval, and of
    the goals with a plan the errors.

    The sum of errors is told of the rows whose every goal was judged.
    """
    asked = [row for row in rows if "error" not in row]
    ran = [row for row in asked if "verdict" in row]
    goals = sum(row["goals"] for row in asked)
    met = sum(sum(row["met"]) for row in ran)
    told: Row = {
        "protocol": protocol.name,
        "asks": protocol.summary,
        "within": {"position_mm": protocol.near_mm, "rotation_deg": _round(protocol.near_deg)},
        "seeds": [row["seed"] for row in rows],
        "items": len(rows),
        "errors": [row["error"] for row in rows if "error" in row],
        "items_planned": sum(not row["refused"] for row in asked),
        "goals": goals,
        "goals_planned": goals - sum(len(row["refused"]) for row in asked),
        "refused": dict(Counter(kind for row in asked for kind in row["refused"].values())),
        "planning_s": _spread([row["planning_s"] for row in asked]),
    }
    if not ran:
        return told
    seconds = {name: sum(row[name] for row in ran) for name in ("simulated_s", "run_s", "judge_s")}
    planning = sum(row["planning_s"] for row in ran)
    used = [row["friction_used"] for row in ran if row["friction_used"] is not None]
    sums = [sum(row["position_mm"]) for row in ran if None not in row["position_mm"]]
    return told | {
        "items_run": len(ran),
        "goals_met": _share(met, goals),
        "items_met": _share(sum(all(row["met"]) for row in ran), len(rows)),
        "dropped": sum(row["dropped"] for row in ran),
        "passed_all_checks": sum(row["verdict"] == "pass" for row in ran),
        "failed_checks": dict(Counter(name for row in ran for name in row["failed"])),
        "position_mm": _spread(_list_misses(ran, "position_mm")),
        "rotation_deg": _spread(_list_misses(ran, "rotation_deg")),
        "sum_of_errors_mm": _spread(sums) if max(row["goals"] for row in ran) > 1 else None,
        "friction_used_peak": max(used, default=None),
        "placements": sum(row["placements"] for row in ran),
        "simulated_s": round(seconds["simulated_s"], 1),
        "computed_s_per_simulated_s": {
            "planning": _round(planning / seconds["simulated_s"]),
            "run": _round(seconds["run_s"] / seconds["simulated_s"]),
            "judge": _round(seconds["judge_s"] / seconds["simulated_s"]),
        },
    }


def _list_misses(rows: Sequence[Row], name: str) -> list[float]:
    """Return the errors at the goals that have a plan and were judged."""
    return [
        miss
        for row in rows
        for k, miss in enumerate(row[name])
        if miss is not None and str(k) not in row["refused"]
    ]


def _share(met: int, count: int) -> Row:
    """Return a count out of another with Wilson's interval."""
    interval = binomtest(met, count).proportion_ci(method="wilson")
    return {
        "count": met,
        "of": count,
        "share": _round(met / count),
        "wilson_95": [_round(interval.low), _round(interval.high)],
    }


def _spread(values: Sequence[float]) -> Row | None:
    """Return median, 95th percentile and largest of ``values``; None of none."""
    if not values:
        return None
    median, most = np.percentile(values, [50, 95])
    return {"median": _round(float(median)), "p95": _round(float(most)), "largest": _round(max(values))}


def _name_refusal(plan: Plan) -> str:
    """Return what kind of no a plan is: its status, and what that comes down to."""
    return str(plan.status) if plan.refusal is None else f"{plan.status}: {plan.refusal.root.kind}"


def _round(value: float | None) -> float | None:
    return None if value is None else round(value, 6)
