"""A gait of fingers whose contacts roll: the object goes its way, and fingers that come to their end are put elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.rolling_contacts import RollingContacts
from dexplan.planning.contacts.rolling_stations import RollingGrip
from dexplan.planning.regrasp.ends import AnyEnd
from dexplan.planning.regrasp.search import PATIENCE
from dexplan.planning.search.engine import Engine
from dexplan.planning.search.moves import Go, Lift, Place
from dexplan.planning.search.nodes import Node, trace_back
from dexplan.planning.search.stepwise import StepProblem
from dexplan.planning.ways.travel import describe_detour
from dexplan.plans.actions import Action, FingerWay, MoveObject, Relocate
from dexplan.plans.contacts import Contacts, list_holding
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.phases import PlannedPhase, build_lifting, build_placing, demand_touch
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.plans.tip_roll import TipRoll

START = Progress(0, 0)
SHARES = (1.0, 0.75, 0.5, 0.25)
"""After which shares of what a grip can do at most something else is tried."""

LONG = 18
"""Stops that a finger goes along at best after it was put down: 210 degrees, as prototypes of TriFinger went."""


@dataclass(eq=False)
class UsedUp:
    """How many placements and lifts are missing about: every finger that comes to its end before the object does is put
    elsewhere, as often as the longest carry that is known asks for.

    A finger can only be put elsewhere while others hold.  Where the first that comes to its end cannot be let go, neither now nor
    then, something else has to be done before.
    """

    contacts: RollingContacts

    def count_moves(self, stop: int, grip: RollingGrip) -> float:
        """Return how many moves are missing about."""
        known, last = self.contacts.touches, self.contacts.touches.last
        ends = sorted((known.touches[t].until, f) for f, t in enumerate(grip) if t is not None)
        missing = sum(2.0 * max(1.0, (last - until) / LONG) for until, _ in ends if until < last)
        if ends and ends[0][0] < last and len(ends) > 2:
            until, first = ends[0]
            rest = self.contacts.change(grip, first, None)
            if not any(self.contacts.seems_to_hold(rest, then) for then in {stop, until}):
                missing += 2.0
        return missing

    def refuse(self, stop: int, grip: RollingGrip) -> None:
        """Learn nothing: what does not hold is not counted on."""


class RollingGait:
    """Searches moves that take the object along the way of ``contacts`` from a grip; can be asked to go on."""

    def __init__(self, contacts: RollingContacts, start: RollingGrip) -> None:
        self.contacts = contacts
        problem = StepProblem(contacts, AnyEnd(), UsedUp(contacts), shares=SHARES, is_one_go=True)
        self._engine = Engine(problem, PATIENCE)
        self._engine.push(Node(START, start))

    @property
    def opened(self) -> int:
        """Number of nodes opened."""
        return self._engine.opened

    @property
    def is_exhausted(self) -> bool:
        """Whether there is nothing left to open."""
        return self._engine.is_exhausted

    def run(self, nodes: int) -> Node[RollingGrip] | None:
        """Open up to ``nodes`` more nodes; return the last node of the way to the end, None where that was not come to."""
        return self._engine.run(nodes)

    def explain(self) -> Refusal:
        """Return what stopped the search nearest to the end."""
        return next(iter(self._engine.list_refusals(1)), Refusal(RefusalKind.NO_PLACE))


def build_rolling_actions(contacts: RollingContacts, last: Node[RollingGrip]) -> tuple[Action, ...]:
    """Return the actions on the way to ``last``; in its motions every finger that holds rolls as it is carried."""
    return tuple(_build_action(contacts, before, node) for before, node in pairwise(trace_back(last)))


def _list_contacts(contacts: RollingContacts, node: Node[RollingGrip]) -> Contacts:
    return tuple(None if t is None else contacts.place(t, node.at) for t in node.grip)


def _build_action(contacts: RollingContacts, before: Node[RollingGrip], node: Node[RollingGrip]) -> Action:
    after, known = _list_contacts(contacts, node), contacts.touches
    held = _list_contacts(contacts, before)
    if (go := node.find_move(Go)) is not None:
        first, end = (int(known.stops[n.at.stop]) for n in (before, node))
        steps = known.track.steps[before.at.stop : node.at.stop]
        motion = ObjectMotion.between(
            steps[0].X_WO_start, steps[-1].X_WO_end, steps[0].axis_W, sum(step.angle for step in steps)
        )
        rolls = []
        for number in node.grip:
            if number is None:
                continue
            touch = known.touches[number]
            rows = slice(first - touch.batch.first, end - touch.batch.first + 1)
            found = touch.batch.carried
            rolls.append(TipRoll(touch.finger, found.X_OF[rows, touch.row], found.n_O[rows, touch.row]))
        return MoveObject(
            motion=motion,
            grasping=list_holding(held),
            contacts_end=after,
            phases=(PlannedPhase("move", demand_touch(held)),),
            why="until fingers can be relocated"
            if node.at.stop < known.last
            else "until the object is where it should be",
            margins=contacts.judge_carry(before.grip, before.at, go.stops).margins,
            rolls=tuple(rolls),
        )
    change = node.find_move(Place) or node.find_move(Lift)
    assert change is not None
    assert isinstance(change.touch, int)
    places = isinstance(change, Place)
    away = contacts.change(node.grip, change.finger, None)
    way = contacts.find_way(change.touch, away, node.at, looks_around=True)
    why = "it stands in for a finger that has to move" if places else "the others hold without it"
    postures = way.postures if places else way.postures[::-1]
    build_phases = build_placing if places else build_lifting
    return Relocate(
        finger=change.finger,
        motion=rest_at(known.track.poses[node.at.stop]),
        grasping=list_holding(held if places else after),
        contacts_end=after,
        phases=build_phases(change.finger, held, after),
        why=why + describe_detour(way),
        margins=node.arrival.margins,
        ways=(FingerWay(change.finger, postures, is_detour=bool(way.around)),),
    )
