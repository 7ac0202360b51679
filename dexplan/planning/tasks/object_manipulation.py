"""From a goal to a plan: reads the start, tries route after route, and says in words why where there is no plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from dexplan.planning.actions.gaits import build_actions
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.conditions import Condition
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.contact_table import ContactTable
from dexplan.planning.contacts.held import Held
from dexplan.planning.contacts.legs import Leg
from dexplan.planning.gait.escape import MOST_PLACES_COUNTED, count_room, find_escapes
from dexplan.planning.gait.exchange import GaitNode
from dexplan.planning.gait.routes import build_detours, build_routes, list_swings
from dexplan.planning.gait.search import CURE, GaitSearch
from dexplan.planning.search.cost import Improvement
from dexplan.planning.search.options import Primitive
from dexplan.planning.tasks.blocked import (
    may_hold_at,
)
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.pair_survey import refuse_every_pair, spell_no_pair
from dexplan.planning.tasks.start_refusals import refuse_lifting
from dexplan.planning.tasks.starting import Start, begin, find_held
from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Cure, Refusal
from dexplan.plans.status import Status

STRETCH = 4
"""Nodes that the search of a route may open before another may have its turn."""
ROUTE_COST = 12.0
"""The next route is tried whenever so many more nodes have been opened."""
SPENT = 0.1
"""What every node opened on a route takes from its promise, in placements."""
BUDGET_OFF_THE_GRID = 24
"""Nodes that may be opened although no pair of contacts of a grid holds the object at its goal."""
FIRST = Improvement()
"""The first plan is good enough."""


def refuse(
    hand: HandModel,
    goal: RotationGoal,
    status: Status,
    reason: str,
    refusal: Refusal | None = None,
) -> Plan:
    """Return the plan that says why there is none."""
    nothing: Contacts = (None,) * len(hand.fingers)
    return replace(_answer(hand, goal, status, reason, nothing, (), {}), refusal=refusal)


def _answer(
    hand: HandModel,
    goal: RotationGoal,
    status: Status,
    reason: str,
    contacts: Contacts,
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
        turned_angle=None if goal.is_attitude else goal.angle,
        start_contacts=contacts,
        actions=actions,
        normal_force=hand.normal_force,
        normal_floor=hand.limits.normal_floor,
        normal_ceiling=hand.limits.normal_ceiling,
        statistics=statistics,
    )


def plan_rotation(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    node_budget: int,
    primitives: tuple[Primitive, ...] = ("substitution",),
    improvement: Improvement = FIRST,
) -> Plan:
    """Return a plan that takes the object to ``goal`` by finger gaiting.

    ``primitives``: the gaits that may be used; "rewind" alone moves the object with one pair of fingers only.  ``improvement``:
    how long better plans are looked for once there is one, within the ``node_budget``.  No plan is an answer with a status, not
    an exception.
    """
    return _Planning(hand, goal, start, node_budget, primitives, improvement).answer()


def plan_rotations(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    node_budget: int,
    primitives: tuple[Primitive, ...] = ("substitution",),
) -> Iterator[Plan]:
    """Yield plans as :func:`plan_rotation` finds them, one after another: they end in different grasps.

    Where there is none, the one plan that is yielded says why.
    """
    yield from _Planning(hand, goal, start, node_budget, primitives, FIRST).answers()


@dataclass(eq=False)
class _Planning:
    """One goal on its way to a plan: the routes, a search for each that was begun, and what was refused."""

    hand: HandModel
    goal: RotationGoal
    start: Start
    node_budget: int
    primitives: tuple[Primitive, ...]
    improvement: Improvement
    contacts: Contacts = ()
    searches: list[GaitSearch] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    is_complete: bool = False
    """Whether every route was begun, and none of the searches has anything left to try."""

    doubt: No | None = None
    """The answer where no pair of contacts of a grid holds the object at its goal."""

    def __post_init__(self) -> None:
        self._admissibility = Admissibility(self.hand)
        self.contacts = (None,) * len(self.hand.fingers)

    @property
    def statistics(self) -> dict[str, float]:
        """Nodes opened, states checked, routes begun, plans found, and what the first and the best of them cost."""
        found = (
            {"plans": len(self.costs), "first_cost": self.costs[0], "cost": min(self.costs)}
            if self.costs
            else {}
        )
        return {
            **found,
            "nodes": sum(s.opened for s in self.searches),
            "states_checked": sum(s.states_checked for s in self.searches),
            "routes": len(self.searches),
        }

    def answer(self) -> Plan:
        """Return the plan."""
        refusal = self._begin_all()
        if refusal is not None:
            return refusal
        best: tuple[float, Plan] | None = None
        for search, node in self._find_ways():
            self.costs.append(search.compute_cost(node, self.improvement.weights))
            if best is None:
                until = int((1.0 + self.improvement.share) * self.statistics["nodes"])
                self.node_budget = min(self.node_budget, until)
            if best is None or self.costs[-1] < best[0]:
                # Built at once: nodes are shared with ways found later, which leave their own margins behind.
                best = self.costs[-1], self._build(search, node)
            for begun in self.searches:
                begun.seek_cheaper(best[0], self.improvement.weights)
        return self._explain_failure() if best is None else replace(best[1], statistics=self.statistics)

    def answers(self) -> Iterator[Plan]:
        """Yield plan after plan as they are found, or the one that says why there is none."""
        refusal = self._begin_all()
        if refusal is not None:
            yield refusal
            return
        found = False
        for search, node in self._find_ways():
            found = True
            yield self._build(search, node)
        if not found:
            yield self._explain_failure()

    def _begin_all(self) -> Plan | None:
        """Begin with the first route, or return the refusal of goal or start."""
        if no := self._check_goal():
            if not may_hold_at(self.hand, self.goal, self.start):
                return self._refuse(no)
            # The grid of contacts that this was asked of is fine, not endless: the start grasp may be what holds there.
            self.doubt = no
            self.node_budget = min(self.node_budget, BUDGET_OFF_THE_GRID)
        first = GaitSearch(self.hand, build_routes(self.goal)[0], self._admissibility, self.primitives)
        self.searches.append(first)
        begun = begin(self.hand, self.goal.X_WO_start, self.start, first, self._admissibility)
        self.contacts = begun.contacts
        return None if begun.no is None else self._refuse(begun.no)

    def _find_held(self, table: ContactTable) -> tuple[Held, ...]:
        """Return the start contacts on the first leg of a route."""
        return find_held(self.hand, self.goal.X_WO_start, self.start, table)

    def _find_ways(self) -> Iterator[tuple[GaitSearch, GaitNode]]:
        """Yield ways to the goal, each as its search and last node, until the budget is spent."""
        proposals = self._propose(self.searches[0].tables[0])
        while (left := self.node_budget - int(self.statistics["nodes"])) > 0:
            search = self._choose_search(proposals)
            if search is None:
                self.is_complete = True
                return
            if (node := search.run(min(STRETCH, left))) is not None:
                yield search, node

    def _explain_failure(self) -> Plan:
        """Return the plan that says why no way was found."""
        first = self.searches[0]
        table = first.tables[0]
        if self.doubt:
            return self._refuse(self.doubt)
        if self.is_complete:
            if self.start is not None and not table.has_pair(self._find_held(table)):
                return self._refuse(refuse_lifting(table))
            cure, refusal = self._suggest_cure(first), first.refusals[0]
            reason = f"{first.reason}; what may help: {cure}"
            return self._refuse(No(Status.NO_GAIT, reason, replace(refusal, cure=Cure(cure))))
        reason = f"no gait within {self.node_budget} nodes ({first.reason}); raise gait.node_budget"
        return self._refuse(No(Status.BUDGET_EXHAUSTED, reason, first.refusals[0]))

    def _suggest_cure(self, search: GaitSearch) -> str:
        """Return what might help against the commonest reasons not to go on; none of it was tried."""
        cures = [str(c) for c in dict.fromkeys(search.unmet) if c is not Condition.FRICTION]
        if self.hand.object.allowed_regions:
            cures.insert(0, Condition.ALLOWED.value)
        if not cures or Condition.FRICTION in search.unmet:
            cures.append(CURE)
        return ", or ".join(cures)

    def _refuse(self, no: No) -> Plan:
        plan = _answer(self.hand, self.goal, no.status, no.reason, self.contacts, (), self.statistics)
        return replace(plan, refusal=no.refusal)

    def _build(self, search: GaitSearch, node: GaitNode) -> Plan:
        steps = search.steps(node)
        first: list[Placement | None] = [None] * len(self.hand.fingers)
        for placement in steps[0].contacts:
            first[placement.finger] = placement
        actions = build_actions(steps, tuple(first), self.goal.axis_W)
        return _answer(self.hand, self.goal, Status.SOLVED, "", tuple(first), actions, self.statistics)

    # -- goal and routes -------------------------------------------------------------------------------------------------

    def _check_goal(self) -> No | None:
        """Return why the object cannot be held at a shifted goal by any pair of fingers; None if it can, or is not shifted."""
        if not np.any(self.goal.shift_W):
            return None
        refusal = refuse_every_pair(self.hand, self.goal.X_WO_goal, self._admissibility)
        if refusal is None:
            return None
        where = "the goal, ({:.1f}, {:.1f}, {:.1f}) mm from its start".format(*(1e3 * self.goal.shift_W))
        why = spell_no_pair(refusal)
        reason = f"no two fingers can hold the object at {where}: {why}; shorten goal.translation_m"
        return No(Status.GOAL_UNREACHABLE, reason, refusal)

    def _propose(self, table: ContactTable) -> Iterator[tuple[Leg, ...]]:
        """Yield all routes but the first: those of the goal, and those on which the pair first turns to where there is room.

        ``table`` is that of the first route's first leg.
        """
        swings = list_swings(self.hand.p_WF_home) if self.goal.is_attitude else ()
        straight = build_routes(self.goal, swings)[1:]
        held = () if self.start is None else self._find_held(table)
        if len(held) != 2:
            yield from straight
            return
        pair = (held[0], held[1])
        room = count_room(table, pair)
        is_stuck = not room
        if not is_stuck:
            yield from straight
        if room >= MOST_PLACES_COUNTED:
            return
        detours = [build_detours(self.goal, e.axis_W, e.angle) for e in find_escapes(table, pair)]
        yield from (ways[0] for ways in detours)
        if is_stuck:
            yield from straight
        yield from (way for ways in detours for way in ways[1:])

    def _choose_search(self, proposals: Iterator[tuple[Leg, ...]]) -> GaitSearch | None:
        """Return the search to go on with, None where all are exhausted; begins that of the next route when it is time.

        Of those begun, the one that promises the goal at the least cost, what was spent on it counted.
        """
        going = [s for s in self.searches if not s.is_exhausted]
        # A turn about a given axis is asked for as such: other ways are for where it cannot be begun.
        is_time = self.goal.is_attitude and len(self.searches) <= self.statistics["nodes"] / ROUTE_COST
        if is_time or not going:
            for route in proposals:
                self.searches.append(self._begin(route))
                if not self.searches[-1].is_exhausted:
                    return self.searches[-1]
        return min(going, key=lambda s: s.promise + SPENT * s.opened, default=None)

    def _begin(self, route: tuple[Leg, ...]) -> GaitSearch:
        search = GaitSearch(self.hand, route, self._admissibility, self.primitives)
        if self.start is None:
            search.begin_anywhere()
        elif held := self._find_held(search.tables[0]):
            search.begin(held)
        if self.costs:
            search.seek_cheaper(min(self.costs), self.improvement.weights)
        return search
