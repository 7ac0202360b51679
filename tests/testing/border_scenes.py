"""Five scenes whose border between holding and slipping is a closed form, at numbers that nobody chose.

The truths, stated before anything is judged; ``share`` is the load as a share of the border:

* slope: a body that cannot turn rests on a slope below the friction angle, tan(slope) = share mu; a solid ball that can turn
  rolls without sliding up to tan(slope) = 3.5 mu;
* torsion: two soft contacts that press with N carry a moment of 2 mu_t N about their line;
* shear: they carry a load of 2 mu N across it;
* spin: a soft contact that slides and spins at once does so as v / w = (mu_t / mu) u_t / sqrt(1 - u_t^2), where u_t is the part
  of mu N that resists sliding: turning takes more of the power than sliding exactly where u_t^2 < 1/2;
* a pyramid holds less between its edges: mu / (|cos h| + |sin h|) of a load along heading h of its frame, which on the
  slope is that of the world; shear, torsion and push are along an edge;
* push: a crate on a table withstands a push of mu m g, and slides under a larger one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from foreign_scenes import GRAVITY

from dexplan.testing import Measurement, measure_contacts

SAMPLES = 400
TIPS = ("left", "right")


@dataclass(frozen=True, eq=False)
class Scene:
    """A model, how it is driven, and who is who in it."""

    model: mujoco.MjModel
    ctrl: np.ndarray
    object: str
    tips: tuple[str, ...] = ()

    def measure(self, model: mujoco.MjModel | None = None) -> Measurement:
        """Return what its contacts do; ``model`` may be a changed one."""
        return measure_contacts(
            model or self.model, None, self.ctrl, tips=self.tips or None, object=self.object
        )


@dataclass(frozen=True)
class Draw:
    """Numbers of a scene: frictions [-, m], squeeze [N], mass [kg], radius [m], options as MJCF has them, heading [rad]."""

    mu: float
    mu_t: float
    squeeze: float
    mass: float
    radius: float
    timestep: float
    solref: float
    impratio: float
    noslip: int
    heading: float
    cone: str = "elliptic"

    @property
    def option(self) -> str:
        return (
            f'timestep="{self.timestep}" cone="{self.cone}" impratio="{self.impratio}" noslip_iterations="{self.noslip}" '
            'tolerance="1e-12" iterations="200" integrator="implicitfast"'
        )

    @property
    def default(self) -> str:
        return f'<default><geom friction="{self.mu} {self.mu_t} 0.0001" condim="4" solref="{self.solref} 1"/></default>'


def draw(seed: int) -> Draw:
    """Return numbers that a seed decides; every second one has noslip."""
    rng = np.random.default_rng(seed)
    timestep = float(rng.choice([0.0005, 0.001, 0.002]))
    return Draw(
        mu=float(rng.uniform(0.15, 1.2)),
        mu_t=float(rng.uniform(0.002, 0.02)),
        squeeze=float(rng.uniform(0.5, 8.0)),
        mass=float(rng.uniform(0.02, 0.3)),
        radius=float(rng.uniform(0.015, 0.05)),
        timestep=timestep,
        solref=float(rng.uniform(2.0 * timestep, 0.01)),
        impratio=float(rng.choice([10.0, 30.0, 100.0])),
        noslip=int(rng.choice([0, 30])) if seed % 2 else 0,
        heading=float(rng.uniform(0.0, 2.0 * np.pi)),
    )


def draw_pyramidal(seed: int) -> Draw:
    """Return the same numbers with pyramidal cones, whose impratio stays 1."""
    return replace(draw(seed), cone="pyramidal", impratio=1.0)


def _ramp(rows: np.ndarray, columns: list[int]) -> np.ndarray:
    """Return controls (T, nu) whose ``columns`` begin after a quarter of the time and are whole at half of it."""
    share = np.clip(4.0 * np.arange(len(rows)) / len(rows) - 1.0, 0.0, 1.0)
    rows = rows.copy()
    rows[:, columns] *= share[:, None]
    return rows


def slope(numbers: Draw, share: float, *, is_ball: bool) -> Scene:
    """Return a body on a plane; the pull is tilted as the slope would be, in any direction."""
    along = np.array([np.cos(numbers.heading), np.sin(numbers.heading)])
    edges = np.abs(along).sum() if numbers.cone == "pyramidal" else 1.0
    tilt = np.arctan(share * numbers.mu * (3.5 if is_ball else 1.0) / edges)
    pull = GRAVITY * np.sin(tilt) * along
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option gravity="{pull[0]} {pull[1]} {-GRAVITY * np.cos(tilt)}" {numbers.option}/>{numbers.default}
      <worldbody>
        <geom name="slope" type="plane" size="0 0 1" condim="3"/>
        <body name="thing" pos="0 0 {numbers.radius}">{"<freejoint/>" if is_ball else slides}
          <geom type="sphere" size="{numbers.radius}" mass="{numbers.mass}" condim="3"/></body>
      </worldbody>
    </mujoco>""")
    return Scene(model, np.zeros((SAMPLES, 0)), "thing")


def pinch_model(numbers: Draw) -> mujoco.MjModel:
    """Return a ball between two flat tips on slides along the heading, without gravity; controls: left, right, load, twist.

    The tips are flat, so that a ball that creeps along them is pressed as before.
    """
    along = np.array([np.cos(numbers.heading), np.sin(numbers.heading), 0.0])
    text = " ".join(map(str, along))
    reach = numbers.radius + 0.01
    tips = "".join(
        f"""<body name="{name}" pos="{" ".join(map(str, sign * reach * along))}">
          <joint name="{name}" type="slide" axis="{" ".join(map(str, -sign * along))}"/>
          <geom type="box" size=".01 .03 .03" euler="0 0 {np.degrees(numbers.heading)}" mass=".1"/></body>"""
        for name, sign in (("left", -1.0), ("right", 1.0))
    )
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option gravity="0 0 0" {numbers.option}/>{numbers.default}
      <worldbody>{tips}
        <body name="thing"><freejoint/><site name="middle"/>
          <geom name="skin" type="sphere" size="{numbers.radius}" mass="{numbers.mass}"/></body>
      </worldbody>
      <actuator><motor joint="left"/><motor joint="right"/>
        <motor site="middle" gear="0 0 1 0 0 0"/><motor site="middle" gear="0 0 0 {text}"/></actuator>
    </mujoco>""")


def pinch_controls(numbers: Draw, share: float, kind: str) -> np.ndarray:
    """Return controls under which shear or torsion is ``share`` of what the pinch carries."""
    load, twist = 2.0 * numbers.mu * numbers.squeeze * share, 2.0 * numbers.mu_t * numbers.squeeze * share
    row = [
        numbers.squeeze,
        numbers.squeeze,
        load if kind == "shear" else 0.0,
        twist if kind == "torsion" else 0.0,
    ]
    return _ramp(np.tile(row, (SAMPLES, 1)), [2, 3])


def pinch(numbers: Draw, share: float, kind: str) -> Scene:
    """Return the pinch under a share of its border in ``kind``: shear or torsion."""
    return Scene(pinch_model(numbers), pinch_controls(numbers, share, kind), "thing", TIPS)


def spin(numbers: Draw, u_t: float, speed: float = 0.3) -> Scene:
    """Return a foot pressed on a table that servos slide along x and turn about the normal at ``speed`` [rad/s].

    What slides and turns is heavy, so that its servos are no stiffer than the integrator can follow and it hardly creeps; the
    foot itself is light, so that it stays on the table.
    """
    numbers = replace(numbers, impratio=100.0)
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option gravity="0 0 0" {numbers.option}/>{numbers.default}
      <worldbody>
        <geom name="table" type="plane" size="0 0 1"/>
        <body name="carriage"><joint name="x" type="slide" axis="1 0 0"/>
          <joint name="turn" type="hinge" axis="0 0 1" armature="1"/><inertial pos="0 0 .1" mass="10" diaginertia=".1 .1 .1"/>
          <body name="foot" pos="0 0 .01"><joint name="z" type="slide" axis="0 0 1"/>
            <geom type="sphere" size=".01" mass=".1"/></body></body>
      </worldbody>
      <actuator><velocity joint="x" kv="100000"/><motor joint="z"/><velocity joint="turn" kv="5000"/></actuator>
    </mujoco>""")
    slide = speed * numbers.mu_t / numbers.mu * u_t / np.sqrt(1.0 - u_t**2)
    rows = np.tile([slide, -numbers.squeeze, speed], (SAMPLES, 1))
    rows[: SAMPLES // 4, [0, 2]] = 0.0
    return Scene(model, rows, "foot")


def push(numbers: Draw, share: float) -> Scene:
    """Return a flat crate on a table that a pusher without friction presses with ``share`` of mu m g."""
    low = 0.3 * numbers.radius
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option {numbers.option}/>{numbers.default}
      <worldbody>
        <geom name="table" type="plane" size="0 0 1"/>
        <body name="crate" pos="0 0 {low}"><freejoint/>
          <geom type="box" size="{numbers.radius} {numbers.radius} {low}" mass="{numbers.mass}"
            contype="3" conaffinity="1"/></body>
        <body name="pusher" pos="{-numbers.radius - 0.01} 0 {low}" gravcomp="1">
          <joint name="x" type="slide" axis="1 0 0" damping="1"/>
          <geom type="sphere" size=".01" mass=".1" contype="0" conaffinity="2" condim="1" priority="1"/></body>
      </worldbody>
      <actuator><motor joint="x"/></actuator>
    </mujoco>""")
    rows = np.full((SAMPLES, 1), share * numbers.mu * numbers.mass * GRAVITY)
    return Scene(model, _ramp(rows, [0]), "crate", ("pusher",))


def gripper(numbers: Draw, share: float, *, body: str, rider: float | None = None) -> Scene:
    """Return two pads that carry a cube, or a mesh of its shape, whose weight is ``share`` of 2 mu N.

    ``rider``: a second body lies on the first, and everything is tilted to this share of its friction angle; the squeeze then
    carries four times what is needed.
    """
    weight = numbers.mass * GRAVITY
    squeeze = weight / (2.0 * numbers.mu * share) if rider is None else 4.0 * weight / numbers.mu
    tilt = 0.0 if rider is None else np.arctan(rider * numbers.mu)
    half = 0.02
    corners = " ".join(f"{x} {y} {z}" for x in (-half, half) for y in (-half, half) for z in (-half, half))
    pads = "".join(
        f"""<body name="{name}" pos="{sign * (half + 0.01)} 0 .3" gravcomp="1">
          <joint name="{name}" type="slide" axis="{-sign} 0 0" damping="5"/>
          <geom type="box" size=".01 .03 .03" mass=".2"/></body>"""
        for name, sign in (("left", -1.0), ("right", 1.0))
    )
    above = f"""<body name="rider" pos="0 0 {0.303 + half}"><freejoint/>
      <geom type="box" size=".01 .01 .003" mass="{0.2 * numbers.mass}"/></body>"""
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <option {numbers.option} gravity="0 {-GRAVITY * np.sin(tilt)} {-GRAVITY * np.cos(tilt)}"/>{numbers.default}
      <asset><mesh name="gem" vertex="{corners}"/></asset>
      <worldbody>{pads}
        <body name="thing" pos="0 0 .3"><freejoint/>
          <geom type="{body}" {'mesh="gem"' if body == "mesh" else f'size="{half} {half} {half}"'} mass="{numbers.mass}"/></body>
        {"" if rider is None else above}
      </worldbody>
      <actuator><motor joint="left"/><motor joint="right"/></actuator>
    </mujoco>""")
    return Scene(model, np.full((SAMPLES, 2), squeeze), "thing" if rider is None else "rider", TIPS)
