"""Where the reference has the object at this tick and at the next: many ticks are sampled at once."""

from __future__ import annotations

from typing import NamedTuple

from dexplan.control.poses import Pose
from dexplan.control.reference import ObjectPath
from dexplan.spatial import Array

AHEAD = 32
"""Ticks that are sampled together: one costs nearly as much as all of them."""
SAME_TIME = 1e-12
"""Times nearer to one another [s] than this are the same, summed up in another way."""


class Moment(NamedTuple):
    """Where the object is to be at one tick, ``X_WO`` (4, 4) and the same as ``pose``, and a tick later, ``pose_next``; its
    ``acceleration`` (6,) = (v', w') in W.
    """

    X_WO: Array
    acceleration: Array
    pose: Pose
    pose_next: Pose


class ObjectAhead:
    """The object's reference tick by tick, for ticks of ``tick`` [s]."""

    def __init__(self, tick: float) -> None:
        self._tick = tick
        self._path: ObjectPath | None = None
        self._times: list[float] = []
        self._moments: list[Moment] = []
        self._k, self._is_still = 0, False

    def look(self, path: ObjectPath, t: float) -> Moment:
        """Return where the object is to be ``t`` [s] after the start of ``path``."""
        k = self._k = self._k + 1
        # In a new phase, and where an approach ended by a touch, time does not go on from tick to tick.
        if path is not self._path or (
            not self._is_still and (k >= AHEAD or abs(self._times[k] - t) > SAME_TIME)
        ):
            self._sample(path, t)
        return self._moments[0 if self._is_still else self._k]

    def _sample(self, path: ObjectPath, t: float) -> None:
        """Sample ``path`` from ``t`` [s] on."""
        self._path, self._k, self._is_still = path, 0, path.motion.is_still
        self._times = [t + n * self._tick for n in range(1 if self._is_still else AHEAD + 1)]
        X, _, acceleration = path.sample_many(self._times)
        poses = [Pose.from_matrix(x) for x in X]
        self._moments = [
            Moment(*row) for row in zip(X, acceleration, poses, poses[1:] or poses, strict=False)
        ]
