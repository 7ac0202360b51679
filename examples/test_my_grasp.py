# test_my_grasp.py
"""A regression test of a grasp of your own: two fingers of any MuJoCo model that hold a cube."""

import mujoco
import numpy as np

from dexplan.testing import Measurement, judge_contacts, measure_contacts
from dexplan.testing.plugin import ContactBaseline

MODEL = """
<mujoco>
  <option cone="elliptic" timestep="0.001" noslip_iterations="20"/>
  <default><geom friction="0.8 0.01 0.0001" condim="4" solref="0.004 1"/></default>
  <worldbody>
    <body name="cube" pos="0 0 0.1"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.05"/></body>
    <body name="left" pos="-0.03 0 0.1">
      <joint name="left" type="slide" axis="1 0 0" damping="5"/><geom type="sphere" size="0.01" mass="0.02"/>
    </body>
    <body name="right" pos="0.03 0 0.1">
      <joint name="right" type="slide" axis="-1 0 0" damping="5"/><geom type="sphere" size="0.01" mass="0.02"/>
    </body>
  </worldbody>
  <actuator><motor joint="left"/><motor joint="right"/></actuator>
</mujoco>
"""


def measure(squeeze_N: float) -> Measurement:
    """Return what happens at the contacts in half a second."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    ctrl = np.full((500, model.nu), squeeze_N)
    return measure_contacts(model, None, ctrl, tips=["left", "right"], object="cube", steps_per_sample=1)


def test_pinch(contact_baseline: ContactBaseline) -> None:
    """The contacts are as they were when the baseline was written."""
    contact_baseline.check("pinch", measure(3.0))


def test_less_squeeze_slips() -> None:
    """A fifteenth of the squeeze does not hold the cube."""
    assert "stuck" not in {str(v.kind) for v in judge_contacts(measure(0.2)).verdicts}
