"""What a real robot would know: the only state the controller sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array


@dataclass(frozen=True, eq=False)
class PlannedMotion:
    """Where the plan has the object at a tick; told to controllers that do not know the plan themselves.

    ``X_WO`` (4, 4) is the object's pose, ``V_WO`` (6,) its velocity (v [m/s], w [rad/s]) and ``A_WO`` (6,) its acceleration,
    both in world axes and of the object's centre; ``X_WO_next`` (4, 4) the pose one tick later, where servo targets given now
    should lead.  ``action_index`` and ``phase_index`` say which action of the plan this is and which of its phases,
    ``time_in_phase`` [s] since when, ``holding`` (F,) which fingers the plan has holding the object.
    """

    X_WO: Array
    V_WO: Array
    A_WO: Array
    X_WO_next: Array
    action_index: int
    phase_index: int
    time_in_phase: float
    holding: NDArray[np.bool_]

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class Observation:
    """One reading of the robot's senses.

    ``time`` [s] since the run began; ``q`` [rad], ``qdot`` [rad/s] (F, J) from joint encoders, a row per finger; ``X_WO``
    (4, 4) the object's pose in the world from an object tracker; ``touching`` (F,) from binary touch sensors in the fingertips.
    No contact forces, no contact points, no object velocity.  ``motion`` is where the plan has the object; None for dexplan's
    own controller, which has the plan.
    """

    time: float
    q: Array
    qdot: Array
    X_WO: Array
    touching: NDArray[np.bool_]
    motion: PlannedMotion | None = None

    __repr__ = brief_repr
