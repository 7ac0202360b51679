"""The force audit on foreign scenes against closed forms; every *no* has a certificate that is checked apart from OSQP.

The truths: a pinch needs the squeeze load / 2 mu, or moment / 2 mu_t; fingers whose motors give F each lift 2 mu F; two faces
that press a ball from above its equator, their normals b below the horizontal, can hold it only where tan(b) < mu, whatever
the squeeze; a ball on a slope can only roll away, and rolling friction mu_r holds it up to tan(slope) = mu_r / radius.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from border_scenes import TIPS, Scene, draw, gripper, pinch
from foreign_scenes import ELLIPTIC, GRAVITY, POINT, nothing, slope
from scipy.optimize import linprog

from dexplan.cli import main
from dexplan.errors import DexplanError
from dexplan.sim.judge.force_audit_values import Certificate, ForceQuestion
from dexplan.testing import audit_forces, measure_contacts
from dexplan.testing.actuators import find_joint_ranges
from dexplan.testing.forces import ForceInstant, ForceReport, prove

SEEDS = (21, 22, 23)


def audit(scene: Scene, **options: object) -> ForceReport:
    options = {"instants": 4} | options
    return audit_forces(scene.model, scene.measure(), **options)  # type: ignore[arg-type]


def last(report: ForceReport) -> ForceInstant:
    return report.instants[-1]


def shape_of(question: ForceQuestion, spokes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what each extreme ray of polyhedral cones around the round ones adds to the wrench, and its normal force."""
    rays = []
    for a in np.linspace(0.0, 2.0 * np.pi, spokes, endpoint=False):
        for b in np.linspace(-0.5 * np.pi, 0.5 * np.pi, spokes // 2 + 1):
            rays.append((np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)))
    # The polyhedron through points of the ball is within it; a little longer it is around it.
    around = np.array(rays) * 1.05
    columns, normal = [], []
    for k, (mu, torsional) in enumerate(question.friction):
        for x, y, t in around:
            columns.append(question.maps[:, 4 * k : 4 * k + 4] @ (mu * x, mu * y, 1.0, torsional * t))
            normal.append(k)
    return np.array(columns).T, np.array(normal)


def is_feasible_by_linprog(question: ForceQuestion, spokes: int = 24) -> bool:
    """Return whether forces in polyhedral cones around the round ones answer a question without shared limits."""
    columns, owner = shape_of(question, spokes)
    scale = np.repeat([1.0, 1.0 / question.length], 3)
    count = len(question.friction)
    bound = np.zeros((count, columns.shape[1]))
    bound[owner, np.arange(columns.shape[1])] = 1.0
    found = linprog(
        np.zeros(columns.shape[1]),
        A_ub=bound,
        b_ub=np.full(count, question.ceiling),
        A_eq=scale[:, None] * columns,
        b_eq=scale * question.wrench,
        method="highs",
    )
    return found.status == 0


def draw_forces(question: ForceQuestion, count: int) -> np.ndarray:
    """Return forces (count, K, 4) within cones and ceiling, many of them at the border."""
    rng = np.random.default_rng(3)
    K = len(question.friction)
    part = rng.normal(size=(count, K, 3))
    part /= np.linalg.norm(part, axis=2, keepdims=True)
    part *= np.where(rng.random((count, K, 1)) < 0.5, 1.0, rng.random((count, K, 1)) ** (1.0 / 3.0))
    normal = question.ceiling * np.where(rng.random((count, K)) < 0.3, 1.0, rng.random((count, K)))
    mu, torsional = question.friction.T
    return normal[:, :, None] * np.stack(
        [mu * part[:, :, 0], mu * part[:, :, 1], np.ones((count, K)), torsional * part[:, :, 2]], axis=2
    )


def assert_proven(instant: ForceInstant) -> None:
    """Check a certificate on what it says: no allowed force does as much work on its motion as the wrench has to."""
    assert instant.answer.verdict == "infeasible"
    question, certificate = instant.question, instant.answer.certificate
    assert certificate is not None
    assert instant.shortfall > 0.0
    assert prove(question, Certificate(-certificate.twist, certificate.joints)) <= 0.0
    if question.shared is None:
        assert not is_feasible_by_linprog(question)
        forces = draw_forces(question, 2000).reshape(2000, -1)
        assert (forces @ (certificate.twist @ question.maps)).max() < certificate.twist @ question.wrench


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["shear", "torsion"])
def test_a_pinch_needs_its_load_over_twice_its_friction(kind: str, seed: int) -> None:
    numbers = draw(seed)
    for share in (0.5, 0.9):
        report = audit(pinch(numbers, share, kind))
        assert report.could_hold, report
        assert last(report).squeeze_N == pytest.approx(share * numbers.squeeze, rel=0.03)
        assert last(report).measured_N == pytest.approx(numbers.squeeze, rel=0.05)
        assert f"{last(report).squeeze_N:.3g} N per contact are enough" in str(report)


@pytest.mark.parametrize("seed", SEEDS)
def test_fingers_lift_what_friction_makes_of_their_motors(seed: int) -> None:
    """The weight is 2 mu F / share: motors of 0.98 of what is needed cannot, those of 1.02 can, however much they are told."""
    scene = gripper(draw(seed), 1.0, body="box")
    needed = float(scene.ctrl[0, 0])
    model = scene.model
    for share, could in ((0.98, False), (1.02, True)):
        model.actuator_forcelimited[:] = 1
        model.actuator_forcerange[:] = -share * needed, share * needed
        report = audit(scene)
        assert report.could_hold == could, report
        assert report.could_never_hold != could
        if not could:
            worst = max(report.instants, key=lambda i: i.shortfall)
            assert_proven(worst)
            assert worst.escape is not None
            np.testing.assert_allclose(worst.escape[:3], [0.0, 0.0, -1.0], atol=0.05)
            assert worst.shortfall == pytest.approx(0.02 * draw(seed).mass * GRAVITY, rel=0.3)
            assert worst.friction_factor == pytest.approx(1.0 / 0.98, abs=0.03)
    # Joint limits of force count like those of the actuators.
    model.actuator_forcelimited[:] = 0
    model.jnt_actfrclimited[:2] = 1
    model.jnt_actfrcrange[:2] = -0.98 * needed, 0.98 * needed
    assert audit(scene).could_never_hold
    # So do controls that are clamped.
    model.jnt_actfrclimited[:2] = 0
    model.actuator_ctrllimited[:] = 1
    model.actuator_ctrlrange[:] = -0.98 * needed, 0.98 * needed
    assert audit(scene).could_never_hold


def from_above(angle: float, mu: float) -> Scene:
    """Return a ball between two fixed plates whose normals point ``angle`` below the horizontal."""
    plates = "".join(
        f"""<body name="{name}" pos="{sign * 0.0495 * np.cos(angle)} 0 {0.0495 * np.sin(angle)}">
          <geom type="box" size=".02 .02 .02" euler="0 {np.degrees(sign * -angle)} 0"/></body>"""
        for name, sign in (("left", -1.0), ("right", 1.0))
    )
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="0.001" {ELLIPTIC}/>
      <default><geom friction="{mu} 0.01 0.0001" condim="4" solref="0.004 1"/></default>
      <worldbody>{plates}<body name="thing"><freejoint/><geom type="sphere" size=".03" mass=".1"/></body></worldbody>
    </mujoco>""")
    return Scene(model, nothing(2), "thing", TIPS)


@pytest.mark.parametrize("mu", [0.23, 0.61, 1.07])
def test_no_squeeze_holds_a_ball_from_too_far_above(mu: float) -> None:
    border = np.arctan(mu)
    assert audit(from_above(0.95 * border, mu)).could_hold
    report = audit(from_above(1.05 * border, mu), instants=1)
    assert report.could_never_hold, report
    assert_proven(last(report))
    assert "at no instant could any contact forces hold thing" in str(report)
    # As the certificate says, it falls; and friction up to the border would do.
    assert last(report).escape[2] < -0.9  # type: ignore[index]
    assert last(report).friction_factor == pytest.approx(np.tan(1.05 * border) / mu, rel=0.03)


def test_a_contact_without_torsion_lets_its_object_turn() -> None:
    numbers = draw(24)
    scene = pinch(numbers, 0.5, "torsion")
    assert audit(scene).could_hold
    scene.model.geom_condim[:] = 3
    report = audit(scene)
    worst = max(report.instants, key=lambda i: i.shortfall)
    assert_proven(worst)
    escape = worst.escape
    assert escape is not None
    along = np.array([np.cos(numbers.heading), np.sin(numbers.heading), 0.0])
    assert np.linalg.norm(escape[3:]) * worst.question.length > 0.99
    assert escape[3:] @ along / np.linalg.norm(escape[3:]) > 0.99
    assert worst.friction_factor == np.inf
    assert "or torsion (condim 4)" in str(report)


@pytest.mark.parametrize("share", [0.9, 1.5])
def test_rolling_friction_keeps_a_ball_on_a_slope(share: float) -> None:
    """The square around its cone is wider by up to sqrt(2): in between the answer is yes, which may be wrong."""
    rolling, radius, mu = 0.002, 0.01, 0.8
    body = '<freejoint/><geom type="sphere" size=".01" mass=".1" condim="6"/>'
    model = slope(share * rolling / radius / mu, friction=f"{mu} 0.005 {rolling}", body=body)
    report = audit_forces(model, measure_contacts(model, None, nothing(50), object="thing"), instants=3)
    assert report.could_hold == (share < 1.0)
    if share > 1.0:
        assert report.could_never_hold
        assert_proven(last(report))
    bare = slope(0.05, body='<freejoint/><geom type="sphere" size=".01" mass=".1"/>')
    rolls = audit_forces(bare, measure_contacts(bare, None, nothing(50), object="thing"), instants=3)
    assert rolls.could_never_hold
    escape = last(rolls).escape
    assert escape is not None
    # It rolls the way it is pulled: about y, where +x is down.
    assert escape[4] > 0.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_reference_adds_its_acceleration(seed: int) -> None:
    """Lifted with a, the object needs m (g + a); spun up about the pinch's line, its inertia times that."""
    numbers = replace(draw(seed), mu=0.6)
    scene = gripper(numbers, 0.25, body="box")
    measured = scene.measure()
    time, rise = measured.time, 4.0
    poses = np.tile([0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0], (len(time), 1))
    still = audit_forces(scene.model, measured, reference=poses)
    poses[:, 2] += 0.5 * rise * time**2
    lifted = audit_forces(scene.model, measured, reference=poses)
    for report, acceleration in ((still, 0.0), (lifted, rise)):
        wrench = last(report).question.wrench
        np.testing.assert_allclose(
            wrench[:3], [0.0, 0.0, numbers.mass * (GRAVITY + acceleration)], atol=1e-6 * GRAVITY
        )
    assert last(lifted).squeeze_N / last(still).squeeze_N == pytest.approx(1.0 + rise / GRAVITY, rel=0.03)
    rate = 3.0
    angle = 0.5 * rate * time**2
    poses[:, 2] = 0.3
    poses[:, 3], poses[:, 4] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    spun = last(audit_forces(scene.model, measured, reference=poses)).question.wrench
    inertia = numbers.mass * 2.0 * 0.02**2 / 3.0
    assert spun[3] == pytest.approx(inertia * rate, rel=0.01)


def test_what_rests_on_the_object_is_carried_too() -> None:
    numbers = draw(25)
    scene = replace(gripper(numbers, 1.0, body="box", rider=0.0), object="thing")
    wrench = last(audit(scene)).question.wrench
    assert wrench[2] == pytest.approx(1.2 * numbers.mass * GRAVITY, rel=0.01)


def test_a_certificate_that_is_tampered_with_proves_nothing() -> None:
    instant = last(audit(from_above(1.2 * np.arctan(0.4), 0.4), instants=1))
    certificate = instant.answer.certificate
    assert certificate is not None
    assert prove(instant.question, certificate) > 0.0
    assert prove(instant.question, replace(certificate, twist=0.0 * certificate.twist)) == 0.0
    assert prove(instant.question.with_friction(3.0), certificate) <= 0.0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"ceiling": 0.0}, "ceiling: 0.0 is no force above 0"),
        ({"ceiling": np.nan}, "ceiling: nan is no force above 0"),
        ({"instants": 0}, "instants: 0 is no count"),
        ({"reference": np.zeros((3, 7))}, "reference: has shape (3, 7)"),
        ({"reference": np.full((400, 7), np.nan)}, "finite poses"),
    ],
)
def test_what_cannot_be_audited_is_said_in_one_line(change: dict, told: str) -> None:
    scene = pinch(draw(21), 0.5, "shear")
    with pytest.raises(DexplanError) as caught:
        audit(scene, **change)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_joints_can_get_what_their_actuators_give() -> None:
    model = mujoco.MjModel.from_xml_string("""
    <mujoco><worldbody>
      <body><joint name="servo" type="hinge" axis="0 0 1"/><geom size=".1"/></body>
      <body><joint name="geared" type="slide"/><geom size=".1"/></body>
      <body><joint name="endless" type="hinge"/><geom size=".1"/></body>
      <body><joint name="pulled" type="hinge"/><geom size=".1"/></body>
      <body><joint name="other" type="hinge"/><geom size=".1"/></body>
      <body><joint name="bare" type="hinge"/><geom size=".1"/></body>
      <body><joint name="two" type="slide" actuatorfrcrange="-4 9"/><geom size=".1"/></body>
    </worldbody>
    <tendon><fixed name="both"><joint joint="pulled" coef="1"/><joint joint="other" coef="2"/></fixed></tendon>
    <actuator>
      <position joint="servo" kp="10" ctrlrange="-1 1" ctrllimited="true"/>
      <motor joint="geared" gear="-3" forcerange="-1 2" forcelimited="true"/>
      <motor joint="endless"/>
      <motor tendon="both" forcerange="-1 1" forcelimited="true"/>
      <motor joint="two" ctrlrange="-3 3" ctrllimited="true"/>
      <general joint="two" dyntype="filter" dynprm=".1" gainprm="2" ctrlrange="0 5" ctrllimited="true"/>
    </actuator></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos[0] = 0.3
    mujoco.mj_forward(model, data)
    inf = np.inf
    expected = [(-13, 7), (-6, 3), (-inf, inf), (-inf, inf), (-inf, inf), (-inf, inf), (-3, 9)]
    np.testing.assert_allclose(find_joint_ranges(model, data), expected)


def test_an_object_that_is_not_free_is_not_audited() -> None:
    model = slope(0.5, body=POINT)
    for name in ("thing", None):
        with pytest.raises(DexplanError, match="no body that moves freely is the object"):
            audit_forces(model, measure_contacts(model, None, nothing(5), object=name))


def test_the_doctor_says_what_no_forces_could_hold(cwd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, share in (("low", 0.9), ("high", 1.1)):
        mujoco.mj_saveLastXML(str(cwd / f"{name}.xml"), from_above(share * np.arctan(0.5), 0.5).model)
        main(["doctor", str(cwd / f"{name}.xml"), "--object", "thing", "--seconds", "0.002"])
    out = capsys.readouterr().out
    assert "forces: 2 of 2 instants have forces for thing" in out
    assert "forces: at no instant could any contact forces hold thing" in out
