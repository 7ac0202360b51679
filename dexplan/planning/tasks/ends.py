"""Grasps in which gaits can end that bring the object to a pose: several that differ, for what comes next may need another one.

From a grasp in which no two fingers hold alone the gaits begin with rolling, as in an object manipulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from dexplan.planning.actions.joining import follow_actions, without_holds
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.still import StillContacts
from dexplan.planning.rolling.roll_gait import build_roll_actions
from dexplan.planning.rolling.roll_to_goal import RollEveryPair, measure_angle
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.object_manipulation import plan_rotations
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts
from dexplan.plans.goal import RotationGoal
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.plans.status import Status
from dexplan.spatial import VERTICAL

BUDGETS = (12, 12, 50, 400)
"""Nodes that the gaits from one beginning may open, at first from the first beginning alone and then from all of them: more,
once asked to go so deep, where that leads nowhere."""
MOST = 12
"""Gaits from one beginning that are looked at."""
APART = float(np.radians(15.0))
"""Grasps of the same fingers are alike where every contact lies nearer than this to the other's [rad]."""


@dataclass(frozen=True, eq=False)
class End:
    """The ``actions`` of a gait from the contacts ``start``, and the ``contacts`` in which it ends, with their postures there."""

    actions: tuple[Action, ...]
    start: Contacts
    contacts: Contacts


@dataclass(frozen=True, eq=False)
class Beginning:
    """What comes before a gait, and the grasp from which it then begins."""

    actions: tuple[Action, ...]
    start: Start


def choose_beginnings(
    hand: HandModel, hold: Plan, start: Start, admissibility: Admissibility
) -> list[Beginning]:
    """Return the start grasp, or where no two of three fingers hold ways to roll it until two do, and then the grasp itself.

    ``hold`` is the plan that holds still with the contacts ``start``.
    """
    contacts, X_WO = hold.start_contacts, hold.X_WO_start
    held = [c for c in contacts if c is not None]
    still = StillContacts(hand, X_WO, admissibility)
    itself = Beginning((), start)
    if len(held) < 3 or still.has_pair(tuple(still.add(c) for c in held)):
        return [itself]
    found = []
    for option in RollEveryPair(hand, X_WO, contacts, admissibility).first_of_every_pair(1):
        after = tuple(None if c is None or c.finger == option.lifted else c.X_OF for c in option.contacts)
        found.append(Beginning(build_roll_actions(option, hand, X_WO, VERTICAL), after))
    return [*found, itself]


@dataclass(eq=False)
class Ends:
    """Ends of gaits to ``goal``, found one after another as they are asked for.

    ``opened`` counts nodes, ``why`` says why there is none, ``found`` has those that were asked for so far.  ``is_over``: there
    are no more.  ``is_cut``: gaits are given up with something left to try, so that there may be others.
    ``contacts`` are those from which the ``beginnings`` begin, where they are known; the latest that led to an end is put first.
    """

    hand: HandModel
    goal: RotationGoal
    beginnings: list[Beginning]
    contacts: Contacts
    options: SearchOptions
    opened: int = 0
    why: Refusal | None = None
    found: list[End] = field(default_factory=list)
    is_over: bool = False
    is_cut: bool = False

    def __post_init__(self) -> None:
        self._more: Iterator[End | None] = self._find()
        self._until, self._depth = 0, 0

    def settle(self, end: End) -> None:
        """Take the only end there is: nothing has to move."""
        self.found, self._more, self.is_over = [end], iter(()), True

    def get(self, number: int, most: int, depth: int = len(BUDGETS) - 1) -> End | None:
        """Return an end by its number, None where it is not found: there is none if ``is_over``, else more may find it.

        About ``most`` more nodes are opened, none with a budget beyond number ``depth`` of ``BUDGETS``.
        """
        self._until, self._depth = self.opened + most, depth
        while len(self.found) <= number and not self.is_over:
            try:
                end = next(self._more)
            except StopIteration:
                self.is_over = True
                break
            if end is None:
                break
            self.found.append(end)
        return self.found[number] if number < len(self.found) else None

    def _find(self) -> Iterator[End | None]:
        """Yield end after end; None where more nodes, or a greater depth, are asked for before it goes on."""
        tried, closed = dict[Beginning, int](), list[Beginning]()
        for depth, budget in enumerate(BUDGETS):
            # Where one beginning led somewhere the others are given as many nodes, but none is given more.
            if self.found and budget > BUDGETS[depth - 1]:
                return
            for beginning in self.beginnings[: None if depth else 1]:
                most = min(budget, self.options.node_budget)
                if beginning in closed or tried.get(beginning, 0) >= most:
                    continue
                while self._depth < depth or self._until <= self.opened:
                    yield None
                before, nodes = self.opened, min(most, self._until - self.opened)
                tried[beginning] = nodes
                plans = plan_rotations(self.hand, self.goal, beginning.start, nodes, self.options.primitives)
                for plan in islice(plans, MOST):
                    self.opened = before + int(plan.statistics.get("nodes", 0))
                    if not plan.is_solved:
                        if plan.status is Status.BUDGET_EXHAUSTED:
                            self.why = Refusal(RefusalKind.GAIT_CUT_SHORT, measured=nodes)
                        else:
                            # What was searched to the end, or refused, will not do with more nodes either.
                            closed.append(beginning)
                            self.why = self.why or _refuse_gait(plan)
                        break
                    actions = (*beginning.actions, *without_holds(plan.actions))
                    first = self.contacts if beginning.actions else plan.start_contacts
                    last = actions[-1].contacts_end if actions else first
                    if all(_are_different(last, end.contacts) for end in self.found):
                        # What led somewhere will lead elsewhere, too: the next gaits begin with it.
                        self.beginnings.remove(beginning)
                        self.beginnings.insert(0, beginning)
                        yield End(actions, first, follow_actions(self.hand, first, actions))
        self.is_cut = len(closed) < len(self.beginnings)


def _refuse_gait(plan: Plan) -> Refusal:
    """Return the refusal because gaits come to the answer ``plan``, which is a no."""
    because = () if plan.refusal is None else (plan.refusal,)
    words = f"the object cannot be brought there ({plan.status}: {plan.reason})"
    return Refusal(RefusalKind.NOT_BROUGHT, because=because, words=words)


def _are_different(a: Contacts, b: Contacts) -> bool:
    """Return whether other fingers touch, or one of them elsewhere."""
    return any(
        (x is None) != (y is None)
        or (x is not None and y is not None and measure_angle(x.normal_O, y.normal_O) > APART)
        for x, y in zip(a, b, strict=True)
    )
