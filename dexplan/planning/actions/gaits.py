"""Gaits as sequences of actions: finger substitution and finger rewind [paper §2.2]."""

from __future__ import annotations

from typing import Any

import numpy as np

from dexplan.planning.gait.steps import Step
from dexplan.planning.ways.travel import describe_detour
from dexplan.plans.plan import MAY, MUST, MUST_NOT, Action, Placement, PlannedPhase
from dexplan.spatial import Array


def build_actions(
    steps: list[Step], start: tuple[Placement | None, ...], axis_W: Array
) -> tuple[Action, ...]:
    """Return the actions of a gait: hold, then for every step place, lift and move, and hold at the end.

    ``axis_W`` (3,) is the axis of the steps that name none.
    """
    contacts = list(start)
    X = steps[0].X_WO_start
    still = {"X_WO_start": X, "X_WO_end": X, "axis_W": axis_W, "angle": 0.0}
    actions = [build_hold(contacts, still, "let the grasp settle")]
    previous: Step | None = None
    for step in steps:
        axis = axis_W if step.axis_W is None else step.axis_W
        still = {"X_WO_start": step.X_WO_start, "X_WO_end": step.X_WO_start, "axis_W": axis, "angle": 0.0}
        if previous is not None and step.lifted is not None:
            if step.placed is not None:
                actions.append(_place(contacts, step, previous, still))
            actions.append(_lift(contacts, step, previous, still))
        if not step.is_still:
            actions.append(_move(contacts, step, axis))
        previous = step
    end = steps[-1].X_WO_end
    actions.append(build_hold(contacts, {**still, "X_WO_start": end, "X_WO_end": end}, "the goal is reached"))
    return tuple(actions)


def _place(contacts: list[Placement | None], step: Step, previous: Step, still: dict[str, Any]) -> Action:
    """First half of a finger substitution: the free finger forms a grasp with one of the two [paper §2.2]."""
    assert step.placed is not None
    finger, before = step.placed.finger, _holding(contacts)
    partner = next(c.finger for c in step.contacts if c.finger != finger)
    phases = [
        PlannedPhase("travel", _touch(contacts, {})),
        PlannedPhase("approach", _touch(contacts, {finger: MAY})),
    ]
    contacts[finger] = step.placed
    phases.append(PlannedPhase("load", _touch(contacts, {})))
    way = step.ways.get(finger)
    return Action(
        kind="place",
        finger=finger,
        grasping=before,
        contacts_end=tuple(contacts),
        phases=tuple(phases),
        why=f"{_gait(step)}it forms a force-closure grasp with finger {partner + 1}{describe_detour(way)}",
        limiting_finger=previous.limit[0],
        limit=previous.limit[1],
        margins=step.place_margins,
        way=None if way is None else way.postures,
        **still,
    )


def _lift(contacts: list[Placement | None], step: Step, previous: Step, still: dict[str, Any]) -> Action:
    """Second half: the finger that is no longer needed goes home."""
    assert step.lifted is not None
    limiting, limit = previous.limit
    ended = f"finger {limiting + 1} came to {limit}" if limiting is not None else limit
    stands_in = "" if step.placed is None else f"finger {step.placed.finger + 1} stands in for it; "
    phases = [PlannedPhase("unload", _touch(contacts, {}))]
    contacts[step.lifted] = None
    phases += [
        PlannedPhase("retreat", _touch(contacts, {step.lifted: MAY})),
        PlannedPhase("travel", _touch(contacts, {})),
    ]
    way = step.ways.get(step.lifted)
    return Action(
        kind="lift",
        finger=step.lifted,
        grasping=_holding(contacts),
        contacts_end=tuple(contacts),
        phases=tuple(phases),
        why=f"{_gait(step)}{stands_in}{ended}{describe_detour(way)}",
        limiting_finger=limiting,
        limit=limit,
        margins=step.place_margins,
        way=None if way is None else way.postures[::-1],
        **still,
    )


def _gait(step: Step) -> str:
    return "finger rewind: " if step.is_rewind else ""


def _move(contacts: list[Placement | None], step: Step, axis_W: Array) -> Action:
    limiting, limit = step.limit
    end = f"finger {limiting + 1} comes to {limit}" if limiting is not None else limit
    return Action(
        kind="move_object",
        finger=None,
        grasping=_holding(contacts),
        X_WO_start=step.X_WO_start,
        X_WO_end=step.X_WO_end,
        axis_W=axis_W,
        angle=step.angle,
        contacts_end=tuple(contacts),
        phases=(PlannedPhase("move", _touch(contacts, {})),),
        why=f"until {end}",
        limiting_finger=limiting,
        limit=limit,
        margins=step.margins,
    )


def build_hold(contacts: list[Placement | None], still: dict[str, Any], why: str) -> Action:
    """Return the action that holds still with ``contacts``; ``still`` says where the object stands."""
    phase = PlannedPhase("hold", _touch(contacts, {}))
    return Action(
        "hold", None, _holding(contacts), contacts_end=tuple(contacts), phases=(phase,), why=why, **still
    )


def _holding(contacts: list[Placement | None]) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero([c is not None for c in contacts]))


def _touch(contacts: list[Placement | None], changing: dict[int, str]) -> tuple[str, ...]:
    return tuple(changing.get(i, MUST_NOT if c is None else MUST) for i, c in enumerate(contacts))
