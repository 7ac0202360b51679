"""Move an object with fingers whose contacts roll: any number of joints from three on."""

from __future__ import annotations

from dexplan.planning.actions.joining import enclose
from dexplan.planning.contacts.oracle import Progress
from dexplan.planning.contacts.rolling_contacts import RollingContacts, RollingGrip
from dexplan.planning.regrasp.rolling_gait import RollingGait, build_rolling_actions
from dexplan.plans.plan import Plan
from dexplan.plans.refusal import Refusal
from dexplan.plans.status import Status
from dexplan.plans.timing import Touchdown


def plan_rolling(contacts: RollingContacts, start: RollingGrip, node_budget: int) -> Plan:
    """Return a plan that takes the object along the way of ``contacts`` from a grip.

    No plan is an answer with a status: ``start_inadmissible`` where the start does not hold, ``no_gait`` where everything was
    tried, ``budget_exhausted`` where nodes ran out.
    """
    refusal = contacts.judge(start, Progress(0, 0)).refusal
    if refusal is not None:
        return _answer(contacts, start, Status.START_INADMISSIBLE, refusal, 0)
    gait = RollingGait(contacts, start)
    last = gait.run(node_budget)
    if last is None:
        status = Status.NO_GAIT if gait.is_exhausted else Status.BUDGET_EXHAUSTED
        return _answer(contacts, start, status, gait.explain(), gait.opened)
    plan = _answer(contacts, start, Status.SOLVED, None, gait.opened)
    track = contacts.touches.track
    actions = enclose(
        build_rolling_actions(contacts, last),
        plan.start_contacts,
        plan.X_WO_start,
        track.motions[0].axis_W,
    )
    return Plan(**{**vars(plan), "actions": actions})


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
