"""Does the judge's force audit agree with Clarabel, an interior-point method for cones, on the same questions?

Clarabel is asked for the largest margin m with which forces keep everything: |(x_1, x_2, x_4)| + m <= x_3, x_3 + m <= 1, and the
joint torques m inside their limits, all in shares of the greatest normal force (:mod:`..judge.force_audit`).  Forces exist if
m >= 0.  That is a program of another form, solved by a method of another kind.

**The band.**  The audit lets forces leave a cone by 1e-6 of the greatest normal force and says "none" only with a proof, so
it may call feasible what misses by up to 1e-6.  Clarabel's margin is known to about 1e-8.  Answers are compared where |m| > 1e-5;
what lies nearer to the border is counted.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
from scipy.sparse import csc_matrix

from dexplan.errors import DexplanError
from dexplan.sim.judge.force_audit import ForceAudit
from dexplan.sim.judge.force_audit_questions import QuestionBuilder
from dexplan.sim.judge.force_audit_values import FEASIBLE, UNDECIDED, ForceQuestion
from dexplan.sim.judge.replay import replay
from dexplan.sim.trace import Trace
from dexplan.spatial import GRAVITY, Array, build_frame

BAND = 1e-5
"""Margins [greatest normal force] nearer to zero than this are not compared."""
REACH = 0.1
"""Joint torques over this length [m] read as forces."""
FRICTION_LIMIT = 8.0
"""Factor on friction up to which the border is looked for."""
HALVINGS = 14


@dataclass(frozen=True)
class Disagreement:
    """A question outside the band to which the answers differ: its number, Clarabel's margin, the audit's verdict."""

    number: int
    margin: float
    verdict: str


@dataclass(frozen=True, eq=False)
class AuditAgreement:
    """What a comparison found.

    Of ``count`` questions ``feasible`` are, as Clarabel says; ``in_band`` were not compared, ``unsolved`` have no answer of
    Clarabel's; ``undecided`` are the margins outside the band at which the audit proves nothing.  ``nearest`` is the smallest
    margin compared; ``seconds`` (count,) of processor time the audit took, without its set-up.
    """

    count: int
    feasible: int
    in_band: int
    unsolved: int
    undecided: tuple[float, ...]
    disagreements: tuple[Disagreement, ...]
    nearest: float
    seconds: Array


def compare(questions: Iterable[ForceQuestion]) -> AuditAgreement:
    """Ask both about every question."""
    audit, seconds = ForceAudit(), []
    feasible = in_band = unsolved = 0
    undecided: list[float] = []
    nearest, differing = np.inf, []
    for number, question in enumerate(questions):
        # The first question of its kind sets OSQP up.
        audit.prepare(question)
        began = time.process_time()
        verdict = audit.ask(question).verdict
        seconds.append(time.process_time() - began)
        margin = compute_margin(question)
        if np.isnan(margin):
            unsolved += 1
            continue
        feasible += margin >= 0.0
        if abs(margin) <= BAND:
            in_band += 1
            continue
        nearest = min(nearest, abs(margin))
        if verdict == UNDECIDED:
            undecided.append(margin)
        elif (verdict == FEASIBLE) != (margin >= 0.0):
            differing.append(Disagreement(number, margin, verdict))
    times = np.array(seconds)
    return AuditAgreement(
        len(times), feasible, in_band, unsolved, tuple(undecided), tuple(differing), nearest, times
    )


def compute_margin(question: ForceQuestion) -> float:
    """Return Clarabel's margin [greatest normal force]; -inf where no forces at all give the wrench, NaN where it gives up."""
    clarabel = load_clarabel()
    count, joints = question.torque_bias.shape
    size, own = 4 * count, [slice(4 * k, 4 * k + 4) for k in range(count)]
    mu, torsional = question.friction.T
    scale = np.stack([mu, mu, np.ones(count), torsional], axis=1)
    per_length = np.repeat([1.0, 1.0 / question.length], 3)
    equal = np.zeros((6, size + 1))
    equal[:, :size] = question.maps * scale.ravel() * per_length[:, None]
    plain = np.zeros((count * (1 + 2 * joints), size + 1))
    plain[:, -1] = 1.0
    bounds, cones = [], []
    row = 0
    for k in range(count):
        plain[row, 4 * k + 2] = 1.0
        rows = question.torque_maps[k] * scale[k] / REACH
        plain[row + 1 : row + 1 + joints, own[k]] = rows
        plain[row + 1 + joints : row + 1 + 2 * joints, own[k]] = -rows
        room = [
            question.torque_limit[k] - question.torque_bias[k],
            question.torque_limit[k] + question.torque_bias[k],
        ]
        bounds.append(np.concatenate([[1.0], *room / np.array(REACH * question.ceiling)]))
        cone = np.zeros((4, size + 1))
        cone[0, 4 * k + 2], cone[0, -1] = -1.0, 1.0
        cone[[1, 2, 3], [4 * k, 4 * k + 1, 4 * k + 3]] = -1.0
        cones.append(cone)
        row += 1 + 2 * joints
    limit = np.concatenate(bounds)
    known = np.isfinite(limit)
    A = np.vstack([equal, plain[known], *cones])
    b = np.concatenate([question.wrench * per_length / question.ceiling, limit[known], np.zeros(4 * count)])
    kinds = [
        clarabel.ZeroConeT(6),
        clarabel.NonnegativeConeT(int(known.sum())),
        *[clarabel.SecondOrderConeT(4)] * count,
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    cost = np.zeros(size + 1)
    cost[-1] = -1.0
    answer = clarabel.DefaultSolver(
        csc_matrix((size + 1, size + 1)), cost, csc_matrix(A), b, kinds, settings
    ).solve()
    status = str(answer.status)
    if status == "PrimalInfeasible":
        return -np.inf
    return float(answer.x[-1]) if status in ("Solved", "AlmostSolved") else np.nan


def sample_random(count: int, rng: np.random.Generator) -> Iterator[ForceQuestion]:
    """Yield random questions of two or three contacts, every second one near the border."""
    for number in range(count):
        question = _draw_question(rng)
        yield move_to_border(question, rng) if number % 2 else question


def sample_replayed(
    found: list[ForceQuestion], count: int, rng: np.random.Generator
) -> Iterator[ForceQuestion]:
    """Yield questions of a run with wrench, ceiling and joint torques changed a little, and their friction near the border."""
    for _ in range(count):
        question = found[int(rng.integers(len(found)))]
        wrench = question.wrench * (1.0 + 0.2 * rng.normal(size=6))
        bias = question.torque_bias + 0.02 * rng.normal(size=question.torque_bias.shape)
        ceiling = question.ceiling * rng.uniform(0.3, 1.2)
        yield move_to_border(replace(question, wrench=wrench, torque_bias=bias, ceiling=ceiling), rng)


def move_to_border(question: ForceQuestion, rng: np.random.Generator) -> ForceQuestion:
    """Return the question with frictions 0.01 to 10 per cent above or below the ones at which its forces begin to exist.

    The border is Clarabel's.  Where there is none up to :data:`FRICTION_LIMIT` the question stays as it is.
    """
    low, high = 0.0, FRICTION_LIMIT
    if not compute_margin(question.with_friction(high)) >= 0.0:
        return question
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if compute_margin(question.with_friction(middle)) >= 0.0:
            high = middle
        else:
            low = middle
    return question.with_friction(high * (1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-4.0, -1.0)))


def collect_questions(trace: Trace, ceiling: float, stride: int) -> list[ForceQuestion]:
    """Return the questions of every ``stride``-th sample of a run at which two fingers or more touch."""
    steps = int(trace["physics_steps_per_sample"])
    replayed = replay(trace.model_xml, trace["initial_state"], trace["ctrl"], steps)
    step = steps * replayed.world.timestep
    builder = QuestionBuilder(replayed, trace["object_pose_reference"], step, ceiling)
    touching = replayed.contact_active.sum(axis=1) >= 2
    asked = (builder.build(t) for t in range(0, len(touching), stride) if touching[t])
    return [question for question in asked if question is not None]


def _draw_question(rng: np.random.Generator) -> ForceQuestion:
    """Return contacts anywhere on a ball, some leaning, with a weight and a little torque to give."""
    count, joints, radius = int(rng.integers(2, 4)), 6, float(rng.uniform(0.012, 0.065))
    while True:
        out = rng.normal(size=(count, 3))
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        # Contacts that are all on one side hold nothing at any friction: a few of them are enough.
        if rng.random() < 0.3 or np.linalg.norm(out.sum(axis=0)) < 1.0:
            break
    inward = -out + 0.2 * rng.normal(size=out.shape) * (rng.random() < 0.5)
    maps = np.zeros((6, 4 * count))
    for k in range(count):
        frame = build_frame(inward[k] / np.linalg.norm(inward[k]))
        maps[:3, 4 * k : 4 * k + 3] = frame
        maps[3:, 4 * k : 4 * k + 3] = np.cross(radius * out[k], frame.T).T
        maps[3:, 4 * k + 3] = frame[:, 2]
    weight = GRAVITY * 10.0 ** rng.uniform(-2.6, -0.4)
    push = rng.normal(size=3)
    force = weight * rng.uniform(0.8, 1.5) * push / np.linalg.norm(push)
    sliding = float(rng.uniform(0.2, 1.2))
    torsional = float(rng.uniform(5e-4, 0.25 * sliding * 0.018))
    return ForceQuestion(
        maps=maps,
        wrench=np.concatenate([force, 0.1 * radius * weight * rng.normal(size=3)]),
        friction=np.tile([sliding, torsional], (count, 1)),
        ceiling=float(rng.uniform(min(12.0, max(1.0, 2.0 * weight)), 12.0)),
        torque_maps=rng.normal(size=(count, joints, 4)) * [0.06, 0.06, 0.06, 1.0],
        torque_bias=0.05 * rng.normal(size=(count, joints)),
        torque_limit=rng.choice([0.05, 0.2, 0.5, 1.5], size=(count, joints), p=[0.02, 0.08, 0.4, 0.5]),
    )


def load_clarabel() -> ModuleType:
    """Return the package ``clarabel``, which only the development tools need."""
    try:
        import clarabel
    except ImportError as error:
        raise DexplanError("clarabel is not installed; `pip install clarabel` makes it so") from error
    return clarabel
