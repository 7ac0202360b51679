"""Tasks with goal contacts in up to three stages: gaits take the object some way, the grasp is adjusted, the new grasp goes on.

Where between start and goal the grasp is adjusted is what tells the paper's orders apart [paper §1]: at the goal (a), or as
early as the goal grasp can carry the object from there (b).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from dexplan.planning.adjustment_search import AdjustmentSearch
from dexplan.planning.admissible import Admissibility
from dexplan.planning.coordinated import ObjectMotion, center_spin, plan_coordinated
from dexplan.planning.goal import VERTICAL, RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.joining import Contacts, build_move_actions, enclose, follow_actions, without_holds
from dexplan.planning.plan import SOLVED, Action, Placement, Plan
from dexplan.planning.planner import Start, plan_rotation
from dexplan.planning.rolling_start import plan_object_manipulation
from dexplan.planning.still import StillContacts, build_landings
from dexplan.spatial import Array

GoalContacts = tuple[Array | None, ...]
"""Per finger the outward normal (3,) of its goal contact in object axes, None where it has to be free."""


@dataclass(eq=False)
class Stages:
    """What stays the same while ways of reaching goal contacts are tried; counts the work."""

    hand: HandModel
    X_WO: Array
    start: Start
    goal: GoalContacts
    node_budget: int
    primitives: tuple[Literal["substitution", "rewind"], ...]
    opened: int = 0
    hold: Plan = field(init=False)

    def __post_init__(self) -> None:
        self.admissibility = Admissibility(self.hand)
        # Holding still is the simplest object manipulation: it settles the start contacts, or says what is wrong with them.
        self.hold = plan_rotation(
            self.hand, RotationGoal(self.X_WO, VERTICAL, 0.0), self.start, self.node_budget, self.primitives
        )

    @property
    def start_refusal(self) -> str:
        """The status that refuses the start contacts; "" where they hold."""
        return "" if self.hold.is_solved or self.hold.status == "no_admissible_pair" else self.hold.status

    def land_goal(self, X_WO: Array) -> tuple[Contacts, str]:
        """Return the goal contacts with the object at ``X_WO`` (4, 4), and which finger cannot reach its own ("" if all can)."""
        found: list[Placement | None] = []
        missing = []
        for finger, normal in enumerate(self.goal):
            if normal is None:
                found.append(None)
                continue
            placement = build_landings(self.hand, X_WO, finger, normal[None])[0]
            found.append(placement)
            if placement is None:
                missing.append(self.hand.fingers[finger].name)
        return tuple(found), " and ".join(missing)

    def refuse_goal(self, X_WO: Array, contacts: Contacts) -> str:
        """Return why the goal grasp cannot hold the object at ``X_WO`` (4, 4); "" where it can."""
        still = StillContacts(self.hand, X_WO, self.admissibility)
        stand = tuple(None if c is None else still.add(c) for c in contacts)
        return still.judge(stand).refusal

    def run(self, gait: RotationGoal | None, after: ObjectMotion) -> tuple[tuple[Action, ...], Contacts, str]:
        """Plan one way: gaits to ``gait`` (None: the object stays), adjust, carry through ``after`` with the goal grasp.

        Returns the actions (none where it fails), the start contacts, and why it fails.
        """
        X_WO = after.X_WO_start
        goal, missing = self.land_goal(X_WO)
        if missing:
            return (), (), f"{missing} cannot reach the goal contact where the grasp would be adjusted"
        goal = tuple(None if c is None else center_spin(self.hand, c, after) for c in goal)
        if refusal := self.refuse_goal(X_WO, goal):
            return (), (), f"the goal grasp does not hold where it would be made: {refusal}"
        last: tuple[Action, ...] = ()
        if not after.is_still:
            why = "coordinated manipulation with the goal grasp reaches the goal"
            action, refusal = plan_coordinated(self.hand, self.admissibility, goal, after, why)
            if action is None:
                return (), (), f"the goal grasp cannot carry the object to the goal: {refusal}"
            last = (action,)
        first: tuple[Action, ...] = ()
        start = self.hold.start_contacts
        if gait is not None:
            moved = plan_object_manipulation(self.hand, gait, self.start, self.node_budget, self.primitives)
            self.opened += int(moved.statistics.get("nodes", 0))
            if not moved.is_solved:
                return (), (), f"the object cannot be brought there ({moved.status}: {moved.reason})"
            first, start = without_holds(moved.actions), moved.start_contacts
        here = follow_actions(self.hand, start, first)
        still = StillContacts(self.hand, X_WO, self.admissibility)
        search = AdjustmentSearch(still, here, goal)
        found = search.run(self.node_budget)
        self.opened += found.opened
        if found.moves is None:
            return (), (), f"no way from the grasp there to the goal grasp: {found.reason}"
        moves = build_move_actions(found.moves, here, X_WO, after.axis_W)
        if found.moves and last:
            # Fingers that were rolled to their goals do not stand as they would have landed.
            held = follow_actions(self.hand, here, moves)
            action, refusal = plan_coordinated(self.hand, self.admissibility, held, after, last[0].why)
            if action is None:
                return (), (), f"the goal grasp cannot carry the object to the goal: {refusal}"
            last = (action,)
        return (*first, *moves, *last), start, ""

    def build_plan(self, kind: str, goal: RotationGoal, actions: tuple[Action, ...], start: Contacts) -> Plan:
        """Return the plan made of ``actions``."""
        return replace(
            self.hold,
            status=SOLVED,
            reason="",
            goal_kind=kind,
            X_WO_goal=goal.X_WO_goal,
            axis_W=goal.axis_W,
            turned_angle=None if goal.is_attitude else goal.angle,
            start_contacts=start,
            actions=enclose(actions, start, self.X_WO, goal.axis_W),
            statistics={"nodes": self.opened},
        )

    def refuse(self, kind: str, goal: RotationGoal, status: str, reason: str) -> Plan:
        """Return the plan that says why there is none."""
        return replace(
            self.hold,
            status=status,
            reason=reason,
            goal_kind=kind,
            X_WO_goal=goal.X_WO_goal,
            axis_W=goal.axis_W,
            turned_angle=None if goal.is_attitude else goal.angle,
            actions=(),
            statistics={"nodes": self.opened},
        )


def rest_at(X_WO: Array) -> ObjectMotion:
    """Return no motion, at ``X_WO`` (4, 4)."""
    return ObjectMotion(X_WO, VERTICAL, 0.0, np.zeros(3))
