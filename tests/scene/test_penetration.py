"""How deep tips stand in the object: the closed form against MuJoCo, over masses, profiles, tips and squeezes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from dexplan.scene.description import SceneParameters
from dexplan.scene.library import load_scene_with
from dexplan.scene.penetration import (
    compute_force_at,
    compute_impedance,
    compute_resting_force,
    predict_penetration,
)
from dexplan.scene.scene import Scene
from dexplan.scene.shape import Shape

OPPOSITE = """
<mujoco>
  <option timestep="0.001" integrator="Euler" cone="elliptic" impratio="100" gravity="0 0 0"/>
  <default><geom condim="4" friction="0.55 0.0025 0.0001" solref="{solref}" solimp="{solimp}"/></default>
  <worldbody>
    <body name="ball"><freejoint/><geom name="ball" type="sphere" size="0.02" mass="{mass}"/></body>
    <body name="left" pos="-0.0379 0 0"><joint name="left" type="slide" axis="1 0 0"/>
      <geom name="left" type="sphere" size="0.018" mass="{tip}"/></body>
    <body name="right" pos="0.0379 0 0"><joint name="right" type="slide" axis="1 0 0"/>
      <geom name="right" type="sphere" size="0.018" mass="{tip}"/></body>
  </worldbody>
</mujoco>
"""


def squeeze_and_settle(model: mujoco.MjModel, force: float) -> float:
    """Return how deep [m] two tips on slides stand in the ball after a second of pressing it from both sides."""
    data = mujoco.MjData(model)
    data.qfrc_applied[model.joint("left").dofadr[0]] = force
    data.qfrc_applied[model.joint("right").dofadr[0]] = -force
    mujoco.mj_step(model, data, nstep=1000)
    assert data.ncon == 2
    return float(-data.contact.dist.mean())


@pytest.mark.parametrize("force", [0.1, 1.2, 5.5])
@pytest.mark.parametrize("mass", [0.0027, 0.01, 0.06, 0.4])
@pytest.mark.parametrize(
    ("solref", "solimp"),
    [
        ("0.002 1", "0.95 0.99 0.001 0.5 2"),
        ("0.004 0.8", "0.9 0.95 0.0005 0.3 3"),
        ("0.001 1", "0.8 0.95 0.001 0.5 1"),
    ],
)
def test_closed_form_is_mujocos(force: float, mass: float, solref: str, solimp: str) -> None:
    """The same scene, but any hand will do: inverse masses are what MuJoCo says of its bodies."""
    model = mujoco.MjModel.from_xml_string(OPPOSITE.format(solref=solref, solimp=solimp, mass=mass, tip=0.05))
    scene = _Bare(model)
    predicted = predict_penetration(scene, 0, force)  # type: ignore[arg-type]
    assert squeeze_and_settle(model, force) == pytest.approx(predicted, rel=0.03)


class _Bare:
    """As much of a scene as the prediction reads."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.n_fingers = model, 2
        self.tip_geoms = np.array([model.geom("left").id, model.geom("right").id])
        self.object_geom = model.geom("ball").id


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene_with(SceneParameters(object_mass=0.0027, object_shape=Shape.ball(0.02)))


def test_light_ball_is_entered_as_deep_as_was_measured(scene: Scene) -> None:
    """8, 41, 120 and 354 um were measured with a hand that holds a table-tennis ball."""
    measured = {0.1: 8e-6, 0.5: 41e-6, 1.5: 120e-6, 5.5: 354e-6}
    for force, depth in measured.items():
        assert predict_penetration(scene, 0, force) == pytest.approx(depth, rel=0.03)


def test_force_and_depth_are_inverse(scene: Scene) -> None:
    depths = [predict_penetration(scene, i, compute_force_at(scene, 1e-4)) for i in range(scene.n_fingers)]
    assert max(depths) == pytest.approx(1e-4, rel=1e-9)
    assert compute_resting_force(scene, 0, depths[0]) == pytest.approx(
        compute_force_at(scene, 1e-4), rel=1e-9
    )


def test_impedance_is_monotone_and_ends_where_solimp_says() -> None:
    for solimp in ((0.95, 0.99, 1e-3, 0.5, 2.0), (0.8, 0.9, 1e-3, 0.3, 3.0), (0.8, 0.9, 1e-3, 0.5, 1.0)):
        d = [compute_impedance(solimp, r) for r in np.linspace(0.0, 2e-3, 101)]
        assert d[0] == solimp[0]
        assert d[-1] == solimp[1]
        assert (np.diff(d) >= 0.0).all()
