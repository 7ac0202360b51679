"""Verdicts on scenes whose truth is known beforehand: closed forms, and what a setting is known to do.

The truths, stated before anything is judged:

* a body on a slope holds below its friction angle and slides above it;
* a pinch with two soft contacts carries a moment of 2 mu_t N about its line and a load of 2 mu N across it, and no more;
* a soft contact that slides under a tangential load u_t mu N moves and turns as v / w = (mu_t / mu) u_t / sqrt(1 - u_t^2), so
  that turning takes more of the power than sliding exactly where u_t^2 < 1/2;
* a box that is pushed slowly costs its pusher mu m g, and slides on the table, not under the pusher.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from foreign_scenes import BALL, BOX, ELLIPTIC, GRAVITY, POINT, nothing, pinch, pinch_controls, slope

from dexplan.testing import Measurement, measure_contacts
from dexplan.testing.verdict import Judgement, Kind, Verdict, judge_contacts

PYRAMIDAL = 'cone="pyramidal"'
NOSLIP = f'{ELLIPTIC} noslip_iterations="50"'
SLIPS = {Kind.COULOMB_SLIP, Kind.TORSIONAL_SLIP}
TIPS = ("left", "right")


def on_slope(share: float, samples: int = 600, **settings: str) -> Verdict:
    measured = measure_contacts(slope(share, **settings), None, nothing(samples), object="thing")
    return judge_contacts(measured).of("table")[0]


def in_pinch(samples: int = 500, *, option: str = ELLIPTIC, **load: float) -> tuple[Measurement, Judgement]:
    model, controls = pinch(option=option), pinch_controls(samples, **load)
    measured = measure_contacts(model, None, controls, tips=TIPS, object="thing")
    return measured, judge_contacts(measured)


@pytest.mark.parametrize("body", [BOX, POINT], ids=["box", "point"])
@pytest.mark.parametrize("option", [ELLIPTIC, NOSLIP, PYRAMIDAL], ids=["elliptic", "noslip", "pyramidal"])
def test_slope_holds_below_the_friction_angle_and_not_above(option: str, body: str) -> None:
    for share in (0.5, 0.9, 0.975):
        verdict = on_slope(share, option=option, body=body)
        assert verdict.kind in {Kind.STUCK, Kind.CREEPING}, verdict
        # A box on pyramids trembles from corner to corner, up to the border of its cones.
        if option != PYRAMIDAL:
            assert verdict.utilisation_max == pytest.approx(share, abs=0.05)
    for share in (1.025, 1.1):
        verdict = on_slope(share, option=option, body=body)
        assert verdict.kind == Kind.COULOMB_SLIP, verdict
        assert verdict.findings[0].amount > 0.1
    # Soft contacts that slide fast throw a body off the table for a while: lost, after Coulomb slip.
    assert on_slope(2.0, option=option, body=body).find(Kind.COULOMB_SLIP) is not None


def test_noslip_sticks_where_soft_contacts_creep() -> None:
    assert on_slope(0.5).kind == Kind.CREEPING
    assert on_slope(0.5, option=NOSLIP).kind == Kind.STUCK


@pytest.mark.parametrize("share", [0.3, 0.8])
@pytest.mark.parametrize("impratio", [1, 10, 100])
@pytest.mark.parametrize("solref", ["0.004 1", "0.02 1"])
def test_creep_is_predicted(share: float, impratio: int, solref: str) -> None:
    option, geom = f'cone="elliptic" impratio="{impratio}"', f'solref="{solref}"'
    for body in (BOX, POINT):
        verdict = on_slope(share, 1500, option=option, geom=geom, body=body)
        creep = verdict.find(Kind.CREEPING)
        assert creep is not None or (impratio == 100 and verdict.kind == Kind.STUCK)
        if creep is not None and creep.amount < 1000.0:
            assert creep.predicted == pytest.approx(creep.amount, rel=0.1)


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_creep_of_pyramids_is_predicted_within_a_factor_of_two(share: float) -> None:
    creep = on_slope(share, 1500, option=PYRAMIDAL, body=POINT).find(Kind.CREEPING)
    assert creep is not None
    assert 0.5 < creep.predicted / creep.amount < 2.0


def test_under_noslip_the_prediction_is_called_an_upper_bound() -> None:
    measured = measure_contacts(slope(0.7, option=NOSLIP, body=POINT), None, nothing(800), object="thing")
    pairs = measured.pairs()
    late = pairs.sample > 400
    assert np.linalg.norm(pairs.slip_W[late].mean(axis=0)) < np.linalg.norm(pairs.creep_W[late].mean(axis=0))
    strict = judge_contacts(measured).verdicts[0]
    assert strict.kind == Kind.STUCK


@pytest.mark.parametrize("option", [ELLIPTIC, NOSLIP], ids=["elliptic", "noslip"])
def test_torsion_ends_at_twice_its_friction_times_force(option: str) -> None:
    limit = 2 * 0.01 * 2.0
    for share in (0.5, 0.98):
        _, judged = in_pinch(option=option, twist=share * limit)
        assert {v.kind for v in judged.verdicts} <= {Kind.STUCK, Kind.CREEPING}, judged
    for share in (1.02, 1.3):
        _, judged = in_pinch(option=option, twist=share * limit)
        assert {v.kind for tip in TIPS for v in judged.of(tip)} == {Kind.TORSIONAL_SLIP}, judged


@pytest.mark.parametrize("option", [ELLIPTIC, NOSLIP], ids=["elliptic", "noslip"])
def test_shear_ends_at_twice_friction_times_force(option: str) -> None:
    limit = 2 * 0.5 * 2.0
    for share in (0.5, 0.98):
        _, judged = in_pinch(option=option, load=share * limit)
        assert {v.kind for v in judged.verdicts} <= {Kind.STUCK, Kind.CREEPING}, judged
    _, judged = in_pinch(150, option=option, load=1.02 * limit)
    for tip in TIPS:
        verdict = judged.of(tip, "thing")[0]
        assert verdict.kind == Kind.COULOMB_SLIP, judged
    _, judged = in_pinch(option=option, load=1.3 * limit)
    for tip in TIPS:
        verdict = judged.of(tip, "thing")[0]
        assert verdict.kind == Kind.LOST
        slip = verdict.find(Kind.COULOMB_SLIP)
        assert slip is not None
        assert slip.start_s < verdict.end_s


def driven_foot(option: str) -> mujoco.MjModel:
    """Return a ball pressed on a table with 2 N that servos slide along x and turn about the normal."""
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="0.001" gravity="0 0 0" integrator="implicitfast" {option}/>
      <default><geom friction="0.5 0.01 0.0001" condim="4" solref="0.02 1"/></default>
      <worldbody>
        <geom name="table" type="plane" size="0 0 1"/>
        <body name="foot" pos="0 0 .01">
          <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1" damping="20"/>
          <joint name="turn" type="hinge" axis="0 0 1" armature="0.01"/>
          <geom type="sphere" size=".01" mass=".1"/></body>
      </worldbody>
      <actuator><velocity joint="x" kv="10000"/><motor joint="z"/><velocity joint="turn" kv="500"/></actuator>
    </mujoco>""")


@pytest.mark.parametrize("option", [ELLIPTIC, NOSLIP], ids=["elliptic", "noslip"])
@pytest.mark.parametrize("u_t", [0.3, 0.6, 0.68, 0.73, 0.9])
def test_spinning_contact_slides_by_its_law(u_t: float, option: str) -> None:
    mu, mu_t, spin = 0.5, 0.01, 0.1
    speed = spin * mu_t / mu * u_t / np.sqrt(1.0 - u_t**2)
    controls = np.tile([speed, -2.0, spin], (600, 1))
    controls[:100, [0, 2]] = 0.0
    measured = measure_contacts(driven_foot(option), None, controls, object="foot")
    rows = measured.contacts
    last = (rows.sample >= 300) & (rows.force[:, 2] > 0.0)
    used = np.linalg.norm(rows.force[last, :2], axis=1) / (mu * rows.force[last, 2])
    ratio = mu / mu_t * np.linalg.norm(rows.slip[last, :2], axis=1) / np.abs(rows.spin[last])
    np.testing.assert_allclose(used, ratio / np.sqrt(1.0 + ratio**2), rtol=0.02)
    # The servos lag by what they have to overcome.
    assert np.median(used) == pytest.approx(u_t, rel=0.06)
    (verdict,) = judge_contacts(measured).verdicts
    assert verdict.kind == (Kind.TORSIONAL_SLIP if u_t**2 < 0.5 else Kind.COULOMB_SLIP), verdict
    assert verdict.find(Kind.TORSIONAL_SLIP if u_t**2 < 0.5 else Kind.COULOMB_SLIP) is not None


def pushed_box() -> mujoco.MjModel:
    """Return a flat crate before a pusher that touches it at the height of its centre of mass, without friction of its own."""
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="0.001" integrator="implicitfast" {ELLIPTIC}/>
      <default><geom friction="0.4 0.005 0.0001" solref="0.01 1"/></default>
      <worldbody>
        <geom name="table" type="plane" size="0 0 1"/>
        <body name="crate" pos="0 0 .01"><freejoint/><geom type="box" size=".05 .05 .01" mass=".2"/></body>
        <body name="pusher" pos="-.0605 0 .01"><joint name="x" type="slide" axis="1 0 0" damping="1"/>
          <geom type="sphere" size=".01" mass=".5" contype="2" conaffinity="1"/></body>
      </worldbody>
      <actuator><velocity joint="x" kv="100"/></actuator>
    </mujoco>""")


def test_a_pushed_box_slides_on_the_table_and_not_under_its_pusher() -> None:
    model = pushed_box()
    controls = np.minimum(np.arange(2000)[:, None] * 2e-5, 0.01)
    measured = measure_contacts(model, None, controls, tips=["pusher"], object="crate")
    judged, pairs = judge_contacts(measured), measured.pairs()
    (table,), (pusher,) = judged.of("table"), judged.of("pusher")
    assert table.kind == Kind.COULOMB_SLIP
    assert pusher.kind in {Kind.STUCK, Kind.CREEPING}, judged
    is_late = pairs.sample > 1500
    push = pairs.force_W[is_late & (pairs.by == measured.parties.names.index("pusher"))].mean(axis=0)
    support = pairs.force_W[is_late & (pairs.by == measured.parties.names.index("table"))].mean(axis=0)
    # The pusher's friction presses the crate down a little: mu takes its part of that as well.
    assert push[2] + support[2] == pytest.approx(0.2 * GRAVITY, rel=0.01)
    assert push[0] == pytest.approx(0.4 * support[2], rel=0.01)


def test_a_ball_on_a_slope_rolls() -> None:
    verdict = on_slope(0.3, body=BALL)
    assert verdict.kind == Kind.ROLLING
    assert verdict.find(Kind.COULOMB_SLIP) is None


def test_steep_slopes_make_a_ball_slide_while_it_rolls() -> None:
    """A solid ball rolls without slip only where tan(slope) <= 3.5 mu."""
    assert on_slope(3.2, body=BALL).find(Kind.COULOMB_SLIP) is None
    assert on_slope(3.8, body=BALL).kind == Kind.COULOMB_SLIP


def test_a_hard_dropped_ball_bounces() -> None:
    model = slope(0.0, body=BALL, geom='solref="-20000 -2"')
    state = mujoco.MjData(model)
    state.qpos[2] = 0.03
    spec = int(mujoco.mjtState.mjSTATE_INTEGRATION)
    vector = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, state, vector, spec)
    judged = judge_contacts(measure_contacts(model, vector, nothing(1500), object="thing"))
    assert any(v.kind in {Kind.BOUNCING, Kind.LOST} for v in judged.verdicts)


def test_condim_3_does_not_resist_turning() -> None:
    model = pinch(condim=3)
    controls = pinch_controls(300, twist=0.002)
    judged = judge_contacts(measure_contacts(model, None, controls, tips=TIPS, object="thing"))
    for tip in TIPS:
        (verdict,) = judged.of(tip)
        assert verdict.kind == Kind.TORSIONAL_SLIP
        assert "condim 3" in verdict.findings[0].note


def test_a_frictionless_contact_is_said_to_be_one() -> None:
    verdict = on_slope(0.3, geom='condim="1"')
    assert verdict.kind == Kind.COULOMB_SLIP
    assert verdict.findings[0].note == "this contact has no friction"


def test_pyramidal_defaults_drop_a_grasp_by_creep_alone() -> None:
    """MuJoCo's defaults lose a light grasp that uses a third of its friction; no Coulomb slip is seen while it lasts."""
    model = pinch(option='impratio="1"', solref="0.02 1", condim=3)
    controls = pinch_controls(4000, load=0.6, after=100)
    judged = judge_contacts(measure_contacts(model, None, controls, tips=TIPS, object="thing"))
    for tip in TIPS:
        creep = judged.of(tip)[0].find(Kind.CREEPING)
        assert creep is not None
        assert creep.amount > 100.0


def test_an_actuator_at_its_end_is_named() -> None:
    model = pinch()
    model.actuator_forcelimited[0] = 1
    model.actuator_forcerange[0] = -1.5, 1.5
    judged = judge_contacts(measure_contacts(model, None, pinch_controls(100), tips=TIPS, object="thing"))
    assert judged.of("left")[0].find(Kind.OVERLOADED) is not None
    assert judged.of("right")[0].find(Kind.OVERLOADED) is None


def test_deep_contacts_and_early_stops_are_said() -> None:
    soft = judge_contacts(
        measure_contacts(
            pinch(solref="0.1 1", squeeze=2.0), None, pinch_controls(300), tips=TIPS, object="thing"
        )
    )
    assert soft.verdicts[0].find(Kind.PENETRATING) is not None
    hasty = slope(0.6, option='cone="elliptic" impratio="100" iterations="1" solver="CG"')
    judged = judge_contacts(measure_contacts(hasty, None, nothing(300), object="thing"))
    assert [f.kind for f in judged.findings] == [Kind.UNSOLVED]
    fine = judge_contacts(measure_contacts(slope(0.6), None, nothing(300), object="thing"))
    assert fine.findings == ()
