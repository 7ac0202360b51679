"""Which contact forces the fingers are told to exert, and the joint torques that exert them: one force QP per tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.control.hand import MeasuredHand
from dexplan.control.observation import Observation
from dexplan.control.options import ControlOptions
from dexplan.control.reference import Phase, Reference
from dexplan.grasp.force.solver import (
    EXCHANGES,
    GENTLE_FRICTION,
    ForceLimits,
    ForceProblem,
    ForceSettings,
    ForceSolution,
    ForceSolver,
    SolverOptions,
)
from dexplan.grasp.grasp import map_contact
from dexplan.plans.pace import smooth_step
from dexplan.scene.scene import Scene
from dexplan.spatial import GRAVITY, Array

REFRESH = 5
"""Ticks between two looks at where the contacts are on the object."""
CONE_SHARE = 0.99
"""Share of the believed cone that forces may use: the rest covers what contact frames are known to."""
_UP = np.array([0.0, 0.0, GRAVITY])


@dataclass(frozen=True, eq=False)
class Push:
    """What the fingers are told: ``forces_W`` (F, 4) on the object, contact force (3,) in world axes and spin torque about the
    inward normal, NaN for fingers that do not hold; the joint ``torque`` (F, J) [N m] they take; and the QP's ``answer``.
    """

    forces_W: Array
    torque: Array
    answer: ForceSolution | None

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class _GraspMaps:
    """The grasp map ``G`` (6, 4 K), the torque maps (K, J, 4) in object axes, and each contact's point and frame in the object,
    for the K fingers that hold in a phase.
    """

    phase: Phase
    G: Array
    torques: Array
    points: Array
    frames: Array


class ForceControl:
    """Asks for forces that give the object the wrench it needs."""

    def __init__(
        self, scene: Scene, hand: MeasuredHand, reference: Reference, options: ControlOptions
    ) -> None:
        self._scene, self._hand, self._options = scene, hand, options
        self._shape = scene.joint_qpos.shape
        self._torque = np.stack([f.torque_limit for f in scene.fingers])
        self._friction = SoftFinger(options.sliding, options.torsional).scaled(CONE_SHARE)
        self._none = np.full((self._shape[0], 4), np.nan)
        self._normal_force = reference.normal_force
        self._floor, self._ceiling = (
            planned if asked is None else asked
            for asked, planned in (
                (options.normal_floor, reference.normal_floor),
                (options.normal_ceiling, reference.normal_ceiling),
            )
        )
        self._solvers: dict[tuple[int, ...], ForceSolver] = {}
        self._rows: dict[tuple[int, ...], NDArray[np.intp]] = {}
        self._limits: tuple[object, ForceLimits] | None = None
        self.restart()

    def restart(self) -> None:
        """Be as before the first tick."""
        self._maps: _GraspMaps | None = None
        self._ticks = 0
        for solver in self._solvers.values():
            solver.forget()

    def compute_push(
        self, observation: Observation, phase: Phase, t: float, acceleration: Array, carried: Array
    ) -> Push:
        """Return what the holding fingers are told ``t`` [s] after the phase began.

        ``acceleration`` (6,) of the object in world axes; ``carried`` (F, 4, 4) the tip poses in the object that fingers hold at.
        """
        forces_W = self._none.copy()
        holding = phase.holding
        if len(holding) < 2:
            return Push(forces_W, np.zeros(self._shape), None)
        solver, rows = self._find_solver(holding), self._rows[holding]
        share = phase.load_start[rows]
        if phase.load_end is not phase.load_start:
            share += (phase.load_end[rows] - share) * smooth_step(t / phase.duration)
        R_WO, p_WO = observation.X_WO[:3, :3], observation.X_WO[:3, 3]
        maps = self._map_grasp(observation, phase, carried)
        wrench = np.empty(6)
        wrench[:3] = R_WO.T @ (self._scene.object.mass * (acceleration[:3] + _UP))
        wrench[3:] = self._scene.object.inertia @ (R_WO.T @ acceleration[3:])
        bias = self._hand.bias[rows]
        limits = self._limit_forces(holding, tuple(share.tolist()))
        answer = solver.solve(
            ForceProblem(
                solver.settings, maps.G, wrench, limits, share * self._normal_force, maps.torques, bias
            )
        )
        forces = answer.forces if answer.is_solved else np.nan_to_num(answer.forces)
        R_WC = R_WO @ maps.frames
        f_W = (R_WC @ forces[:, :3, None])[..., 0]
        forces_W[rows, :3], forces_W[rows, 3] = f_W, forces[:, 3]
        torque = self._hand.compute_push_torque(
            holding, f_W, forces[:, 3:] * R_WC[:, :, 2], maps.points @ R_WO.T + p_WO
        )
        return Push(forces_W, torque, answer)

    def _find_solver(self, holding: tuple[int, ...]) -> ForceSolver:
        """Return the solver for these holding fingers, made when first asked for."""
        solver = self._solvers.get(holding)
        if solver is None:
            size = float(np.linalg.norm(self._scene.object.surface.radial(np.array([1.0, 0.0, 0.0]))))
            settings = ForceSettings((self._friction,) * len(holding), size, friction_weight=GENTLE_FRICTION)
            exchanges = EXCHANGES if self._options.force_solver == "daqp" else 0
            solver = ForceSolver(settings, self._shape[1], SolverOptions(exchanges=exchanges))
            self._solvers[holding], self._rows[holding] = solver, np.array(holding)
        return solver

    def _map_grasp(self, observation: Observation, phase: Phase, carried: Array) -> _GraspMaps:
        """Return where the forces act.

        Fixed contacts hardly move on the object, and torque limits have room: the maps, which make the QP's matrix, are made
        anew every ``REFRESH`` ticks, and every tick while a contact rolls.  What the servos are told uses the Jacobians of this
        very tick.
        """
        holding, maps = phase.holding, self._maps
        if maps is None or maps.phase is not phase or phase.rolls or self._ticks % REFRESH == 0:
            R_OW, surface = observation.X_WO[:3, :3].T, self._scene.object.surface
            count = len(holding)
            G, torques = np.zeros((6, 4 * count)), np.zeros((count, self._shape[1], 4))
            points, frames = np.zeros((count, 3)), np.zeros((count, 3, 3))
            for k, i in enumerate(holding):
                p_OC = surface.radial(carried[i, :3, 3])
                p_OF = R_OW @ (self._hand.X_WF[i, :3, 3] - observation.X_WO[:3, 3])
                J = self._hand.compute_jacobian(i)
                columns, torques[k] = map_contact(np.vstack([R_OW @ J[:3], R_OW @ J[3:]]), p_OC, p_OC - p_OF)
                G[:, 4 * k : 4 * k + 4] = columns
                points[k], frames[k] = p_OC, columns[:3, :3]
            for frozen in (G, torques):
                frozen.setflags(write=False)  # so that nobody has to copy them
            self._maps = maps = _GraspMaps(phase, G, torques, points, frames)
        self._ticks += 1
        return maps

    def _limit_forces(self, holding: tuple[int, ...], share: tuple[float, ...]) -> ForceLimits:
        """Return the limits for loads of these shares; most ticks ask for the same ones as the tick before."""
        key = (holding, share)
        if self._limits is None or self._limits[0] != key:
            loads, reach = np.array(share), self._options.torque_fraction * self._torque[list(holding)]
            floor, ceiling = loads * self._floor, loads * self._ceiling + 1e-9
            self._limits = (key, ForceLimits(floor, ceiling, -reach, reach))
        return self._limits[1]
