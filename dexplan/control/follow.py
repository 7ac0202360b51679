"""From where the fingertips should be to joint angles: differential inverse kinematics by mink, one step per tick."""

from __future__ import annotations

from dataclasses import dataclass

import daqp  # type: ignore[import-not-found]
import mink
import numpy as np

from dexplan.brief import brief_repr
from dexplan.control.hand import HandBody
from dexplan.control.tasks import FingertipTask, JointLimit
from dexplan.spatial import Array

DAMPING = 1e-9
"""Weight of joint motion beside the fingertips' errors: it only decides what they leave open."""
NEAR_LIMIT = 1e-3
"""A joint this near to its limit [rad] is at it."""
_INFINITY = 1e30
"""What DAQP takes for "no bound"."""


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the commanded posture: joint rates ``qdot`` (F, J) [rad/s], the largest distance ``tip_error`` [m] left between
    aimed and commanded fingertips, and whether a joint is at its limit.
    """

    qdot: Array
    tip_error: float
    is_at_limit: bool

    __repr__ = brief_repr


class PostureFollower:
    """The commanded posture, which follows the fingertips' targets within joint ranges and speeds.

    mink builds the quadratic program; DAQP is asked directly.  `mink.solve_ik` would look at the limits once more, which the
    program keeps, and go through two more layers, for the same answer in twice the time (docs/choices.md).
    """

    def __init__(self, body: HandBody, joint_speed: float, tick: float) -> None:
        self._joints, self._tick = body.joints, tick
        self._configuration = mink.Configuration(body.model)
        self._qpos = self._configuration.data.qpos
        self._task = FingertipTask(body.sites, body.model.nv)
        self._tasks = [self._task]
        self._lower, self._upper = np.empty(body.model.nq), np.empty(body.model.nq)
        self._lower[body.joints], self._upper[body.joints] = body.lower, body.upper
        self._limits = [JointLimit(self._lower, self._upper, joint_speed)]
        rows = 2 * body.model.nv
        self._below, self._sense = np.full(rows, -_INFINITY), np.zeros(rows, dtype=np.intc)
        self._nowhere = np.zeros(body.model.nv)

    @property
    def q(self) -> Array:
        """The commanded posture (F, J) [rad]."""
        return self._qpos[self._joints]

    def start(self, qpos: Array) -> None:
        """Begin at the posture ``qpos`` (nq,)."""
        self._configuration.update(qpos)

    def follow(self, targets: Array) -> Step:
        """Move the posture towards tip poses ``targets`` (F, 4, 4), as far as one tick allows.  Without an answer it stays."""
        task, configuration = self._task, self._configuration
        task.set_targets(targets)
        program = mink.build_ik(configuration, self._tasks, self._tick, DAMPING, self._limits)
        step, _, flag, _ = daqp.solve(program.P, program.q, program.G, program.h, self._below, self._sense)
        velocity = step / self._tick if flag > 0 else self._nowhere
        configuration.integrate_inplace(velocity, self._tick)
        far = task.compute_distance(configuration)
        room = min((self._qpos - self._lower).min(), (self._upper - self._qpos).min())
        return Step(velocity[self._joints], far, bool(room < NEAR_LIMIT))
