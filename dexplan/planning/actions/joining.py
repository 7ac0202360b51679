"""Joining what was planned apart: where a piece of a plan leaves the fingers, and pieces one after another as one plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dexplan.planning.actions.gaits import build_hold
from dexplan.planning.admissible.carry import follow_object
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regrasp.moves import Contacts, Move
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import MAY, MUST, MUST_NOT, Action, Placement, PlannedPhase
from dexplan.spatial import Array


def build_move_actions(moves: tuple[Move, ...], before: Contacts, axis_W: Array) -> tuple[Action, ...]:
    """Return an adjustment's moves as actions; ``axis_W`` (3,) is noted where the object stands still.

    Carries from pose to pose with one grasp become one motion of the object.
    """
    actions: list[Action] = []
    k = 0
    while k < len(moves):
        if moves[k].kind != "carry":
            actions.append(_relocate(moves[k], before, axis_W))
            before, k = moves[k].contacts, k + 1
            continue
        last = k
        while last + 1 < len(moves) and moves[last + 1].kind == "carry":
            last += 1
        first, end = moves[k].motion, moves[last].motion
        assert first is not None
        assert end is not None
        actions.append(_carry(moves[k : last + 1], first, end, before, last + 1 < len(moves)))
        before, k = moves[last].contacts, last + 1
    return tuple(actions)


def _carry(
    moves: tuple[Move, ...], first: ObjectMotion, last: ObjectMotion, before: Contacts, goes_on: bool
) -> Action:
    """Return carries one after another as one motion of the object."""
    rows = [m.margins for m in moves]
    return Action(
        kind="move_object",
        finger=None,
        grasping=_holding(before),
        X_WO_start=first.X_WO_start,
        X_WO_end=last.X_WO_end,
        axis_W=first.axis_W,
        angle=len(moves) * first.angle,
        contacts_end=moves[-1].contacts,
        phases=(PlannedPhase("move", _touch(before)),),
        why="until fingers can be relocated" if goes_on else "until the object is where it should be",
        margins={key: (max if key == "torque_share" else min)(row[key] for row in rows) for key in rows[0]},
    )


def _relocate(move: Move, before: Contacts, axis_W: Array) -> Action:
    """Return a placement, lift or roll as an action."""
    touch, after = _touch(before), _touch(move.contacts)
    grasping = _holding(before)
    if move.kind == "roll":
        phases = [PlannedPhase("roll", touch)]
    else:
        assert move.finger is not None
        changing = tuple(MAY if k == move.finger else t for k, t in enumerate(touch))
        if move.kind == "place":
            phases = [
                PlannedPhase("travel", touch),
                PlannedPhase("approach", changing),
                PlannedPhase("load", after),
            ]
        else:
            grasping = _holding(move.contacts)
            phases = [
                PlannedPhase("unload", touch),
                PlannedPhase("retreat", changing),
                PlannedPhase("travel", after),
            ]
    return Action(
        kind=move.kind,
        finger=move.finger,
        grasping=grasping,
        X_WO_start=move.X_WO,
        X_WO_end=move.X_WO,
        axis_W=axis_W,
        angle=0.0,
        contacts_end=move.contacts,
        phases=tuple(phases),
        why=move.why,
        margins=move.margins,
        rolls=move.rolls,
        way=move.way,
    )


def without_holds(actions: tuple[Action, ...]) -> tuple[Action, ...]:
    """Return the actions that change something."""
    return tuple(a for a in actions if a.kind != "hold")


def follow_actions(hand: HandModel, contacts: Contacts, actions: tuple[Action, ...]) -> Contacts:
    """Return the contacts after ``actions`` with the postures that the fingers then have.

    A placement's ``q`` is the posture in which the finger landed; what has moved since changes it.
    """
    for action in actions:
        now: list[Placement | None] = []
        rolled = {roll.finger for roll in action.rolls}
        shift = action.X_WO_end[:3, 3] - action.X_WO_start[:3, 3]
        motion = ObjectMotion(action.X_WO_start, action.axis_W, action.angle, shift)
        for before, after in zip(contacts, action.contacts_end, strict=True):
            if before is None or after is None or after.finger in rolled:
                now.append(after)
            elif motion.is_still:
                now.append(before)
            else:
                q, _ = follow_object(hand, before, motion.poses())
                now.append(replace(before, q=q[-1]))
        contacts = tuple(now)
    return contacts


def enclose(actions: tuple[Action, ...], start: Contacts, X_WO: Array, axis_W: Array) -> tuple[Action, ...]:
    """Return ``actions`` between a hold in which the first grasp settles and one in which the goal is held."""
    first: dict[str, Any] = {"X_WO_start": X_WO, "X_WO_end": X_WO, "axis_W": axis_W, "angle": 0.0}
    end = actions[-1].X_WO_end if actions else X_WO
    last = actions[-1].contacts_end if actions else start
    return (
        build_hold(list(start), first, "let the grasp settle"),
        *actions,
        build_hold(list(last), {**first, "X_WO_start": end, "X_WO_end": end}, "the goal is reached"),
    )


def _holding(contacts: Contacts) -> tuple[int, ...]:
    return tuple(int(i) for i in np.flatnonzero([c is not None for c in contacts]))


def _touch(contacts: Contacts) -> tuple[str, ...]:
    return tuple(MUST_NOT if c is None else MUST for c in contacts)
