"""How near fingers come to what they must not touch, by MuJoCo's own collisions."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from dexplan.sim.judge.world import Indices, World
from dexplan.spatial import Array

OBSTACLE_KINDS = ("object", "fingers", "obstacles", "floor")
"""What a finger's clearance is measured to: the last axis of ``Replay.clearance``."""


class Clearances:
    """The world with every geom reaching out by ``horizon`` [m]: its collisions are distances."""

    def __init__(self, world: World, horizon: float) -> None:
        self.world, self.horizon = world, horizon
        self._model = copy.deepcopy(world.model)
        self._model.geom_margin[:] = horizon
        self._model.body_margin[:] = horizon  # made from the geoms' when the model was compiled
        self._data = mujoco.MjData(self._model)
        self._kinds = _name_kinds(world)

    def measure(self, qpos: Array) -> Array:
        """Return the smallest distances (F, 4) [m] of each finger's geoms to :data:`OBSTACLE_KINDS` at ``qpos``, at most
        the horizon.
        """
        out = np.full((len(self.world.fingers), len(OBSTACLE_KINDS)), self.horizon)
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_collision(self._model, data)
        if not data.ncon:
            return out
        pairs, distances = data.contact.geom, data.contact.dist
        owner, kind = self.world.geom_finger, self._kinds
        for one, other in ((pairs[:, 0], pairs[:, 1]), (pairs[:, 1], pairs[:, 0])):
            # A finger's own links are no obstacle to it.
            counts = (owner[one] >= 0) & (owner[one] != owner[other])
            np.minimum.at(out, (owner[one[counts]], kind[other[counts]]), distances[counts])
        return out


def _name_kinds(world: World) -> Indices:
    """Return for each geom its index in :data:`OBSTACLE_KINDS`; whatever is neither object, finger nor floor
    is an obstacle.
    """
    kinds = np.full(len(world.geom_names), OBSTACLE_KINDS.index("obstacles"))
    kinds[world.geom_finger >= 0] = OBSTACLE_KINDS.index("fingers")
    kinds[world.object_geom] = OBSTACLE_KINDS.index("object")
    kinds[world.geom_names.index("floor")] = OBSTACLE_KINDS.index("floor")
    return kinds
