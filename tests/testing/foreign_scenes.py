"""Scenes that are not ours, with a truth that is known beforehand: no names of ours, no hand, often no floor."""

from __future__ import annotations

import mujoco
import numpy as np

ELLIPTIC = 'cone="elliptic" impratio="100"'
BOX = '<freejoint/><geom type="box" size=".02 .02 .01" mass=".1"/>'
POINT = (
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>'
    '<geom type="sphere" size=".01" mass=".1"/>'
)
BALL = '<freejoint/><geom type="sphere" size=".01" mass=".1"/>'
GRAVITY = 9.81


def slope(
    share: float,
    *,
    friction: str = "0.5 0.005 0.0001",
    option: str = ELLIPTIC,
    body: str = BOX,
    geom: str = 'solref="0.004 1"',
    dt: float = 0.001,
) -> mujoco.MjModel:
    """Return ``body`` on a plane tilted to ``share`` of its friction angle, told by tilting gravity: t = atan(share mu)."""
    tilt = np.arctan(share * float(friction.split()[0]))
    pull = f"{GRAVITY * np.sin(tilt)} 0 {-GRAVITY * np.cos(tilt)}"
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="{dt}" gravity="{pull}" {option}/>
      <default><geom friction="{friction}" {geom}/></default>
      <worldbody>
        <geom name="table" type="plane" size="0 0 1"/>
        <body name="thing" pos="0 0 .01">{body}</body>
      </worldbody>
    </mujoco>""")


def pinch(
    *,
    squeeze: float = 2.0,
    load: float = 0.0,
    twist: float = 0.0,
    friction: str = "0.5 0.01 0.0001",
    option: str = ELLIPTIC,
    condim: int = 4,
    solref: str = "0.004 1",
    mass: float = 0.05,
) -> mujoco.MjModel:
    """Return a ball between two balls on slides, each pressing with ``squeeze`` [N], no gravity.

    ``load`` [N] pulls the ball across the line of the pinch (along z), ``twist`` [N m] turns it about that line (x): both by
    motors on the ball's own joints, so the controls are (left, right, load, twist).  At rest the two contacts carry half
    each: the borders are load = 2 mu N and twist = 2 mu_t N.
    """
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option timestep="0.001" gravity="0 0 0" {option}/>
      <default><geom friction="{friction}" condim="{condim}" solref="{solref}"/></default>
      <worldbody>
        <body name="left" pos="-.04 0 0"><joint name="left" type="slide" axis="1 0 0"/>
          <geom type="sphere" size=".01" mass=".1"/></body>
        <body name="right" pos=".04 0 0"><joint name="right" type="slide" axis="-1 0 0"/>
          <geom type="sphere" size=".01" mass=".1"/></body>
        <body name="thing"><freejoint/><site name="middle"/>
          <geom name="skin" type="sphere" size=".03" mass="{mass}"/></body>
      </worldbody>
      <actuator>
        <motor joint="left"/><motor joint="right"/>
        <motor site="middle" gear="0 0 1 0 0 0"/><motor site="middle" gear="0 0 0 1 0 0"/>
      </actuator>
      <keyframe><key name="pressed" ctrl="{squeeze} {squeeze} {load} {twist}"/></keyframe>
    </mujoco>""")


def pinch_controls(
    samples: int, *, squeeze: float = 2.0, load: float = 0.0, twist: float = 0.0, after: int = 100
) -> np.ndarray:
    """Return controls (samples, 4) for :func:`pinch`: squeezed alone for ``after`` samples, then loaded as well."""
    rows = np.tile([squeeze, squeeze, load, twist], (samples, 1))
    rows[:after, 2:] = 0.0
    return rows


def nothing(samples: int) -> np.ndarray:
    """Return the controls (samples, 0) of a model without actuators."""
    return np.zeros((samples, 0))
