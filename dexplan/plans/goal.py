"""What is asked for: the three task types of the paper (§1), and the ways an object may take to its goal."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.plans.motion import ObjectMotion
from dexplan.spatial import VERTICAL, Array, read_only, rotate_about


@dataclass(frozen=True, eq=False)
class RotationGoal:
    """Object manipulation: turn the object from ``X_WO_start`` (4, 4) by ``angle`` [rad] about the unit world axis ``axis_W``
    through its centre, and shift the centre by ``shift_W`` (3,) [m].

    Angles beyond a turn mean more turns; the sign is the sense.  ``is_attitude``: only the attitude at the end counts, not the
    way there.
    """

    X_WO_start: Array
    axis_W: Array
    angle: float
    shift_W: Array = field(default_factory=lambda: np.zeros(3))
    is_attitude: bool = False

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "X_WO_start", read_only(self.X_WO_start))
        object.__setattr__(self, "axis_W", read_only(self.axis_W / np.linalg.norm(self.axis_W)))
        object.__setattr__(self, "shift_W", read_only(self.shift_W))

    @property
    def motion(self) -> ObjectMotion:
        """The motion that is asked for; one of many that lead there where only the attitude counts."""
        return ObjectMotion(self.X_WO_start, self.axis_W, self.angle, self.shift_W)

    @property
    def X_WO_goal(self) -> Array:
        """The object pose (4, 4) to reach."""
        X = self.X_WO_start.copy()
        X[:3, :3] = rotate_about(self.axis_W, self.angle) @ X[:3, :3]
        X[:3, 3] += self.shift_W
        return X

    @classmethod
    def from_attitude(cls, X_WO_start: Array, R_WO_goal: Array, shift_W: Array | None = None) -> RotationGoal:
        """Return the goal that reaches the attitude ``R_WO_goal`` (3, 3); its axis and angle are those of the shortest way."""
        turn = Rotation.from_matrix(R_WO_goal @ X_WO_start[:3, :3].T).as_rotvec()
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle > 1e-12 else VERTICAL
        return cls(X_WO_start, axis, angle, np.zeros(3) if shift_W is None else shift_W, is_attitude=True)
