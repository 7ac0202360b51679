"""What is asked for: the three task types of the paper (§1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.spatial import Array, read_only, rotate_about


@dataclass(frozen=True, eq=False)
class RotationGoal:
    """Object manipulation: turn the object from ``X_WO_start`` (4, 4) by ``angle`` [rad] about the unit world axis ``axis_W``.

    Angles beyond a turn mean more turns; the sign is the sense.
    """

    X_WO_start: Array
    axis_W: Array
    angle: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "X_WO_start", read_only(self.X_WO_start))
        object.__setattr__(self, "axis_W", read_only(self.axis_W / np.linalg.norm(self.axis_W)))

    @property
    def X_WO_goal(self) -> Array:
        """The object pose (4, 4) to reach."""
        X = self.X_WO_start.copy()
        X[:3, :3] = rotate_about(self.axis_W, self.angle) @ X[:3, :3]
        return X

    @classmethod
    def from_attitude(cls, X_WO_start: Array, R_WO_goal: Array) -> RotationGoal:
        """Return the goal that reaches the attitude ``R_WO_goal`` (3, 3) the shortest way."""
        turn = Rotation.from_matrix(R_WO_goal @ X_WO_start[:3, :3].T).as_rotvec()
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle > 1e-12 else np.array([0.0, 0.0, 1.0])
        return cls(X_WO_start, axis, angle)
