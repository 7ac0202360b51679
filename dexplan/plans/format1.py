"""Plans of format 1, as they were written before actions held their ways and times: to be shown and judged, not to be run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dexplan.plans.file import write_touchdown
from dexplan.plans.poses import read_pose, write_pose
from dexplan.plans.timing import Touchdown

OLD_FORMAT = 1
OLD_LIMITS = {"normal_floor_N": 4.0, "normal_ceiling_N": 12.0}
"""What every plan had before plans said it [N]."""


def upgrade(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a plan's data of format 1 as data of format 2 that has no arcs and no durations.

    Tips in the object were matrices; a detour was an action's only way; how a finger travels otherwise, and how long anything
    takes, was not written.
    """
    return {
        **OLD_LIMITS,
        "speed": None,
        **data,
        "format": 2,
        "touchdown": write_touchdown(Touchdown()),
        "start": {**data["start"], "contacts": _upgrade_contacts(data["start"]["contacts"])},
        "goal": {"contacts": None, **data["goal"]},
        "actions": [_upgrade_action(action) for action in data["actions"]],
    }


def _upgrade_action(action: Mapping[str, Any]) -> dict[str, Any]:
    start, end = (read_pose(action[name]) for name in ("object_pose_start", "object_pose_end"))
    kept = {name: value for name, value in action.items() if name not in ("finger", "rolls", "way")}
    way, ways = action.get("way"), []
    if way is not None:
        ways = [{"finger": action["finger"], "is_detour": True, "postures_rad": way}]
    if action["kind"] in ("place", "lift"):
        kept["finger"] = action["finger"]
    if action["kind"] in ("roll", "move_object"):
        kept |= {"pace": None, "rolls": action.get("rolls", [])}
    return {
        **kept,
        "shift_W_m": (np.round(end[:3, 3] - start[:3, 3], 12) + 0.0).tolist(),
        "contacts_end": _upgrade_contacts(action["contacts_end"]),
        "ways": ways,
        "phases": [{**phase, "duration_s": None} for phase in action["phases"]],
    }


def _upgrade_contacts(contacts: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: None
        if c is None
        else {
            "point_O": c["point_O"],
            "normal_O": c["normal_O"],
            "X_OF": write_pose(np.array(c["X_OF"], dtype=np.float64)),
            "q_rad": c["q"],
        }
        for name, c in contacts.items()
    }
