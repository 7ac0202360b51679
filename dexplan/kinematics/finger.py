"""One finger as a value without MuJoCo: its chain, its tip, and the limits of its servos."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.brief import brief_repr
from dexplan.kinematics.chain import Chain, compute_tip_pose
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class FingerDescription:
    """One finger: its names in the model, its chain, the radius of its tip [m] and the limits of its servos.

    ``servo_gain`` (J,) [N m/rad] and ``servo_damping`` (J,) [N m s/rad] describe the position servos inside the simulator,
    ``torque_limit`` (J,) [N m] what they can give.  ``q_home`` (J,) [rad] points the tip at the object from a short way off.
    """

    name: str
    joint_names: tuple[str, ...]
    tip_radius: float
    chain: Chain
    torque_limit: Array
    servo_gain: Array
    servo_damping: Array
    q_home: Array

    __repr__ = brief_repr

    def pose_at(self, q: Array) -> Array:
        """Return X_WF (..., 4, 4) at joint angles ``q`` (..., J) [rad]."""
        return compute_tip_pose(self.chain, q)

    def __post_init__(self) -> None:
        for name in ("torque_limit", "servo_gain", "servo_damping", "q_home"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
