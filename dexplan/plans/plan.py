"""A plan: symbolic actions and the grasp after each, as a value that explains itself.

A plan is data.  Nothing in it is a trajectory: curves in time are made from it by ``control/reference.py``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dexplan.brief import brief_repr
from dexplan.errors import RunFolderError
from dexplan.plans.forces import NormalForces
from dexplan.plans.poses import read_pose, write_pose
from dexplan.plans.roll import Roll
from dexplan.plans.speed import PlannedSpeed
from dexplan.spatial import Array, read_only

FORMAT = 1

SOLVED = "solved"

MUST, MAY, MUST_NOT = "must", "may", "must_not"
"""Whether a finger has to touch the object throughout a phase, may begin or end to touch in it, or has to stay off."""


@dataclass(frozen=True, eq=False)
class Placement:
    """Where and how one finger touches the object.

    ``point_O``, ``normal_O`` (3,): contact point [m] and outward normal in the object frame; ``X_OF`` (4, 4): the fingertip in
    the object frame, spin included; ``q`` (J,): the finger's posture when it lands [rad].
    """

    finger: int
    point_O: Array
    normal_O: Array
    X_OF: Array
    q: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("point_O", "normal_O", "X_OF", "q"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def as_dict(self) -> dict[str, Any]:
        """Return the placement as JSON data; poses as (x, y, z, qw, qx, qy, qz)."""
        return {
            "point_O": self.point_O.tolist(),
            "normal_O": self.normal_O.tolist(),
            "X_OF": self.X_OF.tolist(),
            "q": self.q.tolist(),
        }


@dataclass(frozen=True, eq=False)
class GoalContact:
    """Where a finger has to touch in the end: contact point [m] and outward normal (3,) in the object frame."""

    finger: int
    point_O: Array
    normal_O: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("point_O", "normal_O"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def as_dict(self) -> dict[str, Any]:
        """Return the goal contact as JSON data."""
        return {"point_O": self.point_O.tolist(), "normal_O": self.normal_O.tolist()}


@dataclass(frozen=True)
class PlannedPhase:
    """One stretch of an action during which the demanded contacts do not change: its name and a demand per finger."""

    name: str
    touch: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Action:
    """One symbolic step.

    ``kind`` is hold, move_object, roll, place or lift; ``finger`` the one placed or lifted; ``grasping`` the fingers that hold
    the object throughout; ``rolls`` how some of them roll on it meanwhile, at the progress of the object's motion.
    ``X_WO_start`` and ``X_WO_end`` (4, 4) bound that motion, a turn by ``angle`` [rad] about the world axis ``axis_W`` (3,) with
    a straight shift.  ``limiting_finger`` and ``limit`` say what ended a motion; ``margins`` what was left at its worst sample.
    ``contacts_end`` has one entry per finger, None where it is free.  ``way`` (K, J) are the postures [rad] that the free finger
    goes through where something is in the way of the arc that it would take; None: the arc, or no finger travels.
    """

    kind: str
    finger: int | None
    grasping: tuple[int, ...]
    X_WO_start: Array
    X_WO_end: Array
    axis_W: Array
    angle: float
    contacts_end: tuple[Placement | None, ...]
    phases: tuple[PlannedPhase, ...]
    why: str
    limiting_finger: int | None = None
    limit: str | None = None
    margins: Mapping[str, float] = field(default_factory=dict)
    rolls: tuple[Roll, ...] = ()
    way: Array | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("X_WO_start", "X_WO_end", "axis_W"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        if self.way is not None:
            object.__setattr__(self, "way", read_only(self.way))


@dataclass(frozen=True, eq=False)
class Plan:
    """The answer to a problem: ``status`` "solved", or why not and what would help in ``reason``.

    ``turned_angle`` is the signed unwrapped turn of the goal [rad], None where the goal is an attitude without an axis.
    ``X_WO_goal`` (4, 4) is the goal pose.  ``statistics`` counts the work of the search.  ``goal_contacts`` says per finger where
    it has to touch in the end, None where it has to be free; None instead of the tuple where the goal names no contacts.
    ``normal_force`` [N] is what a loaded contact aims at; no contact bears less than ``normal_floor`` or more than
    ``normal_ceiling`` of it at full load.  ``speed`` says how fast the object turns; None where it never turns, or nobody asked.
    """

    status: str
    reason: str
    fingers: tuple[str, ...]
    goal_kind: str
    X_WO_start: Array
    X_WO_goal: Array
    axis_W: Array | None
    turned_angle: float | None
    start_contacts: tuple[Placement | None, ...]
    actions: tuple[Action, ...]
    normal_force: float
    statistics: Mapping[str, float] = field(default_factory=dict)
    goal_contacts: tuple[GoalContact | None, ...] | None = None
    normal_floor: float = NormalForces.floor
    normal_ceiling: float = NormalForces.ceiling
    speed: PlannedSpeed | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("X_WO_start", "X_WO_goal", "axis_W"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, read_only(value))

    def __str__(self) -> str:
        return self.explain()

    @property
    def is_solved(self) -> bool:
        """Whether the plan reaches the goal."""
        return self.status == SOLVED

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as JSON data (``plan.json``)."""
        return {
            "format": FORMAT,
            "status": self.status,
            "reason": self.reason,
            "fingers": list(self.fingers),
            "normal_force_N": self.normal_force,
            "normal_floor_N": self.normal_floor,
            "normal_ceiling_N": self.normal_ceiling,
            "start": {
                "object_pose": write_pose(self.X_WO_start),
                "contacts": self._contacts(self.start_contacts),
            },
            "goal": {
                "kind": self.goal_kind,
                "object_pose": write_pose(self.X_WO_goal),
                "axis_W": None if self.axis_W is None else self.axis_W.tolist(),
                "turned_angle_deg": None
                if self.turned_angle is None
                else round(float(np.degrees(self.turned_angle)), 12),
                "contacts": None if self.goal_contacts is None else self._contacts(self.goal_contacts),
            },
            "actions": [self._action(k, action) for k, action in enumerate(self.actions)],
            "speed": None if self.speed is None else self.speed.as_dict(),
            "statistics": dict(self.statistics),
        }

    def _contacts(self, contacts: tuple[Placement | GoalContact | None, ...]) -> dict[str, Any]:
        return {
            name: None if c is None else c.as_dict() for name, c in zip(self.fingers, contacts, strict=True)
        }

    def _name(self, finger: int | None) -> str | None:
        return None if finger is None else self.fingers[finger]

    def _action(self, index: int, action: Action) -> dict[str, Any]:
        return {
            "index": index,
            "kind": action.kind,
            "finger": self._name(action.finger),
            "grasping": [self.fingers[i] for i in action.grasping],
            "limiting_finger": self._name(action.limiting_finger),
            "limit": action.limit,
            "why": action.why,
            "object_pose_start": write_pose(action.X_WO_start),
            "object_pose_end": write_pose(action.X_WO_end),
            "rotation": {
                "axis_W": action.axis_W.tolist(),
                "angle_deg": round(float(np.degrees(action.angle)), 12),
            },
            "contacts_end": self._contacts(action.contacts_end),
            "rolls": [
                {
                    "finger": self._name(roll.finger),
                    "X_OF": [write_pose(X) for X in roll.X_OF],
                    "normal_O": np.round(roll.normal_O, 12).tolist(),
                }
                for roll in action.rolls
            ],
            **({} if action.way is None else {"way": action.way.tolist()}),
            "margins": dict(action.margins),
            "phases": [
                {"name": p.name, "touch": dict(zip(self.fingers, p.touch, strict=True))}
                for p in action.phases
            ],
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write ``plan.json`` atomically."""
        target = Path(path)
        partial = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        try:
            partial.write_text(json.dumps(self.as_dict(), indent=1) + "\n", encoding="utf-8")
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Plan:
        """Read a plan written by :meth:`save`.  Raises RunFolderError for anything else."""
        try:
            plan = cls.from_dict(json.loads(Path(path).read_text(encoding="utf-8")))
            # Whatever cannot be told and written again is no plan, however it was made.
            plan.explain()
            plan.as_dict()
            return plan
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise RunFolderError(
                str(path), f"cannot be read as a plan ({error})", "a plan.json written by dexplan is accepted"
            ) from error

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Plan:
        """Return the plan that :meth:`as_dict` described."""
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']}, not {FORMAT}")
        names = list(data["fingers"])
        index = {name: k for k, name in enumerate(names)}

        def contacts(entry: Mapping[str, Any]) -> tuple[Placement | None, ...]:
            return tuple(
                None
                if entry[n] is None
                else Placement(
                    index[n], entry[n]["point_O"], entry[n]["normal_O"], entry[n]["X_OF"], entry[n]["q"]
                )
                for n in names
            )

        actions = tuple(
            Action(
                kind=a["kind"],
                finger=None if a["finger"] is None else index[a["finger"]],
                grasping=tuple(index[n] for n in a["grasping"]),
                X_WO_start=read_pose(a["object_pose_start"]),
                X_WO_end=read_pose(a["object_pose_end"]),
                axis_W=np.array(a["rotation"]["axis_W"]),
                angle=float(np.radians(a["rotation"]["angle_deg"])),
                contacts_end=contacts(a["contacts_end"]),
                phases=tuple(
                    PlannedPhase(p["name"], tuple(p["touch"][n] for n in names)) for p in a["phases"]
                ),
                why=a["why"],
                limiting_finger=None if a["limiting_finger"] is None else index[a["limiting_finger"]],
                limit=a["limit"],
                margins=a["margins"],
                rolls=tuple(
                    Roll(index[r["finger"]], np.stack([read_pose(X) for X in r["X_OF"]]), r["normal_O"])
                    for r in a.get("rolls", ())
                ),
                way=None if a.get("way") is None else np.array(a["way"], dtype=np.float64),
            )
            for a in data["actions"]
        )
        goal = data["goal"]
        # Older files say null for the goal contacts, or nothing.
        wanted = goal.get("contacts")
        turned = goal["turned_angle_deg"]
        return cls(
            status=data["status"],
            reason=data["reason"],
            fingers=tuple(names),
            goal_kind=goal["kind"],
            X_WO_start=read_pose(data["start"]["object_pose"]),
            X_WO_goal=read_pose(goal["object_pose"]),
            axis_W=None if goal["axis_W"] is None else np.array(goal["axis_W"]),
            turned_angle=None if turned is None else float(np.radians(turned)),
            start_contacts=contacts(data["start"]["contacts"]),
            actions=actions,
            normal_force=float(data["normal_force_N"]),
            # Older files do not say: these were the only ones.
            normal_floor=float(data.get("normal_floor_N", 4.0)),
            normal_ceiling=float(data.get("normal_ceiling_N", 12.0)),
            speed=None if data.get("speed") is None else PlannedSpeed.from_dict(data["speed"]),
            statistics=data["statistics"],
            goal_contacts=None
            if wanted is None
            else tuple(
                None if (c := wanted[n]) is None else GoalContact(index[n], c["point_O"], c["normal_O"])
                for n in names
            ),
        )

    def explain(self) -> str:
        """Return the plan as text: which finger, why, from where to where, what holds meanwhile, what is left."""
        from dexplan.plans.words import explain_plan

        return explain_plan(self)
