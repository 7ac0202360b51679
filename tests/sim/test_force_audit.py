"""The force audit: closed forms, proofs that hold on their own, and questions that are what MuJoCo's own numbers say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from held_ball import HOME, make_case, make_plan, record
from scipy.spatial.transform import Rotation

from dexplan.sim.judge import checks_force_audit
from dexplan.sim.judge.checks_case import Case
from dexplan.sim.judge.checks_force_audit import check_force_qp_feasible, choose_samples, find_friction_need
from dexplan.sim.judge.force_audit import ForceAudit
from dexplan.sim.judge.force_audit_program import AuditProgram
from dexplan.sim.judge.force_audit_questions import QuestionBuilder, compute_acceleration
from dexplan.sim.judge.force_audit_values import FEASIBLE, INFEASIBLE, UNDECIDED, ForceAnswer, ForceQuestion
from dexplan.spatial import Array, build_frame

MU, MU_T, RADIUS, CEILING = 0.55, 0.0025, 0.035, 10.0
WEIGHT = np.array([0.0, 0.0, 0.06 * 9.81, 0.0, 0.0, 0.0])


def build_question(
    azimuths: tuple[float, ...], wrench: Array = WEIGHT, ceiling: float = CEILING, limit: float = np.inf
) -> ForceQuestion:
    """Return contacts on the equator of a ball, in the ball's axes; one joint per finger feels the normal force at 0.1 m."""
    count = len(azimuths)
    maps = np.zeros((6, 4 * count))
    for k, a in enumerate(np.radians(azimuths)):
        frame = build_frame(-np.array([np.cos(a), np.sin(a), 0.0]))
        maps[:3, 4 * k : 4 * k + 3] = frame
        maps[3:, 4 * k : 4 * k + 3] = np.cross(-RADIUS * frame[:, 2], frame.T).T
        maps[3:, 4 * k + 3] = frame[:, 2]
    torque = np.zeros((count, 1, 4))
    torque[:, 0, 2] = 0.1
    friction = np.tile([MU, MU_T], (count, 1))
    bounds = np.full((count, 1), limit)
    return ForceQuestion(maps, wrench, friction, ceiling, torque, np.zeros((count, 1)), bounds)


def require_factor(phi: float) -> float:
    """Return in closed form from which factor on both frictions a pair ``phi`` [deg] apart carries the weight."""
    lean, half = np.tan(np.radians(90.0 - phi / 2.0)), WEIGHT[2] / 2.0
    parts = half / (MU * CEILING), half * RADIUS * lean / (MU_T * CEILING), lean / MU
    return float(np.linalg.norm(parts))


@pytest.mark.parametrize("phi", [120.0, 136.0, 140.0, 150.0, 178.0])
def test_friction_that_a_pair_needs_is_the_closed_form(phi: float) -> None:
    audit, question, needed = ForceAudit(), build_question((0.0, phi)), require_factor(phi)
    factor = audit.find_friction_factor(question, 0.0, 4.0, 1e-4)
    assert needed - 1e-6 <= factor <= needed + 2e-4
    assert audit.ask(question.with_friction(needed + 1e-4)).verdict == FEASIBLE
    assert audit.ask(question.with_friction(needed - 1e-4)).verdict == INFEASIBLE


@pytest.mark.parametrize("azimuths", [(0.0, 140.0), (0.0, 180.0), (0.0, 120.0, 240.0), (10.0, 130.0, 200.0)])
def test_forces_prove_themselves(azimuths: tuple[float, ...]) -> None:
    question = build_question(azimuths)
    answer = ForceAudit().ask(question)
    assert answer.verdict == FEASIBLE
    forces = answer.forces
    assert forces is not None
    assert np.allclose(question.maps @ forces.ravel(), question.wrench, atol=1e-6 * CEILING)
    sideways = np.sqrt((forces[:, :2] ** 2).sum(axis=1) / MU**2 + forces[:, 3] ** 2 / MU_T**2)
    assert np.all(sideways <= forces[:, 2] + 1e-6 * CEILING)
    assert np.all(forces[:, 2] <= CEILING * (1.0 + 1e-6))


def test_shortfall_is_what_is_missing() -> None:
    """Two fingers at opposite ends lift 2 mu times their ceiling and no more."""
    heavy = np.array([0.0, 0.0, 12.0, 0.0, 0.0, 0.0])
    answer = ForceAudit().ask(build_question((0.0, 180.0), heavy))
    assert answer.verdict == INFEASIBLE
    missing = 12.0 - 2.0 * MU * CEILING
    assert 0.5 * missing <= answer.shortfall <= missing + 1e-6


def test_ceiling_and_torque_limits_bind() -> None:
    audit, needed = ForceAudit(), require_factor(140.0)
    assert needed < 1.0
    assert audit.ask(build_question((0.0, 140.0), ceiling=0.5)).verdict == INFEASIBLE
    # The joint feels 0.1 m times the normal force: 0.05 N m leave 0.5 N.
    assert audit.ask(build_question((0.0, 140.0), limit=0.05)).verdict == INFEASIBLE
    assert audit.ask(build_question((0.0, 140.0), limit=1.0)).verdict == FEASIBLE
    broken = build_question((0.0, 140.0), limit=0.05)
    broken = replace(broken, torque_bias=np.full((2, 1), -2.0))
    answer = audit.ask(broken)
    assert answer.verdict == INFEASIBLE


def test_no_finger_and_one_finger_hold_nothing() -> None:
    audit = ForceAudit()
    for azimuths in ((), (0.0,)):
        answer = audit.ask(build_question(azimuths))
        assert answer.verdict == INFEASIBLE
        assert answer.shortfall > 0.0


def test_no_vector_proves_what_is_not_so() -> None:
    """Whatever OSQP would hand over: where forces exist, no vector counts as a proof that there are none."""
    rng = np.random.default_rng(0)
    for azimuths in ((0.0, 140.0), (0.0, 120.0, 240.0)):
        question = build_question(azimuths, limit=1.5)
        program = AuditProgram(*question.shape)
        rows = program._write(question)
        size = len(program._upper)
        for _ in range(2000):
            y = rng.normal(size=size) * rng.choice([0.0, 1e-6, 1.0, 1e6], size=size)
            assert program._prove_infeasible(rows, y, question.length) is None


def test_order_of_questions_does_not_matter() -> None:
    """Solver and planes are kept, and what was asked before changes no verdict."""
    questions = [
        build_question((0.0, phi)).with_friction(factor)
        for phi in (130.0, 150.0)
        for factor in (0.3, 0.7, 1.0)
    ]
    audit = ForceAudit()
    forward = [audit.ask(q).verdict for q in questions]
    backward = [audit.ask(q).verdict for q in questions[::-1]][::-1]
    assert forward == backward == [ForceAudit().ask(q).verdict for q in questions]
    assert len(set(forward)) == 2


# -- questions from a replay ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def held() -> Case:
    return make_case(record(samples=250))


def build_questions(case: Case, reference: Array | None = None) -> QuestionBuilder:
    poses = case.reference if reference is None else reference
    return QuestionBuilder(case.replay, poses, case.sample_time, 12.0)


def test_measured_forces_answer_the_question_at_rest(held: Case) -> None:
    """Wrench, friction and joint torques are MuJoCo's: its own contact forces and servo torques fit the question's rows."""
    question = build_questions(held).build(200)
    assert question is not None
    forces = held.replay.contact_force[200]
    assert np.allclose(question.maps @ forces.ravel(), question.wrench, atol=1e-3)
    assert np.allclose(question.wrench, [0.0, 0.0, 0.06 * 9.81, 0.0, 0.0, 0.0])
    assert np.allclose(question.friction, [0.55, 0.0025])
    torque = question.torque_bias + np.einsum("kjm,km->kj", question.torque_maps, forces)
    assert np.allclose(torque.ravel(), held.replay.actuator_force[200], atol=2e-3)
    assert np.allclose(question.torque_limit, held.replay.world.torque_limit.reshape(3, -1))


def test_wrench_follows_the_reference_and_not_the_object(held: Case) -> None:
    t = held.replay.time
    reference = np.tile(HOME, (len(t), 1))
    reference[:, 2] += 0.5 * 2.0 * t**2
    reference[:, 3:] = Rotation.from_rotvec(0.5 * 3.0 * t[:, None] ** 2 * [0.0, 0.0, 1.0]).as_quat(
        scalar_first=True
    )
    question = build_questions(held, reference).build(100)
    assert question is not None
    inertia = 0.4 * 0.06 * RADIUS**2
    assert question.wrench == pytest.approx([0, 0, 0.06 * 11.81, 0, 0, 3.0 * inertia], abs=1e-6)


def test_acceleration_of_a_turning_body_that_is_held_off_its_centre() -> None:
    step, arm, rate = 0.004, np.array([0.01, 0.0, 0.0]), 2.0
    angle = rate * step * np.arange(50)
    poses = np.zeros((50, 7))
    poses[:, 3:] = Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0]).as_quat(scalar_first=True)
    speed, acceleration = compute_acceleration(poses, arm, step)
    inward = -(rate**2) * np.stack([0.01 * np.cos(angle), 0.01 * np.sin(angle), 0.0 * angle], axis=1)
    assert np.allclose(speed[1:-1], [0.0, 0.0, rate])
    assert np.allclose(acceleration[1:-1, :3], inward[1:-1], atol=1e-5)
    assert np.allclose(acceleration[:, 3:], 0.0, atol=1e-9)
    poses[20] = np.nan
    assert np.isnan(compute_acceleration(poses, arm, step)[1][19:22]).all()


# -- the check --------------------------------------------------------------------------------------------------


def test_held_ball_passes_and_says_what_friction_it_needs(held: Case) -> None:
    result = check_force_qp_feasible(held)
    assert (result.status, result.value) == ("pass", 0.0)
    assert "OSQP decided 11 instants" in result.note
    assert "times the friction on" in result.note
    samples = choose_samples(held)
    assert samples[0] == 0
    assert np.diff(samples).max() * held.sample_time <= 0.1 + 1e-9


def test_need_is_that_of_the_worst_sample(held: Case) -> None:
    audit = ForceAudit()
    audited = checks_force_audit.audit_samples(held, audit, np.array([0, 100, 200]), 12.0)
    assert audited[1].question is not None
    weak = replace(audited[1], question=audited[1].question.with_friction(0.5))
    alone, among = (
        find_friction_need(audit, [audited[0]]),
        find_friction_need(audit, [audited[0], weak, audited[2]]),
    )
    assert alone is not None
    assert among is not None
    assert among.factor == pytest.approx(2.0 * alone.factor, rel=0.1)
    assert among.time == weak.time


def with_friction(case: Case, factor: float) -> Case:
    replayed = replace(case.replay, contact_friction=factor * case.replay.contact_friction)
    return replace(case, replay=replayed)


def test_infeasible_samples_fail_with_their_proof(held: Case) -> None:
    result = check_force_qp_feasible(with_friction(held, 0.01))
    assert (result.status, result.value, result.worst_time_s) == ("fail", 11.0, held.replay.time[0])
    assert "11 of them infeasible" in result.note
    assert "3 contacts miss the wrench by 0." in result.note
    assert "certificate with residual" in result.note
    assert result.note.count("forces exist from") == checks_force_audit.WORST_COUNT


def test_ceiling_is_the_plans(held: Case) -> None:
    weak = replace(held, plan={**make_plan(), "normal_ceiling_N": 0.1})
    assert check_force_qp_feasible(weak).value == 11.0
    for value in (0.0, -1.0, float("nan"), True, "12"):
        result = check_force_qp_feasible(replace(held, plan={**make_plan(), "normal_ceiling_N": value}))
        assert (result.status, result.value) == ("fail", None)
        assert "normal_ceiling_N" in result.note


def test_reference_that_is_none_fails(held: Case) -> None:
    columns = dict(held.columns)
    del columns["object_pose_reference"]
    result = check_force_qp_feasible(replace(held, columns=columns))
    assert result.status == "fail"
    assert "a number is missing" in result.note


@pytest.mark.parametrize(("share", "status"), [(0.0, "pass"), (0.3, "fail")])
def test_undecided_samples_are_counted(
    held: Case, monkeypatch: pytest.MonkeyPatch, share: float, status: str
) -> None:
    ask, asked = ForceAudit.ask, []

    def shrug(self: ForceAudit, question: ForceQuestion) -> ForceAnswer:
        asked.append(question)
        return ForceAnswer(UNDECIDED) if len(asked) <= share * 11 else ask(self, question)

    monkeypatch.setattr(ForceAudit, "ask", shrug)
    result = check_force_qp_feasible(held)
    assert result.status == status
    assert ("3 of them undecided" in result.note) == (status == "fail")
