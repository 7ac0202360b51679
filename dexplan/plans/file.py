"""``plan.json``, format 2: contacts and actions as JSON data and back.  ``docs/plan.schema.json`` says what stands where.

Every pose is (x, y, z, qw, qx, qy, qz), in metres; fingers are named.  What was read is written again to the byte.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dexplan.plans.actions import Action, FingerWay, Hold, MoveObject, Relocate, Roll
from dexplan.plans.contacts import Contacts, GoalContact, Placement
from dexplan.plans.motion import ObjectMotion
from dexplan.plans.pace import Pace
from dexplan.plans.phases import PlannedPhase
from dexplan.plans.poses import read_pose, write_pose
from dexplan.plans.runner_up import RunnerUp
from dexplan.plans.timing import Touchdown
from dexplan.plans.tip_roll import TipRoll

FORMAT = 2
"""The format that is written."""
DIGITS = 12
"""Decimals of positions, angles and directions."""
SAME_POSE = 1e-6
"""An action's end and the end of its motion differ by less in every number [m, 1].  Files round the poses and the angle."""


class PlanWriter:
    """Writes what names fingers by their numbers with the names of the ``fingers``."""

    def __init__(self, fingers: Sequence[str]) -> None:
        self._names = tuple(fingers)

    def write_contacts(self, contacts: Sequence[Placement | GoalContact | None]) -> dict[str, Any]:
        """Return the contacts by finger."""
        return {name: _write_contact(c) for name, c in zip(self._names, contacts, strict=True)}

    def write_action(self, index: int, action: Action) -> dict[str, Any]:
        """Return an action; ``index`` is its place in the plan."""
        motion = action.motion
        angle_deg = round(float(np.degrees(motion.angle)), DIGITS)
        shift = np.round(motion.shift_W, DIGITS) + 0.0
        start = write_pose(motion.X_WO_start)
        # The end follows from what is written, as it does for a reader.
        end = ObjectMotion(read_pose(start), motion.axis_W, float(np.radians(angle_deg)), shift).X_WO_end
        return {
            "index": index,
            "kind": action.name,
            **({"finger": self._names[action.finger]} if isinstance(action, Relocate) else {}),
            "grasping": [self._names[i] for i in action.grasping],
            "limiting_finger": None
            if action.limiting_finger is None
            else self._names[action.limiting_finger],
            "limit": action.limit,
            "why": action.why,
            **self._write_runner_up(action),
            "object_pose_start": start,
            "object_pose_end": write_pose(end),
            "rotation": {"axis_W": motion.axis_W.tolist(), "angle_deg": angle_deg},
            "shift_W_m": shift.tolist(),
            **self._write_pace(action),
            "contacts_end": self.write_contacts(action.contacts_end),
            "ways": [
                {
                    "finger": self._names[way.finger],
                    "is_detour": way.is_detour,
                    "postures_rad": way.postures.tolist(),
                }
                for way in action.ways
            ],
            "margins": dict(action.margins),
            "phases": [
                {
                    "name": phase.name,
                    "duration_s": phase.duration,
                    "touch": dict(zip(self._names, phase.touch, strict=True)),
                }
                for phase in action.phases
            ],
        }

    def _write_runner_up(self, action: Action) -> dict[str, Any]:
        """Return what would have been placed instead, where that is known."""
        if not isinstance(action, Relocate) or action.runner_up is None:
            return {}
        return {"runner_up": action.runner_up.as_dict(self._names)}

    def _write_pace(self, action: Action) -> dict[str, Any]:
        """Return what only actions with a motion in time have: its pace, and the tips that roll meanwhile."""
        if not isinstance(action, Roll | MoveObject):
            return {}
        pace = action.pace
        return {
            "pace": None
            if pace is None
            else {"duration_s": pace.duration, "ramp_s": pace.ramp, "limit": pace.limit},
            "rolls": [
                {
                    "finger": self._names[roll.finger],
                    "X_OF": [write_pose(X) for X in roll.X_OF],
                    "normal_O": np.round(roll.normal_O, DIGITS).tolist(),
                }
                for roll in action.rolls
            ],
        }


class PlanReader:
    """Reads what :class:`PlanWriter` wrote, with the names of the ``fingers``.  Raises LookupError, TypeError or ValueError."""

    def __init__(self, fingers: Sequence[str]) -> None:
        self._names = tuple(fingers)
        self._index = {name: k for k, name in enumerate(self._names)}

    def read_contacts(self, data: Mapping[str, Any]) -> Contacts:
        """Return the contacts by finger."""
        return tuple(
            None
            if (c := data[name]) is None
            else Placement(finger, c["point_O"], c["normal_O"], read_pose(c["X_OF"]), c["q_rad"])
            for finger, name in enumerate(self._names)
        )

    def read_goal_contacts(self, data: Mapping[str, Any]) -> tuple[GoalContact | None, ...]:
        """Return where fingers have to touch in the end."""
        return tuple(
            None if (c := data[name]) is None else GoalContact(finger, c["point_O"], c["normal_O"])
            for finger, name in enumerate(self._names)
        )

    def read_action(self, data: Mapping[str, Any]) -> Action:
        """Return an action."""
        shared = self._read_shared(data)
        match data["kind"]:
            case "hold":
                return Hold(**shared)
            case "roll":
                return Roll(**shared, **self._read_pace(data))
            case "move_object":
                return MoveObject(**shared, **self._read_pace(data))
            case "place" | "lift":
                other = data.get("runner_up")
                action = Relocate(
                    **shared,
                    finger=self._index[data["finger"]],
                    runner_up=None if other is None else RunnerUp.from_dict(other, self._names),
                )
                if action.name != data["kind"]:
                    raise ValueError(
                        f"action {data['index'] + 1} is called {data['kind']}, and is a {action.name}"
                    )
                return action
            case other:
                raise ValueError(f"action {data['index'] + 1} is of kind {other!r}")

    def _read_shared(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values that every action has."""
        limiting = data["limiting_finger"]
        motion = ObjectMotion(
            read_pose(data["object_pose_start"]),
            np.array(data["rotation"]["axis_W"]),
            float(np.radians(data["rotation"]["angle_deg"])),
            np.array(data["shift_W_m"]),
        )
        if not np.allclose(motion.X_WO_end, read_pose(data["object_pose_end"]), rtol=0.0, atol=SAME_POSE):
            raise ValueError(f"action {data['index'] + 1} does not end at its object_pose_end")
        return {
            "motion": motion,
            "grasping": tuple(self._index[name] for name in data["grasping"]),
            "contacts_end": self.read_contacts(data["contacts_end"]),
            "phases": tuple(
                PlannedPhase(
                    p["name"],
                    tuple(p["touch"][name] for name in self._names),
                    None if p["duration_s"] is None else float(p["duration_s"]),
                )
                for p in data["phases"]
            ),
            "why": data["why"],
            "limiting_finger": None if limiting is None else self._index[limiting],
            "limit": data["limit"],
            "margins": data["margins"],
            "ways": tuple(
                FingerWay(
                    self._index[w["finger"]], np.array(w["postures_rad"], dtype=np.float64), w["is_detour"]
                )
                for w in data["ways"]
            ),
        }

    def _read_pace(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return what only actions with a motion in time have."""
        pace = data["pace"]
        return {
            "pace": None
            if pace is None
            else Pace(float(pace["duration_s"]), float(pace["ramp_s"]), str(pace["limit"])),
            "rolls": tuple(
                TipRoll(self._index[r["finger"]], np.stack([read_pose(X) for X in r["X_OF"]]), r["normal_O"])
                for r in data["rolls"]
            ),
        }


def _write_contact(contact: Placement | GoalContact | None) -> dict[str, Any] | None:
    if contact is None:
        return None
    where = {"point_O": contact.point_O.tolist(), "normal_O": contact.normal_O.tolist()}
    if isinstance(contact, GoalContact):
        return where
    return {**where, "X_OF": write_pose(contact.X_OF), "q_rad": contact.q.tolist()}


def write_touchdown(touchdown: Touchdown) -> dict[str, float]:
    """Return how fingers meet and leave the object."""
    return {
        "hover_m": touchdown.hover,
        "speed_m_s": touchdown.speed,
        "timeout_s": touchdown.timeout,
        "light_load": touchdown.light_load,
    }


def read_touchdown(data: Mapping[str, float]) -> Touchdown:
    """Return what :func:`write_touchdown` wrote."""
    return Touchdown(*(float(data[name]) for name in ("hover_m", "speed_m_s", "timeout_s", "light_load")))
