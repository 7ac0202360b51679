"""The program that OSQP solves for a force audit, and the proofs that make its answer count."""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np
import osqp
from scipy.sparse import csc_matrix

from dexplan.sim.judge.force_audit_values import (
    FEASIBLE,
    INFEASIBLE,
    UNDECIDED,
    Certificate,
    ForceAnswer,
    ForceQuestion,
)
from dexplan.spatial import Array

TOLERANCE = 1e-6
"""Forces may leave a cone, a bound or a torque limit by this share of the greatest normal force."""
PROOF = 1e-9
"""A proof that there are no forces needs a gap of this share of the greatest normal force: above what
sums of a few dozen doubles lose."""
REACH = 0.1
"""Typical lever arm of a joint [m]: torque rows are divided by it to read as forces.  Only scales."""
SLOTS = 24
"""Tangent planes per finger, the fixed ones included.  More make a solve slower; with fewer a plane may be
given up too early."""
ROUNDS = 20
"""Solves per inset, each with one more plane at every finger that leaves its cone."""
INSETS = (3e-2, 3e-3, 3e-4, 3e-5, 3e-6, 0.0)
"""How far inside the cones the planes stand, one after the other [ceilings].  Forces that aim inside need
few planes and little precision of OSQP; only questions near the border come to the last ones."""
PRECISION = 0.1
"""OSQP's tolerances as a share of the inset.  Of 300 random grasps, half of them near the border, 0.3
took more solves and 0.01 more iterations."""
FINEST = 1e-8
"""OSQP's smallest tolerances."""
SETTINGS: tuple[dict[str, float], ...] = (
    {"scaling": 0, "rho": 0.1, "max_iter": 1000},
    {"scaling": 10, "rho": 1.0, "max_iter": 4000},
)
"""OSQP's settings at first, and for a retry."""
FIXED = np.concatenate([np.eye(3), -np.eye(3)])
"""Slopes a (6, 3) of the planes that every finger keeps."""
TANGENTIAL = [0, 1, 3]
"""Where the components stand that friction bounds."""


class _Rows(NamedTuple):
    """The numbers of one question, in units of the ceiling.

    ``G`` (6, n), ``w`` (6,), ``T`` (K J + S, n), ``low`` and ``high`` (K J + S,), n = 4 K.
    """

    G: Array
    w: Array
    T: Array
    low: Array
    high: Array


class _Proof(NamedTuple):
    """By how much every force misses the wrench [ceilings], the certificate, and what is left of its rows."""

    shortfall: float
    certificate: Certificate
    residual: float


@final
class AuditProgram:
    """The programs of K fingers with J joints and S shared limits, written down in :mod:`dexplan.sim.judge.force_audit`.

    The pattern of entries is fixed and OSQP set up once; planes come and go in their slots.
    Rows: wrench | normal forces | tangent planes, SLOTS per finger | joint torques | shared limits.
    """

    def __init__(self, count: int, joints: int, shared: int = 0) -> None:
        self._count, size = count, 4 * count
        self._normal = 4 * np.arange(count) + 2
        planes, torques = 6 + count, 6 + count + count * SLOTS
        total = torques + count * joints + shared
        pattern, A = np.zeros((total, size), dtype=bool), np.zeros((total, size))
        pattern[:6] = True
        pattern[6 + np.arange(count), self._normal] = True
        A[6 + np.arange(count), self._normal] = 1.0
        for k in range(count):
            own = slice(4 * k, 4 * k + 4)
            pattern[planes + k * SLOTS : planes + (k + 1) * SLOTS, own] = True
            pattern[torques + k * joints : torques + (k + 1) * joints, own] = True
        pattern[torques + count * joints :] = True
        self._A, self._planes, self._torques = A, slice(planes, torques), slice(torques, total)
        self._columns_of, self._rows_of = np.nonzero(pattern.T)
        self._starts = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
        self._lower, self._upper = np.zeros(total), np.zeros(total)
        self._upper[6:planes] = 1.0
        self._lower[self._planes] = -np.inf
        self._aim = np.zeros(size)
        self._aim[self._normal] = 0.5
        self._next = np.full(count, len(FIXED))
        for k in range(count):
            for slot in range(SLOTS):
                # Slots without a plane of their own say 0 <= x_3 until they are needed.
                self._write_plane(k, slot, FIXED[slot] if slot < len(FIXED) else np.zeros(3))
        self._solvers: list[osqp.OSQP | None] = [None] * len(SETTINGS)

    def ask(self, question: ForceQuestion) -> ForceAnswer:
        """Return what OSQP finds with the first settings, else with those of the retry."""
        rows = self._write(question)
        iterations = rounds = 0
        answer = ForceAnswer(UNDECIDED)
        for attempt in range(len(SETTINGS)):
            answer = self._decide(question, rows, attempt)
            iterations, rounds = iterations + answer.iterations, rounds + answer.rounds
            if answer.verdict != UNDECIDED:
                break
        return ForceAnswer(**{**vars(answer), "iterations": iterations, "rounds": rounds})

    def _write(self, question: ForceQuestion) -> _Rows:
        """Take over the numbers of ``question``."""
        scale = question.scale
        per_length = np.repeat([1.0, 1.0 / question.length], 3)
        G = question.maps * scale.ravel() * per_length[:, None]
        w = question.wrench * per_length / question.ceiling
        own = question.torque_maps * scale[:, None, :] / REACH
        T = np.zeros((self._torques.stop - self._torques.start, 4 * self._count))
        joints = own.shape[1]
        for k in range(self._count):
            T[k * joints : (k + 1) * joints, 4 * k : 4 * k + 4] = own[k]
        unit = REACH * question.ceiling
        low = (-question.torque_limit - question.torque_bias).ravel() / unit
        high = (question.torque_limit - question.torque_bias).ravel() / unit
        if question.shared is not None:
            T[self._count * joints :] = question.shared.maps * scale.ravel() / REACH
            low = np.concatenate([low, question.shared.low / unit])
            high = np.concatenate([high, question.shared.high / unit])
        self._A[:6], self._A[self._torques] = G, T
        self._lower[:6] = self._upper[:6] = w
        self._lower[self._torques], self._upper[self._torques] = low, high
        return _Rows(G, w, T, low, high)

    def _decide(self, question: ForceQuestion, rows: _Rows, attempt: int) -> ForceAnswer:
        """Solve, and add planes where the forces leave their cones, until something is proven."""
        solver = self._start(attempt)
        iterations = number = 0
        for inset in INSETS:
            self._upper[self._planes] = -inset
            tolerance = max(PRECISION * inset, FINEST)
            solver.update_settings(eps_abs=tolerance, eps_rel=tolerance, eps_prim_inf=tolerance)
            for _ in range(ROUNDS):
                number += 1
                solver.update(l=self._lower, u=self._upper, Ax=self._A[self._rows_of, self._columns_of])
                result = solver.solve(raise_error=False)
                iterations += int(result.info.iter)
                x, y = np.array(result.x), np.array(result.y)
                is_out = "infeasible" in result.info.status or not np.isfinite(x).all()
                if is_out:
                    y = np.array(result.prim_inf_cert)
                    # What is left of the iterates would be a bad start for the next solve.
                    solver.warm_start(self._aim, np.zeros(len(self._upper)))
                proof = self._prove_infeasible(rows, y, question.length)
                if proof is not None:
                    shortfall = proof.shortfall * question.ceiling
                    return ForceAnswer(
                        INFEASIBLE,
                        None,
                        np.nan,
                        shortfall,
                        proof.residual,
                        number,
                        iterations,
                        proof.certificate,
                    )
                if is_out:
                    break
                x += np.linalg.lstsq(rows.G, rows.w - rows.G @ x, rcond=None)[0]
                beyond = self._leave_cones(x)
                excess = max(float(beyond.max()), self._overstep(rows, x))
                if excess <= TOLERANCE:
                    forces = question.ceiling * question.scale * x.reshape(-1, 4)
                    excess *= question.ceiling
                    return ForceAnswer(FEASIBLE, forces, excess, np.nan, np.nan, number, iterations)
                if not self._cut(x, beyond + inset):
                    break
        return ForceAnswer(UNDECIDED, rounds=number, iterations=iterations)

    def _start(self, attempt: int) -> osqp.OSQP:
        """Return the solver with the settings of this attempt, set up at its first use."""
        solver = self._solvers[attempt]
        if solver is None:
            size, total = len(self._aim), len(self._upper)
            solver = osqp.OSQP(algebra="builtin")
            solver.setup(
                csc_matrix((np.ones(size), np.arange(size), np.arange(size + 1)), shape=(size, size)),
                -self._aim,
                csc_matrix(
                    (self._A[self._rows_of, self._columns_of], self._rows_of, self._starts),
                    shape=(total, size),
                ),
                self._lower,
                self._upper,
                verbose=False,
                polishing=False,
                check_termination=10,
                **SETTINGS[attempt],
            )
            self._solvers[attempt] = solver
        return solver

    def _prove_infeasible(self, rows: _Rows, y: Array, length: float) -> _Proof | None:
        """Return what ``y`` proves of how far every force misses the wrench; ``length`` [m] scales its torques.

        Cones, ceiling and torque limits are kept, the inequality is that of the module
        :mod:`dexplan.sim.judge.force_audit`.  None: nothing is proven.
        """
        largest = float(np.abs(y).max())
        if not (np.isfinite(largest) and largest > 0.0):
            return None
        y = y / largest
        nu, turning = y[:6], y[self._torques].copy()
        # A limit that is not there holds nothing back; its part of y is rounding.
        turning[(turning > 0.0) & ~(rows.high < np.inf)] = 0.0
        turning[(turning < 0.0) & ~(rows.low > -np.inf)] = 0.0
        pushed, pulled = turning > 0.0, turning < 0.0
        most = turning[pushed] @ rows.high[pushed] + turning[pulled] @ rows.low[pulled]
        z = (nu @ rows.G + turning @ rows.T).reshape(-1, 4)
        least = np.minimum(0.0, z[:, 2] - np.linalg.norm(z[:, TANGENTIAL], axis=1)).sum()
        gap, size = float(least - nu @ rows.w - most), float(np.linalg.norm(nu))
        if not gap > PROOF * max(size, float(np.linalg.norm(turning))):
            return None
        certificate = Certificate(-nu * np.repeat([1.0, 1.0 / length], 3), -turning / REACH)
        shortfall = gap / size if size > 0.0 else np.inf
        return _Proof(shortfall, certificate, float(np.abs(y @ self._A).max()))

    def _leave_cones(self, x: Array) -> Array:
        """Return by how much (K,) the forces leave their cones; negative inside."""
        rows = x.reshape(-1, 4)
        return np.linalg.norm(rows[:, TANGENTIAL], axis=1) - rows[:, 2]

    def _overstep(self, rows: _Rows, x: Array) -> float:
        """Return by how much the worst of the other rows is missed: wrench, normal forces, joint torques."""
        normal, torque = x[self._normal], rows.T @ x
        miss = np.abs(rows.G @ x - rows.w)
        beyond = np.concatenate([miss, -normal, normal - 1.0, torque - rows.high, rows.low - torque])
        return float(beyond.max())

    def _cut(self, x: Array, beyond: Array) -> bool:
        """Add the plane nearest to the force of every finger that is outside; return if any is.

        A new plane takes the place of the finger's oldest one.
        """
        outside = np.flatnonzero(beyond > TOLERANCE)
        for k in outside.tolist():
            sideways = x.reshape(-1, 4)[k, TANGENTIAL]
            slot = int(self._next[k])
            self._write_plane(k, slot, sideways / np.linalg.norm(sideways))
            self._next[k] = slot + 1 if slot + 1 < SLOTS else len(FIXED)
        return len(outside) > 0

    def _write_plane(self, finger: int, slot: int, slope: Array) -> None:
        row = self._planes.start + finger * SLOTS + slot
        self._A[row, [4 * finger + i for i in TANGENTIAL]] = slope
        self._A[row, 4 * finger + 2] = -1.0
