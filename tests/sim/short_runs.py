"""Short problems through the whole hand, planned and simulated once per process, shared by the tests beside this file."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from dexplan import pipeline
from dexplan.control.options import ControlOptions
from dexplan.control.reference import Reference, build_reference
from dexplan.planning.actions.gaits import build_actions
from dexplan.planning.gait.steps import Step
from dexplan.plans.phases import PlannedPhase
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.plans.timing import Timing
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.record.rollout import Truth, rollout
from dexplan.sim.trace import Trace

PROFILES = ("firm", "portable")
HOLDS: dict[str, tuple[str, list[object]]] = {
    "hold_three": ("hold_three", [[0.0, 0.0], [120.0, 0.0], [240.0, 0.0]]),
    "hold_12": ("hold_two", [[-40.0, 0.0], [104.0, 0.0], "free"]),
    "hold_23": ("hold_two", ["free", [80.0, 0.0], [224.0, 0.0]]),
    "hold_31": ("hold_two", [[20.0, 0.0], "free", [236.0, 0.0]]),
}
"""Holding still with three fingers and with each pair: built-in problem and start contacts."""
SHORT_TURN: dict[str, object] = {
    "goal.rotation.angle_deg": 15.0,
    "start.contacts_deg": [[36.0, 0.0], [180.0, 0.0], "free"],
}
"""Finger 2 starts near the end of its reach, so that 15 degrees take one substitution (finger 3 for 2)."""
HOLD_TIMING = Timing(first_hold=0.5, last_hold=1.5)
"""Two seconds in all."""

DROPPED = {"not_dropped", "position_error_max", "contact_schedule", "phases_in_order"}
"""Seen in every run that loses the object before its end."""


@lru_cache
def hold_problem(name: str, profile: str) -> Problem:
    """Return the problem of holding still, one of :data:`HOLDS`."""
    built_in, contacts = HOLDS[name]
    return load_problem(built_in, {"start.contacts_deg": contacts, "control.physics_profile": profile})


@lru_cache
def turn_problem(profile: str = "firm") -> Problem:
    """Return the short turn's problem."""
    return load_problem("fig4_substitution", {**SHORT_TURN, "control.physics_profile": profile})


@lru_cache
def plan_of(problem: Problem) -> Plan:
    """Return the plan, found once per process."""
    plan = pipeline.plan(problem)
    if problem.name == "hold_three" and plan.status == "no_admissible_pair":
        # Nothing is lifted in a hold, so the grasp the planner was given is the whole plan.
        contacts = tuple(c for c in plan.start_contacts if c is not None)
        step = Step(contacts, plan.X_WO_start, plan.X_WO_start, 0.0, None, None, (None, "the goal"))
        assert plan.axis_W is not None
        actions = build_actions([step], plan.start_contacts, plan.axis_W)
        solved = replace(plan, status=Status.SOLVED, reason="", actions=actions)
        return pipeline.time_plan(problem, solved)
    assert plan.is_solved, plan.reason
    return plan


@lru_cache
def trace_of(problem: Problem, timing: Timing | None = None) -> Trace:
    """Return the honest run of the problem's plan, simulated once per process."""
    return simulate(problem, build_plan_reference(problem, plan_of(problem), timing))


@lru_cache
def report_of(problem: Problem, timing: Timing | None = None) -> ValidationReport:
    """Return the judgement of :func:`trace_of`."""
    return pipeline.validate(problem, plan_of(problem), trace_of(problem, timing))


def build_plan_reference(problem: Problem, plan: Plan, timing: Timing | None = None) -> Reference:
    """Return the plan's reference, with the problem's timing unless another is given."""
    return build_reference(pipeline.time_plan(problem, plan, timing))


def simulate(
    problem: Problem,
    reference: Reference,
    options: ControlOptions | None = None,
    truth: Truth | None = None,
) -> Trace:
    """Return the run of any reference on the problem's scene."""
    return rollout(
        pipeline.build_scene(problem),
        reference,
        options or pipeline.build_options(problem),
        truth=truth,
        meta={"problem": problem.name, "seed": problem.seed},
    )


def with_truth(
    problem: Problem,
    *,
    mass_kg: float | None = None,
    sliding: float | None = None,
    torsional_m: float | None = None,
) -> Problem:
    """Return the world of ``problem`` with another mass and friction; torsional friction goes with sliding unless it is given."""
    ball, friction = problem.object, problem.friction
    sliding = friction.sliding if sliding is None else sliding
    share = sliding / friction.sliding
    return replace(
        problem,
        object=replace(ball, mass_kg=ball.mass_kg if mass_kg is None else mass_kg),
        friction=replace(
            friction,
            sliding=sliding,
            torsional_m=share * friction.torsional_m if torsional_m is None else torsional_m,
        ),
    )


def failed(report: ValidationReport) -> set[str]:
    """Return the names of the checks that failed."""
    return {check.name for check in report.failures}


def lift_wrong_finger(problem: Problem, plan: Plan) -> Plan:
    """Return the plan with the first lift taking the partner instead, and everything after it as that leaves it."""
    actions = list(plan.actions)
    index = next(k for k, action in enumerate(actions) if action.name == "lift")
    right, before = actions[index].finger, actions[index - 1].contacts_end
    placed = actions[index - 1].finger
    wrong = next(k for k, c in enumerate(before) if c is not None and k not in (right, placed))
    after = tuple(None if k == wrong else c for k, c in enumerate(before))
    order = list(range(len(after)))
    order[right], order[wrong] = wrong, right

    def exchange(phase: PlannedPhase) -> PlannedPhase:
        return PlannedPhase(phase.name, tuple(phase.touch[k] for k in order))

    for k in range(index, len(actions)):
        actions[k] = replace(
            actions[k],
            **({"finger": wrong} if k == index else {}),
            grasping=tuple(i for i, c in enumerate(after) if c is not None),
            contacts_end=after,
            phases=tuple(map(exchange, actions[k].phases)),
        )
    return pipeline.time_plan(problem, replace(plan, actions=tuple(actions)))
