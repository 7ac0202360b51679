"""Tasks with goal contacts in up to three stages: gaits take the object some way, the grasp is adjusted, the new grasp goes on.

Where between start and goal the grasp is adjusted is what tells the paper's orders apart [paper §1]: at the goal (a), or as
early as the goal grasp can carry the object from there (b).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Literal

import numpy as np

from dexplan.grasp.closure import check_force_closure
from dexplan.grasp.grasp import Contact, Grasp
from dexplan.planning.adjustment_search import AdjustmentSearch
from dexplan.planning.admissible import Admissibility
from dexplan.planning.coordinated import ObjectMotion, center_spin, plan_coordinated
from dexplan.planning.goal import VERTICAL, RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.joining import Contacts, build_move_actions, enclose, follow_actions, without_holds
from dexplan.planning.plan import SOLVED, Action, GoalContact, Placement, Plan
from dexplan.planning.planner import Start, plan_rotation
from dexplan.planning.roll_gait import RollPlan
from dexplan.planning.rolling_start import plan_object_manipulation
from dexplan.planning.still import StillContacts, build_landings
from dexplan.spatial import Array, build_frame

GoalContacts = tuple[Array | None, ...]
"""Per finger the outward normal (3,) of its goal contact in object axes, None where it has to be free."""

SEARCH_BUDGET = 400
"""Nodes that one search for an adjustment may open."""
GAIT_BUDGET = 2000
"""Nodes that the gait before it may open."""
REST_ANGLES = tuple(np.radians((40.0, 20.0, 80.0)).tolist())
"""So much of the object's turn [rad] is left to that search, in the order in which it is tried: enough for fingers to find room
on the way, and little enough for the search to stay small."""
REST_SHIFT = 0.25
"""So much of a shift [m] counts as a turn by one radian there."""


@dataclass(eq=False)
class Stages:
    """What stays the same while ways of reaching goal contacts are tried; counts the work.

    ``opened``: nodes of all searches so far; ``exhausted``: adjustments of the start grasp that had nothing left to try.
    """

    hand: HandModel
    X_WO: Array
    start: Start
    goal: GoalContacts
    node_budget: int
    primitives: tuple[Literal["substitution", "rewind"], ...]
    opened: int = 0
    exhausted: int = 0
    hold: Plan = field(init=False)
    _known_rolls: dict[bytes, tuple[list[RollPlan], str]] = field(default_factory=dict)

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

    @property
    def _goal_contacts(self) -> tuple[GoalContact | None, ...]:
        closest = self.hand.object.surface.closest
        return tuple(None if n is None else GoalContact(f, closest(n), n) for f, n in enumerate(self.goal))

    def refuse_goal_anywhere(self) -> tuple[str, str]:
        """Return the status and the reason that refuse the goal contacts wherever the object is; "" and "" where nothing does.

        These are questions of the object and the fingertips alone: where contacts are allowed, whether tips overlap, and force
        closure with the believed friction.
        """
        surface, names = self.hand.object.surface, [f.name for f in self.hand.fingers]
        wanted = [(f, n) for f, n in enumerate(self.goal) if n is not None]
        for f, n in wanted:
            if not self.hand.object.allows(n[None])[0]:
                return "goal_not_allowed", (
                    f"the goal contact of {names[f]} lies outside object.allowed_regions; move it inside, or widen a region"
                )
        for (f, n), (g, m) in combinations(wanted, 2):
            tips = [self.hand.fingers[k].tip_radius for k in (f, g)]
            between = np.linalg.norm(surface.closest(n) + tips[0] * n - surface.closest(m) - tips[1] * m)
            if (gap := between - sum(tips)) < self.hand.limits.clearance:
                return "goal_grasp_inadmissible", (
                    f"the tips of {names[f]} and {names[g]} would come within {1e3 * gap:.1f} mm at their goal contacts, and "
                    f"{1e3 * self.hand.limits.clearance:.1f} mm have to be left; move the two contacts apart"
                )
        grasp = Grasp(
            tuple(Contact(f, surface.closest(n), build_frame(-n), self.hand.friction) for f, n in wanted)
        )
        if not check_force_closure(grasp).is_closed:
            return "goal_grasp_inadmissible", (
                "the goal contacts are not force closed with the believed friction; move two of them nearer to opposite, raise "
                "the friction, or lower friction.safety"
            )
        return "", ""

    def refuse_goal(self, X_WO: Array, contacts: Contacts) -> str:
        """Return why the goal grasp cannot hold the object at ``X_WO`` (4, 4); "" where it can."""
        still = StillContacts(self.hand, X_WO, self.admissibility)
        stand = tuple(None if c is None else still.add(c) for c in contacts)
        return still.judge(stand).refusal

    def explain_end(self, why: str) -> str:
        """Return ``why`` with what would help; where everything was tried from the start grasp, friction is what was short."""
        if not self.exhausted:
            return f"{why}; {suggest_cure(why)}"
        apart = np.degrees(np.arccos(StillContacts(self.hand, self.X_WO, self.admissibility).opposite))
        return (
            f"{why}; every grasp that the start grasp leads to was tried, and with the believed friction two fingers hold alone "
            f"only where they are {apart:.0f} deg or more apart; raise the friction, lower friction.safety, choose another start "
            f"grasp, or {suggest_cure(why)}"
        )

    def run(
        self,
        before: ObjectMotion,
        after: ObjectMotion,
        *,
        is_attitude: bool = True,
        is_simultaneous: bool = False,
        budget: int = SEARCH_BUDGET,
        rests: tuple[float, ...] | None = None,
    ) -> tuple[tuple[Action, ...], Contacts, str]:
        """Plan one way: the object goes through ``before``, the goal grasp is made, and carries it through ``after``.

        ``is_attitude``: any way to the end of ``before`` will do.  ``is_simultaneous``: goal contacts may be taken on the way.
        ``budget`` bounds the nodes of every search; ``rests`` are the shares of ``before`` that are left to it, by default those
        of :func:`choose_rests`.
        Returns the actions (none where it fails), the start contacts, and why it fails.
        """
        X_WO = after.X_WO_start
        goal, missing = self.land_goal(X_WO)
        if missing:
            return (), (), f"{missing} cannot reach the goal contact where the grasp would be adjusted"
        goal = tuple(None if c is None else center_spin(self.hand, c, after) for c in goal)
        if refusal := self.refuse_goal(X_WO, goal):
            return (), (), f"the goal grasp does not hold where it would be made: {refusal}"
        if not after.is_still:
            _, refusal = plan_coordinated(self.hand, self.admissibility, goal, after, "")
            if refusal:
                return (), (), f"the goal grasp cannot carry the object to the goal: {refusal}"
        why = ""
        for rest in choose_rests(before) if rests is None else rests:
            first, start, refused = self._gait(before, rest, is_attitude)
            if not refused:
                here = follow_actions(self.hand, start, first)
                search = AdjustmentSearch(
                    self.hand,
                    self.admissibility,
                    (here,),
                    goal,
                    before.part(1.0 - rest, 1.0),
                    is_simultaneous,
                    known_rolls=self._known_rolls,
                )
                found = search.run(min(budget, self.node_budget))
                self.opened += found.opened
                self.exhausted += found.is_exhausted and not first
                if found.moves is None:
                    refused = f"no way from the grasp there to the goal grasp: {found.reason}"
                else:
                    moves = build_move_actions(found.moves, here, after.axis_W)
                    last, refused = self._finish(follow_actions(self.hand, here, moves), after)
                    if not refused:
                        return (*first, *moves, *last), start, ""
            why = why or refused
        return (), (), why

    def _gait(
        self, motion: ObjectMotion, rest: float, is_attitude: bool
    ) -> tuple[tuple[Action, ...], Contacts, str]:
        """Return the gait that takes the object through all of ``motion`` but its last share ``rest``."""
        if motion.is_still or rest == 1.0:
            return (), self.hold.start_contacts, ""
        part = motion.part(0.0, 1.0 - rest)
        goal = RotationGoal(self.X_WO, part.axis_W, part.angle, part.shift_W, is_attitude)
        nodes = min(GAIT_BUDGET, self.node_budget)
        moved = plan_object_manipulation(self.hand, goal, self.start, nodes, self.primitives)
        self.opened += int(moved.statistics.get("nodes", 0))
        if not moved.is_solved:
            return (), (), f"the object cannot be brought there ({moved.status}: {moved.reason})"
        return without_holds(moved.actions), moved.start_contacts, ""

    def _finish(self, contacts: Contacts, after: ObjectMotion) -> tuple[tuple[Action, ...], str]:
        """Return the coordinated manipulation with the goal grasp as it was really made, or why it is not possible."""
        if after.is_still:
            return (), ""
        why = "coordinated manipulation with the goal grasp reaches the goal"
        action, refusal = plan_coordinated(self.hand, self.admissibility, contacts, after, why)
        if action is None:
            return (), f"the goal grasp cannot carry the object to the goal: {refusal}"
        return (action,), ""

    def build_plan(self, kind: str, goal: RotationGoal, actions: tuple[Action, ...], start: Contacts) -> Plan:
        """Return the plan made of ``actions``."""
        return replace(
            self.hold,
            status=SOLVED,
            reason="",
            goal_kind=kind,
            goal_contacts=self._goal_contacts,
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
            goal_contacts=self._goal_contacts,
            X_WO_goal=goal.X_WO_goal,
            axis_W=goal.axis_W,
            turned_angle=None if goal.is_attitude else goal.angle,
            actions=(),
            statistics={"nodes": self.opened},
        )


def suggest_cure(refusal: str) -> str:
    """Return what would help against a refusal of a grasp or of the way to it."""
    if "obstacle" in refusal or "floor" in refusal:
        return "move or shrink what is in the way, or choose goal contacts or a goal pose farther from it"
    if "come within" in refusal or "too near" in refusal:
        return "move the goal contacts of these fingers apart, or towards where the fingers stand"
    if any(word in refusal for word in ("joint", "singular", "workspace", "order", "reach")):
        return "move the goal contacts towards where the fingers stand, and keep the fingers' clockwise order"
    return "move two of the goal contacts nearer to opposite, raise the friction, lower friction.safety, or use a lighter object"


def choose_rests(motion: ObjectMotion) -> tuple[float, ...]:
    """Return the shares of a motion that are left to the search that adjusts the grasp; gaits do what comes before."""
    if motion.is_still:
        return (0.0,)
    size = max(abs(motion.angle), float(np.linalg.norm(motion.shift_W)) / REST_SHIFT)
    shares = [min(1.0, angle / size) for angle in REST_ANGLES]
    return tuple(dict.fromkeys(shares))


def rest_at(X_WO: Array) -> ObjectMotion:
    """Return no motion, at ``X_WO`` (4, 4)."""
    return ObjectMotion(X_WO, VERTICAL, 0.0, np.zeros(3))
