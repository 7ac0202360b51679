"""Gaits as sequences of actions: finger substitution and finger rewind [paper §2.2]."""

from __future__ import annotations

from dexplan.planning.gait.steps import Step
from dexplan.planning.ways.travel import Way, describe_detour
from dexplan.plans.actions import Action, FingerWay, Hold, MoveObject, Relocate
from dexplan.plans.contacts import Contacts, Placement, list_holding
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.phases import PlannedPhase, build_lifting, build_placing, demand_touch
from dexplan.spatial import Array


def build_actions(steps: list[Step], start: Contacts, axis_W: Array) -> tuple[Action, ...]:
    """Return the actions of a gait: hold, then for every step place, lift and move, and hold at the end.

    ``axis_W`` (3,) is the axis of the steps that name none.
    """
    contacts, axis = start, axis_W
    actions: list[Action] = [build_hold(contacts, rest_at(steps[0].X_WO_start, axis), "let the grasp settle")]
    previous: Step | None = None
    for step in steps:
        axis = axis_W if step.axis_W is None else step.axis_W
        still = rest_at(step.X_WO_start, axis)
        if previous is not None and step.lifted is not None:
            if step.placed is not None:
                actions.append(_place(contacts, step, previous, still))
                contacts = actions[-1].contacts_end
            actions.append(_lift(contacts, step, previous, still))
            contacts = actions[-1].contacts_end
        if not step.is_still:
            actions.append(_move(contacts, step, axis))
        previous = step
    actions.append(build_hold(contacts, rest_at(steps[-1].X_WO_end, axis), "the goal is reached"))
    return tuple(actions)


def _place(contacts: Contacts, step: Step, previous: Step, still: ObjectMotion) -> Relocate:
    """First half of a finger substitution: the free finger forms a grasp with one of the two [paper §2.2]."""
    assert step.placed is not None
    finger = step.placed.finger
    partner = next(c.finger for c in step.contacts if c.finger != finger)
    after = _exchange(contacts, finger, step.placed)
    way = step.ways.get(finger)
    return Relocate(
        finger=finger,
        motion=still,
        grasping=list_holding(contacts),
        contacts_end=after,
        phases=build_placing(finger, contacts, after),
        why=f"{_gait(step)}it forms a force-closure grasp with finger {partner + 1}{describe_detour(way)}",
        limiting_finger=previous.limit[0],
        limit=previous.limit[1],
        margins=step.place_margins,
        ways=_keep_detour(finger, way, is_back=False),
        runner_up=step.runner_up,
    )


def _lift(contacts: Contacts, step: Step, previous: Step, still: ObjectMotion) -> Relocate:
    """Second half: the finger that is no longer needed goes home."""
    assert step.lifted is not None
    limiting, limit = previous.limit
    ended = f"finger {limiting + 1} came to {limit}" if limiting is not None else limit
    stands_in = "" if step.placed is None else f"finger {step.placed.finger + 1} stands in for it; "
    after = _exchange(contacts, step.lifted, None)
    way = step.ways.get(step.lifted)
    return Relocate(
        finger=step.lifted,
        motion=still,
        grasping=list_holding(after),
        contacts_end=after,
        phases=build_lifting(step.lifted, contacts, after),
        why=f"{_gait(step)}{stands_in}{ended}{describe_detour(way)}",
        limiting_finger=limiting,
        limit=limit,
        margins=step.place_margins,
        ways=_keep_detour(step.lifted, way, is_back=True),
    )


def _exchange(contacts: Contacts, finger: int, placement: Placement | None) -> Contacts:
    """Return the contacts with another one, or none, of ``finger``."""
    return tuple(placement if k == finger else c for k, c in enumerate(contacts))


def _keep_detour(finger: int, way: Way | None, *, is_back: bool) -> tuple[FingerWay, ...]:
    """Return the way that a search found between home and hover, as it is walked; nothing for an arc."""
    if way is None:
        return ()
    return (FingerWay(finger, way.postures[::-1] if is_back else way.postures, is_detour=True),)


def _gait(step: Step) -> str:
    return "finger rewind: " if step.is_rewind else ""


def _move(contacts: Contacts, step: Step, axis_W: Array) -> MoveObject:
    limiting, limit = step.limit
    end = f"finger {limiting + 1} comes to {limit}" if limiting is not None else limit
    return MoveObject(
        motion=ObjectMotion.between(step.X_WO_start, step.X_WO_end, axis_W, step.angle),
        grasping=list_holding(contacts),
        contacts_end=contacts,
        phases=(PlannedPhase("move", demand_touch(contacts)),),
        why=f"until {end}",
        limiting_finger=limiting,
        limit=limit,
        margins=step.margins,
    )


def build_hold(contacts: Contacts, still: ObjectMotion, why: str) -> Hold:
    """Return the action that holds still with ``contacts``; ``still`` says where the object stands."""
    return Hold(
        motion=still,
        grasping=list_holding(contacts),
        contacts_end=contacts,
        phases=(PlannedPhase("hold", demand_touch(contacts)),),
        why=why,
    )
