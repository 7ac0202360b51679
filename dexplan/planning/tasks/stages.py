"""Tasks with goal contacts in up to three stages: gaits take the object some way, the grasp is adjusted, the new grasp goes on.

Where between start and goal the grasp is adjusted is what tells the paper's orders apart [paper §1]: at the goal (a), or as
early as the goal grasp can carry the object from there (b).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from dexplan.planning.actions.coordinated import center_spin, plan_coordinated
from dexplan.planning.actions.joining import build_move_actions, follow_actions
from dexplan.planning.admissible.tip_rotation import refuse_rotation
from dexplan.planning.regrasp.goal_side import GoalSide
from dexplan.planning.regrasp.search import AdjustmentSearch
from dexplan.planning.rolling.roll_gait import RollPlan
from dexplan.planning.search.cost import compute_actions_cost
from dexplan.planning.tasks.ends import BUDGETS, Beginning, End, Ends, choose_beginnings
from dexplan.planning.tasks.grasp_task import GraspTask
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.passes import (
    NOT_BEGUN,
    UNLIMITED,
    Allowance,
    GraspWay,
    Outcome,
    Pass,
    Passes,
    Stop,
    choose_rests,
    scale_work,
)
from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.spatial import Array

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


def _land_goal(task: GraspTask, after: ObjectMotion) -> Contacts | Refusal:
    """Return the goal contacts with the object where ``after`` begins, which they then carry it through; or why they cannot."""
    X_WO = after.X_WO_start
    goal, missing = task.land_goal(X_WO)
    if missing:
        return Refusal(RefusalKind.GOAL_CONTACT_OUT_OF_REACH, missing)
    goal = tuple(None if c is None else center_spin(task.hand, c, after) for c in goal)
    if refusal := task.refuse_goal(X_WO, goal):
        return Refusal(RefusalKind.GOAL_GRASP_FAILS, because=(refusal,))
    if after.is_still:
        return goal
    _, refusal = plan_coordinated(task.hand, task.admissibility, goal, after, "")
    return Refusal(RefusalKind.CANNOT_CARRY_TO_GOAL, because=(refusal,)) if refusal else goal


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
    """What stays the same while ways of reaching the goal contacts of a ``task`` are tried; counts the work.

    ``opened``: nodes of all searches so far; ``work``: the same, those of gaits counted as often as they take longer;
    ``exhausted``: adjustments of the start grasp that had nothing left to try.
    """

    task: GraspTask
    opened: int = 0
    work: int = 0
    exhausted: int = 0
    _known_rolls: dict[bytes, tuple[list[RollPlan], Refusal | None]] = field(default_factory=dict)
    _sides: dict[bytes, GoalSide] = field(default_factory=dict)
    _gaits: dict[bytes, Ends] = field(default_factory=dict)
    _attempts: dict[bytes, _Attempt] = field(default_factory=dict)

    def refuse(self, kind: str, goal: RotationGoal, no: No) -> Plan:
        """Return the plan that says why there is none."""
        return self.task.refuse(kind, goal, no, self.opened)

    def build_plan(self, kind: str, goal: RotationGoal, way: Outcome) -> Plan:
        """Return the plan that goes a ``way`` that was found."""
        return self.task.build_plan(kind, goal, way.actions, way.start, self.opened)

    def run(self, way: GraspWay, allowance: Allowance = UNLIMITED) -> Outcome:
        """Plan one way: the object goes through ``before``, the goal grasp is made, and carries it through ``after``.

        Asked again for the same way with more, it goes on where it stopped.
        """
        goal = _land_goal(self.task, way.after)
        if isinstance(goal, Refusal):
            return Outcome(why=goal, stop=Stop.GOAL_GRASP)
        before = way.before
        side = self._approach(way.after.X_WO_start, goal)
        if side.refusal and not before.is_still:
            # Rolls are tried in a few steps only: that none of them did is no proof.
            why = Refusal(RefusalKind.NO_WAY_IN, because=(side.refusal,))
            return Outcome(why=why, stop=Stop.ENTRY, gave_up=side.is_rolled)
        shares, refused, part = choose_rests(before, self.task.is_on_sites), list[Outcome](), allowance.part
        for k in range(len(shares)) if part is None else (part.rest,):
            if self.work >= allowance.work:
                refused.append(NOT_BEGUN)
                break
            asked = Pass(k, ENDS, len(BUDGETS) - 1) if part is None else part
            found = self._adjust(side, way, shares[k], replace(allowance, part=asked))
            if found.is_found:
                return found
            refused.append(found)
        return replace(refused[0], gave_up=any(r.gave_up for r in refused))

    def run_all(self, ways: list[GraspWay], passes: Passes, work: int, is_early: bool = False) -> Outcome:
        """Plan one of ``ways``, each as for :meth:`run`, that comes to the goal: little is tried with all, then more.

        ``passes`` say how much; no way is begun after so much ``work``, more with a larger budget of nodes.  Once one has come
        there, ways that might cost less are tried for as long again as the task's improvement says; ``is_early``: none that comes
        later in ``ways`` than the one found.
        """
        improvement = self.task.options.improvement
        begun, best, cheapest = self.work, None, np.inf
        limit = float(begun + scale_work(work, self.task.options.node_budget))
        rests = {k for k, _, _ in passes}
        refused: dict[tuple[int, int], Outcome] = {
            (number, k): NOT_BEGUN
            for number, way in enumerate(ways)
            for k in range(len(choose_rests(way.before, self.task.is_on_sites)))
            if k in rests
        }
        for part in passes:
            for number, way in enumerate(ways):
                key = number, part.rest
                is_open = key in refused and refused[key].gave_up
                if self.work >= limit or not is_open or (is_early and best and number > (best.number or 0)):
                    continue
                found = self.run(way, Allowance(limit, part, cheapest))
                if not found.is_found:
                    refused[key] = found
                    continue
                if best is None:
                    more = improvement.share * max(self.work - begun, LEAST_WORK_REPEATED)
                    limit = min(limit, int(self.work + more))
                if (cost := compute_actions_cost(improvement.weights, found.actions)) < cheapest:
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

    def _adjust(self, side: GoalSide, way: GraspWay, rest: float, allowance: Allowance) -> Outcome:
        """Plan one way as in :meth:`run`, the last share ``rest`` of what comes before left to the search that adjusts the grasp.

        A gait's first end is tried alone; further ends are asked for while the search does not come to the goal grasp.
        """
        attempt, after, part, limit = (
            self._attempt(side, way, rest),
            way.after,
            allowance.part,
            allowance.work,
        )
        search, begun = attempt.search, attempt.begun
        assert part is not None
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
                if self._bound(search, end) >= allowance.cost:
                    continue
                begun.append(end)
                found = search.begin(end.contacts)
            if found is None:
                # What the ends that there are not leave is for those that there are.
                found = search.run(SEARCH_BUDGET if end is None else search.opened + SEARCH_BUDGET // ENDS)
            self._count(found.opened)
            if found.moves is not None:
                end = begun[search.chosen]
                moves = build_move_actions(found.moves, end.contacts, after.axis_W)
                last, refused = _finish(self.task, follow_actions(self.task.hand, end.contacts, moves), after)
                if refused := refused or refuse_rotation(self.task.hand, (*end.actions, *moves)):
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

    def _attempt(self, side: GoalSide, way: GraspWay, rest: float) -> _Attempt:
        """Return the attempt of a way that leaves so much to the search; begun before, or new."""
        before = way.before
        key = b"".join(
            [side.X_WO.tobytes(), np.round([rest, way.is_attitude, way.is_simultaneous], 9).tobytes()]
        )
        key += b"".join(c.X_OF.tobytes() for c in side.goal if c is not None) + before.axis_W.tobytes()
        if key not in self._attempts:
            motion = before.part(1.0 - rest, 1.0)
            search = AdjustmentSearch.along(
                motion, side, self._known_rolls, way.is_simultaneous, self.task.is_on_sites
            )
            self._attempts[key] = _Attempt(search, self._gait(before, rest, way.is_attitude))
        return self._attempts[key]

    def _bound(self, search: AdjustmentSearch, end: End) -> float:
        """Return what a plan that goes on from an end of a gait costs at least."""
        weights, moves = self.task.options.improvement.weights, search.count_moves(end.contacts)
        if not np.isfinite(moves):
            return 0.0
        ahead = weights.placement * np.ceil(0.5 * moves) + weights.turn * search.layers.track.turned
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
            side = self._sides[key] = GoalSide(self.task.hand, self.task.admissibility, X_WO, goal)
            self.work += ROLLED_SIDE_WORK if side.is_rolled else SIDE_WORK
        return self._sides[key]

    def _gait(self, motion: ObjectMotion, rest: float, is_attitude: bool) -> Ends:
        """Return the ends of gaits that take the object through all of ``motion`` but its last share ``rest``."""
        task, contacts = self.task, self.task.spin_start(motion)
        part = motion.part(0.0, 1.0 - rest)
        key = np.round([*part.axis_W, part.angle, *part.shift_W, is_attitude], 9).tobytes()
        if key not in self._gaits:
            goal = RotationGoal(task.X_WO, part.axis_W, part.angle, part.shift_W, is_attitude)
            ends = self._gaits[key] = Ends(task.hand, goal, self.beginnings, contacts, task.options)
            if part.is_still:
                ends.settle(End((), contacts, contacts))
        return self._gaits[key]

    @cached_property
    def beginnings(self) -> list[Beginning]:
        """How gaits may begin."""
        task = self.task
        return choose_beginnings(task.hand, task.hold, task.start, task.admissibility)


def _finish(
    task: GraspTask, contacts: Contacts, after: ObjectMotion
) -> tuple[tuple[Action, ...], Refusal | None]:
    """Return the coordinated manipulation with the goal grasp as it was really made, or why it is not possible."""
    if after.is_still:
        return (), None
    why = "coordinated manipulation with the goal grasp reaches the goal"
    action, refusal = plan_coordinated(task.hand, task.admissibility, contacts, after, why)
    if action is not None:
        return (action,), None
    return (), refusal and Refusal(RefusalKind.CANNOT_CARRY_TO_GOAL, because=(refusal,))
