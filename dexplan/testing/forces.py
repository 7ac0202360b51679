"""Could any contact forces have held the object?  The judge's audit of forces, for any MuJoCo scene.

At instants of a measured run it is asked whether the contacts that were there, with forces within their friction cones and
within what actuators can give, could make the object move as it should: as a reference does, or rest under gravity.  Where
none could, no controller helps; the certificate that proves it is a motion along which the object gives way whatever the
fingers do.  See :mod:`dexplan.sim.judge.force_audit` for the program that OSQP solves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from dexplan.brief import brief_repr
from dexplan.errors import SceneError
from dexplan.sim.judge.force_audit import ForceAudit
from dexplan.sim.judge.force_audit_values import (
    FEASIBLE,
    INFEASIBLE,
    UNDECIDED,
    Certificate,
    ForceAnswer,
    ForceQuestion,
)
from dexplan.spatial import Array
from dexplan.testing.force_questions import ForceQuestions
from dexplan.testing.measurement import Measurement
from dexplan.testing.parties import Indices, list_descendants
from dexplan.testing.raw_contacts import find_free_dof

INSTANTS = 20
"""Instants that are asked about: each costs a few milliseconds."""
MOST_FRICTION = 16.0
"""Factor on friction up to which forces are looked for where there are none."""
PRECISION = 0.02
"""Share to which the friction and the squeeze that would do are found."""
LADDER = 0.01, 0.1, 1.0
"""Shares of the ceiling under which forces are looked for, one after the other."""
LEAST_SHARE = 1e-4
"""Share of the ceiling below which the squeeze that would do is not looked for any further."""


@dataclass(frozen=True, eq=False)
class ForceInstant:
    """One instant at ``time_s`` [s]: the question, the answer, and what would do.

    ``squeeze_N``: the smallest bound on all normal forces under which forces exist; NaN where there are none.
    ``measured_N``: the largest normal force that was there.  ``friction_factor``: times so much friction there would be
    forces; 1 where there are some, infinite where friction does not help.  All three are NaN where they were not looked for.
    """

    time_s: float
    question: ForceQuestion
    answer: ForceAnswer
    squeeze_N: float = float("nan")
    measured_N: float = float("nan")
    friction_factor: float = float("nan")

    __repr__ = brief_repr

    @property
    def escape(self) -> Array | None:
        """The motion (6,) (v [m/s], w [rad/s]) about the centre of mass that contacts cannot prevent, None where they can.

        Scaled so that its larger part, v or w times the grasp's lever arm, is 1.
        """
        if self.answer.certificate is None:
            return None
        twist = -self.answer.certificate.twist
        size = max(np.linalg.norm(twist[:3]), np.linalg.norm(twist[3:]) * self.question.length)
        return twist / size if size > 0.0 else twist

    @property
    def shortfall(self) -> float:
        """By how much [N] every force misses what is needed, as the certificate proves without OSQP's help; 0: it does not."""
        certificate = self.answer.certificate
        return 0.0 if certificate is None else max(0.0, prove(self.question, certificate))


@dataclass(frozen=True, eq=False)
class ForceReport:
    """What was found at the instants of a run, in order of time."""

    object: str
    instants: tuple[ForceInstant, ...]

    __repr__ = brief_repr

    def of(self, verdict: str) -> tuple[ForceInstant, ...]:
        """Return the instants with a verdict: feasible, infeasible or undecided."""
        return tuple(i for i in self.instants if i.answer.verdict == verdict)

    @property
    def could_hold(self) -> bool:
        """Whether forces exist at every instant that was asked about."""
        return bool(self.instants) and len(self.of(FEASIBLE)) == len(self.instants)

    @property
    def could_never_hold(self) -> bool:
        """Whether no instant has forces, each by proof."""
        return bool(self.instants) and len(self.of(INFEASIBLE)) == len(self.instants)

    def __str__(self) -> str:
        if not self.instants:
            return "forces: nothing touched the object"
        out, count = self.of(INFEASIBLE), len(self.instants)
        if not out:
            doubt = f", {len(self.of(UNDECIDED))} undecided" if self.of(UNDECIDED) else ""
            told = (
                f"forces: {len(self.of(FEASIBLE))} of {count} instants have forces for {self.object}{doubt}"
            )
            hardest = max(self.of(FEASIBLE), key=lambda i: np.nan_to_num(i.squeeze_N, nan=-1.0), default=None)
            if hardest is not None and np.isfinite(hardest.squeeze_N):
                there = f"{hardest.measured_N:.3g} N were there at {hardest.time_s:.3f} s"
                told += f"; normal forces of {hardest.squeeze_N:.3g} N per contact are enough, up to {there}"
            return told
        worst = max(out, key=lambda i: i.shortfall)
        share = "at no instant" if len(out) == count else f"not at {len(out)} of {count} instants"
        told = f"forces: {share} could any contact forces hold {self.object}: {worst.shortfall:.3g} N short"
        told += f" at {worst.time_s:.3f} s; {_tell_escape(worst)}"
        if np.isfinite(worst.friction_factor):
            return f"{told}; {worst.friction_factor:.3g} times the friction would do"
        return (
            told
            if np.isnan(worst.friction_factor)
            else f"{told}; no more of the same friction would do; other contacts might, or torsion (condim 4)"
        )


def _tell_escape(instant: ForceInstant) -> str:
    escape = instant.escape
    if escape is None or not escape.any():
        return (
            "its contacts are gone"
            if not len(instant.question.friction)
            else "actuators are too weak for themselves"
        )
    v, w = escape[:3], instant.question.length * escape[3:]
    words = [
        f"{word} ({', '.join(f'{x:.2f}' for x in part)})"
        for word, part in (("moves along", v), ("turns about", w))
        if np.linalg.norm(part) > 0.05
    ]
    return f"it gives way where it {' and '.join(words)}"


def can_audit(model: mujoco.MjModel, measured: Measurement) -> bool:
    """Return whether an object was named that contacts alone can hold: it has a free joint, and nothing ties it."""
    body = measured.parties.object_body
    return body > 0 and find_free_dof(model, body, list_descendants(model, body)) >= 0


def audit_forces(
    model: mujoco.MjModel,
    measured: Measurement,
    *,
    reference: Array | None = None,
    ceiling: float | None = None,
    instants: int = INSTANTS,
) -> ForceReport:
    """Ask at ``instants`` of a run, evenly spread over the samples in which the object is touched, whether it could be held.

    Args:
      model: the model that was measured.
      measured: its run, with an object that has a free joint and whose only ties are contacts.
      reference: poses (T, 7) [m, wxyz, W] of the object's body that it should follow; None: it should rest where it is.
      ceiling: greatest normal force of a contact [N]; None: a hundred times what the object needs.
      instants: how many samples are asked about at most.

    Returns: the answers; of the last instant that has forces how much squeeze is enough, of the one that lacks most how much
    friction would do.
    Raises: SceneError where there is nothing to audit.
    """
    if isinstance(instants, bool) or not isinstance(instants, int | np.integer) or instants < 1:
        raise SceneError("instants", f"{instants!r} is no count", "accepted: a whole number, 1 or more")
    builder, audit = ForceQuestions(model, measured, reference, ceiling), ForceAudit()
    found = []
    for sample in _choose_samples(measured, int(instants)).tolist():
        question = builder.build(sample)
        if question.is_finite:
            answer = _confirm(question, _ask(audit, question))
            found.append(
                ForceInstant(
                    float(measured.time[sample]), question, answer, measured_N=_read_normal(measured, sample)
                )
            )
    # What would do is looked for where it is told: at the last instant that has forces, and at the one that lacks most.
    for verdict, weight in ((FEASIBLE, "time_s"), (INFEASIBLE, "shortfall")):
        chosen = [k for k, instant in enumerate(found) if instant.answer.verdict == verdict]
        if chosen:
            k = max(chosen, key=lambda k: getattr(found[k], weight))
            found[k] = _look_further(audit, found[k])
    return ForceReport(measured.parties.names[measured.parties.object], tuple(found))


def _ask(audit: ForceAudit, question: ForceQuestion) -> ForceAnswer:
    """Return the answer to a question, asked with low ceilings first.

    Where forces exist they are mostly far below the ceiling, and OSQP, which counts in ceilings, is slow to find what is a
    thousandth of one.  Forces below a lower ceiling are forces below the ceiling.
    """
    answer = ForceAnswer(UNDECIDED)
    for share in LADDER:
        answer = audit.ask(replace(question, ceiling=share * question.ceiling))
        if answer.verdict == FEASIBLE:
            break
    return answer


def _confirm(question: ForceQuestion, answer: ForceAnswer) -> ForceAnswer:
    """Return the answer; one whose certificate does not prove it in newtons, without OSQP's scales, is undecided."""
    if answer.verdict != INFEASIBLE or answer.certificate is None:
        return answer
    return answer if prove(question, answer.certificate) > 0.0 else replace(answer, verdict=UNDECIDED)


def prove(question: ForceQuestion, certificate: Certificate) -> float:
    """Return by how much [N] every allowed force misses the wrench, as a certificate proves it; not positive: it proves nothing.

    Along the certificate's motion t the wrench w asks for the power t' w.  All that contacts within their cones, below the
    ceiling c, can give is, for any numbers s of the limits low <= T f <= high,

        t' G f  <=  sum over contacts of c max(0, z_3 + |(mu z_1, mu z_2, mu_t z_4)|)  +  sum of max(-s low, -s high)

    with z = G' t + T' s.  Torques count over the question's lever arm.
    """
    own = _stack_limits(question)
    t, s = certificate.twist, certificate.joints.copy()
    s[(s < 0.0) & ~np.isfinite(own.high)] = 0.0
    s[(s > 0.0) & ~np.isfinite(own.low)] = 0.0
    z = (t @ question.maps + s @ own.maps).reshape(-1, 4)
    mu, torsional = question.friction.T
    sideways = np.sqrt((mu * z[:, 0]) ** 2 + (mu * z[:, 1]) ** 2 + (torsional * z[:, 3]) ** 2)
    most = question.ceiling * np.maximum(0.0, z[:, 2] + sideways).sum()
    most += -(s[s > 0.0] @ own.low[s > 0.0]) - s[s < 0.0] @ own.high[s < 0.0]
    gap = float(t @ question.wrench - most)
    size = float(np.linalg.norm(np.append(t[:3], t[3:] * question.length)))
    if size == 0.0:
        return np.inf if gap > 0.0 else 0.0
    return gap / size


@dataclass(frozen=True, eq=False)
class _Limits:
    """All limits of a question as low <= maps f <= high."""

    maps: Array
    low: Array
    high: Array


def _stack_limits(question: ForceQuestion) -> _Limits:
    count, joints = question.torque_bias.shape
    maps = np.zeros((count * joints, 4 * count))
    for k in range(count):
        maps[k * joints : (k + 1) * joints, 4 * k : 4 * k + 4] = question.torque_maps[k]
    low = (-question.torque_limit - question.torque_bias).ravel()
    high = (question.torque_limit - question.torque_bias).ravel()
    if question.shared is None:
        return _Limits(maps, low, high)
    shared = question.shared
    return _Limits(np.vstack([maps, shared.maps]), np.append(low, shared.low), np.append(high, shared.high))


def _look_further(audit: ForceAudit, instant: ForceInstant) -> ForceInstant:
    """Return the instant with what would do: less squeeze where there are forces, more friction where there are none."""
    if instant.answer.verdict == INFEASIBLE:
        if not instant.question.friction.any():
            return replace(instant, friction_factor=np.inf)
        return replace(instant, friction_factor=_find_friction(audit, instant.question))
    return replace(instant, friction_factor=1.0, squeeze_N=_find_squeeze(audit, instant.question))


def _find_friction(audit: ForceAudit, question: ForceQuestion) -> float:
    """Return the smallest factor on friction at which forces exist, above 1; infinite where there are none at the largest."""
    if _ask(audit, question.with_friction(MOST_FRICTION)).verdict != FEASIBLE:
        return np.inf
    low, high = 1.0, MOST_FRICTION
    while high - low > PRECISION * low:
        middle = float(np.sqrt(low * high))
        if _ask(audit, question.with_friction(middle)).verdict == FEASIBLE:
            high = middle
        else:
            low = middle
    return high


def _find_squeeze(audit: ForceAudit, question: ForceQuestion) -> float:
    """Return the smallest bound on all normal forces [N] under which forces exist, found from above."""
    if not np.abs(question.wrench).max() > 0.0:
        return 0.0
    high, least = question.ceiling, LEAST_SHARE * question.ceiling
    low = 0.0
    while high > least and high - low > PRECISION * high:
        middle = 0.5 * (low + high) if low > 0.0 else 0.25 * high
        if audit.ask(replace(question, ceiling=middle)).verdict == FEASIBLE:
            high = middle
        else:
            low = middle
    return high


def _choose_samples(measured: Measurement, count: int) -> Indices:
    """Return at most ``count`` samples, even among those in which somebody presses on the object, the last one included."""
    rows = measured.contacts
    touched = np.unique(rows.sample[(rows.on == measured.parties.object) & (rows.force[:, 2] > 0.0)])
    if not len(touched):
        return touched
    pick = np.linspace(0, len(touched) - 1, min(count, len(touched)) + 1)[1:]
    return touched[np.unique(np.round(pick).astype(np.intp))]


def _read_normal(measured: Measurement, sample: int) -> float:
    """Return the largest normal force [N] on the object at a sample."""
    rows = measured.contacts
    return float(
        rows.force[(rows.sample == sample) & (rows.on == measured.parties.object), 2].max(initial=0.0)
    )
