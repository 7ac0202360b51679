"""What a problem file may say: bounds of every number, what each other key accepts, and the scenes there are.

Tables only; ``dexplan.problems.check`` applies them and puts their words into its messages.
"""

from __future__ import annotations

import difflib
import importlib.resources
import math
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from xml.etree import ElementTree


@dataclass(frozen=True)
class SceneFacts:
    """What a problem must know about a scene before the scene is built."""

    finger_count: int
    summary: str


SCENES = {
    "three_finger_sphere": SceneFacts(
        3, "three fingers with soft spherical tips, 120 degrees apart, around a ball"
    ),
}
"""The built-in scenes."""


@dataclass(frozen=True)
class Bounds:
    """The numbers a key accepts, both ends included."""

    lowest: float
    highest: float
    unit: str = ""

    def accepts(self, value: float) -> bool:
        """Whether ``value`` lies between the ends."""
        return self.lowest <= value <= self.highest

    def __str__(self) -> str:
        return f"a number from {self.lowest:.9g} to {self.highest:.9g}{' ' + self.unit if self.unit else ''}"


BOUNDS = {
    "seed": Bounds(0, 2**63 - 1),
    "object.radius_m": Bounds(1e-3, 1.0, "m"),
    "object.shape.semi_axes_m": Bounds(1e-3, 1.0, "m"),
    "object.shape.half_sizes_m": Bounds(1e-3, 1.0, "m"),
    "object.shape.radius_m": Bounds(1e-3, 1.0, "m"),
    "object.shape.half_length_m": Bounds(1e-3, 1.0, "m"),
    "object.shape.rim_m": Bounds(0.0, 1.0, "m"),
    "object.shape.vertices_m": Bounds(-1.0, 1.0, "m"),
    "object.shape.scale": Bounds(1e-6, 1e6),
    "object.shape.origin_m": Bounds(-10.0, 10.0, "m"),
    "object.shape.mesh_volume_m3": Bounds(0.0, 10.0, "m^3"),
    "object.mass_kg": Bounds(1e-4, 100.0, "kg"),
    "object.com_m": Bounds(-1.0, 1.0, "m"),
    "object.inertia_kg_m2": Bounds(-1e3, 1e3, "kg m^2"),
    "object.allowed_regions.axis": Bounds(-1e6, 1e6),
    "object.allowed_regions.half_angle_deg": Bounds(0.1, 180.0, "degrees"),
    "hand.tip_radii_m": Bounds(1e-3, 1.0, "m"),
    "hand.tip_polar_limit_deg": Bounds(1.0, 180.0, "degrees"),
    "hand.tip_rotation_limit_deg": Bounds(1.0, 180.0, "degrees"),
    "hand.base_azimuths_deg": Bounds(-360.0, 360.0, "degrees"),
    "friction.sliding": Bounds(0.01, 10.0),
    "friction.torsional_m": Bounds(1e-6, 1.0, "m"),
    "friction.safety": Bounds(1.0, 10.0),
    "goal.rotation.axis": Bounds(-1e6, 1e6),
    "goal.rotation.angle_deg": Bounds(-3.6e6, 3.6e6, "degrees"),
    "goal.orientation_wxyz": Bounds(-1e6, 1e6),
    "goal.translation_m": Bounds(-10.0, 10.0, "m"),
    "goal.waypoints.rotation.axis": Bounds(-1e6, 1e6),
    "goal.waypoints.rotation.angle_deg": Bounds(-3.6e6, 3.6e6, "degrees"),
    "goal.waypoints.orientation_wxyz": Bounds(-1e6, 1e6),
    "goal.waypoints.translation_m": Bounds(-10.0, 10.0, "m"),
    "gait.node_budget": Bounds(1, 10**9),
    "gait.improvement": Bounds(0.0, 1e6),
    "gait.weights.placement": Bounds(0.0, 1e6),
    "gait.weights.turn": Bounds(0.0, 1e6),
    "gait.weights.load": Bounds(0.0, 1e6),
    "gait.weights.clearance": Bounds(0.0, 1e6),
    "obstacles.pos_m": Bounds(-100.0, 100.0, "m"),
    "obstacles.size_m": Bounds(1e-4, 100.0, "m"),
    "control.speed_deg_s": Bounds(0.1, 720.0, "degrees per second"),
    "forces.normal_N": Bounds(0.1, 100.0, "N"),
    "forces.normal_floor_N": Bounds(0.01, 100.0, "N"),
    "forces.normal_ceiling_N": Bounds(0.1, 100.0, "N"),
    "margins.joint_deg": Bounds(0.0, 45.0, "degrees"),
    # Approaches begin 8 mm from the object: a free finger could not keep more than that off it.
    "margins.clearance_mm": Bounds(0.0, 7.0, "mm"),
    # The controller's forces keep to 0.99 of the believed cone, and to 0.07 of the torque limits more than the plan's.
    "margins.cone_share": Bounds(0.05, 0.99),
    "margins.torque_share": Bounds(0.05, 0.93),
}
"""Key with its indices dropped -> its numbers."""

AZIMUTH = Bounds(-360.0, 360.0, "degrees")
ELEVATION = Bounds(-90.0, 90.0, "degrees")

NAME_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
JOINT_PATTERN = re.compile(r"finger_([1-9]\d{0,5})\.(\w{1,40})")

OBSTACLE_SIZES = {
    "box": (3, "three half sizes"),
    "sphere": (1, "[radius]"),
    "capsule": (2, "[radius, half length]"),
}

_CONTACT = '[azimuth, elevation] in degrees, { point_m = [x, y, z] } or "free"'
_THREE = "three numbers [x, y, z]"
_TABLE = "a table"

ACCEPTED = {
    "name": "a name of letters, digits, '_', '-' and '.', at most 100, that starts with a letter or digit",
    "summary": "one line of at most 200 characters",
    "scene": "a scene's name",
    "seed": "a whole number, 0 or more, of 64 bits",
    "object.shape": 'a table with a kind and its lengths, such as { kind = "box", half_sizes_m = [0.03, 0.03, 0.03] }',
    "object.shape.kind": '"ellipsoid", "capsule", "cylinder", "box" or "mesh"',
    "object.shape.semi_axes_m": f"{_THREE} [m], positive",
    "object.shape.half_sizes_m": f"{_THREE} [m], positive",
    "object.shape.path": "the path of an OBJ or binary STL file, relative to the problem file",
    "object.shape.scale": "metres per unit of the mesh file, such as 0.001 for millimetres",
    "object.shape.origin_m": f"{_THREE} in metres",
    "object.shape.vertices_m": "a list of points [x, y, z] in metres",
    "object.shape.vertices_m[]": f"{_THREE} in metres",
    "object.shape.taken_from": "a file's name",
    "object.com_m": f"{_THREE} in metres",
    "object.inertia_kg_m2": "three principal moments, or a symmetric 3 x 3 matrix, in kg m^2",
    "object.inertia_kg_m2[]": _THREE,
    "object.allowed_regions": "a list of cones { axis = [x, y, z], half_angle_deg = number }",
    "object.allowed_regions[]": "{ axis = [x, y, z], half_angle_deg = number }",
    "object.allowed_regions[].axis": _THREE + ", not all zero",
    "start.contacts_deg": f'"auto", or a list with one entry per finger: {_CONTACT}',
    "start.contacts_deg[]": _CONTACT,
    "goal.contacts_deg": f"a list with one entry per finger: {_CONTACT}",
    "goal.contacts_deg[]": _CONTACT,
    "goal.kind": '"object_manipulation", "grasp_adjustment" or "dextrous_manipulation"',
    "goal.order": '"object_first", "grasp_first" or "simultaneous"',
    "goal.keep_object": "true or false",
    "goal.rotation": "{ axis = [x, y, z], angle_deg = number }",
    "goal.rotation.axis": _THREE + ", not all zero",
    "goal.orientation_wxyz": 'a quaternion [w, x, y, z] that is not zero, or "random" (drawn from the seed)',
    "goal.translation_m": _THREE,
    "goal.waypoints": "a list of one or more { rotation, orientation_wxyz, translation_m }, each as in [goal]",
    "goal.waypoints[]": "{ rotation, orientation_wxyz, translation_m }",
    "goal.waypoints[].rotation": "{ axis = [x, y, z], angle_deg = number }",
    "goal.waypoints[].rotation.axis": _THREE + ", not all zero",
    "goal.waypoints[].orientation_wxyz": "a quaternion [w, x, y, z] that is not zero",
    "goal.waypoints[].translation_m": _THREE,
    "gait.primitives": 'a list out of "substitution" and "rewind"; empty for fixed contacts',
    "gait.primitives[]": '"substitution" or "rewind"',
    "gait.node_budget": "a whole number from 1 to 1000000000",
    "gait.weights": "{ placement, turn, load, clearance = numbers, 0 or more }",
    "hand.tip_radii_m": "a list with one number of metres per finger",
    "hand.base_azimuths_deg": "a list with one number of degrees per finger",
    "hand.joint_ranges_deg": '"finger_<i>.joint_<k>" = [lowest, highest] in degrees',
    "obstacles": "a list of tables [[obstacles]] with kind, pos_m and size_m",
    "obstacles[]": "a table with kind, pos_m and size_m",
    "obstacles[].kind": '"box", "sphere" or "capsule"',
    "obstacles[].pos_m": _THREE,
    "obstacles[].size_m": "half sizes of a box, [radius] of a sphere or [radius, half length] of a capsule",
    "control.physics_profile": '"firm" or "portable"',
    "control.force_solver": '"daqp" or "osqp"',
    "control.rate_hz": '"auto", 125, 250, 500 or 1000',
    "acceptance": "a table of limits, each a number or true/false",
    **dict.fromkeys(
        ("object", "hand", "friction", "start", "goal", "gait", "control", "forces", "margins"), _TABLE
    ),
}
"""Key with its indices emptied -> what it accepts, in words; numbers fall back on ``BOUNDS``."""


def describe_accepted(key: str) -> str:
    """Return what ``key`` (such as ``start.contacts_deg[0]``) accepts, as "accepted: ..."."""
    emptied = re.sub(r"\[\d+\]", "[]", key)
    bare = emptied.replace("[]", "")
    if emptied in ACCEPTED:
        return f"accepted: {ACCEPTED[emptied]}"
    if bare in BOUNDS:
        return f"accepted: {BOUNDS[bare]}"
    # One step into something that is described as a whole, such as an elevation that is a string.
    return f"accepted: {ACCEPTED.get(emptied.removesuffix('[]'), ACCEPTED.get(bare, 'a number'))}"


def suggest(word: str, known: Iterable[str]) -> str:
    """Return "did you mean 'x'?" or, where nothing is near, the list of what is known."""
    known = list(known)
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean {near[0]!r}?" if near else f"accepted: {', '.join(known)}"


def spell(value: object) -> str:
    """Return ``value`` as it should stand in a one-line message: without line breaks and not longer than 60
    characters.
    """
    try:
        text = repr(value) if not isinstance(value, bool) else str(value).lower()
    except ValueError:
        return "a number of thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


@cache
def load_limits() -> dict[str, bool | float]:
    """Return every name that ``[acceptance]`` may set, with its default, from the packaged
    ``sim/judge/limits.toml``.
    """
    resource = importlib.resources.files("dexplan.sim.judge").joinpath("limits.toml")
    raw = tomllib.loads(resource.read_text(encoding="utf-8"))
    return {name: value if isinstance(value, bool) else float(value) for name, value in raw.items()}


@cache
def load_joint_ranges() -> dict[str, tuple[float, float]]:
    """Return each joint of a finger of the built-in hand with its lowest and highest angle [deg], from the packaged model.

    To a hundredth of a degree, towards the inside: a range that is copied out of a message is accepted.
    """
    text = importlib.resources.files("dexplan.models").joinpath("finger.xml").read_text(encoding="utf-8")
    ranges = {}
    for joint in ElementTree.fromstring(text).iter("joint"):
        if "name" in joint.attrib:
            lowest, highest = (math.degrees(float(limit)) for limit in joint.attrib["range"].split())
            ranges[joint.attrib["name"]] = (math.ceil(1e2 * lowest) / 1e2, math.floor(1e2 * highest) / 1e2)
    return ranges
