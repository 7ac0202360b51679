"""What a film tells in words: what is being done, by which finger, why, and where it is to end.

A trace carries this as JSON data (``meta["captions"]``), so that it can be filmed without its plan.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.names import name_place
from dexplan.plans.actions import Action, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import list_holding
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.plan import Plan
from dexplan.plans.poses import read_pose, write_pose
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, lock_arrays
from dexplan.viz.body import find_body
from dexplan.viz.timeline import choose_axis

PLACING = {
    "travel": "{} moves to its new place",
    "approach": "{} touches down",
    "load": "{} takes over load",
}
LIFTING = {
    "unload": "{} hands over its load",
    "retreat": "{} leaves the object",
    "travel": "{} moves out of the way",
}
"""What a finger does in each phase of being placed and of being lifted."""
LEAST_SHIFT, LEAST_TURN = 1e-4, 1e-3
"""Below these [m], [rad] the object is not said to be moved."""


@dataclass(frozen=True)
class Chapter:
    """One action in words: a headline per phase, its reason, the fingers that move, and the one that is near a limit."""

    headlines: tuple[str, ...]
    why: str = ""
    movers: tuple[int, ...] = ()
    limiting: int | None = None

    def get_headline(self, phase: int) -> str:
        """Return what is said in a phase; of one that the action does not have, what is said in its last."""
        return self.headlines[max(0, min(phase, len(self.headlines) - 1))] if self.headlines else ""


@dataclass(frozen=True, eq=False)
class Story:
    """All actions in words, and the goal: turn about ``axis_W`` [rad], pose and contact points on the object [m].

    What is not known is None; of ``goal_points`` a finger's is None where it has to be free in the end.
    """

    chapters: tuple[Chapter, ...]
    axis_W: Array
    turn: float | None = None
    X_WO_goal: Array | None = None
    goal_points: tuple[Array | None, ...] = ()

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def find_chapter(self, action: int) -> Chapter:
        """Return the chapter of an action; an empty one where there is none."""
        return self.chapters[action] if 0 <= action < len(self.chapters) else Chapter(())


def tell_story(plan: Plan | None, trace: Trace) -> Story:
    """Return what a film of ``trace`` tells: from its plan, without one from what the trace itself carries."""
    if plan is None:
        captions = trace.meta.get("captions")
    else:
        captions = build_captions(plan, find_body(trace.model_xml))
    return read_captions(captions if isinstance(captions, Mapping) else {})


def build_captions(plan: Plan, body: ConvexBody | None = None) -> dict[str, Any]:
    """Return what a film says of ``plan`` as JSON data that a trace may carry; of a ``body`` with faces it says on which."""
    points = [None if c is None else c.point_O.tolist() for c in plan.goal_contacts or ()]
    return {
        "actions": [list(describe_phases(plan, action, body)) for action in plan.actions],
        "why": [explain(plan, action) for action in plan.actions],
        "movers": [list(find_movers(action)) for action in plan.actions],
        "limiting": [action.limiting_finger for action in plan.actions],
        "axis_W": choose_axis(plan).tolist(),
        "turn": compute_goal_turn(plan),
        "goal_pose": write_pose(plan.X_WO_goal),
        "goal_points": points,
    }


def read_captions(captions: Mapping[str, Any]) -> Story:
    """Return the story in JSON data that a trace carries; what is missing or odd stays out of it."""
    try:
        return _read(captions)
    except (TypeError, ValueError, KeyError, IndexError, AttributeError):
        return Story((), np.array([0.0, 0.0, 1.0]))


def _read(captions: Mapping[str, Any]) -> Story:
    texts = captions.get("actions", [])
    count = len(texts)
    why, movers, limiting = (captions.get(key) or [None] * count for key in ("why", "movers", "limiting"))
    chapters = [
        Chapter(
            tuple(map(str, texts[k])),
            str(why[k] or ""),
            tuple(int(finger) for finger in movers[k] or ()),
            None if limiting[k] is None else int(limiting[k]),
        )
        for k in range(count)
    ]
    axis = np.asarray(captions.get("axis_W", (0.0, 0.0, 1.0)), dtype=float)
    if axis.shape != (3,) or not np.linalg.norm(axis) > 1e-6:
        raise ValueError("no axis")
    turn, pose = captions.get("turn"), captions.get("goal_pose")
    points = captions.get("goal_points") or ()
    return Story(
        tuple(chapters),
        axis / np.linalg.norm(axis),
        None if turn is None else float(turn),
        None if pose is None else read_pose(pose),
        tuple(None if p is None else np.array(p, dtype=float).reshape(3) for p in points),
    )


def compute_goal_turn(plan: Plan) -> float:
    """Return how far the goal is turned from the start [rad], about the axis of the story, whole turns included."""
    if plan.turned_angle is not None:
        return float(plan.turned_angle)
    R = plan.X_WO_goal[:3, :3] @ plan.X_WO_start[:3, :3].T
    return float(np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0)))


def find_movers(action: Action) -> tuple[int, ...]:
    """Return the fingers that move on their own in an action, rather than with the object."""
    own = [action.finger] if isinstance(action, Relocate) else [way.finger for way in action.ways]
    rolling = [roll.finger for roll in action.rolls]
    return tuple(dict.fromkeys([*own, *rolling]))


def describe_phases(plan: Plan, action: Action, body: ConvexBody | None = None) -> tuple[str, ...]:
    """Return what is being done, in words, in each phase of an action, and which finger is near a limit."""
    holders = speak_fingers(plan.fingers, list_holding(action.contacts_end))
    is_many = len(list_holding(action.contacts_end)) != 1
    match action:
        case Relocate():
            own, texts = speak(plan.fingers[action.finger]), PLACING if action.is_placing else LIFTING
            heads = [texts.get(p.name, f"{{}}: {p.name}").format(own) for p in action.phases]
            heads = [f"{head}{name_face(action, body)}" for head in heads]
        case MoveObject():
            heads = [f"{holders} {describe_motion(action.motion, is_many)}"] * len(action.phases)
            if action.rolls:
                rolling = speak_fingers(plan.fingers, [roll.finger for roll in action.rolls])
                heads = [f"{head}, {rolling} rolling on it" for head in heads]
        case Roll():
            own = speak_fingers(plan.fingers, [roll.finger for roll in action.rolls])
            verb = "roll" if len(action.rolls) != 1 else "rolls"
            heads = [f"{own} {verb} on the object"] * len(action.phases)
        case Hold():
            heads = [f"{holders} {'hold' if is_many else 'holds'} the object still"] * len(action.phases)
    limit = action.limiting_finger
    if limit is not None:
        near = f"{speak(plan.fingers[limit])} {'comes' if isinstance(action, MoveObject) else 'is'} near its limit"
        heads = [f"{head} · {near}" for head in heads]
    return tuple(heads)


def name_face(action: Action, body: ConvexBody | None) -> str:
    """Return on which face of a body a finger is placed; nothing where the body has no letters or the finger is lifted."""
    if not isinstance(action, Relocate) or not action.is_placing:
        return ""
    placement = action.contacts_end[action.finger]
    letter = "" if body is None or placement is None else name_place(body, placement.point_O)
    return f" on face {letter}" if letter else ""


def explain(plan: Plan, action: Action) -> str:
    """Return the reason of an action; of a motion of the object it says how far it goes, and follows its headline as it is."""
    reason = speak(action.why, plan.fingers)
    return reason if isinstance(action, MoveObject) else f"why: {reason}"


def describe_motion(motion: ObjectMotion, is_many: bool) -> str:
    """Return what fingers do with the object, for instance ``turn the object by 76°``."""
    shift = float(np.linalg.norm(motion.shift_W))
    parts = []
    if abs(motion.angle) > LEAST_TURN:
        parts.append(f"{'turn' if is_many else 'turns'} the object by {abs(np.degrees(motion.angle)):.0f}°")
    if shift > LEAST_SHIFT:
        verb = "shift" if is_many else "shifts"
        parts.append(f"{verb} {'it' if parts else 'the object'} by {1e3 * shift:.0f} mm")
    return " and ".join(parts) or ("keep the object in place" if is_many else "keeps the object in place")


def speak_fingers(names: Sequence[str], fingers: Sequence[int]) -> str:
    """Return fingers in words: ``finger 1``, or ``fingers 1 and 2`` where their names differ by a number alone."""
    spoken = [speak(names[f]) for f in fingers]
    numbers = [s.removeprefix("finger ") for s in spoken]
    if len(spoken) > 1 and all(n.isdecimal() for n in numbers):
        return f"fingers {', '.join(numbers[:-1])} and {numbers[-1]}"
    return " and ".join(spoken) or "no finger"


def speak(text: str, names: Sequence[str] = ()) -> str:
    """Return a text with names such as ``finger_1/link_2`` and ``finger_1`` as they are spoken."""
    known = "|".join(re.escape(n) for n in sorted(names, key=len, reverse=True)) if names else r"\w+"
    return re.sub(rf"\b(?:{known})(?:/\w+)?", lambda m: m[0].replace("/", " ").replace("_", " "), text)
