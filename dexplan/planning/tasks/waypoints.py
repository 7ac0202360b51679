"""Several goals in a row: one plan after another, each from the grasp with which the one before ended.

The hold that ends a piece marks its waypoint: there the object is where that goal asks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from dexplan.planning.actions.joining import follow_actions
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import Action, Hold
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan

PlanOne = Callable[[RotationGoal, Start], Plan]
"""Returns the plan for one goal from one start."""


def plan_waypoints(hand: HandModel, goals: tuple[RotationGoal, ...], start: Start, plan_one: PlanOne) -> Plan:
    """Return one plan for all ``goals``, each planned by ``plan_one`` from the contacts with which the one before ended.

    Args:
        hand: the hand with its object.
        goals: one or more, each beginning at the pose where the one before ends.
        start: the contacts before the first goal.
        plan_one: plans one of them.

    Returns:
        The joined plan.  Where one waypoint has no plan, its status and refusal, and the actions as far as they go; the
        reason says which waypoint it is.
    """
    pieces: list[Plan] = []
    actions: tuple[Action, ...] = ()
    for number, goal in enumerate(goals, start=1):
        piece = plan_one(goal, start)
        pieces.append(piece)
        # The hold that marks the waypoint before is the one in which the next piece settles.
        actions += piece.actions[1:] if actions else piece.actions
        if not piece.is_solved:
            break
        if number < len(goals):
            actions = (*actions[:-1], _mark(actions[-1], number, len(goals)))
        start = follow_actions(hand, piece.start_contacts, piece.actions)
    last = pieces[-1]
    reason = last.reason if last.is_solved else f"waypoint {len(pieces)} of {len(goals)}: {last.reason}"
    counts: dict[str, float] = {}
    for piece in pieces:
        for key, value in piece.statistics.items():
            counts[key] = counts.get(key, 0.0) + value
    return replace(
        last,
        reason=reason,
        X_WO_start=goals[0].X_WO_start,
        X_WO_goal=goals[-1].X_WO_goal,
        axis_W=None,
        turned_angle=None,
        start_contacts=pieces[0].start_contacts,
        actions=actions,
        statistics={**counts, "waypoints": float(sum(piece.is_solved for piece in pieces))},
    )


def _mark(action: Action, number: int, count: int) -> Action:
    """Return the hold that ends a piece as the mark of its waypoint."""
    assert isinstance(action, Hold)
    return replace(action, why=f"waypoint {number} of {count} is reached")
