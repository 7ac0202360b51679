r"""Contact forces while some contacts pivot: their torsion is no choice, and what they bear sideways costs slip.

A contact whose tip turns about the normal against the object has overcome its torsional friction.  With N its normal force and
u_t = |f_t| / (mu N) the share of friction that it bears sideways, the limit surface of a soft finger leaves

    tau_n = mu_t N sqrt(1 - u_t^2)       along the tip's turn, and
    slip  = (mu_t / mu) u_t / sqrt(1 - u_t^2)  per radian of the turn.

So the torsion of such a contact goes into the columns of the grasp map and of the joint torques, in proportion to its normal
force, and its friction is that of a hard finger; the slip is a price [BODIES: "Pivot is priced, not forbidden"].  The torsion is
that of the friction one expects (``nominal``), what may be relied on is less (``believed``).

Balance comes before the floor: where no forces keep the wished least normal force, it is lowered step by step.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.contact.friction import NORMAL, ContactModel, HardFinger, SoftFinger
from dexplan.grasp.force.problem import ForceLimits, ForceProblem, ForceSettings
from dexplan.grasp.force.solver import GENTLE_FRICTION, ForceSolver
from dexplan.spatial import Array, build_frame, lock_arrays, skew

FLOORS = (1.0, 0.7, 0.45, 0.2)
"""Shares of the wished least normal force that are tried, one after the other."""
SPARSE_FRICTION = 2.0
"""Friction weight while contacts pivot: sideways force costs slip then, so squeeze is spent to have less of it."""
EXPECTED = 0.95
"""Share of the torsional friction that a pivoting contact is first taken to bear, before u_t is known."""
ROUNDS = 2
"""How often the torsion is put right by the u_t found."""


@dataclass(frozen=True, eq=False)
class PivotingContacts:
    """N contacts in one frame's axes.

    ``arms`` (N, 3) [m] from the origin of the wrench to the contact points, **outward** unit ``normals`` (N, 3); ``offsets``
    (N, 3) [m] from the tips' centres to the points; ``jacobians`` (N, 6, J) of the tips' centres; ``pivots`` (N,) says
    which tips turn about the outward normal against the object, 1 where positively, -1 where negatively, 0 where not; between
    them torsional friction is not quite overcome, as when a motion begins.
    """

    arms: Array
    normals: Array
    offsets: Array
    jacobians: Array
    pivots: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class PivotingForces:
    """Forces of N contacts.

    ``forces`` (N, 4) [N, N m] on the object, each in its contact frame (t1, t2, n into the object, torsion about n); ``force_W``
    and ``moment_W`` (N, 3) the same in the frame's axes.  ``tangential`` (N,) is u_t with the nominal friction, ``used`` (N,) the
    share of the believed cone in use, torsion left out where the contact pivots.  ``slip_per_turn`` (N,) [m/rad], 0 where
    nothing pivots.  ``torque`` (N, J) [N m]; ``floor`` the share of the wished floor that was kept.
    """

    forces: Array
    force_W: Array
    moment_W: Array
    tangential: Array
    used: Array
    slip_per_turn: Array
    torque: Array
    floor: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(frozen=True, eq=False)
class PivotingLimits:
    """What N contacts may: normal forces from ``floor`` to ``ceiling`` (N,) [N], aimed at ``target`` (N,) [N], joint torques from
    ``torque_lower`` to ``torque_upper`` (N, J) [N m], of which ``bias`` (N, J) is taken whatever the forces.
    """

    floor: Array
    ceiling: Array
    target: Array
    torque_lower: Array
    torque_upper: Array
    bias: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


@dataclass(eq=False)
class PivotingSolver:
    """Answers which forces hold the object; keeps one warm program per kind of grip.

    ``believed`` is the friction that forces keep inside, ``nominal`` what pivots are expected to bear; ``length`` [m] the size of
    the object.
    """

    believed: SoftFinger
    nominal: SoftFinger
    length: float
    _solvers: dict[tuple[tuple[bool, ...], int], ForceSolver] = field(default_factory=dict, init=False)

    def solve(
        self, contacts: PivotingContacts, wrench: Array, limits: PivotingLimits
    ) -> PivotingForces | None:
        """Return forces that exert ``wrench`` (6,) [N, N m] about its origin; None where there are none."""
        is_pivoting = contacts.pivots != 0.0
        solver = self._find_solver(is_pivoting, contacts.jacobians.shape[2])
        share = np.full(len(is_pivoting), EXPECTED)
        for kept in FLOORS:
            found = self._solve(solver, contacts, wrench, limits, share, kept)
            if found is None:
                continue
            for _ in range(ROUNDS if is_pivoting.any() else 0):
                share = np.sqrt(1.0 - np.minimum(found.tangential, 0.999) ** 2)
                found = self._solve(solver, contacts, wrench, limits, share, kept) or found
            return found
        return None

    def _find_solver(self, is_pivoting: NDArray[np.bool_], joints: int) -> ForceSolver:
        key = tuple(is_pivoting.tolist()), joints
        if key not in self._solvers:
            hard = HardFinger(self.believed.sliding)
            models: tuple[ContactModel, ...] = tuple(hard if p else self.believed for p in key[0])
            weight = SPARSE_FRICTION if is_pivoting.any() else GENTLE_FRICTION
            self._solvers[key] = ForceSolver(
                ForceSettings(models, self.length, friction_weight=weight), joints
            )
        return self._solvers[key]

    def _solve(
        self,
        solver: ForceSolver,
        contacts: PivotingContacts,
        wrench: Array,
        limits: PivotingLimits,
        share: Array,
        kept: float,
    ) -> PivotingForces | None:
        count, joints = len(contacts.arms), contacts.jacobians.shape[2]
        frames = np.stack([build_frame(-n) for n in contacts.normals])
        columns, maps = np.zeros((count, 6, 4)), np.zeros((count, joints, 4))
        for k, (R, J) in enumerate(zip(frames, contacts.jacobians, strict=True)):
            columns[k, :3, :3], columns[k, 3:, :3] = R, skew(contacts.arms[k]) @ R
            columns[k, 3:, 3] = R[:, 2]
            maps[k, :, :3] = (J[:3] - skew(contacts.offsets[k]) @ J[3:]).T @ R
            maps[k, :, 3] = J[3:].T @ R[:, 2]
        # The tip's turn drags the object along: about the outward normal, against the contact frame's z.
        torsion = -contacts.pivots * self.nominal.torsional * share
        is_pivoting = contacts.pivots != 0.0
        columns[:, :, NORMAL] += torsion[:, None] * columns[:, :, 3]
        maps[:, :, NORMAL] += torsion[:, None] * maps[:, :, 3]
        width = [3 if p else 4 for p in is_pivoting]
        G = np.concatenate([c[:, :w] for c, w in zip(columns, width, strict=True)], axis=1)
        floor = np.minimum(kept * limits.floor, limits.ceiling)
        bounds = ForceLimits(floor, limits.ceiling, limits.torque_lower, limits.torque_upper)
        problem = ForceProblem(
            solver.settings, G, wrench, bounds, limits.target, maps[:, :, : max(width)], limits.bias
        )
        answer = solver.solve(problem, explain=False)
        if not answer.is_solved:
            return None
        forces = answer.forces.copy()
        forces[is_pivoting, 3] = 0.0
        normal = np.maximum(forces[:, NORMAL], 1e-9)
        sideways = np.linalg.norm(forces[:, :2], axis=1) / normal
        twist = np.where(is_pivoting, 0.0, forces[:, 3] / normal)
        believed, nominal = self.believed, self.nominal
        tangential = sideways / nominal.sliding
        used = np.hypot(sideways / believed.sliding, twist / believed.torsional)
        lost = tangential / np.sqrt(np.maximum(1.0 - tangential**2, 1e-6))
        torque = limits.bias + np.einsum("kjc,kc->kj", maps, forces)
        forces[:, 3] += torsion * forces[:, NORMAL]
        return PivotingForces(
            forces,
            np.einsum("kij,kj->ki", frames, forces[:, :3]),
            frames[:, :, 2] * forces[:, 3:],
            tangential,
            used,
            np.where(is_pivoting, nominal.torsional / nominal.sliding * lost, 0.0),
            torque,
            kept,
        )
