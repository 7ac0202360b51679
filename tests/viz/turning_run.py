"""A run made by hand for pictures: a ball that turns, fingers that say they hold it, nothing simulated."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from dexplan.plans.actions import Hold, MoveObject, Relocate
from dexplan.plans.contacts import Contacts, Placement
from dexplan.plans.motion import ObjectMotion, rest_at
from dexplan.plans.phases import MAY, MUST, MUST_NOT, PlannedPhase
from dexplan.plans.plan import Plan
from dexplan.scene.library import load_scene
from dexplan.sim.trace import Trace
from dexplan.spatial import Array, as_pose7, build_frame, direction_from_angles, make_pose, rotate_about

AXIS = np.array([0.0, 0.0, 1.0])
AZIMUTHS = (-38.0, 102.0, 240.0)
HOLD, MOVE, PLACE, LIFT = range(4)


@lru_cache
def make_plan(turn_deg: float = 90.0) -> Plan:
    """Return a plan of four actions: hold, turn, place the third finger, lift the first."""
    home = load_scene().object.X_WO_home
    turned = make_pose(rotate_about(AXIS, np.radians(turn_deg)), home[:3, 3])
    before = (_make_placement(0), _make_placement(1), None)
    three = (*before[:2], _make_placement(2))
    after = (None, *three[1:])
    both = (MUST, MUST, MUST_NOT)

    def values(motion: ObjectMotion, contacts: Contacts, phases: tuple, **changes: object) -> dict[str, Any]:
        return {
            "motion": motion,
            "grasping": (0, 1),
            "contacts_end": contacts,
            "phases": tuple(PlannedPhase(*phase) for phase in phases),
            "why": "made by hand",
            **changes,
        }

    placing = (("travel", both), ("approach", (MUST, MUST, MAY)), ("load", (MUST, MUST, MUST)))
    lifting = (("unload", (MAY, MUST, MUST)), ("travel", (MUST_NOT, MUST, MUST)))
    angle = np.radians(turn_deg)
    turn = ObjectMotion(home, AXIS, angle, np.zeros(3))
    limit = {"limiting_finger": 1, "limit": "tip_rotation"}
    actions = (
        Hold(**values(rest_at(home), before, (("hold", both),))),
        MoveObject(**values(turn, before, (("turn", both),), **limit)),
        Relocate(**values(rest_at(turned), three, placing, finger=2)),
        Relocate(**values(rest_at(turned), after, lifting, finger=0, grasping=(1, 2))),
    )
    names = tuple(finger.name for finger in load_scene().fingers)
    return Plan(
        "solved",
        "",
        names,
        "object_manipulation",
        home,
        turned,
        AXIS,
        angle,
        before,
        actions,
        normal_force=5.0,
    )


def make_trace(turn_deg: float = 90.0, duration: float = 1.0, dt: float = 0.02) -> Trace:
    """Return the run of :func:`make_plan`: the turn takes the middle half, place and lift the rest."""
    scene = load_scene()
    time = np.arange(round(duration / dt) + 1) * dt
    share = time / duration
    q_home = np.stack([finger.q_home for finger in scene.fingers])
    angles = np.radians(turn_deg) * np.clip(2.0 * share - 0.5, 0.0, 1.0)
    poses = [make_pose(rotate_about(AXIS, a), scene.object.X_WO_home[:3, 3]) for a in angles]
    action = np.searchsorted([0.25, 0.75, 0.9], share, side="right")
    active = np.stack([action < LIFT, np.ones(len(time), dtype=bool), share >= 0.85], axis=1)
    normals = direction_from_angles(AZIMUTHS, (0.0, 0.0, 0.0))
    frames = np.stack([build_frame(-n) for n in normals])
    force = np.broadcast_to([0.3, 0.9, 5.0, 0.001], (len(time), 3, 4))
    columns = {
        "time": time,
        "qpos": np.stack([scene.as_qpos(q_home, X) for X in poses]),
        "object_pose_reference": as_pose7(np.stack(poses)),
        "action_index": action,
        "phase_index": np.where(action == PLACE, np.where(share < 0.85, 1, 2), 0),
        "contact_active": active,
        "contact_point_O": _mask(np.broadcast_to(0.035 * normals, (len(time), 3, 3)), active),
        "contact_rotation_O": _mask(np.broadcast_to(frames, (len(time), 3, 3, 3)), active),
        "contact_force": _mask(force, active),
        "contact_force_reference": _mask(1.02 * force, active),
    }
    return Trace(scene.xml, columns, {"failure": None})


def _make_placement(finger: int) -> Placement:
    normal = direction_from_angles(AZIMUTHS[finger], 0.0)
    X_OF = make_pose(build_frame(-normal), 0.053 * normal)
    return Placement(finger, 0.035 * normal, normal, X_OF, load_scene().fingers[finger].q_home)


def _mask(values: Array, active: Array) -> Array:
    """Return ``values`` (T, F, ...) with NaN where ``active`` (T, F) says no."""
    return np.where(active.reshape(*active.shape, *(1,) * (values.ndim - 2)), values, np.nan)
