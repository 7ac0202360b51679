"""Can the hand carry this state?  One function answers, with margins, for the planner, for `inspect` and for tests.

Force closure is geometry; whether *this* hand can hold *this* object here also takes joints away from their limits, forces
that carry the weight inside the believed cones, torques that the joints can give, and nothing in the way.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from dexplan.grasp.force.solver import (
    GENTLE_FRICTION,
    ForceLimits,
    ForceProblem,
    ForceSettings,
    ForceSolver,
)
from dexplan.grasp.grasp import map_contact
from dexplan.grasp.wrench import compute_wrench
from dexplan.kinematics.chain import (
    compute_dexterity,
    compute_joint_margin,
    compute_tip_jacobian,
    compute_tip_pose,
)
from dexplan.planning.admissible.conditions import refuse_nearness
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.refusal import Refusal, RefusalKind
from dexplan.scene.description import Nearness
from dexplan.spatial import Array, lock_arrays, read_only


@dataclass(frozen=True)
class Margins:
    """What one state leaves to spare, and why it is refused if it is.

    ``joint`` [rad] and ``dexterity`` over the loaded fingers; ``load``: share of the believed cone that the force QP leaves
    unused, -inf where it finds no forces; ``torque``: largest share of a torque limit; ``clearance`` [m].
    ``refusal`` is None for an admissible state, else says which condition is the first that is not met.
    """

    joint: float
    dexterity: float
    load: float
    torque: float
    clearance: float
    refusal: Refusal | None = None

    @property
    def is_admissible(self) -> bool:
        """Whether the state may be planned through."""
        return self.refusal is None

    def as_dict(self) -> dict[str, float]:
        """Return the margins in the units of ``plan.json``."""
        return {
            "joint_deg": float(np.degrees(self.joint)),
            "dexterity": self.dexterity,
            "load": self.load,
            "torque_share": self.torque,
            "clearance_mm": 1e3 * self.clearance,
        }


def worst(rows: list[Margins]) -> dict[str, float]:
    """Return the worst of each margin over a motion, as JSON data; empty for no samples."""
    if not rows:
        return {}
    dicts = [row.as_dict() for row in rows]
    pick = {key: (max if key == "torque_share" else min) for key in dicts[0]}
    return {key: pick[key](d[key] for d in dicts) for key in dicts[0]}


@dataclass(frozen=True, eq=False)
class FingerState:
    """One finger's posture with what follows from it: tip pose, Jacobian, room in the joints, distance to singularity."""

    q: Array
    X_WF: Array
    J: Array
    joint: float
    dexterity: float

    def __post_init__(self) -> None:
        lock_arrays(self)


def compute_finger_states(hand: HandModel, finger: int, q: Array) -> list[FingerState]:
    """Return the states of ``finger`` at postures ``q`` (N, J) [rad]; one pass for all of them."""
    chain = hand.fingers[finger].chain
    X, J = compute_tip_pose(chain, q), compute_tip_jacobian(chain, q)
    joint, dexterity = compute_joint_margin(chain, q), compute_dexterity(chain, q)
    # Locked as a whole, so that no state has to copy its rows.
    for stack in (X, J):
        stack.setflags(write=False)
    return [FingerState(*row) for row in zip(read_only(q), X, J, joint, dexterity, strict=True)]


@dataclass(frozen=True)
class _Load:
    """How well contacts carry the object: share of the friction cone left, largest share of a joint's torque limit, and the
    ``fault`` of the force QP ("" where it is solved).
    """

    margin: float
    torque: float
    fault: str


@dataclass(eq=False)
class Admissibility:
    """Answers "can the hand carry this state?"; keeps one warm force solver per number of contacts."""

    hand: HandModel
    _solvers: dict[int, ForceSolver] = field(default_factory=dict)
    failed_detours: int = 0
    """Detours that all searches for one goal have looked for in vain."""

    def compute_margins(
        self,
        q: Array,
        X_WO: Array,
        holding: tuple[int, ...],
        landing: tuple[int, ...] = (),
        axis_W: Array | None = None,
    ) -> Margins:
        """Return the margins of a state.

        Args:
            q: postures (F, J) [rad] of all fingers; the tips of ``holding`` touch the object.
            X_WO: object pose (4, 4).
            holding: fingers that carry the object.
            landing: fingers on their way to or from a contact, which may be near the object.
            axis_W: unit axis about which the object is being accelerated, or None.
        """
        states = {i: compute_finger_states(self.hand, i, q[i][None])[0] for i in holding}
        return self.compute_margins_of(states, q, X_WO, landing, axis_W)

    def compute_margins_of(
        self,
        states: dict[int, FingerState],
        q: Array,
        X_WO: Array,
        landing: tuple[int, ...] = (),
        axis_W: Array | None = None,
        explain: bool = True,
    ) -> Margins:
        """Return the same for holding fingers whose ``states`` are known already; ``q`` (F, J) holds them too.

        ``explain`` says whether a refusal for the load names what is short, which takes longer than the rest.
        """
        hand, limits = self.hand, self.hand.limits
        holding = tuple(sorted(states))
        joint = min(states[i].joint for i in holding)
        dexterity = min(states[i].dexterity for i in holding)
        nearest = hand.probe.find_nearest(q, X_WO, (*holding, *landing))
        load, torque, refusal = -np.inf, np.inf, None
        if joint < limits.joint_margin:
            who = min(states, key=lambda i: states[i].joint)
            refusal = Refusal(
                RefusalKind.JOINT_LIMIT, (hand.fingers[who].name,), float(joint), limits.joint_margin
            )
        elif dexterity < limits.dexterity:
            who = min(states, key=lambda i: states[i].dexterity)
            name = hand.fingers[who].name
            refusal = Refusal(RefusalKind.SINGULAR, (name,), float(dexterity), limits.dexterity)
        elif nearest.distance < limits.clearance:
            refusal = refuse_nearness(nearest, limits.clearance)
        else:
            found = self._compute_load(states, q, X_WO, axis_W, explain)
            load, torque = found.margin, found.torque
            if found.fault:
                words = f"the contacts cannot carry the load ({found.fault})" if explain else ""
                refusal = Refusal(RefusalKind.LOAD, words=words)
        return Margins(float(joint), float(dexterity), load, torque, nearest.distance, refusal)

    def find_nearest_on_path(
        self, q: Array, X_WO: Array, free: int, path: Array, touching: tuple[int, ...]
    ) -> Nearness:
        """Return what is nearest to what while finger ``free`` moves along ``path`` (K, J) and the others stay at ``q``."""
        q, found = q.copy(), []
        for posture in path:
            q[free] = posture
            found.append(self.hand.probe.find_nearest(q, X_WO, touching))
        return min(found, key=lambda nearest: nearest.distance)

    def refuse_load(self, states: dict[int, FingerState], q: Array, X_WO: Array) -> bool:
        """Return whether fingers in ``states`` cannot carry the object at rest, whatever else may be wrong with the state."""
        return bool(self._compute_load(states, q, X_WO, None, explain=False).fault)

    def _compute_load(
        self, states: dict[int, FingerState], q: Array, X_WO: Array, axis_W: Array | None, explain: bool
    ) -> _Load:
        """Return what the force QP says of fingers in ``states`` with the object at rest or accelerated about ``axis_W``."""
        hand, limits, body = self.hand, self.hand.limits, self.hand.object.body
        holding = tuple(sorted(states))
        n, joints = len(holding), hand.fingers[0].chain.n_joints
        solver = self._solvers.get(n)
        if solver is None:
            friction = hand.friction.scaled(limits.cone_share)
            settings = ForceSettings((friction,) * n, hand.object.body.bound, friction_weight=GENTLE_FRICTION)
            solver = self._solvers[n] = ForceSolver(settings, joints)
        R_WO, p_WO = X_WO[:3, :3], X_WO[:3, 3]
        G, maps = np.zeros((6, 4 * n)), np.zeros((n, joints, 4))
        for k, i in enumerate(holding):
            p_WF = states[i].X_WF[:3, 3]
            touched = body.project(R_WO.T @ (p_WF - p_WO))
            arm_W = R_WO @ touched.point
            normal_W = None if hand.object.is_isotropic else R_WO @ touched.normal
            G[:, 4 * k : 4 * k + 4], maps[k] = map_contact(states[i].J, arm_W, p_WO + arm_W - p_WF, normal_W)
        alpha = np.zeros(3) if axis_W is None else hand.acceleration * axis_W
        wrench = compute_wrench(hand.object.mass_properties, R_WO, angular_acceleration=alpha)
        bias = hand.probe.compute_gravity_torque(q)[list(holding)]
        torque_limit = np.stack([hand.fingers[i].torque_limit for i in holding])
        reach = limits.torque_share * torque_limit
        bounds = ForceLimits(
            np.full(n, limits.normal_floor), np.full(n, limits.normal_ceiling), -reach, reach
        )
        problem = ForceProblem(solver.settings, G, wrench, bounds, np.full(n, hand.normal_force), maps, bias)
        solution = solver.solve(problem, explain=explain)
        if not solution.is_solved:
            return _Load(-np.inf, np.inf, ", ".join(solution.faults) or solution.status)
        used = max(float(hand.friction.utilisation(f)) for f in solution.forces)
        torque = bias + np.einsum("kjc,kc->kj", maps, solution.forces)
        return _Load(1.0 - used, float((np.abs(torque) / torque_limit).max()), "")
