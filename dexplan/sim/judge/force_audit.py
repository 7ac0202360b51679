"""Can fingers that touch an object where they do give it a wrench at all?

OSQP is asked, and its answer is proven before it counts.  Unknown are the contact forces, per finger
x = (f_t1/mu, f_t2/mu, f_n, tau/mu_t) / c with c the greatest normal force, so that every friction cone
is the same round one, |(x_1, x_2, x_4)| <= x_3, and all numbers are near one:

    minimise    1/2 |x - aim|^2                   aim: all fingers press with half of c
    subject to  G x = w                           the wrench; torques over a length of the grasp
                0 <= x_3 <= 1                     what a finger may press
                a' (x_1, x_2, x_4) <= x_3         tangent planes of the cone, |a| = 1
                lower <= bias + T x <= upper      joint torques

The objective is strictly convex and says nothing about feasibility: it only gives OSQP one point to go
to.  (A program that asks for the largest margin has a flat optimum; OSQP runs into its iteration limit
there.)  Tangent planes never cut the cone, so that

- forces that keep every row and leave the cone by at most ``TOLERANCE`` **are** an answer; where they
  leave it by more, the tangent plane there is added and OSQP goes on;
- where the program has no solution there is none in the cone.  OSQP gives a vector y with A' y = 0
  whose products with the bounds contradict that [Boyd & Vandenberghe 2004, §5.8].  Call nu and lambda
  its parts for wrench and torques, and z = G' nu + T' lambda.  Every x that keeps cones and limits has

      nu' (G x) + max over the torque limits (lambda' T x)
          >= z' x >= sum over fingers of min(0, z_3 - |(z_1, z_2, z_4)|),

  whatever the rest of y is.  Where G x = w contradicts that, no forces exist, and by how much w would
  have to move is known.  This needs neither a small residual of y nor the planes.

What is proven neither way is undecided.  The planes hold for every grasp and every friction, so they
are kept from one question to the next, as is OSQP, which is set up once per number of fingers.
"""

from __future__ import annotations

from typing import final

import numpy as np

from dexplan.sim.judge.force_audit_program import AuditProgram
from dexplan.sim.judge.force_audit_values import FEASIBLE, INFEASIBLE, ForceAnswer, ForceQuestion


@final
class ForceAudit:
    """Answers questions, those of equally many fingers with the same solver."""

    def __init__(self) -> None:
        self._programs: dict[tuple[int, ...], AuditProgram] = {}

    def ask(self, question: ForceQuestion) -> ForceAnswer:
        """Return whether forces exist, with what proves it."""
        if len(question.friction) == 0:
            miss = float(np.linalg.norm(question.wrench[:3]))
            is_nothing_wanted = not question.wrench.any()
            return ForceAnswer(
                FEASIBLE if is_nothing_wanted else INFEASIBLE, np.zeros((0, 4)), 0.0, miss, 0.0
            )
        return self.prepare(question).ask(question)

    def prepare(self, question: ForceQuestion) -> AuditProgram:
        """Return the program that answers questions like this one, set up at the first of them."""
        shape = question.shape
        if shape not in self._programs:
            self._programs[shape] = AuditProgram(*shape)
        return self._programs[shape]

    def find_friction_factor(
        self, question: ForceQuestion, low: float, high: float, precision: float
    ) -> float:
        """Return the smallest factor on both frictions at which forces exist, ``precision`` above it at most.

        It is looked for between ``low``, where there are none, and ``high``; infinity where there are
        none at ``high`` either.  Where the question stays undecided there count as no forces.
        """
        if self.ask(question.with_friction(high)).verdict != FEASIBLE:
            return np.inf
        while high - low > precision:
            middle = 0.5 * (low + high)
            if self.ask(question.with_friction(middle)).verdict == FEASIBLE:
                high = middle
            else:
                low = middle
        return high
