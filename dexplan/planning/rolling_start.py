"""Object manipulation from any start grasp: gaits at once where two fingers hold, rolling first where no two do [paper §1].

"If the initial grasp uses all fingers, then use rolling to obtain a FC grasp that leaves at least one finger not used in the
grasp."
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from typing import Literal

from dexplan.planning.admissible import Admissibility
from dexplan.planning.cost import Improvement
from dexplan.planning.gaits import build_hold
from dexplan.planning.goal import RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.plan import Plan
from dexplan.planning.planner import FIRST, Start, plan_rotation
from dexplan.planning.roll_gait import RollPlan, RollToPair, build_roll_actions

OPTIONS = 8
"""Ways to roll that are tried before the goal is given up."""


def plan_object_manipulation(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    node_budget: int,
    primitives: tuple[Literal["substitution", "rewind"], ...] = ("substitution",),
    improvement: Improvement = FIRST,
) -> Plan:
    """Return a plan that takes the object to ``goal``; arguments as in :func:`plan_rotation`."""
    plan = plan_rotation(hand, goal, start, node_budget, primitives, improvement)
    stuck = ("no_admissible_pair", "no_gait", "budget_exhausted")
    if plan.status not in stuck or sum(c is not None for c in plan.start_contacts) < 3:
        return plan
    rolling = RollToPair(hand, goal.X_WO_start, plan.start_contacts, Admissibility(hand))
    refused = ""
    for option in islice(rolling.options(), OPTIONS):
        after = tuple(None if c is None or c.finger == option.lifted else c.X_OF for c in option.contacts)
        rest = plan_rotation(hand, goal, after, node_budget, primitives, improvement)
        if rest.is_solved:
            return _join(hand, goal, plan, option, rest)
        refused = refused or f"{rest.status}: {rest.reason}"
    why = f"after rolling: {refused}" if refused else f"rolling cannot make one: {rolling.explain()}"
    return replace(plan, reason=f"{plan.reason}; {why}")


def _join(hand: HandModel, goal: RotationGoal, start: Plan, option: RollPlan, rest: Plan) -> Plan:
    """Return the plan that holds, rolls, lifts the finger that is no longer needed, and goes on with ``rest``."""
    still = {"X_WO_start": goal.X_WO_start, "X_WO_end": goal.X_WO_start, "axis_W": goal.axis_W, "angle": 0.0}
    hold = build_hold(list(start.start_contacts), still, "let the grasp settle")
    roll, lift = build_roll_actions(option, hand, goal.X_WO_start, goal.axis_W)
    return replace(rest, start_contacts=start.start_contacts, actions=(hold, roll, lift, *rest.actions[1:]))
