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
    refused: list[Plan] = []
    left, is_cut = node_budget - int(plan.statistics["nodes"]), False
    for number, option in enumerate(islice(rolling.options(), OPTIONS + 1)):
        # One budget for all: what an option leaves is for those after it.
        share = left // (OPTIONS - number) if number < OPTIONS else 0
        if share < 1:
            is_cut = True
            break
        after = tuple(None if c is None or c.finger == option.lifted else c.X_OF for c in option.contacts)
        rest = plan_rotation(hand, goal, after, share, primitives, improvement)
        left -= int(rest.statistics["nodes"])
        if rest.is_solved:
            return _join(hand, goal, plan, option, rest)
        refused.append(rest)
    if not refused and not is_cut:
        return replace(plan, reason=f"{plan.reason}; rolling cannot make one: {rolling.explain()}")
    # Where a search was cut short there may be a gait after all: its words go first, and its status is the plan's.
    telling = next((r for r in refused if r.status == "budget_exhausted"), refused[0] if refused else plan)
    status = "budget_exhausted" if is_cut or telling.status == "budget_exhausted" else plan.status
    tried = f"{len(refused)} ways tried" if len(refused) > 1 else "one way tried"
    found = (
        f"after rolling ({tried}): {telling.status}: {telling.reason}" if refused else "rolling comes first"
    )
    if is_cut and len(refused) < OPTIONS:
        found += f"; the search gave up with ways to roll left; raise gait.node_budget above {node_budget}"
    elif is_cut:
        found += "; the search gave up, for there are more ways to roll; choose another start grasp"
    return replace(plan, status=status, reason=f"{plan.reason}; {found}")


def _join(hand: HandModel, goal: RotationGoal, start: Plan, option: RollPlan, rest: Plan) -> Plan:
    """Return the plan that holds, rolls, lifts the finger that is no longer needed, and goes on with ``rest``.

    Nothing rolls where a pair holds alone as it stands and lifting the third finger is all that helps.
    """
    still = {"X_WO_start": goal.X_WO_start, "X_WO_end": goal.X_WO_start, "axis_W": goal.axis_W, "angle": 0.0}
    hold = build_hold(list(start.start_contacts), still, "let the grasp settle")
    roll, lift = build_roll_actions(option, hand, goal.X_WO_start, goal.axis_W)
    if start.status != "no_admissible_pair":
        roll = replace(
            roll, why="no gait was found from the start contacts; rolled, they make a grasp with one"
        )
        i, j = (hand.fingers[f].name for f in option.pair)
        lift = replace(lift, why=f"{i} and {j} hold alone, and a gait begins with them")
    first = (hold, roll, lift) if option.rolls else (hold, lift)
    return replace(rest, start_contacts=start.start_contacts, actions=(*first, *rest.actions[1:]))
