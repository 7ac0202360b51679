"""The controller: one tick from what is sensed to what the servos are told.

Every tick it (1) advances the reference, (2) aims the fingertips: those that hold are carried with the object, the free one
follows its path, (3) lets mink turn tip poses into joint angles, (4) asks the force QP which contact forces give the object the
wrench it needs, and (5) sends both to the position servos: the posture, plus the offset that makes the servo push with the
wanted torque.  Its state lives here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.surfaces.sphere import require_sphere
from dexplan.control.clock import PlanClock
from dexplan.control.follow import PostureFollower
from dexplan.control.forces import REFRESH, ForceControl
from dexplan.control.hand import MeasuredHand, build_hand_body
from dexplan.control.observation import Observation
from dexplan.control.options import ControlOptions
from dexplan.control.reference import ObjectPath, Phase, Reference
from dexplan.control.rolling import RollOffset
from dexplan.control.way import FreeWay
from dexplan.grasp.force.solver import ForceSolution
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, invert_pose, rotation_matrix, rotation_vector, scale_rotations

ACCELERATION_LIMIT = 15.0
"""Commanded joint accelerations beyond this [rad/s^2] are jumps, not motion, and get no torque of their own."""
CORRECTION_LIMIT = np.array([1e-3, 1e-3, 1e-3, 0.03, 0.03, 0.03])
"""The object feedback may shift the fingertips' targets by no more than this [m, rad]."""


SAME_TIME = 1e-12
"""Times nearer to one another [s] than this are the same, summed up in another way."""
_STILL = np.zeros(6)


class _Moment(NamedTuple):
    """Where a reference has the object ``t`` [s] after the start of ``path``: ``X_WO`` (4, 4), ``acceleration`` (6,) in W."""

    path: ObjectPath | None
    t: float
    X_WO: Array
    acceleration: Array


def _look_at(path: ObjectPath, t: float) -> _Moment:
    if path.motion.is_still:
        return _Moment(path, t, path.motion.X_WO_start, _STILL)
    X, _, acceleration = path.sample(t)
    return _Moment(path, t, X, acceleration)


@dataclass(frozen=True, eq=False)
class Command:
    """What one tick decided, and what it was based on.

    ``ctrl`` (nu,) for the servos; ``X_WO_ref`` (4, 4); phase indices; ``forces_W`` (F, 4) wanted contact force (3,) on the object
    in world axes and spin torque about the inward normal, NaN for fingers that do not hold; ``qp`` the force QP's answer;
    ``tip_error`` largest distance [m] between aimed and commanded fingertips; ``is_done`` once the reference has ended.
    """

    ctrl: Array
    X_WO_ref: Array
    action_index: int
    phase_index: int
    forces_W: Array
    qp: ForceSolution | None
    tip_error: float
    ik_at_limit: bool
    is_done: bool
    failure: str | None

    __repr__ = brief_repr


class Controller:
    """Follows a reference with a scene's hand.  Call :meth:`step` once per tick, in order."""

    def __init__(self, scene: Scene, reference: Reference, options: ControlOptions) -> None:
        require_sphere(scene.object.surface, "the controller")
        self._scene, self._reference, self._options = scene, reference, options
        self._tick = options.tick
        self._clock = PlanClock(reference, [f.name for f in scene.fingers], options.tick)
        body, self._n = build_hand_body(scene), scene.n_fingers
        self._measured = MeasuredHand(body)
        self._commanded = PostureFollower(body, options.joint_speed, options.tick)
        self._forces = ForceControl(scene, self._measured, reference, options)
        self._gain = np.stack([f.servo_gain for f in scene.fingers])
        self._damping = np.stack([f.servo_damping for f in scene.fingers])
        self.restart()

    def restart(self) -> None:
        """Be as before the first tick: what was made for this hand and reference stays, nothing else."""
        self._forces.restart()
        self._qdot, self._settling = np.zeros(self._gain.shape), REFRESH
        self._is_started = False
        self._clock.restart()
        self._carried = np.tile(np.eye(4), (self._n, 1, 1))
        self._adopted: frozenset[int] = frozenset()
        self._correction, self._is_primed = np.zeros(6), False
        self._offsets: dict[int, RollOffset] = {}
        self._way: FreeWay | None = None
        self._X_OF_start = np.eye(4)
        self._ahead = _Moment(None, 0.0, self._X_OF_start, _STILL)
        self._targets = np.tile(np.eye(4), (self._n, 1, 1))

    def step(self, observation: Observation) -> Command:
        """Return the command for the tick that starts now."""
        self._sense(observation)
        phase, t, is_done, failure, entered = self._clock.advance(observation.time, observation.touching)
        for index in entered:
            self._enter(index, observation)
        now, X_next = self._look(phase.object_path, t)
        self._relax(observation, phase, t)
        self._aim(phase, t, observation.time, self._correct(observation, now.X_WO, X_next))
        moved = self._commanded.follow(self._targets)
        push = self._forces.compute_push(observation, phase, t, now.acceleration, self._carried)
        torque = self._measured.bias + push.torque + self._accelerate(moved.qdot)
        ctrl = np.zeros(self._scene.model.nu)
        ctrl[self._scene.actuators] = (
            self._commanded.q + (self._options.feedforward * torque + self._damping * moved.qdot) / self._gain
        )
        return Command(
            ctrl,
            now.X_WO,
            phase.action_index,
            phase.phase_index,
            push.forces_W,
            push.answer,
            moved.tip_error,
            moved.is_at_limit,
            is_done,
            failure,
        )

    # -- sensing ---------------------------------------------------------------------------------------------------------

    def _sense(self, observation: Observation) -> None:
        self._measured.measure(observation.q, observation.qdot)
        if not self._is_started:
            self._commanded.start(self._measured.qpos)
            self._targets[:] = self._measured.X_WF

    def _enter(self, index: int, observation: Observation) -> None:
        self._is_started, self._settling = True, REFRESH
        phase = self._reference.phases[index]
        X_OW = invert_pose(observation.X_WO)
        # A finger that begins to hold is carried from where it really touched, not from where it should have.
        for i in set(phase.holding) - self._adopted:
            self._carried[i] = X_OW @ self._measured.X_WF[i]
        self._adopted = frozenset(phase.holding)
        self._offsets = {
            i: RollOffset.measure(roll, 0.0, self._carried[i]) for i, roll in phase.rolls.items()
        }
        if phase.finger is not None:
            self._way = None
            if phase.postures is not None:
                self._way = FreeWay(
                    self._scene.fingers[phase.finger],
                    phase,
                    self._commanded.q[phase.finger],
                    observation.time,
                    self._tick,
                    float(self._scene.model.opt.timestep),
                )
            self._X_OF_start = X_OW @ self._targets[phase.finger]

    def _look(self, path: ObjectPath, t: float) -> tuple[_Moment, Array]:
        """Return the object's reference at ``t`` [s] after the start of ``path``, and its pose (4, 4) a tick later."""
        now = self._ahead
        # A tick later is now the next time: the difference is one of rounding.
        if now.path is not path or abs(now.t - t) > SAME_TIME:
            now = _look_at(path, t)
        self._ahead = _look_at(path, t + self._tick)
        return now, self._ahead.X_WO

    # -- motion ----------------------------------------------------------------------------------------------------------

    def _correct(self, observation: Observation, X_ref: Array, X_next: Array) -> Array:
        """Return the object pose to aim at: the next reference pose, shifted by the integral of the measured error."""
        if not self._is_primed:
            # Begin where the object is: the integral then leads it to the reference instead of jerking it there.
            self._is_primed = True
            self._correction[:3] = observation.X_WO[:3, 3] - X_ref[:3, 3]
            self._correction[3:] = rotation_vector(observation.X_WO[:3, :3] @ X_ref[:3, :3].T)
        gain = self._options.object_feedback * self._options.object_gain * self._tick
        R_error = rotation_vector(X_ref[:3, :3] @ observation.X_WO[:3, :3].T)
        self._correction[:3] += gain * (X_ref[:3, 3] - observation.X_WO[:3, 3])
        self._correction[3:] += gain * R_error
        np.minimum(
            np.maximum(self._correction, -CORRECTION_LIMIT, out=self._correction),
            CORRECTION_LIMIT,
            out=self._correction,
        )
        X = X_next.copy()
        X[:3, :3] = rotation_matrix(self._correction[3:]) @ X[:3, :3]
        X[:3, 3] += self._correction[:3]
        return X

    def _relax(self, observation: Observation, phase: Phase, t: float) -> None:
        """Let the poses at which the fingers hold follow the measured ones."""
        share = self._tick / self._options.relaxation
        X_WF, R_WO, p_WO = self._measured.X_WF, observation.X_WO[:3, :3], observation.X_WO[:3, 3]
        s = phase.object_path.progress(t).done if phase.rolls else 1.0
        rolling = [i for i in phase.holding if i in phase.rolls] if s < 1.0 else []
        for i in rolling:
            X_OF = invert_pose(observation.X_WO) @ X_WF[i]
            self._offsets[i] = self._offsets[i].relaxed(phase.rolls[i], s, X_OF, share)
        rows = [i for i in phase.holding if i not in rolling]
        if rows:
            held, found = self._carried.take(rows, axis=0), X_WF.take(rows, axis=0)
            R, p = held[:, :3, :3], held[:, :3, 3]
            turned = np.matmul(R_WO.T @ found[:, :3, :3], R.swapaxes(1, 2))
            p += share * ((found[:, :3, 3] - p_WO) @ R_WO - p)
            R[:] = scale_rotations(turned, share) @ R
            self._carried[rows] = held

    def _aim(self, phase: Phase, t: float, time: float, X_WO_aim: Array) -> None:
        """Aim every fingertip for the end of this tick."""
        if phase.rolls:
            before, s = (phase.object_path.progress(now).done for now in (t, t + self._tick))
            for i in phase.rolls if before < 1.0 else ():
                self._carried[i] = self._offsets[i].apply(phase.rolls[i], s)
        held = X_WO_aim @ self._carried
        for i in phase.holding:
            self._targets[i] = held[i]
        if phase.finger is not None and phase.finger not in phase.holding:
            self._targets[phase.finger] = self._aim_free(phase, t + self._tick, time, X_WO_aim)

    def _accelerate(self, qdot: Array) -> Array:
        """Return the joint torques (F, J) that the commanded motion takes."""
        # Where a phase begins the command may jump, as when a finger has just touched: that is no acceleration to push for.
        self._settling = max(0, self._settling - 1)
        acceleration = (qdot - self._qdot) / self._tick
        np.minimum(acceleration, ACCELERATION_LIMIT, out=acceleration)
        np.maximum(acceleration, -ACCELERATION_LIMIT, out=acceleration)
        acceleration *= self._settling == 0
        self._qdot = qdot
        return self._measured.compute_motion_torque(qdot, acceleration)

    def _aim_free(self, phase: Phase, t: float, time: float, X_WO: Array) -> Array:
        if self._way is not None:
            return self._way.find_aim(time)
        gap = phase.sample_gap(t, self._reference.touchdown.speed)
        X_OF = (self._X_OF_start if phase.X_OF is None else phase.X_OF).copy()
        assert phase.normal_O is not None
        X_OF[:3, 3] += gap * phase.normal_O
        return X_WO @ X_OF
