"""Which contact forces the fingers are told to exert, and the joint torques that exert them: one force QP per tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dexplan.contact.friction import SoftFinger
from dexplan.control.grasp_maps import GraspMaps, map_grasp
from dexplan.control.hand import MeasuredHand
from dexplan.control.observation import Observation
from dexplan.control.options import ControlOptions
from dexplan.control.poses import Pose
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
from dexplan.grasp.wrench import MassProperties
from dexplan.plans.pace import smooth_step
from dexplan.scene.scene import Scene
from dexplan.spatial import GRAVITY, Array, hat, read_only

REFRESH = 5
"""Ticks between two looks at where the contacts are on the object."""
CONE_SHARE = 0.99
"""Share of the believed cone that forces may use: the rest covers what contact frames are known to."""
_UP = np.array([0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0])


class Push(NamedTuple):
    """What the fingers are told: ``forces_W`` (F, 4) on the object, contact force (3,) in world axes and spin torque about the
    inward normal, NaN for fingers that do not hold; the joint ``torque`` (F, J) [N m] they take; and the QP's ``answer``.
    """

    forces_W: Array
    torque: Array
    answer: ForceSolution | None


class _Mode(NamedTuple):
    """The ``solver`` for the K fingers ``rows`` (K,), and the joint torques (K, J) [N m] that forces may take at most."""

    solver: ForceSolver
    rows: NDArray[np.intp]
    lower: Array
    upper: Array


class _Demand(NamedTuple):
    """What is asked of the K fingers that hold beside the wrench: limits, and the normal forces (K,) [N] to aim at."""

    limits: ForceLimits
    target: Array


def _build_inertia(own: MassProperties) -> Array:
    """Return what makes of accelerations (6,) of the origin, linear then angular, the wrench about it; object axes."""
    across = hat(own.com)
    coupling = own.mass * across
    return np.block(
        [[own.mass * np.eye(3), -coupling], [coupling, own.inertia - coupling @ across]],
    )


class ForceControl:
    """Asks for forces that give the object the wrench it needs."""

    def __init__(
        self, scene: Scene, hand: MeasuredHand, reference: Reference, options: ControlOptions
    ) -> None:
        self._scene, self._hand, self._options = scene, hand, options
        self._shape = scene.joint_qpos.shape
        self._torque = np.stack([f.torque_limit for f in scene.fingers])
        self._friction = SoftFinger(options.sliding, options.torsional).scaled(CONE_SHARE)
        self._none, self._nothing = np.full((self._shape[0], 4), np.nan), read_only(np.zeros(self._shape))
        self._inertia = _build_inertia(scene.object.mass_properties)
        self._normal_force = reference.normal_force
        self._floor, self._ceiling = (
            planned if asked is None else asked
            for asked, planned in (
                (options.normal_floor, reference.normal_floor),
                (options.normal_ceiling, reference.normal_ceiling),
            )
        )
        self._modes: dict[tuple[int, ...], _Mode] = {}
        self._constant: tuple[Phase, _Demand] | None = None
        self.restart()

    def restart(self) -> None:
        """Be as before the first tick."""
        self._maps: GraspMaps | None = None
        self._mapped: Phase | None = None
        self._ticks = 0
        for mode in self._modes.values():
            mode.solver.forget()

    def compute_push(
        self, observation: Observation, phase: Phase, t: float, acceleration: Array, carried: Sequence[Pose]
    ) -> Push:
        """Return what the holding fingers are told ``t`` [s] after the phase began.

        ``acceleration`` (6,) of the object in world axes; ``carried`` the tip poses X_OF that fingers hold at.
        """
        forces_W, holding = self._none.copy(), phase.holding
        if len(holding) < 2:
            return Push(forces_W, self._nothing, None)
        mode, demand = self._find_mode(holding), self._demand(phase, t)
        maps = self._map_grasp(observation, phase, carried)
        felt_O = (acceleration + _UP).reshape(2, 3).dot(observation.X_WO[:3, :3])
        wrench = self._inertia.dot(felt_O.reshape(6))
        bias = self._hand.bias.take(mode.rows, axis=0)
        for frozen in (wrench, bias):
            frozen.setflags(write=False)
        answer = mode.solver.solve(
            ForceProblem(
                mode.solver.settings, maps.G, wrench, demand.limits, demand.target, maps.torques, bias
            )
        )
        forces = answer.forces if answer.is_solved else np.nan_to_num(answer.forces)
        pushes, points = maps.place_pushes(forces, observation.X_WO)
        for k, i in enumerate(holding):
            row = forces_W[i]
            row[:3], row[3] = pushes[k, 0], forces[k, 3]
        return Push(forces_W, self._hand.compute_push_torque(holding, pushes, points), answer)

    def _find_mode(self, holding: tuple[int, ...]) -> _Mode:
        """Return the solver for these holding fingers, made when first asked for, and what goes with it."""
        mode = self._modes.get(holding)
        if mode is None:
            size = self._scene.object.body.bound
            settings = ForceSettings((self._friction,) * len(holding), size, friction_weight=GENTLE_FRICTION)
            exchanges = EXCHANGES if self._options.force_solver == "daqp" else 0
            solver = ForceSolver(settings, self._shape[1], SolverOptions(exchanges=exchanges))
            rows = np.array(holding)
            reach = self._options.torque_fraction * self._torque[rows]
            mode = self._modes[holding] = _Mode(solver, rows, read_only(-reach), read_only(reach))
        return mode

    def _demand(self, phase: Phase, t: float) -> _Demand:
        """Return what is asked of the holding fingers ``t`` [s] after the phase began; where loads stay, the same every time."""
        if self._constant is not None and self._constant[0] is phase:
            return self._constant[1]
        mode = self._find_mode(phase.holding)
        share, is_constant = phase.load_start[mode.rows], phase.load_end is phase.load_start
        if not is_constant:
            share += (phase.load_end[mode.rows] - share) * smooth_step(t / phase.duration)
        floor, ceiling = share * self._floor, share * self._ceiling + 1e-9
        limits = ForceLimits(floor, ceiling, mode.lower, mode.upper)
        demand = _Demand(limits, read_only(share * self._normal_force))
        if is_constant:
            self._constant = phase, demand
        return demand

    def _map_grasp(self, observation: Observation, phase: Phase, carried: Sequence[Pose]) -> GraspMaps:
        """Return where the forces act.

        Fixed contacts hardly move on the object, and torque limits have room: the maps, which make the QP's matrix, are made
        anew every ``REFRESH`` ticks, and every tick while a contact rolls.  What the servos are told uses the Jacobians of this
        very tick.
        """
        maps = self._maps
        if maps is None or self._mapped is not phase or phase.rolls or self._ticks % REFRESH == 0:
            R_WO, holding = observation.X_WO[:3, :3], phase.holding
            held_at, p_WF = (np.array([poses[i].p for i in holding]) for poses in (carried, self._hand.tips))
            p_OF = (p_WF - observation.X_WO[:3, 3]).dot(R_WO)
            J = np.matmul(R_WO.T, self._hand.compute_jacobians(holding))
            maps = map_grasp(self._scene.object.body, held_at, p_OF, J)
            self._maps, self._mapped = maps, phase
        self._ticks += 1
        return maps
