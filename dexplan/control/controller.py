"""The controller: one tick from what is sensed to what the servos are told.

Every tick it (1) advances the reference, (2) aims the fingertips: those that hold are carried with the object, the free one
follows its path, (3) lets mink turn tip poses into joint angles, (4) asks the force QP which contact forces give the object the
wrench it needs, and (5) sends both to the position servos: the posture, plus the offset that makes the servo push with the
wanted torque.  Its state lives here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.control.ahead import Moment, ObjectAhead
from dexplan.control.clock import PlanClock
from dexplan.control.follow import PostureFollower
from dexplan.control.forces import REFRESH, ForceControl
from dexplan.control.hand import MeasuredHand, build_hand_body
from dexplan.control.observation import Observation
from dexplan.control.options import RATE, ControlOptions
from dexplan.control.poses import (
    IDENTITY,
    Pose,
    as_rotation_vector,
    compose,
    express,
    from_rotation_vector,
    move_towards,
    multiply,
    transpose,
)
from dexplan.control.reference import Phase, Reference
from dexplan.control.rolling import RollOffset
from dexplan.control.way import FreeWay
from dexplan.grasp.force.solver import ForceSolution
from dexplan.scene.scene import Scene
from dexplan.spatial import Array

ACCELERATION_LIMIT = 15.0
"""Commanded joint accelerations beyond this [rad/s^2] are jumps, not motion, and get no torque of their own."""
RELAXED_PER_TICK = 0.2
"""Share of the way to the measured pose that a carried one goes in a tick at most.

Where a command begins it pulls tips ahead, and they are measured just then; what is followed of that adds up while the object
turns.  A contact carried through 92 degrees moved on the ball by 0.27 degrees at 250 Hz with 0.2, at 125 Hz by 0.80 with 0.4
and by 0.36 with 0.2.  In longer ticks it is less in proportion: a pen of 216 mm, which turns slowly, was shaken out of the hand
at 125 Hz with 0.2, held within 1.5 degrees with 0.15, and lay still with 0.1."""
CORRECTION_LIMIT = (1e-3, 1e-3, 1e-3, 0.03, 0.03, 0.03)
"""The object feedback may shift the fingertips' targets by no more than this [m, rad]."""


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
        self._carried = [IDENTITY] * self._n
        self._adopted: frozenset[int] = frozenset()
        self._correction: list[float] | None = None
        self._offsets: dict[int, RollOffset] = {}
        self._way: FreeWay | None = None
        self._X_WO = self._X_OF_free = IDENTITY
        self._ahead = ObjectAhead(self._tick)
        self._targets = [IDENTITY] * self._n

    def step(self, observation: Observation) -> Command:
        """Return the command for the tick that starts now."""
        self._sense(observation)
        phase, t, is_done, failure, entered = self._clock.advance(observation.time, observation.touching)
        for index in entered:
            self._enter(index, observation.time)
        now = self._ahead.look(phase.object_path, t)
        self._relax(phase, t)
        self._aim(phase, t, observation.time, self._correct(now))
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
        self._X_WO = Pose.from_matrix(observation.X_WO)
        if not self._is_started:
            self._commanded.start(self._measured.qpos)
            self._targets = list(self._measured.tips)

    def _enter(self, index: int, time: float) -> None:
        self._is_started, self._settling = True, REFRESH
        phase = self._reference.phases[index]
        # A finger that begins to hold is carried from where it really touched, not from where it should have.
        for i in set(phase.holding) - self._adopted:
            self._carried[i] = express(self._X_WO, self._measured.tips[i])
        self._adopted = frozenset(phase.holding)
        self._offsets = {
            i: RollOffset.measure(roll, 0.0, self._carried[i].as_matrix()) for i, roll in phase.rolls.items()
        }
        if phase.finger is not None:
            self._way = None
            if phase.postures is not None:
                self._way = FreeWay(
                    self._scene.fingers[phase.finger],
                    phase,
                    self._commanded.q[phase.finger],
                    time,
                    self._tick,
                    float(self._scene.model.opt.timestep),
                )
            self._X_OF_free = (
                express(self._X_WO, self._targets[phase.finger])
                if phase.X_OF is None
                else Pose.from_matrix(phase.X_OF)
            )

    # -- motion ----------------------------------------------------------------------------------------------------------

    def _correct(self, now: Moment) -> Pose:
        """Return the object pose to aim at: the next reference pose, shifted by the integral of the measured error."""
        gain = self._options.object_feedback * self._options.object_gain * self._tick
        (x, y, z), (u, v, w) = now.pose.p, self._X_WO.p
        turn = as_rotation_vector(multiply(now.pose.R, transpose(self._X_WO.R)))
        error = (x - u, y - v, z - w, *turn)
        # Begin where the object is: the integral then leads it to the reference instead of jerking it there.
        before = [-e for e in error] if self._correction is None else self._correction
        self._correction = [
            min(max(c + gain * e, -most), most)
            for c, e, most in zip(before, error, CORRECTION_LIMIT, strict=True)
        ]
        u, v, w = self._correction[:3]
        x, y, z = now.pose_next.p
        return Pose(
            multiply(from_rotation_vector(tuple(self._correction[3:])), now.pose_next.R),
            (x + u, y + v, z + w),
        )

    def _relax(self, phase: Phase, t: float) -> None:
        """Let the poses at which the fingers hold follow the measured ones."""
        most = RELAXED_PER_TICK * min(1.0, self._options.rate / RATE)
        share, tips = min(self._tick / self._options.relaxation, most), self._measured.tips
        s = phase.object_path.progress(t).done if phase.rolls else 1.0
        for i in phase.holding:
            X_OF = express(self._X_WO, tips[i])
            if s < 1.0 and i in phase.rolls:
                self._offsets[i] = self._offsets[i].relaxed(phase.rolls[i], s, X_OF.as_matrix(), share)
            else:
                self._carried[i] = move_towards(self._carried[i], X_OF, share)

    def _aim(self, phase: Phase, t: float, time: float, X_WO_aim: Pose) -> None:
        """Aim every fingertip for the end of this tick."""
        if phase.rolls:
            before, s = (phase.object_path.progress(now).done for now in (t, t + self._tick))
            for i in phase.rolls if before < 1.0 else ():
                self._carried[i] = Pose.from_matrix(self._offsets[i].apply(phase.rolls[i], s))
        for i in phase.holding:
            self._targets[i] = compose(X_WO_aim, self._carried[i])
        if phase.finger is not None and phase.finger not in phase.holding:
            self._targets[phase.finger] = self._aim_free(phase, t + self._tick, time, X_WO_aim)

    def _accelerate(self, qdot: Array) -> Array:
        """Return the joint torques (F, J) that the commanded motion takes."""
        # Where a phase begins the command may jump, as when a finger has just touched: that is no acceleration to push for.
        self._settling = max(0, self._settling - 1)
        acceleration = qdot - self._qdot
        acceleration /= self._tick
        np.minimum(acceleration, ACCELERATION_LIMIT, out=acceleration)
        np.maximum(acceleration, -ACCELERATION_LIMIT, out=acceleration)
        if self._settling:
            acceleration[:] = 0.0
        self._qdot = qdot
        return self._measured.compute_motion_torque(qdot, acceleration)

    def _aim_free(self, phase: Phase, t: float, time: float, X_WO: Pose) -> Pose:
        if self._way is not None:
            return self._way.find_aim(time)
        gap = phase.sample_gap(t, self._reference.touchdown.speed)
        assert phase.normal_O is not None
        R, (x, y, z) = self._X_OF_free
        u, v, w = phase.normal_O.tolist()
        return compose(X_WO, Pose(R, (x + gap * u, y + gap * v, z + gap * w)))
