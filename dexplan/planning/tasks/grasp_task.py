"""A task with goal contacts as it was asked: who holds what at first, where the fingers are to touch, and what may be tried."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from dexplan.planning.actions.joining import enclose
from dexplan.planning.admissible.admissibility import Admissibility
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.contacts.landings import build_landings
from dexplan.planning.contacts.still import StillContacts
from dexplan.planning.search.options import SearchOptions
from dexplan.planning.tasks.by_shape import plan_gait
from dexplan.planning.tasks.goal_refusals import GoalContacts, locate_goal
from dexplan.planning.tasks.no import No
from dexplan.planning.tasks.start_spins import center_start_spins
from dexplan.planning.tasks.starting import Start
from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts, GoalContact, Placement
from dexplan.plans.goal import RotationGoal
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal
from dexplan.plans.status import Status
from dexplan.spatial import VERTICAL, Array


@dataclass(frozen=True, eq=False)
class GraspTask:
    """What is asked: from the contacts ``start``, the object at ``X_WO`` (4, 4), to the contacts ``goal``.

    ``hold`` is the plan that holds still at the start: it settles the start contacts, or says what is wrong with them.
    ``goal_contacts`` says where on the object the goal contacts are.
    """

    hand: HandModel
    X_WO: Array
    start: Start
    goal: GoalContacts
    options: SearchOptions
    admissibility: Admissibility = field(init=False)
    hold: Plan = field(init=False)
    goal_contacts: tuple[GoalContact | None, ...] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "admissibility", Admissibility(self.hand))
        still, options = RotationGoal(self.X_WO, VERTICAL, 0.0), self.options
        hold = plan_gait(self.hand, still, self.start, options.node_budget, options.primitives)
        object.__setattr__(self, "hold", hold)
        object.__setattr__(self, "goal_contacts", locate_goal(self.hand, self.goal))

    @property
    def is_on_sites(self) -> bool:
        """Whether the object looks different from different sides, so that its ways are searched over sites."""
        return not self.hand.object.is_isotropic

    def spin_start(self, motion: ObjectMotion) -> Contacts:
        """Return the start contacts; on sites, where all of ``motion`` is searched over at once, with the spins it asks for."""
        held = self.hold.start_contacts
        return center_start_spins(self.hand, held, self.start, motion) if self.is_on_sites else held

    @property
    def is_start_refused(self) -> bool:
        """Whether the start contacts do not hold: then :attr:`hold` says why."""
        return self.hold.status not in (Status.SOLVED, Status.NO_ADMISSIBLE_PAIR)

    def land_goal(self, X_WO: Array) -> tuple[Contacts, tuple[str, ...]]:
        """Return the goal contacts with the object at ``X_WO`` (4, 4), and which fingers cannot reach their own, by name."""
        found: list[Placement | None] = []
        missing = []
        for finger, wanted in enumerate(self.goal_contacts):
            if wanted is None:
                found.append(None)
                continue
            points = wanted.point_O[None] if self.is_on_sites else None
            placement = build_landings(self.hand, X_WO, finger, wanted.normal_O[None], points)[0]
            found.append(placement)
            if placement is None:
                missing.append(self.hand.fingers[finger].name)
        return tuple(found), tuple(missing)

    def refuse_goal(self, X_WO: Array, contacts: Contacts) -> Refusal | None:
        """Return why the goal grasp cannot hold the object at ``X_WO`` (4, 4); None where it can."""
        still = StillContacts(self.hand, X_WO, self.admissibility)
        stand = tuple(None if c is None else still.add(c) for c in contacts)
        return still.judge(stand).refusal

    def build_plan(
        self, kind: str, goal: RotationGoal, actions: tuple[Action, ...], start: Contacts, nodes: int
    ) -> Plan:
        """Return the plan made of ``actions``, found after so many nodes."""
        whole = enclose(actions, start, self.X_WO, goal.axis_W)
        return replace(
            self.refuse(kind, goal, No(Status.SOLVED, ""), nodes), start_contacts=start, actions=whole
        )

    def refuse_start(self, kind: str, goal: RotationGoal) -> Plan:
        """Return the plan that says why the start contacts do not hold."""
        return self.refuse(kind, goal, No(self.hold.status, self.hold.reason, self.hold.refusal))

    def refuse(self, kind: str, goal: RotationGoal, no: No, nodes: int = 0) -> Plan:
        """Return the plan that says why there is none, after so many nodes."""
        return replace(
            self.hold,
            status=no.status,
            reason=no.reason,
            refusal=no.refusal,
            goal_kind=kind,
            goal_contacts=self.goal_contacts,
            X_WO_goal=goal.X_WO_goal,
            axis_W=goal.axis_W,
            turned_angle=None if goal.is_attitude else goal.angle,
            actions=(),
            statistics={"nodes": nodes},
        )
