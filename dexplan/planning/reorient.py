"""How should the object stand so that every finger reaches its goal contact?  The smallest turns that bring it there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.planning.coordinated import ObjectMotion
from dexplan.planning.stages import Stages
from dexplan.planning.still import build_landings
from dexplan.scene.workspace import spread_directions
from dexplan.spatial import Array, rotate_about

AXES = 96
"""Axes about which turns are tried."""
TURN_STEP = float(np.radians(10.0))
"""Angles between the turns that are tried [rad]."""
ENOUGH = 8
"""As many turns are looked for."""


@dataclass(frozen=True, eq=False)
class Turn:
    """A turn of the object by ``angle`` [rad] about the unit world axis ``axis_W`` (3,), and the joint room it leaves [rad]."""

    axis_W: Array
    angle: float
    room: float


def find_turns(stages: Stages) -> tuple[list[Turn], str]:
    """Return turns from the smallest on after which the goal grasp can be held; and, where there are none, why not.

    The reason is "" where no turn brings all contacts within reach.  Among turns of the same size those with the most room in
    the joints come first.
    """
    axes, fault, found = spread_directions(AXES), "", []
    for angle in np.arange(TURN_STEP, np.pi + 1e-9, TURN_STEP):
        level = []
        for axis in axes[_reach_mask(stages, axes, float(angle))]:
            X_WO = ObjectMotion(stages.X_WO, axis, float(angle), np.zeros(3)).X_WO_end
            contacts, missing = stages.land_goal(X_WO)
            if missing:
                continue
            if refusal := stages.refuse_goal(X_WO, contacts):
                fault = fault or refusal
                continue
            room = min(
                float(np.minimum(c.q - chain.lower, chain.upper - c.q).min())
                for c in contacts
                if c is not None
                for chain in [stages.hand.fingers[c.finger].chain]
            )
            level.append(Turn(axis, float(angle), room))
        found += sorted(level, key=lambda turn: -turn.room)[:3]
        if len(found) >= ENOUGH:
            break
    return found, "" if found else fault


def _reach_mask(stages: Stages, axes: Array, angle: float) -> Array:
    """Return about which of ``axes`` (N, 3) a turn by ``angle`` [rad] brings every goal contact within reach (N,)."""
    mask = np.ones(len(axes), dtype=bool)
    turns = np.stack([rotate_about(axis, angle) for axis in axes])
    R_WO = stages.X_WO[:3, :3]
    for finger, normal in enumerate(stages.goal):
        if normal is None or not mask.any():
            continue
        # A ball looks the same from every side: turning the object is turning the contact on an object that stands still.
        normals_O = (turns[mask] @ (R_WO @ normal)) @ R_WO
        landed = build_landings(stages.hand, stages.X_WO, finger, normals_O)
        mask[mask] = [placement is not None for placement in landed]
    return mask
