"""A fingertip that rolls on the object while it holds: the path of the tip in the object frame, as data and as a curve."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.spatial import Array, read_only


@dataclass(frozen=True, eq=False)
class TipRoll:
    """Finger ``finger`` rolls: its tip passes ``X_OF`` (K, 4, 4) in the object frame at evenly spaced progress.

    ``normal_O`` (K, 3) are the object's outward unit normals at the contacts on the way.
    """

    finger: int
    X_OF: Array
    normal_O: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("X_OF", "normal_O"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def count(self) -> int:
        """Number of samples K."""
        return len(self.X_OF)

    @cached_property
    def tip_angle(self) -> float:
        """How far the tip turns relative to the object along the way [rad]."""
        steps = np.swapaxes(self.X_OF[:-1, :3, :3], 1, 2) @ self.X_OF[1:, :3, :3]
        return float(np.linalg.norm(Rotation.from_matrix(steps).as_rotvec(), axis=1).sum())

    @cached_property
    def _spline(self) -> CubicSpline:
        quat = Rotation.from_matrix(self.X_OF[:, :3, :3]).as_quat(scalar_first=True)
        # One sign along the way: q and -q are the same rotation, but not the same number.
        quat[1:] *= np.cumprod(np.where(np.sum(quat[1:] * quat[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
        values = np.concatenate([self.X_OF[:, :3, 3], self.normal_O, quat], axis=1)
        return CubicSpline(np.linspace(0.0, 1.0, self.count), values)

    def sample(self, s: float) -> tuple[Array, Array]:
        """Return the tip pose X_OF (4, 4) and the outward normal (3,) at progress ``s`` in [0, 1]."""
        row = self._spline(min(max(s, 0.0), 1.0))
        normal = row[3:6] / np.sqrt(row[3:6].dot(row[3:6]))
        w, x, y, z = row[6:] / np.sqrt(row[6:].dot(row[6:]))
        X = np.array(
            [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y), row[0]],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x), row[1]],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y), row[2]],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        return X, normal
