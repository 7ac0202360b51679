"""What a real robot would know: the only state the controller sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array


@dataclass(frozen=True, eq=False)
class Observation:
    """One reading of the robot's senses.

    ``time`` [s]; ``q``, ``qdot`` (F, J) from joint encoders; ``X_WO`` (4, 4) from an object tracker; ``touching`` (F,) from
    binary touch sensors in the fingertips.  No contact forces, no contact points, no object velocity.
    """

    time: float
    q: Array
    qdot: Array
    X_WO: Array
    touching: NDArray[np.bool_]

    __repr__ = brief_repr
