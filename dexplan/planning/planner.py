"""From a goal to a plan: reads the start, runs the search, and says in words why where there is no plan."""

from __future__ import annotations

from dexplan.planning.contacts import ContactTable
from dexplan.planning.gaits import build_actions
from dexplan.planning.goal import RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.plan import SOLVED, Action, Placement, Plan
from dexplan.planning.search import CURE, GaitSearch
from dexplan.spatial import Array


def refuse(
    hand: HandModel,
    goal: RotationGoal,
    status: str,
    reason: str,
    contacts: tuple[Placement | None, ...] | None = None,
) -> Plan:
    """Return the plan that says why there is none."""
    nothing: tuple[Placement | None, ...] = (None,) * len(hand.fingers)
    return _answer(hand, goal, status, reason, contacts or nothing, (), {})


def _answer(
    hand: HandModel,
    goal: RotationGoal,
    status: str,
    reason: str,
    contacts: tuple[Placement | None, ...],
    actions: tuple[Action, ...],
    statistics: dict[str, float],
) -> Plan:
    return Plan(
        status=status,
        reason=reason,
        fingers=tuple(f.name for f in hand.fingers),
        goal_kind="object_manipulation",
        X_WO_start=goal.X_WO_start,
        X_WO_goal=goal.X_WO_goal,
        axis_W=goal.axis_W,
        turned_angle=goal.angle,
        start_contacts=contacts,
        actions=actions,
        normal_force=hand.normal_force,
        statistics=statistics,
    )


def plan_rotation(
    hand: HandModel, goal: RotationGoal, start: tuple[Array | None, ...] | None, node_budget: int
) -> Plan:
    """Return a plan that turns the object by ``goal.angle`` about ``goal.axis_W`` with finger substitution.

    ``start`` holds the outward normals (3,) in W where the fingers touch at first, None for a free finger; or is None where
    the planner may choose.  No plan is an answer with a status, not an exception.
    """
    table = ContactTable(hand, goal)
    held = table.prepare(start if start is not None else (None,) * len(hand.fingers))
    contacts: tuple[Placement | None, ...] = (None,) * len(hand.fingers)
    if start is None:
        grasps = table.start_pairs()
        if not grasps:
            return refuse(
                hand,
                goal,
                "no_force_closure_pair",
                f"no two fingers reach contacts {table.needed_angle()}; {CURE}",
            )
    else:
        for finger, normal in enumerate(start):
            if normal is not None and held[finger] is None:
                return refuse(
                    hand,
                    goal,
                    "start_unreachable",
                    f"{hand.fingers[finger].name} cannot hold its start contact: it lies outside the finger's workspace or "
                    'against a joint limit; move the contact towards the finger, or set start.contacts_deg = "auto"',
                )
            if normal is not None and not table.allows(normal, 0):
                return refuse(
                    hand,
                    goal,
                    "start_not_allowed",
                    f"the start contact of {hand.fingers[finger].name} lies outside object.allowed_regions; move it inside, "
                    'or set start.contacts_deg = "auto"',
                )
        contacts = tuple(None if h is None else table.placement(h, 0) for h in held)
        grasps = [tuple(h for h in held if h is not None)]
    search = GaitSearch(table, node_budget)
    refusal = "" if start is None else search.margins(grasps[0]).refusal
    if refusal and table.has_pair(grasps[0]):
        reason = (
            f"the start contacts do not hold the object: {refusal}; move them nearer to opposite, or {CURE}"
        )
        return _answer(hand, goal, "start_inadmissible", reason, contacts, (), search.statistics)
    node, status, why = search.run(grasps)
    if node is None and start is not None and not table.has_pair(grasps[0]):
        reason = (
            f"no two of the start contacts are {table.needed_angle()}, so no finger can be lifted, and the goal lies beyond what "
            "this grasp can do alone; the plan would have to begin with rolling, which is not built yet; move two contacts "
            f"apart, or {CURE}"
        )
        return _answer(hand, goal, "no_admissible_pair", reason, contacts, (), search.statistics)
    if node is None:
        return _answer(hand, goal, status, why, contacts, (), search.statistics)
    steps = search.steps(node)
    first: list[Placement | None] = [None] * len(hand.fingers)
    for placement in steps[0].contacts:
        first[placement.finger] = placement
    actions = build_actions(steps, tuple(first), goal.axis_W)
    return _answer(hand, goal, SOLVED, "", tuple(first), actions, search.statistics)
