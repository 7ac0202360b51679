"""The controller: one tick from what is sensed to what the servos are told.

Every tick it (1) advances the reference, (2) aims the fingertips: those that hold are carried with the object, the free one
follows its path, (3) lets mink turn tip poses into joint angles, (4) asks the force QP which contact forces give the object the
wrench it needs, and (5) sends both to the position servos: the posture, plus the offset that makes the servo push with the
wanted torque.  Its state lives here and nowhere else.
"""

from __future__ import annotations

from dataclasses import dataclass

import mink
import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.contact.surfaces.sphere import require_sphere
from dexplan.control.observation import Observation
from dexplan.control.options import ControlOptions
from dexplan.control.reference import Phase, Reference
from dexplan.control.rolling import RollOffset
from dexplan.control.tasks import FingertipTask, JointLimit
from dexplan.grasp.force.solver import EXCHANGES, GENTLE_FRICTION, ForceLimits, ForceSolution, ForceSolver
from dexplan.grasp.grasp import map_contact
from dexplan.plans.pace import smooth_step
from dexplan.scene.scene import Scene
from dexplan.spatial import GRAVITY, Array, cross, invert_pose, rotation_matrix, rotation_vector

ACCELERATION_LIMIT = 15.0
"""Commanded joint accelerations beyond this [rad/s^2] are jumps, not motion, and get no torque of their own."""
REFRESH = 5
"""Ticks between two looks at where the contacts are on the object."""
CONE_SHARE = 0.99
"""Share of the believed cone that forces may use: the rest covers what contact frames are known to."""
CORRECTION_LIMIT = np.array([1e-3, 1e-3, 1e-3, 0.03, 0.03, 0.03])
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
        require_sphere(scene.object.surface, "the controller")
        self._scene, self._reference, self._options = scene, reference, options
        self._tick = options.tick
        self._n = scene.n_fingers
        spec = mujoco.MjSpec.from_string(scene.xml)
        spec.delete(spec.body("object/"))
        self._model = spec.compile()
        self._configuration = mink.Configuration(self._model)
        self._joints = np.array([[self._model.joint(j).id for j in f.joint_names] for f in scene.fingers])
        self._sites = np.array([self._model.site(f"{f.name}/tip_center").id for f in scene.fingers])
        self._task = FingertipTask(self._sites, self._model.nv)
        self._lower, self._upper = (
            np.stack([getattr(f.chain, k) for f in scene.fingers]) for k in ("lower", "upper")
        )
        lower, upper = np.empty(self._model.nq), np.empty(self._model.nq)
        lower[self._joints], upper[self._joints] = self._lower, self._upper
        self._limits = [JointLimit(lower, upper, options.joint_speed)]
        self._gain = np.stack([f.servo_gain for f in scene.fingers])
        self._damping = np.stack([f.servo_damping for f in scene.fingers])
        self._torque = np.stack([f.torque_limit for f in scene.fingers])
        self._friction = SoftFinger(options.sliding, options.torsional).scaled(CONE_SHARE)
        self._solvers: dict[tuple[int, ...], ForceSolver] = {}
        self._maps: tuple[object, Array, Array, list[tuple[Array, Array]]] | None = None
        self._ticks = 0
        self._force_limits: tuple[object, ForceLimits] | None = None
        self._floor, self._ceiling = (
            planned if asked is None else asked
            for asked, planned in (
                (options.normal_floor, reference.normal_floor),
                (options.normal_ceiling, reference.normal_ceiling),
            )
        )
        self._measured = mink.Configuration(self._model)
        self._J = np.zeros((self._n, 6, self._model.nv))
        self._bias = np.zeros(self._model.nv)
        self._qdot, self._settling = np.zeros(self._joints.shape), REFRESH
        self._phase, self._phase_start = -1, 0.0
        self._carried = np.tile(np.eye(4), (self._n, 1, 1))
        self._adopted: frozenset[int] = frozenset()
        self._correction, self._is_primed = np.zeros(6), False
        self._offsets: dict[int, RollOffset] = {}
        self._path: CubicSpline | None = None
        self._X_OF_start = np.eye(4)
        self._targets = np.tile(np.eye(4), (self._n, 1, 1))

    def step(self, observation: Observation) -> Command:
        """Return the command for the tick that starts now."""
        self._sense(observation)
        phase, t, is_done, failure = self._advance(observation)
        X_ref, _, acceleration = phase.object_path.sample(t)
        X_next, _, _ = phase.object_path.sample(t + self._tick)
        self._relax(observation, phase, t)
        qdot, tip_error, at_limit = self._follow(phase, t, self._correct(observation, X_ref, X_next))
        forces_W, torque, qp = self._load(observation, phase, t, acceleration)
        q = self._configuration.q[self._joints]
        bias = self._bias[self._joints]
        ctrl = np.zeros(self._scene.model.nu)
        push = self._options.feedforward * (bias + torque + self._accelerate(qdot))
        ctrl[self._scene.actuators] = q + (push + self._damping * qdot) / self._gain
        return Command(
            ctrl,
            X_ref,
            phase.action_index,
            phase.phase_index,
            forces_W,
            qp,
            tip_error,
            at_limit,
            is_done,
            failure,
        )

    # -- sensing ---------------------------------------------------------------------------------------------------------

    def _sense(self, observation: Observation) -> None:
        """Measured tip poses, Jacobians and gravity torques, from the hand's own model at the measured posture."""
        data = self._measured.data
        data.qpos[self._joints] = observation.q
        data.qvel[self._joints] = observation.qdot
        self._measured.update()
        mujoco.mj_comVel(self._model, data)
        mujoco.mj_rne(self._model, data, 0, self._bias)
        self._X_WF = np.tile(np.eye(4), (self._n, 1, 1))
        self._X_WF[:, :3, :3] = data.site_xmat[self._sites].reshape(-1, 3, 3)
        self._X_WF[:, :3, 3] = data.site_xpos[self._sites]
        for i, site in enumerate(self._sites):
            mujoco.mj_jacSite(self._model, data, self._J[i, :3], self._J[i, 3:], site)
        if self._phase < 0:
            self._configuration.update(data.qpos)
            self._targets = self._X_WF.copy()

    def _advance(self, observation: Observation) -> tuple[Phase, float, bool, str | None]:
        """Move on to the phase that holds now; return it, the time within it, whether all is done, and what failed."""
        phases = self._reference.phases
        failure = None
        if self._phase < 0:
            self._enter(0, observation.time, observation)
        while True:
            phase = phases[self._phase]
            t = observation.time - self._phase_start
            last = self._phase == len(phases) - 1
            if phase.ends_on_touch:
                assert phase.finger is not None
                over = bool(observation.touching[phase.finger])
                if t > phase.duration + self._reference.touchdown.timeout:
                    failure = f"{self._scene.fingers[phase.finger].name} found no object where it should have touched"
            else:
                over = t > phase.duration - 0.5 * self._tick
            if not over or last:
                return phase, t, over and last, failure
            self._enter(self._phase + 1, observation.time, observation)

    def _enter(self, index: int, time: float, observation: Observation) -> None:
        self._phase, self._phase_start, self._settling = index, time, REFRESH
        phase = self._reference.phases[index]
        X_OW = invert_pose(observation.X_WO)
        # A finger that begins to hold is carried from where it really touched, not from where it should have.
        for i in set(phase.holding) - self._adopted:
            self._carried[i] = X_OW @ self._X_WF[i]
        self._adopted = frozenset(phase.holding)
        self._offsets = {
            i: RollOffset.measure(roll, 0.0, self._carried[i]) for i, roll in phase.rolls.items()
        }
        if phase.finger is not None:
            self._path = None
            if phase.postures is not None:
                # The path was planned from where the finger should be; what it is off by fades along the way.
                share = np.linspace(0.0, 1.0, len(phase.postures))
                off = self._configuration.q[self._joints[phase.finger]] - phase.postures[0]
                self._path = CubicSpline(share, phase.postures + (1.0 - share)[:, None] * off)
            self._X_OF_start = X_OW @ self._targets[phase.finger]

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
        share = self._tick / self._options.relaxation
        X_OW = invert_pose(observation.X_WO)
        for i in phase.holding:
            X_OF = X_OW @ self._X_WF[i]
            s, _, _ = phase.object_path.progress(t)
            if i in phase.rolls and s < 1.0:
                self._offsets[i] = self._offsets[i].relaxed(phase.rolls[i], s, X_OF, share)
                continue
            carried = self._carried[i]
            carried[:3, 3] += share * (X_OF[:3, 3] - carried[:3, 3])
            turn = rotation_vector(X_OF[:3, :3] @ carried[:3, :3].T)
            carried[:3, :3] = rotation_matrix(share * turn) @ carried[:3, :3]

    def _follow(self, phase: Phase, t: float, X_WO_aim: Array) -> tuple[Array, float, bool]:
        """Aim every fingertip for the end of this tick and let mink move the commanded posture there."""
        before, s = (phase.object_path.progress(now)[0] for now in (t, t + self._tick))
        for i in phase.holding:
            if i in phase.rolls and before < 1.0:
                self._carried[i] = self._offsets[i].apply(phase.rolls[i], s)
            self._targets[i] = X_WO_aim @ self._carried[i]
        if phase.finger is not None and phase.finger not in phase.holding:
            self._targets[phase.finger] = self._aim_free(phase, t + self._tick, X_WO_aim)
        self._task.set_targets(self._targets)
        configuration = self._configuration
        try:
            velocity = mink.solve_ik(
                configuration, [self._task], self._tick, "daqp", damping=1e-9, limits=self._limits
            )
        except mink.NoSolutionFound:
            velocity = np.zeros(self._model.nv)
        configuration.integrate_inplace(velocity, self._tick)
        error = self._task.compute_error(configuration).reshape(self._n, 6)
        q = configuration.q[self._joints]
        at_limit = bool((np.minimum(q - self._lower, self._upper - q) < 1e-3).any())
        return velocity[self._joints], float(np.linalg.norm(error[:, :3], axis=1).max()), at_limit

    def _accelerate(self, qdot: Array) -> Array:
        """Return the joint torques (F, J) that the commanded motion takes: its inertia and the joints' own damping."""
        # Where a phase begins the command may jump, as when a finger has just touched: that is no acceleration to push for.
        self._settling = max(0, self._settling - 1)
        acceleration = np.clip((qdot - self._qdot) / self._tick, -ACCELERATION_LIMIT, ACCELERATION_LIMIT)
        acceleration *= self._settling == 0
        self._qdot = qdot
        flat, inertial = np.zeros(self._model.nv), np.zeros(self._model.nv)
        flat[self._joints] = acceleration
        mujoco.mj_crb(self._model, self._measured.data)
        mujoco.mj_mulM(self._model, self._measured.data, inertial, flat)
        return inertial[self._joints] + self._model.dof_damping[self._joints] * qdot

    def _aim_free(self, phase: Phase, t: float, X_WO: Array) -> Array:
        assert phase.finger is not None
        if self._path is not None:
            return self._scene.fingers[phase.finger].pose_at(self._path(phase.travelled(t)))
        gap = phase.sample_gap(t, self._reference.touchdown.speed)
        X_OF = (self._X_OF_start if phase.X_OF is None else phase.X_OF).copy()
        assert phase.normal_O is not None
        X_OF[:3, 3] += gap * phase.normal_O
        return X_WO @ X_OF

    # -- forces ----------------------------------------------------------------------------------------------------------

    def _load(
        self, observation: Observation, phase: Phase, t: float, acceleration: Array
    ) -> tuple[Array, Array, ForceSolution | None]:
        """Solve the force QP; return forces in the world (F, 4), the joint torques they take (F, J), and the answer."""
        forces_W = np.full((self._n, 4), np.nan)
        torque = np.zeros((self._n, self._joints.shape[1]))
        holding = phase.holding
        if len(holding) < 2:
            return forces_W, torque, None
        solver = self._solvers.get(holding)
        if solver is None:
            size = float(np.linalg.norm(self._scene.object.surface.radial(np.array([1.0, 0.0, 0.0]))))
            solver = ForceSolver(
                [self._friction] * len(holding),
                self._joints.shape[1],
                length=size,
                friction_weight=GENTLE_FRICTION,
                exchanges=EXCHANGES if self._options.force_solver == "daqp" else 0,
            )
            self._solvers[holding] = solver
        s = smooth_step(t / phase.duration)
        share = (phase.load_start + (phase.load_end - phase.load_start) * s)[list(holding)]
        R_WO = observation.X_WO[:3, :3]
        G, maps, frames = self._map_grasp(observation, holding)
        mass, inertia = self._scene.object.mass, self._scene.object.inertia
        weight = mass * (acceleration[:3] + np.array([0.0, 0.0, GRAVITY]))
        wrench = np.concatenate([R_WO.T @ weight, inertia @ (R_WO.T @ acceleration[3:])])
        bias = self._bias[self._joints[list(holding)]]
        limits = self._limit_forces(holding, tuple(share.tolist()))
        target = share * self._reference.normal_force
        qp = solver.solve(G, wrench, limits, target, maps, bias)
        forces = qp.forces if qp.is_solved else np.nan_to_num(qp.forces)
        for k, i in enumerate(holding):
            p_OC, R_OC = frames[k]
            f_W, n_W = R_WO @ (R_OC @ forces[k, :3]), R_WO @ R_OC[:, 2]
            arm = observation.X_WO[:3, 3] + R_WO @ p_OC - self._X_WF[i][:3, 3]
            J = self._J[i][:, self._joints[i]]
            forces_W[i, :3], forces_W[i, 3] = f_W, forces[k, 3]
            torque[i] = f_W @ J[:3] + (cross(arm, f_W) + forces[k, 3] * n_W) @ J[3:]
        return forces_W, torque, qp

    def _map_grasp(
        self, observation: Observation, holding: tuple[int, ...]
    ) -> tuple[Array, Array, list[tuple[Array, Array]]]:
        """Return the grasp map, the torque maps (in object axes) and each contact's point and frame in the object.

        Fixed contacts hardly move on the object, and torque limits have room: the maps, which make the QP's matrix, are made
        anew every ``REFRESH`` ticks, and every tick while a contact rolls.  What the servos are told uses the Jacobians of this
        very tick.
        """
        key = (self._phase, holding)
        if self._maps is None or self._maps[0] != key or self._offsets or self._ticks % REFRESH == 0:
            R_OW, surface = observation.X_WO[:3, :3].T, self._scene.object.surface
            G, maps = np.zeros((6, 4 * len(holding))), np.zeros((len(holding), self._joints.shape[1], 4))
            frames = []
            for k, i in enumerate(holding):
                p_OC = surface.radial(self._carried[i][:3, 3])
                p_OF = R_OW @ (self._X_WF[i][:3, 3] - observation.X_WO[:3, 3])
                J = self._J[i][:, self._joints[i]]
                columns, maps[k] = map_contact(np.vstack([R_OW @ J[:3], R_OW @ J[3:]]), p_OC, p_OC - p_OF)
                G[:, 4 * k : 4 * k + 4] = columns
                frames.append((p_OC, columns[:3, :3]))
            self._maps = (key, G, maps, frames)
        self._ticks += 1
        return self._maps[1:]

    def _limit_forces(self, holding: tuple[int, ...], share: tuple[float, ...]) -> ForceLimits:
        """Return the limits for loads of these shares; most ticks ask for the same ones as the tick before."""
        key = (holding, share)
        if self._force_limits is None or self._force_limits[0] != key:
            loads, reach = np.array(share), self._options.torque_fraction * self._torque[list(holding)]
            floor, ceiling = loads * self._floor, loads * self._ceiling + 1e-9
            self._force_limits = (key, ForceLimits(floor, ceiling, -reach, reach))
        return self._force_limits[1]
