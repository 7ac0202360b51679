"""A plan: symbolic actions and the grasp after each, as a value that explains itself.

A plan is data, and the whole truth: its actions hold the ways of the fingers and all durations.  Curves in time are made from it
by ``control/reference.py``.
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
from dexplan.notebook import as_html_lines, as_html_table
from dexplan.plans.actions import Action
from dexplan.plans.contacts import Contacts, GoalContact
from dexplan.plans.file import FORMAT, PlanReader, PlanWriter, read_touchdown, write_touchdown
from dexplan.plans.forces import NormalForces
from dexplan.plans.format1 import OLD_FORMAT, upgrade
from dexplan.plans.margins import MarginLimits, spell_margins
from dexplan.plans.poses import read_pose, write_pose
from dexplan.plans.refusal import Refusal
from dexplan.plans.speed import PlannedSpeed
from dexplan.plans.status import Status
from dexplan.plans.timing import Touchdown
from dexplan.plans.words import describe_goal_contacts, explain_action
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class Plan:
    """The answer to a problem: its ``status``, and where that is a no what stood in the way and would help, in ``reason``.

    ``turned_angle`` is the signed unwrapped turn of the goal [rad], None where the goal is an attitude without an axis.
    ``X_WO_goal`` (4, 4) is the goal pose.  ``statistics`` counts the work of the search.  ``goal_contacts`` says per finger where
    it has to touch in the end, None where it has to be free; None instead of the tuple where the goal names no contacts.
    ``normal_force`` [N] is what a loaded contact aims at; no contact bears less than ``normal_floor`` or more than
    ``normal_ceiling`` of it at full load.  ``speed`` says how fast the object turns; None where it never turns, or nobody asked.
    ``touchdown`` says how fingers meet and leave the object.
    """

    status: Status
    reason: str
    fingers: tuple[str, ...]
    goal_kind: str
    X_WO_start: Array
    X_WO_goal: Array
    axis_W: Array | None
    turned_angle: float | None
    start_contacts: Contacts
    actions: tuple[Action, ...]
    normal_force: float
    statistics: Mapping[str, float] = field(default_factory=dict)
    goal_contacts: tuple[GoalContact | None, ...] | None = None
    normal_floor: float = NormalForces.floor
    normal_ceiling: float = NormalForces.ceiling
    speed: PlannedSpeed | None = None
    touchdown: Touchdown = field(default_factory=Touchdown)
    refusal: Refusal | None = None
    """What stood in the way, as a value; None where the goal is reached."""

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "status", Status(self.status))
        for name in ("X_WO_start", "X_WO_goal", "axis_W"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, read_only(value))

    def __str__(self) -> str:
        return self.explain()

    def _repr_html_(self) -> str:
        """Return the plan as notebooks show it: its status, and a row per action."""
        before = (self.start_contacts, *(action.contacts_end for action in self.actions))
        rows = [
            (k, explain_action(self.fingers, action, contacts), spell_margins(action.margins))
            for k, (action, contacts) in enumerate(zip(self.actions, before, strict=False), start=1)
        ]
        heads = ("", "action", "at the worst instant")
        return as_html_lines(self._explain_status()) + (as_html_table(heads, rows) if rows else "")

    @property
    def is_solved(self) -> bool:
        """Whether the plan reaches the goal."""
        return self.status.is_solved

    @property
    def is_timed(self) -> bool:
        """Whether the plan holds all ways and durations, so that it can be run; plans read from files of format 1 do not."""
        return all(action.is_timed for action in self.actions)

    @property
    def duration(self) -> float:
        """Planned duration [s].  Raises ValueError for a plan that has not been timed."""
        return sum(action.duration for action in self.actions)

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as JSON data (``plan.json``, ``docs/plan.schema.json``)."""
        writer = PlanWriter(self.fingers)
        return {
            "format": FORMAT,
            "status": self.status,
            "reason": self.reason,
            **({} if self.refusal is None else {"refusal": self.refusal.as_dict()}),
            "fingers": list(self.fingers),
            "normal_force_N": self.normal_force,
            "normal_floor_N": self.normal_floor,
            "normal_ceiling_N": self.normal_ceiling,
            "start": {
                "object_pose": write_pose(self.X_WO_start),
                "contacts": writer.write_contacts(self.start_contacts),
            },
            "goal": {
                "kind": self.goal_kind,
                "object_pose": write_pose(self.X_WO_goal),
                "axis_W": None if self.axis_W is None else self.axis_W.tolist(),
                "turned_angle_deg": None
                if self.turned_angle is None
                else round(float(np.degrees(self.turned_angle)), 12),
                "contacts": None if self.goal_contacts is None else writer.write_contacts(self.goal_contacts),
            },
            "actions": [writer.write_action(k, action) for k, action in enumerate(self.actions)],
            "touchdown": write_touchdown(self.touchdown),
            "speed": None if self.speed is None else self.speed.as_dict(),
            "statistics": dict(self.statistics),
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
        """Return the plan that :meth:`as_dict` described, or one of format 1, which cannot be run.

        Raises LookupError, TypeError or ValueError for anything else.
        """
        if data["format"] == OLD_FORMAT:
            data = upgrade(data)
        if data["format"] != FORMAT:
            raise ValueError(f"format {data['format']}, not {FORMAT}")
        reader = PlanReader(data["fingers"])
        start, goal = data["start"], data["goal"]
        turned = goal["turned_angle_deg"]
        return cls(
            status=Status(data["status"]),
            reason=data["reason"],
            fingers=tuple(data["fingers"]),
            goal_kind=goal["kind"],
            X_WO_start=read_pose(start["object_pose"]),
            X_WO_goal=read_pose(goal["object_pose"]),
            axis_W=None if goal["axis_W"] is None else np.array(goal["axis_W"]),
            turned_angle=None if turned is None else float(np.radians(turned)),
            start_contacts=reader.read_contacts(start["contacts"]),
            actions=tuple(reader.read_action(action) for action in data["actions"]),
            normal_force=float(data["normal_force_N"]),
            normal_floor=float(data["normal_floor_N"]),
            normal_ceiling=float(data["normal_ceiling_N"]),
            touchdown=read_touchdown(data["touchdown"]),
            speed=None if data["speed"] is None else PlannedSpeed.from_dict(data["speed"]),
            statistics=data["statistics"],
            # Older files, and plans that reach their goal, have none.
            refusal=None if data.get("refusal") is None else Refusal.from_dict(data["refusal"]),
            goal_contacts=None
            if goal.get("contacts") is None
            else reader.read_goal_contacts(goal["contacts"]),
        )

    def explain(self, limits: MarginLimits | None = None) -> str:
        """Return the plan as text: which finger, why, from where to where, what holds meanwhile, what is left to spare.

        ``limits`` are what the problem asks to be left; with them margins are told beside their limits, the tightest marked.
        """
        lines = self._explain_status()
        before = self.start_contacts
        for k, action in enumerate(self.actions):
            lines.append(f"{k + 1:3d}. {explain_action(self.fingers, action, before)}")
            if action.margins:
                lines.append(f"     at the worst instant: {spell_margins(action.margins, limits)}")
            before = action.contacts_end
        return "\n".join(lines)

    def _explain_status(self) -> list[str]:
        """Return what is to be said of the plan as a whole."""
        lines = [f"status: {self.status}, {self.status.meaning}"]
        if self.reason:
            lines.append(f"reason: {self.reason}")
        if self.goal_contacts is not None:
            lines.append(describe_goal_contacts(self.fingers, self.goal_contacts))
        if self.speed is not None:
            lines.append(f"speed: {self.speed}")
        return lines
