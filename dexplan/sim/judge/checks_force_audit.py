"""Could the contacts that were there have held the object at all?  The audit of a run's forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dexplan.sim.judge.checks_case import Case, CheckResult, fail, find_runs, judge
from dexplan.sim.judge.force_audit import ForceAudit
from dexplan.sim.judge.force_audit_questions import QuestionBuilder
from dexplan.sim.judge.force_audit_values import FEASIBLE, INFEASIBLE, UNDECIDED, ForceAnswer, ForceQuestion
from dexplan.sim.judge.world import Flags, Indices

NAME = "force_qp_feasible"
FACTOR_PRECISION = 0.005
"""Factors on friction are found to this [-]."""
FACTOR_LIMIT = 16.0
"""Forces that do not exist at this many times the friction are not looked for any further."""
WORST_COUNT = 3
"""Of so many infeasible samples the factor is found: the ones that miss their wrench by most."""
PEAK_COUNT = 12
"""Where all are feasible, the need of friction is looked for at so many actions: the most utilised ones.  It takes
10 ms each, near the border, as much as the audit itself needs for twenty instants."""


@dataclass(frozen=True, eq=False)
class AuditedSample:
    """One audited sample at ``time`` [s]: its question, None where a number is missing, and the answer."""

    sample: int
    time: float
    question: ForceQuestion | None
    answer: ForceAnswer


class FrictionNeed(NamedTuple):
    """The smallest ``factor`` on both frictions at which forces exist at ``time`` [s]; infinite if there is none."""

    factor: float
    time: float


def check_force_qp_feasible(case: Case) -> CheckResult:
    """Audited instants without forces for what the object should get, and quiet ticks whose QP failed.

    Of another controller's run the audit alone is judged: such a controller need not solve anything.
    """
    limit = case.limit(NAME)
    unsolved = None
    if case.controller is None:
        unsolved = _read_answers(case)
        if unsolved is None:
            return fail(NAME, "count", "the record has no qp_status or qp_wrench_residual", limit)
    ceiling = read_ceiling(case)
    if ceiling is None:
        return fail(NAME, "count", "the plan's normal_ceiling_N is no force above 0", limit)
    samples = choose_samples(case)
    if not len(samples):
        return fail(NAME, "count", "there is no sample to audit", limit)
    audit = ForceAudit()
    audited = audit_samples(case, audit, samples, ceiling)
    peaks = [a for sample in find_peaks(case)[:PEAK_COUNT] for a in audited if a.sample == sample]
    said = _describe(audit, audited, peaks or audited[:1])
    note = said if unsolved is None else f"{said}; {unsolved.note}"
    undecided = [a for a in audited if a.answer.verdict == UNDECIDED]
    if 100 * len(undecided) > case.limit("force_audit_undecided_pct") * len(audited):
        return fail(NAME, "count", note, limit, undecided[0].time)
    failed = () if unsolved is None else np.flatnonzero(unsolved.ticks).tolist()
    bad = [*failed, *(a.sample for a in audited if a.answer.verdict == INFEASIBLE)]
    return judge(
        NAME, float(len(bad)), limit, "count", float(case.replay.time[min(bad)]) if bad else None, note
    )


class Unsolved(NamedTuple):
    """Which ``ticks`` (T,) had no answer to the controller's own QP, and a ``note`` on how well the others were met."""

    ticks: Flags
    note: str


def _read_answers(case: Case) -> Unsolved | None:
    """Return what the record says of the QP at each tick; None where it says nothing."""
    status, residual = case.column("qp_status"), case.column("qp_wrench_residual")
    if status is None or residual is None:
        return None
    share = 100 * residual / case.weight
    unsolved = (status != case.limit("force_qp_solved_status")) | ~(
        share <= case.limit("force_qp_residual_pct")
    )
    # Numbers that are missing must not hide behind a run without quiet samples.
    unsolved = (unsolved & case.quiet) | np.isnan(status) | np.isnan(residual)
    return Unsolved(unsolved, f"largest quiet residual {np.max(share[case.quiet], initial=0.0):.2f} %")


def read_ceiling(case: Case) -> float | None:
    """Return the greatest normal force [N] that the plan allows a finger; older plans do not say.  None: no such force."""
    value = case.plan.get("normal_ceiling_N", case.limit("force_audit_ceiling_N"))
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and np.isfinite(value) and value > 0.0 else None


def choose_samples(case: Case) -> Indices:
    """Return the samples to audit, in order: quiet ones at even steps, and each action's most utilised.

    The first one as well: a grasp that cannot hold lets go at once, and nothing near that is quiet.
    """
    stride = max(1, int(case.limit("force_audit_interval_s") / case.sample_time + 1e-9))
    chosen = {t for start, stop in find_runs(case.quiet) for t in range(start, stop, stride)}
    chosen |= set(range(min(1, case.sample_count)))
    return np.array(sorted(chosen | set(find_peaks(case))), dtype=np.intp)


def find_peaks(case: Case) -> list[int]:
    """Return each action's settled sample with the greatest measured utilisation, the greatest one first."""
    used = np.where(case.settled, np.nan_to_num(case.utilisation, nan=np.inf), -1.0).max(axis=1, initial=-1.0)
    action, peaks = case.column("action_index"), []
    for index in np.unique(action[np.isfinite(action)]) if action is not None else ():
        own = np.where(action == index, used, -1.0)
        if own.max() >= 0.0:
            peaks.append(int(np.argmax(own)))
    return sorted(peaks, key=lambda sample: (-used[sample], sample))


def audit_samples(case: Case, audit: ForceAudit, samples: Indices, ceiling: float) -> list[AuditedSample]:
    """Return the questions of ``samples`` with their answers; one that cannot be asked has no forces."""
    builder = QuestionBuilder(case.replay, case.reference, case.sample_time, ceiling)
    audited = []
    for sample in samples.tolist():
        question = builder.build(sample)
        answer = ForceAnswer(INFEASIBLE) if question is None else audit.ask(question)
        audited.append(AuditedSample(sample, float(case.replay.time[sample]), question, answer))
    return audited


def find_friction_need(audit: ForceAudit, audited: list[AuditedSample]) -> FrictionNeed | None:
    """Return the largest need of friction of samples that are feasible; None where there is none of them."""
    need = None
    for a in audited:
        if a.question is None or a.answer.verdict != FEASIBLE:
            continue
        least = 0.0 if need is None else need.factor
        enough = a.question.with_friction(least + FACTOR_PRECISION)
        if need is None or audit.ask(enough).verdict != FEASIBLE:
            factor = audit.find_friction_factor(a.question, least, 1.0, FACTOR_PRECISION)
            need = FrictionNeed(factor, a.time)
    return need


def _describe(audit: ForceAudit, audited: list[AuditedSample], peaks: list[AuditedSample]) -> str:
    """Return what the audit found in words: how many, and how much friction the worst would need.

    The worst are the ones that miss most; where none misses anything, the ``peaks``.
    """
    said = [f"OSQP decided {len(audited)} instants"]
    for verdict in (INFEASIBLE, UNDECIDED):
        count = sum(a.answer.verdict == verdict for a in audited)
        if count:
            said.append(f"{count} of them {verdict}")
    missing = [a for a in audited if a.answer.verdict == INFEASIBLE]
    if not missing:
        need = find_friction_need(audit, peaks)
        if need is not None:
            said.append(
                f"forces exist from {need.factor:.3g} times the friction on (worst at {need.time:.2f} s)"
            )
        return ", ".join(said)
    worst = sorted(missing, key=lambda a: -np.nan_to_num(a.answer.shortfall, nan=np.inf))[:WORST_COUNT]
    return "; ".join([", ".join(said), *(_describe_missing(audit, a) for a in worst)])


def _describe_missing(audit: ForceAudit, audited: AuditedSample) -> str:
    question, answer = audited.question, audited.answer
    if question is None:
        return f"at {audited.time:.2f} s a number is missing"
    touching = len(question.friction)
    if touching == 0:
        return f"at {audited.time:.2f} s no finger touches"
    factor = audit.find_friction_factor(question, 1.0, FACTOR_LIMIT, FACTOR_PRECISION)
    cure = f"from {factor:.3g} times the friction on" if np.isfinite(factor) else "at no friction"
    return (
        f"at {audited.time:.2f} s {touching} contacts miss the wrench by {answer.shortfall:.3g} N or more "
        f"(certificate with residual {answer.residual:.0e}); forces exist {cure}"
    )
