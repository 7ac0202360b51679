"""Grippers, meshes, stacks, a floating base and a hand from a package: what is known of each is said first."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from dm_control import mjcf
from dm_control.entities.manipulators import kinova
from foreign_scenes import ELLIPTIC, GRAVITY

from dexplan.testing import Kind, judge_contacts, measure_contacts

CUBE = '<geom name="skin" type="box" size=".02 .02 .02" mass="{mass}"/>'
MESH = '<geom name="skin" type="mesh" mesh="gem" mass="{mass}"/>'
GEM = '<asset><mesh name="gem" vertex="{}"/></asset>'.format(
    " ".join(f"{x} {y} {z}" for x in (-0.02, 0.02) for y in (-0.02, 0.02) for z in (-0.02, 0.02))
)
FINGERS = ("left_pad", "right_pad")


def gripper(
    *, body: str = CUBE, mass: float = 0.1, base: str = "", above: str = "", option: str = ELLIPTIC
) -> mujoco.MjModel:
    """Return two pads that press a thing from both sides, by motors; friction 0.5, so they carry at most 2 x 0.5 x N.

    ``base`` is what holds the gripper (nothing: the world), ``above`` another body on top of the thing.
    """
    pads = "".join(
        f"""<body name="{name}_pad" pos="{x} 0 0"><joint name="{name}" type="slide" axis="{-np.sign(x)} 0 0"/>
            <geom type="box" size=".01 .015 .015" mass=".2"/></body>"""
        for name, x in (("left", -0.0302), ("right", 0.0302))
    )
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="0.001" integrator="implicitfast" {option}/>
      {GEM if "mesh" in body else ""}
      <default><geom friction="0.5 0.01 0.0001" condim="4" solref="0.004 1"/><joint damping="5"/></default>
      <worldbody>
        <body name="palm" pos="0 0 .3" gravcomp="1">
          {base}<geom type="box" size=".05 .05 .005" pos="0 0 .08" mass=".5"/>{pads}</body>
        <body name="thing" pos="0 0 .3"><freejoint/>{body.format(mass=mass)}</body>
        {above}
      </worldbody>
      <actuator><motor joint="left"/><motor joint="right"/></actuator>
    </mujoco>""")


def squeeze(force: float, samples: int = 800) -> np.ndarray:
    return np.full((samples, 2), force)


@pytest.mark.parametrize("body", [CUBE, MESH], ids=["cube", "mesh"])
def test_a_gripper_holds_what_its_friction_carries_and_no_more(body: str) -> None:
    """0.1 kg needs 0.981 N across, that is 0.981 N of squeeze: 1.2 N hold, 0.8 N do not."""
    model = gripper(body=body)
    held = measure_contacts(model, None, squeeze(1.2), tips=FINGERS, object="thing")
    judged = judge_contacts(held)
    for pad in FINGERS:
        (verdict,) = judged.of(pad, "thing")
        assert verdict.kind in {Kind.STUCK, Kind.CREEPING}, judged
        assert verdict.normal_force_mean == pytest.approx(1.2, rel=0.03)
    pairs = held.pairs()
    last = pairs.sample == 799
    assert pairs.force_W[last, 2].sum() == pytest.approx(0.1 * GRAVITY, rel=1e-3)
    dropped = judge_contacts(measure_contacts(model, None, squeeze(0.8), tips=FINGERS, object="thing"))
    for pad in FINGERS:
        verdict = dropped.of(pad, "thing")[0]
        assert verdict.kind in {Kind.COULOMB_SLIP, Kind.LOST}, dropped
        assert verdict.find(Kind.COULOMB_SLIP) is not None


def test_of_two_objects_each_is_judged() -> None:
    """The second rests on the first: the pads carry both weights, the first carries one."""
    above = '<body name="rider" pos="0 0 .3301"><freejoint/><geom type="box" size=".01 .01 .01" mass=".05"/></body>'
    model = gripper(above=above)
    measured = measure_contacts(model, None, squeeze(4.0), tips=FINGERS, object="thing")
    pairs, names = measured.pairs(), measured.parties.names
    last = pairs.sample == 799
    by = {names[b]: f for b, f in zip(pairs.by[last], pairs.force_W[last, 2], strict=True)}
    assert by["rider"] == pytest.approx(-0.05 * GRAVITY, rel=0.01)
    assert by["left_pad"] + by["right_pad"] == pytest.approx(0.15 * GRAVITY, rel=0.01)
    rider = judge_contacts(measure_contacts(model, None, squeeze(4.0), object="rider"))
    assert [(v.by, v.on) for v in rider.verdicts] == [("thing", "rider")]
    assert rider.verdicts[0].kind in {Kind.STUCK, Kind.CREEPING}


def test_a_gripper_on_a_floating_base_without_gravity() -> None:
    """Nothing is anchored: what the pads give the thing they give the palm, and the thing has no weight to compare with."""
    option = f'{ELLIPTIC} gravity="0 0 0"'
    measured = measure_contacts(
        gripper(base="<freejoint/>", option=option), None, squeeze(2.0), tips=FINGERS, object="thing"
    )
    judged = judge_contacts(measured)
    for pad in FINGERS:
        (verdict,) = judged.of(pad, "thing")
        assert verdict.kind == Kind.STUCK, judged
        assert verdict.normal_force_mean == pytest.approx(2.0, rel=0.05)
    assert np.isnan(measured.physics.object_weight)
    assert judged.findings == ()


def test_a_hand_from_a_package() -> None:
    """dm_control's Jaco hand, meshes and all, closes on a ball without gravity: three tips by their bodies' names.

    Nothing pushes the ball but the hand, so that its forces add up to the ball's mass times its acceleration.
    """
    hand = kinova.JacoHand().mjcf_model
    arena = mjcf.RootElement()
    arena.option.gravity, arena.option.cone, arena.option.impratio = (0, 0, 0), "elliptic", 100
    arena.option.timestep = 0.001
    arena.worldbody.attach(hand)
    ball = arena.worldbody.add("body", name="ball", pos=(0, 0, 0.17))
    ball.add("freejoint")
    ball.add("geom", type="sphere", size=(0.03,), mass=0.1, friction=(1, 0.005, 0.0001))
    model = mujoco.MjModel.from_xml_string(arena.to_xml_string(), arena.get_assets())
    tips = [name for name in (model.body(b).name for b in range(model.nbody)) if "finger_tip" in name]
    assert len(tips) == 3
    closing = np.tile(np.max(model.actuator_ctrlrange, axis=1), (1500, 1))
    measured = measure_contacts(model, None, closing, tips=tips, object="ball")
    judged = judge_contacts(measured)
    touching = {v.by for v in judged.verdicts if v.on == "ball"}
    assert touching & set(tips), judged
    assert np.isfinite(measured.newton_residual).all()
    assert np.median(measured.newton_residual) < 1e-3
