"""Joining what was planned apart: where a piece of a plan leaves the fingers, and pieces one after another as one plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dexplan.planning.actions.gaits import build_hold
from dexplan.planning.admissible.carry import follow_object
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regrasp.moves import Move
from dexplan.plans.actions import Action, FingerWay, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Contacts, Placement, list_holding
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.phases import PlannedPhase, build_lifting, build_placing, demand_touch
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
        while last + 1 < len(moves) and _goes_on(moves[last], moves[last + 1]):
            last += 1
        first, end = moves[k].motion, moves[last].motion
        assert first is not None
        assert end is not None
        actions.append(_carry(moves[k : last + 1], first, end, before, last + 1 < len(moves)))
        before, k = moves[last].contacts, last + 1
    return tuple(actions)


def _goes_on(before: Move, after: Move) -> bool:
    """Return whether a carry is the next piece of the same motion as the one before."""
    one, other = before.motion, after.motion
    if one is None or other is None:
        return False
    same_turn = np.allclose(one.axis_W, other.axis_W, atol=1e-9) and np.isclose(one.angle, other.angle)
    return bool(same_turn and np.allclose(one.shift_W, other.shift_W, atol=1e-9))


def _carry(
    moves: tuple[Move, ...], first: ObjectMotion, last: ObjectMotion, before: Contacts, goes_on: bool
) -> MoveObject:
    """Return carries one after another as one motion of the object."""
    rows = [m.margins for m in moves]
    angle = len(moves) * first.angle
    return MoveObject(
        motion=ObjectMotion.between(first.X_WO_start, last.X_WO_end, first.axis_W, angle),
        grasping=list_holding(before),
        contacts_end=moves[-1].contacts,
        phases=(PlannedPhase("move", demand_touch(before)),),
        why="until fingers can be relocated" if goes_on else "until the object is where it should be",
        margins={key: (max if key == "torque_share" else min)(row[key] for row in rows) for key in rows[0]},
    )


def _relocate(move: Move, before: Contacts, axis_W: Array) -> Relocate | Roll:
    """Return a placement, lift or roll as an action."""
    after, still = move.contacts, rest_at(move.X_WO, axis_W)
    if move.kind == "roll":
        return Roll(
            motion=still,
            grasping=list_holding(before),
            contacts_end=after,
            phases=(PlannedPhase("roll", demand_touch(before)),),
            why=move.why,
            margins=move.margins,
            rolls=move.rolls,
        )
    assert move.finger is not None
    places = move.kind == "place"
    build_phases = build_placing if places else build_lifting
    return Relocate(
        finger=move.finger,
        motion=still,
        grasping=list_holding(before if places else after),
        contacts_end=after,
        phases=build_phases(move.finger, before, after),
        why=move.why,
        margins=move.margins,
        ways=() if move.way is None else (FingerWay(move.finger, move.way, is_detour=True),),
    )


def without_holds(actions: tuple[Action, ...]) -> tuple[Action, ...]:
    """Return the actions that change something."""
    return tuple(a for a in actions if not isinstance(a, Hold))


def follow_actions(hand: HandModel, contacts: Contacts, actions: tuple[Action, ...]) -> Contacts:
    """Return the contacts after ``actions`` with the postures that the fingers then have.

    A placement's ``q`` is the posture in which the finger landed; what has moved since changes it.
    """
    for action in actions:
        now: list[Placement | None] = []
        rolled = {roll.finger for roll in action.rolls}
        motion = action.motion
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
    end = actions[-1].X_WO_end if actions else X_WO
    last = actions[-1].contacts_end if actions else start
    return (
        build_hold(start, rest_at(X_WO, axis_W), "let the grasp settle"),
        *actions,
        build_hold(last, rest_at(end, axis_W), "the goal is reached"),
    )
