"""Fingers of real hands as chains, for tests: lengths and joint limits as their makers publish them."""

from __future__ import annotations

import numpy as np

from dexplan.kinematics.chain import Chain
from dexplan.spatial import make_pose, rotate_about

TRIFINGER_TIP = 0.010
"""Radius [m] of the tip of TriFinger Pro."""


def build_trifinger(azimuth_deg: float = 0.0) -> Chain:
    """Return a finger of TriFinger Pro: three joints, its base 290 mm above the floor, the pole pointing down the last link."""
    base = make_pose(rotate_about([0.0, 0.0, 1.0], np.radians(azimuth_deg)), [0.0, 0.0, 0.29])
    offsets = np.stack(
        [base, make_pose(p=np.array([0.01685, 0.0505, 0.0])), make_pose(p=np.array([0.05015, 0.0, -0.16]))]
    )
    X_JF = make_pose(np.diag([1.0, -1.0, -1.0]), [0.019, 0.0, -0.16])
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    return Chain(offsets, axes, X_JF, np.array([-0.33, 0.0, -2.7]), np.array([1.0, 1.57, 0.0]))
