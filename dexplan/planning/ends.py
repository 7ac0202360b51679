"""Grasps in which gaits can end that bring the object to a pose: several that differ, for what comes next may need another one.

From a grasp in which no two fingers hold alone the gaits begin with rolling, as in an object manipulation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Literal

import numpy as np

from dexplan.planning.admissible import Admissibility
from dexplan.planning.goal import VERTICAL, RotationGoal
from dexplan.planning.hand import HandModel
from dexplan.planning.joining import Contacts, follow_actions, without_holds
from dexplan.planning.plan import Action, Plan
from dexplan.planning.planner import Start, plan_rotations
from dexplan.planning.roll_gait import build_roll_actions
from dexplan.planning.roll_to_goal import RollEveryPair, measure_angle
from dexplan.planning.still import StillContacts

BUDGETS = (12, 50, 400)
"""Nodes that the gaits from one beginning may open: so many from all of them, and more where that leads nowhere."""
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

    ``opened`` counts nodes, ``why`` says why there is none, ``found`` has those that were asked for so far.
    ``contacts`` are those from which the ``beginnings`` begin, where they are known; the latest that led to an end is put first.
    """

    hand: HandModel
    goal: RotationGoal
    beginnings: list[Beginning]
    contacts: Contacts
    node_budget: int
    primitives: tuple[Literal["substitution", "rewind"], ...]
    opened: int = 0
    why: str = ""
    found: list[End] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._more: Iterator[End] = self._find()
        self._until = 0

    def settle(self, end: End) -> None:
        """Take the only end there is: nothing has to move."""
        self.found, self._more = [end], iter(())

    def get(self, number: int, most: int) -> End | None:
        """Return an end by its number, opening up to about ``most`` more nodes; None where there are not so many."""
        self._until = self.opened + most
        while len(self.found) <= number:
            end = next(self._more, None)
            if end is None:
                return None
            self.found.append(end)
        return self.found[number]

    def _find(self) -> Iterator[End]:
        for budget in BUDGETS:
            if self.found:
                return
            for beginning in tuple(self.beginnings):
                before, nodes = self.opened, min(budget, self.node_budget, self._until - self.opened)
                if nodes <= 0:
                    return
                plans = plan_rotations(self.hand, self.goal, beginning.start, nodes, self.primitives)
                for plan in islice(plans, MOST):
                    self.opened = before + int(plan.statistics.get("nodes", 0))
                    if not plan.is_solved:
                        self.why = (
                            self.why or f"the object cannot be brought there ({plan.status}: {plan.reason})"
                        )
                        break
                    actions = (*beginning.actions, *without_holds(plan.actions))
                    first = self.contacts if beginning.actions else plan.start_contacts
                    last = actions[-1].contacts_end if actions else first
                    if all(_are_different(last, end.contacts) for end in self.found):
                        # What led somewhere will lead elsewhere, too: the next gaits begin with it.
                        self.beginnings.remove(beginning)
                        self.beginnings.insert(0, beginning)
                        yield End(actions, first, follow_actions(self.hand, first, actions))


def _are_different(a: Contacts, b: Contacts) -> bool:
    """Return whether other fingers touch, or one of them elsewhere."""
    return any(
        (x is None) != (y is None)
        or (x is not None and y is not None and measure_angle(x.normal_O, y.normal_O) > APART)
        for x, y in zip(a, b, strict=True)
    )
