"""Where a free fingertip is aimed at while it passes the postures of a phase: many ticks are sampled at once."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from dexplan.control.poses import Pose
from dexplan.control.reference import Phase
from dexplan.kinematics.finger import FingerDescription
from dexplan.spatial import Array

AHEAD = 32
"""Ticks that are sampled together: the kinematics of one posture costs nearly as much as that of them all."""


class FreeWay:
    """The tip poses of a free finger along the postures of a phase."""

    def __init__(
        self,
        finger: FingerDescription,
        phase: Phase,
        q_start: Array,
        start: float,
        tick: float,
        timestep: float,
    ) -> None:
        """Begin at ``start`` [s] with the finger at ``q_start`` (J,); ticks last ``tick`` [s], in steps of ``timestep`` [s]."""
        assert phase.postures is not None
        # The path was planned from where the finger should be; what it is off by fades along the way.
        share = np.linspace(0.0, 1.0, len(phase.postures))
        off = q_start - phase.postures[0]
        self._path = CubicSpline(share, phase.postures + (1.0 - share)[:, None] * off)
        self._finger, self._phase = finger, phase
        self._start, self._tick, self._timestep = start, tick, timestep
        self._poses: dict[float, Pose] = {}

    def find_aim(self, time: float) -> Pose:
        """Return the tip pose X_WF to be at, at the end of the tick that starts at ``time`` [s]."""
        pose = self._poses.get(time)
        if pose is None:
            # Time is summed up step by step, as the simulator does: then the ticks to come are met bit by bit.
            steps = round(self._tick / self._timestep)
            sums = np.add.accumulate(np.array([time, *[self._timestep] * (AHEAD * steps)]))
            times = sums[::steps].tolist()
            travelled = [self._phase.travelled(at - self._start + self._tick) for at in times]
            poses = [Pose.from_matrix(X) for X in self._finger.pose_at(self._path(np.array(travelled)))]
            self._poses = dict(zip(times, poses, strict=True))
            pose = poses[0]
        return pose
