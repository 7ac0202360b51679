"""Tasks with goal contacts in up to three stages: gaits take the object some way, the grasp is adjusted, the new grasp goes on.

Where between start and goal the grasp is adjusted is what tells the paper's orders apart [paper §1]: at the goal (a), or as
early as the goal grasp can carry the object from there (b).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np

from dexplan.planning.actions.coordinated import center_spin, plan_coordinated
from dexplan.planning.actions.joining import build_move_actions, enclose, follow_actions
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.tip_rotation import refuse_rotation
from dexplan.planning.contacts.still import StillContacts, build_landings
from dexplan.planning.gait.cost import Improvement, compute_actions_cost
from dexplan.planning.regrasp.goal_side import GoalSide
from dexplan.planning.regrasp.search import AdjustmentSearch
from dexplan.planning.rolling.roll_gait import RollPlan
from dexplan.planning.tasks.ends import BUDGETS, Beginning, End, Ends, choose_beginnings
from dexplan.planning.tasks.goal_refusals import GoalContacts
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.object_manipulation import FIRST, Start, plan_rotation
from dexplan.planning.tasks.passes import (
    NOT_BEGUN,
    Outcome,
    Pass,
    Passes,
    Stop,
    choose_rests,
    scale_work,
)
from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts, GoalContact, Placement
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.spatial import VERTICAL, Array

SEARCH_BUDGET = 160
"""Nodes that one search for an adjustment may open."""
GAIT_WORK = 6
"""A node of the gait before it takes so many times as long."""
LEAST_WORK_REPEATED = 30
"""At least so much work counts when better plans are looked for as long again."""
SIDE_WORK, ROLLED_SIDE_WORK = 10, 30
"""A look at the goal's side takes as long as so many nodes; rolling a goal grasp apart takes longer."""
MORE_WORK = 120
"""Work that looking for one more end of a gait may take."""
ENDS = 4
"""Ends of gaits from which an adjustment is tried."""


def _stop_at_goal(why: Refusal) -> Outcome:
    return Outcome(why=why, stop=Stop.GOAL_GRASP)


@dataclass(eq=False)
class _Attempt:
    """One way on which the grasp is adjusted: its search, the ends of gaits, and those from which it has begun."""

    search: AdjustmentSearch
    ends: Ends
    asked: int = 0
    begun: list[End] = field(default_factory=list)
    refused: Outcome = NOT_BEGUN
    is_over: bool = False


@dataclass(eq=False)
class Stages:
    """What stays the same while ways of reaching goal contacts are tried; counts the work.

    ``opened``: nodes of all searches so far; ``work``: the same, those of gaits counted as often as they take longer;
    ``exhausted``: adjustments of the start grasp that had nothing left to try.
    """

    hand: HandModel
    X_WO: Array
    start: Start
    goal: GoalContacts
    node_budget: int
    primitives: tuple[Literal["substitution", "rewind"], ...]
    improvement: Improvement = FIRST
    opened: int = 0
    work: int = 0
    exhausted: int = 0
    hold: Plan = field(init=False)
    _known_rolls: dict[bytes, tuple[list[RollPlan], Refusal | None]] = field(default_factory=dict)
    _sides: dict[bytes, GoalSide] = field(default_factory=dict)
    _gaits: dict[bytes, Ends] = field(default_factory=dict)
    _attempts: dict[bytes, _Attempt] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.admissibility = Admissibility(self.hand)
        # Holding still settles the start contacts, or says what is wrong with them.
        self.hold = plan_rotation(
            self.hand, RotationGoal(self.X_WO, VERTICAL, 0.0), self.start, self.node_budget, self.primitives
        )

    @property
    def is_start_refused(self) -> bool:
        """Whether the start contacts do not hold: then :attr:`hold` says why."""
        return self.hold.status not in (Status.SOLVED, Status.NO_ADMISSIBLE_PAIR)

    def land_goal(self, X_WO: Array) -> tuple[Contacts, tuple[str, ...]]:
        """Return the goal contacts with the object at ``X_WO`` (4, 4), and which fingers cannot reach their own, by name."""
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
        return tuple(found), tuple(missing)

    @property
    def _goal_contacts(self) -> tuple[GoalContact | None, ...]:
        radial = self.hand.object.surface.radial
        return tuple(None if n is None else GoalContact(f, radial(n), n) for f, n in enumerate(self.goal))

    def refuse_goal(self, X_WO: Array, contacts: Contacts) -> Refusal | None:
        """Return why the goal grasp cannot hold the object at ``X_WO`` (4, 4); None where it can."""
        still = StillContacts(self.hand, X_WO, self.admissibility)
        stand = tuple(None if c is None else still.add(c) for c in contacts)
        return still.judge(stand).refusal

    def run(
        self,
        before: ObjectMotion,
        after: ObjectMotion,
        *,
        is_attitude: bool = True,
        is_simultaneous: bool = False,
        budget: int = SEARCH_BUDGET,
        limit: float = np.inf,
        part: Pass | None = None,
        cost_limit: float = np.inf,
    ) -> Outcome:
        """Plan one way: the object goes through ``before``, the goal grasp is made, and carries it through ``after``.

        ``is_attitude``: any way to the end of ``before`` will do.  ``is_simultaneous``: goal contacts may be taken on the way.
        ``budget`` bounds the nodes of every search, ``limit`` the work done before one is begun; ``part`` says which share of
        ``before`` is left to the search and how much is tried, by default all shares, one after another.  Asked again for the
        same way with more, it goes on where it stopped.  ``cost_limit``: what costs as much for sure is left out.
        """
        X_WO = after.X_WO_start
        goal, missing = self.land_goal(X_WO)
        if missing:
            return _stop_at_goal(Refusal(RefusalKind.GOAL_CONTACT_OUT_OF_REACH, missing))
        goal = tuple(None if c is None else center_spin(self.hand, c, after) for c in goal)
        if refusal := self.refuse_goal(X_WO, goal):
            return _stop_at_goal(Refusal(RefusalKind.GOAL_GRASP_FAILS, because=(refusal,)))
        if not after.is_still:
            _, refusal = plan_coordinated(self.hand, self.admissibility, goal, after, "")
            if refusal:
                return _stop_at_goal(Refusal(RefusalKind.CANNOT_CARRY_TO_GOAL, because=(refusal,)))
        side = self._approach(X_WO, goal)
        if side.refusal and not before.is_still:
            # Rolls are tried in a few steps only: that none of them did is no proof.
            why = Refusal(RefusalKind.NO_WAY_IN, because=(side.refusal,))
            return Outcome(why=why, stop=Stop.ENTRY, gave_up=side.is_rolled)
        shares, refused = choose_rests(before), list[Outcome]()
        for k in range(len(shares)) if part is None else (part.rest,):
            if self.work >= limit:
                refused.append(NOT_BEGUN)
                break
            asked = Pass(k, ENDS, len(BUDGETS) - 1) if part is None else part
            found = self._adjust(
                side, before, shares[k], after, is_attitude, is_simultaneous, budget, limit, asked, cost_limit
            )
            if found.is_found:
                return found
            refused.append(found)
        return replace(refused[0], gave_up=any(r.gave_up for r in refused))

    def run_all(
        self,
        ways: list[tuple[ObjectMotion, ObjectMotion]],
        passes: Passes,
        work: int,
        is_attitude: bool,
        is_simultaneous: bool,
        is_early: bool = False,
    ) -> Outcome:
        """Plan one of ``ways``, each as for :meth:`run`, that comes to the goal: little is tried with all, then more.

        ``passes`` say how much; no way is begun after so much ``work``, more with a larger budget of nodes.  Once one has come
        there, ways that might cost less are tried for as long again as ``improvement`` says; ``is_early``: none that comes later
        in ``ways`` than the one found.
        """
        begun, best, cheapest = self.work, None, np.inf
        limit = float(begun + scale_work(work, self.node_budget))
        rests = {k for k, _, _ in passes}
        refused: dict[tuple[int, int], Outcome] = {
            (number, k): NOT_BEGUN
            for number, (before, _) in enumerate(ways)
            for k in range(len(choose_rests(before)))
            if k in rests
        }
        for part in passes:
            for number, (before, after) in enumerate(ways):
                key = number, part.rest
                is_open = key in refused and refused[key].gave_up
                if self.work >= limit or not is_open or (is_early and best and number > (best.number or 0)):
                    continue
                found = self.run(
                    before,
                    after,
                    is_attitude=is_attitude,
                    is_simultaneous=is_simultaneous,
                    limit=limit,
                    part=part,
                    cost_limit=cheapest,
                )
                if not found.is_found:
                    refused[key] = found
                    continue
                if best is None:
                    more = self.improvement.share * max(self.work - begun, LEAST_WORK_REPEATED)
                    limit = min(limit, int(self.work + more))
                if (cost := compute_actions_cost(self.improvement.weights, found.actions)) < cheapest:
                    cheapest, best = cost, replace(found, number=number)
        if best is not None:
            return best
        farthest = min(refused.values(), key=lambda r: r.stop, default=NOT_BEGUN)
        return replace(
            farthest,
            gave_up=any(r.gave_up for r in refused.values()),
            tried=len({number for (number, _), r in refused.items() if r is not NOT_BEGUN}),
            ran_out=self.work >= limit,
        )

    def _adjust(
        self,
        side: GoalSide,
        before: ObjectMotion,
        rest: float,
        after: ObjectMotion,
        is_attitude: bool,
        is_simultaneous: bool,
        budget: int,
        limit: float,
        part: Pass,
        cost_limit: float,
    ) -> Outcome:
        """Plan one way as in :meth:`run`, the last share ``rest`` of ``before`` left to the search that adjusts the grasp.

        A gait's first end is tried alone; further ends are asked for while the search does not come to the goal grasp.
        """
        key = b"".join([side.X_WO.tobytes(), np.round([rest, is_attitude, is_simultaneous], 9).tobytes()])
        key += b"".join(c.X_OF.tobytes() for c in side.goal if c is not None) + before.axis_W.tobytes()
        if key not in self._attempts:
            motion = before.part(1.0 - rest, 1.0)
            search = AdjustmentSearch.along(motion, side, self._known_rolls, is_simultaneous)
            self._attempts[key] = _Attempt(search, self._gait(before, rest, is_attitude))
        attempt = self._attempts[key]
        search, begun = attempt.search, attempt.begun
        while attempt.asked < part.ends and not attempt.is_over and self.work < limit:
            end = self._ask(attempt.ends, attempt.asked, limit, part.depth)
            if end is None and not begun:
                attempt.is_over = attempt.ends.is_over
                cut = attempt.ends.is_cut or not attempt.is_over
                attempt.refused = Outcome(why=attempt.ends.why, stop=Stop.GAIT, gave_up=cut)
                break
            attempt.asked += 1
            found = None
            if end is not None:
                if self._bound(search, end) >= cost_limit:
                    continue
                begun.append(end)
                found = search.begin(end.contacts)
            if found is None:
                # What the ends that there are not leave is for those that there are.
                found = search.run(budget if end is None else search.opened + budget // ENDS)
            self._count(found.opened)
            if found.moves is not None:
                end = begun[search.chosen]
                moves = build_move_actions(found.moves, end.contacts, after.axis_W)
                last, refused = self._finish(follow_actions(self.hand, end.contacts, moves), after)
                if refused := refused or refuse_rotation(self.hand, (*end.actions, *moves)):
                    return Outcome(why=refused, stop=Stop.GOAL_GRASP, gave_up=True)
                return Outcome((*end.actions, *moves, *last), end.start)
            attempt.is_over = end is None
            is_whole = attempt.is_over and found.is_exhausted and not begun[0].actions
            assert found.refusal is not None
            why = Refusal(RefusalKind.NO_ADJUSTMENT, because=(found.refusal,))
            # Other ends of gaits, and other rolls into the goal grasp, might lead there.
            attempt.refused = Outcome(why=why, gave_up=not is_whole or side.is_rolled)
            if is_whole and not side.refusal:
                self.exhausted += 1
        return attempt.refused

    def _bound(self, search: AdjustmentSearch, end: End) -> float:
        """Return what a plan that goes on from an end of a gait costs at least."""
        weights, moves = self.improvement.weights, search.count_moves(end.contacts)
        if not np.isfinite(moves):
            return 0.0
        ahead = weights.placement * np.ceil(0.5 * moves) + weights.turn * abs(search.layers.motion.angle)
        return float(compute_actions_cost(weights, end.actions) + ahead)

    def _ask(self, ends: Ends, number: int, limit: float, depth: int) -> End | None:
        """Return an end by its number, None where there is none; counts the work."""
        before = ends.opened
        most = min(limit - self.work, MORE_WORK if number else GAIT_WORK * sum(BUDGETS))
        end = ends.get(number, max(1, int(most) // GAIT_WORK), depth)
        self._count(ends.opened - before, GAIT_WORK)
        return end

    def _count(self, nodes: int, work: int = 1) -> None:
        self.opened += nodes
        self.work += work * nodes

    def _approach(self, X_WO: Array, goal: Contacts) -> GoalSide:
        """Return the ways into the goal contacts with the object at ``X_WO`` (4, 4)."""
        key = b"".join(np.round(m, 9).tobytes() for m in (X_WO, *(c.X_OF for c in goal if c is not None)))
        if key not in self._sides:
            side = self._sides[key] = GoalSide(self.hand, self.admissibility, X_WO, goal)
            self.work += ROLLED_SIDE_WORK if side.is_rolled else SIDE_WORK
        return self._sides[key]

    def _gait(self, motion: ObjectMotion, rest: float, is_attitude: bool) -> Ends:
        """Return the ends of gaits that take the object through all of ``motion`` but its last share ``rest``."""
        contacts = self.hold.start_contacts
        part = motion.part(0.0, 1.0 - rest)
        key = np.round([*part.axis_W, part.angle, *part.shift_W, is_attitude], 9).tobytes()
        if key not in self._gaits:
            goal = RotationGoal(self.X_WO, part.axis_W, part.angle, part.shift_W, is_attitude)
            self._gaits[key] = Ends(
                self.hand, goal, self.beginnings, contacts, self.node_budget, self.primitives
            )
            if part.is_still:
                self._gaits[key].settle(End((), contacts, contacts))
        return self._gaits[key]

    @cached_property
    def beginnings(self) -> list[Beginning]:
        """How gaits may begin."""
        return choose_beginnings(self.hand, self.hold, self.start, self.admissibility)

    def _finish(self, contacts: Contacts, after: ObjectMotion) -> tuple[tuple[Action, ...], Refusal | None]:
        """Return the coordinated manipulation with the goal grasp as it was really made, or why it is not possible."""
        if after.is_still:
            return (), None
        why = "coordinated manipulation with the goal grasp reaches the goal"
        action, refusal = plan_coordinated(self.hand, self.admissibility, contacts, after, why)
        if action is not None:
            return (action,), None
        return (), refusal and Refusal(RefusalKind.CANNOT_CARRY_TO_GOAL, because=(refusal,))

    def build_plan(self, kind: str, goal: RotationGoal, actions: tuple[Action, ...], start: Contacts) -> Plan:
        """Return the plan made of ``actions``."""
        whole = enclose(actions, start, self.X_WO, goal.axis_W)
        return replace(self.refuse(kind, goal, No(Status.SOLVED, "")), start_contacts=start, actions=whole)

    def refuse_start(self, kind: str, goal: RotationGoal) -> Plan:
        """Return the plan that says why the start contacts do not hold."""
        return self.refuse(kind, goal, No(self.hold.status, self.hold.reason, self.hold.refusal))

    def refuse(self, kind: str, goal: RotationGoal, no: No) -> Plan:
        """Return the plan that says why there is none."""
        return replace(
            self.hold,
            status=no.status,
            reason=no.reason,
            refusal=no.refusal,
            goal_kind=kind,
            goal_contacts=self._goal_contacts,
            X_WO_goal=goal.X_WO_goal,
            axis_W=goal.axis_W,
            turned_angle=None if goal.is_attitude else goal.angle,
            actions=(),
            statistics={"nodes": self.opened},
        )
