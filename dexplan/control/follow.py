"""From where the fingertips should be to joint angles: differential inverse kinematics by mink, one step per tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import daqp  # type: ignore[import-not-found]
import mink
import numpy as np

from dexplan.control.hand import HandBody
from dexplan.control.poses import Pose
from dexplan.control.tasks import FingertipTask
from dexplan.spatial import Array

DAMPING = 1e-9
"""Weight of joint motion beside the fingertips' errors: it only decides what they leave open."""
NEAR_LIMIT = 1e-3
"""A joint this near to its limit [rad] is at it."""
LIMIT_GAIN = 0.95
"""Share of the way to a joint's limit that one tick may go, mink's default for `mink.ConfigurationLimit`."""


class Step(NamedTuple):
    """One step of the commanded posture: joint rates ``qdot`` (F, J) [rad/s], the largest distance ``tip_error`` [m] left between
    aimed and commanded fingertips, and whether a joint is at its limit.
    """

    qdot: Array
    tip_error: float
    is_at_limit: bool


class PostureFollower:
    """The commanded posture, which follows the fingertips' targets within joint ranges and speeds.

    The quadratic program is that of `mink.solve_ik` for our task, `mink.ConfigurationLimit` and `mink.VelocityLimit`, written
    into arrays that stay, with joint limits as bounds and not as rows; DAQP is asked directly.  mink builds it anew at every
    tick, looks at the limits once more and goes through two more layers, for the same answer in four times the time
    (docs/choices.md).
    """

    def __init__(self, body: HandBody, joint_speed: float, tick: float) -> None:
        self._shape, self._tick = body.lower.shape, tick
        self._configuration = mink.Configuration(body.model)
        self._qpos = self._configuration.data.qpos
        nv = body.model.nv
        self._task = FingertipTask(body.sites, nv)
        self._H, self._c, self._nowhere = np.empty((nv, nv)), np.empty(nv), np.zeros(nv)
        # How far each joint is from its upper limit, and from its lower one; how far it may go in a tick.
        self._lower, self._upper = body.lower.reshape(-1), body.upper.reshape(-1)
        self._room, self._most = np.empty(2 * nv), joint_speed * tick
        self._up, self._down = self._room[:nv], self._room[nv:]
        self._step, self._step_down = np.empty(2 * nv), np.empty(nv)
        self._step_up, self._rows, self._sense = self._step[:nv], np.empty((0, nv)), np.zeros(nv, np.intc)

    @property
    def q(self) -> Array:
        """The commanded posture (F, J) [rad]."""
        return self._qpos.reshape(self._shape).copy()

    def start(self, qpos: Array) -> None:
        """Begin at the posture ``qpos`` (nq,)."""
        self._configuration.update(qpos)
        self._measure_room()

    def _measure_room(self) -> float:
        """Take down how far the joints are from their limits; return the least of that [rad]."""
        np.subtract(self._upper, self._qpos, out=self._up)
        np.subtract(self._qpos, self._lower, out=self._down)
        return float(self._room[self._room.argmin()])

    def follow(self, targets: Sequence[Pose]) -> Step:
        """Move the posture towards the tip poses ``targets``, as far as one tick allows.  Without an answer it stays."""
        task, configuration = self._task, self._configuration
        task.set_targets(targets)
        task.write_objective(configuration, self._H, self._c, DAMPING)
        np.multiply(self._room, LIMIT_GAIN, out=self._step)
        np.minimum(self._step, self._most, out=self._step)
        np.negative(self._step[len(self._c) :], out=self._step_down)
        step, _, flag, _ = daqp.solve(
            self._H, self._c, self._rows, self._step_up, self._step_down, self._sense
        )
        velocity = step / self._tick if flag > 0 else self._nowhere
        configuration.integrate_inplace(velocity, self._tick)
        far = task.compute_distance(configuration)
        return Step(velocity.reshape(self._shape), far, self._measure_room() < NEAR_LIMIT)
