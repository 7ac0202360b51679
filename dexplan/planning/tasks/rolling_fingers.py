"""Move an object with fingers whose contacts roll: any number of joints from three on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.bodies.sites import build_sites
from dexplan.contact.friction import SoftFinger
from dexplan.kinematics.carry import Carrier
from dexplan.planning.actions.joining import enclose
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.rolling_hold import RollingHold
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.rolling_contacts import RollingContacts
from dexplan.planning.contacts.rolling_stations import RollingGrip, RollingStations
from dexplan.planning.contacts.rolling_touches import RollingTouches
from dexplan.planning.contacts.track import Track
from dexplan.planning.regrasp.rolling_gait import RollingGait, build_rolling_actions
from dexplan.planning.search.moves import Go
from dexplan.planning.search.nodes import trace_back
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal
from dexplan.plans.status import Status
from dexplan.plans.timing import Touchdown
from dexplan.spatial import Array, lock_arrays

SPACING = 0.005
"""Sites to land on are so far apart [m]: drift and handovers are reckoned with to about half of it."""


def build_rolling_contacts(
    hand: HandModel, nominal: SoftFinger, track: Track, *, edge_band: float = 0.0, rolls: bool = True
) -> RollingContacts:
    """Return the oracle for a hand that takes the object along a ``track``.

    Args:
        hand: the hand; ``hand.friction`` is the believed friction.
        nominal: the friction that pivoting contacts are expected to bear.
        track: the object's way.
        edge_band: so much [m] beside sharp edges of the body stays free.
        rolls: contacts roll; else tip poses stay fixed on the object, which takes six joints.
    """
    carriers = tuple(
        Carrier(f.chain, f.tip_radius, hand.limits.joint_margin, hand.tip_polar_limit, edge_band)
        for f in hand.fingers
    )
    sites = build_sites(hand.object.body, SPACING, edge_band)
    touches = RollingTouches(hand, carriers, track, sites, rolls)
    return RollingContacts(RollingStations(touches, RollingHold(hand, nominal)))


@dataclass(frozen=True, eq=False)
class RollingPlan:
    """A ``plan``, and how far (F,) [m] every tip slides in all by the law of pivoting contacts, with the forces planned."""

    plan: Plan
    slips: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def plan_rolling(contacts: RollingContacts, start: RollingGrip, node_budget: int) -> RollingPlan:
    """Return a plan that takes the object along the way of ``contacts`` from a grip.

    No plan is an answer with a status: ``start_inadmissible`` where the start does not hold, ``no_gait`` where everything was
    tried, ``budget_exhausted`` where nodes ran out.
    """
    refusal = contacts.judge(start, Progress(0, 0)).refusal
    if refusal is not None:
        no = _answer(contacts, start, Status.START_INADMISSIBLE, refusal, 0)
        return RollingPlan(no, np.zeros(len(start)))
    gait = RollingGait(contacts, start)
    last = gait.run(node_budget)
    if last is None:
        status = Status.NO_GAIT if gait.is_exhausted else Status.BUDGET_EXHAUSTED
        no = _answer(contacts, start, status, gait.explain(), gait.opened)
        return RollingPlan(no, np.zeros(len(start)))
    plan = _answer(contacts, start, Status.SOLVED, None, gait.opened)
    track = contacts.touches.track
    actions = enclose(
        build_rolling_actions(contacts, last),
        plan.start_contacts,
        plan.X_WO_start,
        track.motions[0].axis_W,
    )
    slips = np.zeros(len(start))
    for before, after in pairwise(trace_back(last)):
        if (go := after.find_move(Go)) is not None:
            slips += contacts.stations.measure_slips(before.grip, before.at, go.stops)
    return RollingPlan(replace(plan, actions=actions), slips)


def _answer(
    contacts: RollingContacts, start: RollingGrip, status: Status, refusal: Refusal | None, opened: int
) -> Plan:
    hand, track = contacts.hand, contacts.touches.track
    first = Progress(0, 0)
    return Plan(
        status=status,
        reason="" if refusal is None else str(refusal),
        fingers=tuple(finger.name for finger in hand.fingers),
        goal_kind="rotation",
        X_WO_start=track.poses[0],
        X_WO_goal=track.poses[-1],
        axis_W=track.motions[0].axis_W,
        turned_angle=sum(motion.angle for motion in track.motions),
        start_contacts=tuple(None if t is None else contacts.place(t, first) for t in start),
        actions=(),
        normal_force=hand.normal_force,
        statistics={"nodes": float(opened)},
        normal_floor=hand.limits.normal_floor,
        normal_ceiling=hand.limits.normal_ceiling,
        touchdown=Touchdown(hover=hand.hover, speed=0.005),
        refusal=refusal,
    )
