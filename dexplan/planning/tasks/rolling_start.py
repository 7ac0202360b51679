"""Object manipulation from any start grasp: gaits at once where there is one, rolling first where there is none [paper §1].

"If the initial grasp uses all fingers, then use rolling to obtain a FC grasp that leaves at least one finger not used in the
grasp."  A pair beside which no third finger finds room, as beside exactly opposite contacts, rolls first as well.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from dexplan.planning.actions.gaits import build_hold
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.rolling.roll_gait import RollPlan, RollToPair, build_roll_actions
from dexplan.planning.search.cost import Improvement
from dexplan.planning.search.options import Primitive
from dexplan.planning.tasks.by_shape import plan_gait
from dexplan.planning.tasks.ends import Beginning
from dexplan.planning.tasks.object_manipulation import FIRST
from dexplan.planning.tasks.pair_roll import PairRolls, build_pair_roll_action
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import Action
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import rest_at
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.spatial import VERTICAL

OPTIONS = 8
"""Ways to roll three fingers that are tried before the goal is given up."""
PAIR_OPTIONS = 4
"""Ways to roll a pair that are tried."""
LIFTS = 2
"""Pairs of three fingers that hold alone, and are rolled after the third was lifted."""
STUCK = (Status.NO_ADMISSIBLE_PAIR, Status.NO_GAIT, Status.BUDGET_EXHAUSTED)
"""Answers after which rolling may help."""


def plan_object_manipulation(
    hand: HandModel,
    goal: RotationGoal,
    start: Start,
    node_budget: int,
    primitives: tuple[Primitive, ...] = ("substitution",),
    improvement: Improvement = FIRST,
) -> Plan:
    """Return a plan that takes the object to ``goal``; arguments as in :func:`plan_rotation`."""
    plan = plan_gait(hand, goal, start, node_budget, primitives, improvement)
    touching = sum(c is not None for c in plan.start_contacts)
    if plan.status not in STUCK or touching < (2 if hand.object.is_isotropic else 3):
        # A pair rolls to make room by closed forms only, which hold where all sides look the same.
        return plan
    beginnings: _Beginnings = (_FromPair if touching == 2 else _RolledStart)(hand, goal, plan)
    refused: list[Plan] = []
    left, is_cut = node_budget - int(plan.statistics["nodes"]), False
    for number, beginning in enumerate(islice(beginnings.find(), beginnings.most + 1)):
        # One budget for all: what an option leaves is for those after it.
        share = left // (beginnings.most - number) if number < beginnings.most else 0
        if share < 1:
            is_cut = True
            break
        rest = plan_gait(hand, goal, beginning.start, share, primitives, improvement)
        left -= int(rest.statistics["nodes"])
        if rest.is_solved:
            return _join(plan, beginning, rest)
        refused.append(rest)
    if not refused and not is_cut:
        return replace(plan, reason=f"{plan.reason}; {beginnings.explain()}")
    # Where a search was cut short there may be a gait after all: its words go first, and its status is the plan's.
    telling = next(
        (r for r in refused if r.status is Status.BUDGET_EXHAUSTED), refused[0] if refused else plan
    )
    status = Status.BUDGET_EXHAUSTED if is_cut or telling.status is Status.BUDGET_EXHAUSTED else plan.status
    tried = f"{len(refused)} ways tried" if len(refused) > 1 else "one way tried"
    found = (
        f"after rolling ({tried}): {telling.status}: {telling.reason}" if refused else "rolling comes first"
    )
    if is_cut and len(refused) < beginnings.most:
        found += f"; the search gave up with ways to roll left; raise gait.node_budget above {node_budget}"
    elif is_cut:
        found += "; the search gave up, for there are more ways to roll; choose another start grasp"
    return replace(plan, status=status, reason=f"{plan.reason}; {found}")


class _Beginnings(ABC):
    """What may come before the gait where ``plan`` found none from its start contacts; ``most`` of it is tried."""

    most = 0

    def __init__(self, hand: HandModel, goal: RotationGoal, plan: Plan) -> None:
        self.hand, self.goal, self.plan = hand, goal, plan

    @abstractmethod
    def find(self) -> Iterator[Beginning]:
        """Yield beginnings, the most promising first."""

    @abstractmethod
    def explain(self) -> str:
        """Return why there was none."""


class _FromPair(_Beginnings):
    """Two fingers hold and roll until a third finds room."""

    most = PAIR_OPTIONS

    def find(self) -> Iterator[Beginning]:
        self._rolls = PairRolls(self.hand, self.goal, self.plan.start_contacts, Admissibility(self.hand))
        for option in self._rolls.options():
            yield Beginning((build_pair_roll_action(self.hand, self.goal, option),), option.contacts)

    def explain(self) -> str:
        return f"rolling first does not help: {self._rolls.explain()}"


class _RolledStart(_Beginnings):
    """Three fingers hold; a pair of them rolls until it holds alone, or does so already, and the third is lifted."""

    most = OPTIONS

    def find(self) -> Iterator[Beginning]:
        hand, goal, contacts = self.hand, self.goal, self.plan.start_contacts
        self._rolls = RollToPair(hand, goal.X_WO_start, contacts, Admissibility(hand))
        lifts: list[Beginning] = []
        for option in self._rolls.options():
            after = tuple(
                None if c is None or c.finger == option.lifted else c.X_OF if hand.object.is_isotropic else c
                for c in option.contacts
            )
            beginning = Beginning(self._build_actions(option), after)
            if not option.rolls:
                lifts.append(beginning)
            yield beginning
        # Where a pair that holds alone leaves no finger room, it may roll once the third is gone.
        for lift in lifts[: LIFTS if hand.object.is_isotropic else 0]:
            pair = tuple(
                c if after is not None else None for c, after in zip(contacts, lift.start or (), strict=True)
            )
            rolls = PairRolls(hand, goal, pair, Admissibility(hand))
            for turned in islice(rolls.options(), PAIR_OPTIONS):
                roll = build_pair_roll_action(hand, goal, turned)
                yield Beginning((*lift.actions, roll), turned.contacts)

    def explain(self) -> str:
        return f"rolling cannot make one: {'; '.join(map(str, self._rolls.explain()))}"

    def _build_actions(self, option: RollPlan) -> tuple[Action, ...]:
        """Return the roll and the lift; nothing rolls where a pair holds alone as it stands and lifting is all that helps."""
        roll, lift = build_roll_actions(option, self.hand, self.goal.X_WO_start, self.goal.axis_W)
        if self.plan.status is not Status.NO_ADMISSIBLE_PAIR:
            roll = replace(
                roll, why="no gait was found from the start contacts; rolled, they make a grasp with one"
            )
            i, j = (self.hand.fingers[f].name for f in option.pair)
            lift = replace(lift, why=f"{i} and {j} hold alone, and a gait begins with them")
        return (roll, lift) if option.rolls else (lift,)


def _join(start: Plan, beginning: Beginning, rest: Plan) -> Plan:
    """Return the plan that holds with the contacts of ``start``, begins as said, and goes on with ``rest``."""
    axis = VERTICAL if start.axis_W is None else start.axis_W
    hold = build_hold(start.start_contacts, rest_at(start.X_WO_start, axis), "let the grasp settle")
    return replace(
        rest, start_contacts=start.start_contacts, actions=(hold, *beginning.actions, *rest.actions[1:])
    )
