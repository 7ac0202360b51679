"""Goal after goal in one rollout: the end contacts of one plan are the start of the next, and the ball is never put down."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan import pipeline
from dexplan.brief import brief_repr
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.sampling import sample_attitude
from dexplan.planning.tasks.rolling_start import plan_object_manipulation
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import count_placements
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.problems.problem import GoalSection, Problem, compute_contact_directions
from dexplan.problems.problem import Rotation as Turn
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.spatial import VERTICAL, Array

POSITION_LIMIT_MM, ROTATION_LIMIT_DEG = 0.5, 1.0
"""What every goal has to be reached within."""
LEAST_TURN_DEG = 90.0
"""Every attitude is at least so far from the one before."""

ChooseGoal = Callable[[Array], RotationGoal]
"""``choose(X_WO)``: the next goal of an object that is at ``X_WO`` (4, 4)."""
Tick = Callable[[], None]


@dataclass(frozen=True)
class PlannedGoal:
    """One goal of a chain: how far it is [deg], and what its plan took; ``last_action`` is the hold at the goal."""

    turn_deg: float
    placements: int
    planning_s: float
    last_action: int


@dataclass(frozen=True, eq=False)
class Chain:
    """Goals planned one after another, joined to one plan; ``reason`` says why there are not as many as asked, else ""."""

    plan: Plan
    goals: tuple[PlannedGoal, ...]
    asked: int
    reason: str

    __repr__ = brief_repr


@dataclass(frozen=True)
class GoalResult:
    """How one goal went: errors against the goal pose when it is reached, and the largest against the reference on the way.

    ``reached_s`` is the moment [s] at which the hold at the goal ends; None, and no errors, where the run did not come so far.
    """

    number: int
    turn_deg: float
    placements: int
    planning_s: float
    reached_s: float | None
    position_mm: float | None
    rotation_deg: float | None
    position_way_mm: float | None
    rotation_way_deg: float | None

    @property
    def is_met(self) -> bool:
        """Whether the goal was reached within the limits, and the object stayed within them on the way."""
        errors = (self.position_mm, self.rotation_deg, self.position_way_mm, self.rotation_way_deg)
        limits = (POSITION_LIMIT_MM, ROTATION_LIMIT_DEG) * 2
        return all(e is not None and e <= limit for e, limit in zip(errors, limits, strict=True))


@dataclass(frozen=True, eq=False)
class Endurance:
    """One rollout of a chain with its judgement."""

    name: str
    problem: Problem
    chain: Chain
    trace: Trace
    report: ValidationReport
    goals: tuple[GoalResult, ...]

    __repr__ = brief_repr

    @property
    def failure(self) -> str:
        """What ended the run early, "" where nothing did."""
        return str(self.trace.meta["failure"] or "")

    @property
    def is_met(self) -> bool:
        """Whether all goals that were asked were planned and met in one run without a failure that all checks confirm."""
        return (
            len(self.goals) == self.chain.asked
            and all(goal.is_met for goal in self.goals)
            and not self.failure
            and self.report.is_passed
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the outcome as JSON data."""
        return {
            "name": self.name,
            "problem": self.problem.name,
            "seed": self.problem.seed,
            "asked": self.chain.asked,
            "planned": len(self.chain.goals),
            "met": sum(goal.is_met for goal in self.goals),
            "is_met": self.is_met,
            "stopped": self.chain.reason,
            "failure": self.failure,
            "verdict": self.report.verdict,
            "failed_checks": [check.name for check in self.report.failures],
            "simulated_s": float(self.trace["time"][-1]),
            "limits": {"position_mm": POSITION_LIMIT_MM, "rotation_deg": ROTATION_LIMIT_DEG},
            "goals": [{**asdict(goal), "is_met": goal.is_met} for goal in self.goals],
        }


# -- planning --------------------------------------------------------------------------------------------------------------


def choose_attitude(rng: np.random.Generator, least_deg: float = LEAST_TURN_DEG) -> ChooseGoal:
    """Return a chooser of attitudes, uniform over those at least ``least_deg`` from where the object is."""

    def choose(X_WO: Array) -> RotationGoal:
        while True:
            goal = RotationGoal.from_attitude(X_WO, sample_attitude(rng))
            if np.degrees(goal.angle) >= least_deg:
                return goal

    return choose


def choose_full_turn(X_WO: Array) -> RotationGoal:
    """Return one whole turn about the vertical."""
    return RotationGoal(X_WO, VERTICAL, 2.0 * np.pi)


def plan_chain(problem: Problem, choose: ChooseGoal, count: int, tick: Tick = lambda: None) -> Chain:
    """Return ``count`` goals planned one after another from the start of ``problem``, as far as plans are found.

    Each plan starts from the tip poses that the one before ends with.  Raises ValueError for a ``count`` below 1.
    """
    if count < 1:
        raise ValueError(f"{count} goals make no chain; 1 or more are accepted")
    hand = pipeline.build_hand(problem, pipeline.build_scene(problem))
    given = problem.start.contacts_deg
    start: Start = None if isinstance(given, str) else compute_contact_directions(given)
    X_WO, joined, reason = hand.object.X_WO_home, None, ""
    goals: list[PlannedGoal] = []
    for _ in range(count):
        goal = choose(X_WO)
        plan, spent = _plan_timed(problem, hand, goal, start)
        if not plan.is_solved:
            reason = f"goal {len(goals) + 1}: {plan.status}: {plan.reason}"
            break
        joined = plan if joined is None else join_plans(joined, plan)
        placed = count_placements(plan.actions)
        goals.append(PlannedGoal(abs(float(np.degrees(goal.angle))), placed, spent, len(joined.actions) - 1))
        last = plan.actions[-1]
        X_WO, start = last.X_WO_end, last.contacts_end
        tick()
    return Chain(pipeline.time_plan(problem, plan if joined is None else joined), tuple(goals), count, reason)


def _plan_timed(problem: Problem, hand: HandModel, goal: RotationGoal, start: Start) -> tuple[Plan, float]:
    begun = time.process_time()
    plan = plan_object_manipulation(hand, goal, start, problem.gait.node_budget, problem.gait.primitives)
    return plan, time.process_time() - begun


def join_plans(first: Plan, second: Plan) -> Plan:
    """Return one plan that does both: ``second`` without its first hold after all of ``first``.

    ``second`` has to start where ``first`` ends, with the same tips in the same poses on the object; else ValueError is raised.
    The joined goal is the attitude that ``second`` reaches; angles about the same axis are added.
    """
    last = first.actions[-1]
    if not np.allclose(last.X_WO_end, second.X_WO_start, atol=1e-9):
        raise ValueError("the second plan starts elsewhere; one that starts where the first ends is accepted")
    for a, b in zip(last.contacts_end, second.start_contacts, strict=True):
        if (a is None) != (b is None) or (
            a is not None and b is not None and not np.allclose(a.X_OF, b.X_OF, atol=1e-6)
        ):
            raise ValueError(
                "the second plan starts with other contacts; those of the first's end are accepted"
            )
    turned = None
    if first.turned_angle is not None and second.turned_angle is not None:
        assert first.axis_W is not None
        assert second.axis_W is not None
        if np.allclose(first.axis_W, second.axis_W):
            turned = first.turned_angle + second.turned_angle
    counts = {key: first.statistics.get(key, 0) + value for key, value in second.statistics.items()}
    return replace(
        first,
        X_WO_goal=second.X_WO_goal,
        axis_W=first.axis_W if turned is not None else None,
        turned_angle=turned,
        actions=(*first.actions, *second.actions[1:]),
        statistics=counts,
    )


def build_whole_problem(problem: Problem, plan: Plan) -> Problem:
    """Return ``problem`` with the goal of the joined ``plan``, by which the whole run is judged."""
    if plan.turned_angle is not None and plan.axis_W is not None:
        x, y, z = (float(v) for v in plan.axis_W)
        goal = GoalSection(rotation=Turn((x, y, z), float(np.degrees(plan.turned_angle))))
    else:
        attitude = Rotation.from_matrix(plan.X_WO_goal[:3, :3])
        w, x, y, z = (float(v) for v in attitude.as_quat(scalar_first=True))
        goal = GoalSection(orientation_wxyz=(w, x, y, z))
    return replace(problem, goal=goal)


# -- running ---------------------------------------------------------------------------------------------------------------


def run_chain(
    name: str, problem: Problem, chain: Chain, progress: Callable[[float], None] | None = None
) -> Endurance:
    """Run a chain in one rollout and judge it.  Raises DexplanError for a chain without goals."""
    whole = build_whole_problem(problem, chain.plan)
    trace = pipeline.rollout(whole, chain.plan, progress=progress)
    report = pipeline.validate(whole, chain.plan, trace)
    address = pipeline.build_scene(whole).object_qpos
    return Endurance(name, whole, chain, trace, report, measure_goals(chain, trace, address))


def measure_goals(chain: Chain, trace: Trace, address: int) -> tuple[GoalResult, ...]:
    """Return how each goal went; the object's pose stands in qpos from ``address`` on.

    Only poses of the trace are used: the goal pose is the plan's, the object's is MuJoCo's.
    """
    pose, index = trace["qpos"][:, address : address + 7], trace["action_index"]
    reference = trace["object_pose_reference"]
    results, first = [], 0
    for number, goal in enumerate(chain.goals, start=1):
        inside = np.flatnonzero((index >= first) & (index <= goal.last_action))
        is_reached = bool((index == goal.last_action).any())
        # Unless it was the last goal, a hold that is not followed by anything was cut off.
        is_whole = is_reached and (not trace.meta["failure"] or index[-1] > goal.last_action)
        errors: list[float | None] = [None] * 5
        if is_whole:
            end = inside[-1]
            wanted = chain.plan.actions[goal.last_action].X_WO_end
            way = _compute_errors(pose[inside], reference[inside])
            turn = (
                Rotation.from_quat(pose[end, 3:], scalar_first=True)
                * Rotation.from_matrix(wanted[:3, :3]).inv()
            )
            errors = [
                float(trace["time"][end]),
                1e3 * float(np.linalg.norm(pose[end, :3] - wanted[:3, 3])),
                float(np.degrees(turn.magnitude())),
                float(way[0].max()),
                float(way[1].max()),
            ]
        results.append(GoalResult(number, goal.turn_deg, goal.placements, goal.planning_s, *errors))
        first = goal.last_action + 1
    return tuple(results)


def _compute_errors(pose: Array, reference: Array) -> tuple[Array, Array]:
    """Return distances (T,) [mm] and angles (T,) [deg] between poses (T, 7)."""
    position = 1e3 * np.linalg.norm(pose[:, :3] - reference[:, :3], axis=1)
    turns = [Rotation.from_quat(p[:, 3:], scalar_first=True) for p in (pose, reference)]
    return position, np.degrees((turns[0] * turns[1].inv()).magnitude())
