"""What a problem file holds, table by table: one frozen value per table, with every default written out.

The classes here only hold values, and write them; ``dexplan.problems.parse`` reads and checks them.  Degrees, metres and
kilograms as in the file: each field carries its unit in its name.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomli_w

from dexplan.brief import brief_repr
from dexplan.planning.admissible.limits import CLEARANCE_MM, JOINT_MARGIN_DEG, AdmissibleLimits
from dexplan.plans.forces import NormalForces
from dexplan.problems.object_section import ObjectSection
from dexplan.spatial import Array, direction_from_angles, read_only

FORMAT = 1
"""The problem-file format this package reads and writes."""


class FrozenMap(Mapping[str, Any]):
    """A mapping that cannot be written, compares by value with any mapping, hashes and pickles."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, Any] | None = None) -> None:
        self._items = dict(items or {})

    def __getitem__(self, key: str) -> Any:
        return self._items[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(frozenset(self._items.items()))

    def __repr__(self) -> str:
        return f"FrozenMap({self._items!r})"


@dataclass(frozen=True)
class ContactPoint:
    """A contact given as a point on the object's surface, in the object frame [m]."""

    point_m: tuple[float, float, float]


ContactSpec = tuple[float, float] | ContactPoint | Literal["free"]
"""Where one finger touches: (azimuth, elevation) [deg] in the object frame, a :class:`ContactPoint`, or
"free".
"""


@dataclass(frozen=True)
class HandSection:
    """The hand: one entry of ``tip_radii_m`` and ``base_azimuths_deg`` per finger, in finger order."""

    tip_radii_m: tuple[float, ...] = (0.018, 0.018, 0.018)
    tip_polar_limit_deg: float = 80.0
    """Largest angle between a tip's pole and the contact on that tip."""
    tip_rotation_limit_deg: float = 75.0
    """The paper's gamma: how far a tip may roll along its "equator"."""
    base_azimuths_deg: tuple[float, ...] = (0.0, 120.0, 240.0)
    """Where each finger stands around the object's home, about world z from x."""
    joint_ranges_deg: Mapping[str, tuple[float, float]] = field(default_factory=FrozenMap)
    """"finger_1.joint_1" -> (lowest, highest) [deg]: narrows a range of the model, never widens it."""

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_ranges_deg", FrozenMap(self.joint_ranges_deg))

    @property
    def finger_count(self) -> int:
        """How many fingers the hand has."""
        return len(self.tip_radii_m)


@dataclass(frozen=True)
class FrictionSection:
    """Friction between tip and object; ``torsional_m`` [m] is MuJoCo's length scale of torque about the
    normal.
    """

    sliding: float = 0.55
    torsional_m: float = 0.0025
    """A file that leaves it out gets this, or as much as the smallest tip can have at this ``sliding`` if that is less."""
    safety: float = 1.3
    """Planner and force QP believe ``sliding / safety`` and ``torsional_m / safety``."""

    @property
    def believed_sliding(self) -> float:
        """The sliding coefficient that planner and controller count on."""
        return self.sliding / self.safety

    @property
    def believed_torsional_m(self) -> float:
        """The torsional coefficient [m] that planner and controller count on."""
        return self.torsional_m / self.safety


@dataclass(frozen=True)
class StartSection:
    """The start: the object at the scene's home pose, the fingers at these contacts ("auto": the planner
    chooses).
    """

    contacts_deg: tuple[ContactSpec, ...] | Literal["auto"] = "auto"

    __repr__ = brief_repr

    @property
    def is_auto(self) -> bool:
        """Whether the planner chooses the first grasp."""
        return self.contacts_deg == "auto"


@dataclass(frozen=True)
class Rotation:
    """A turn about the object's centre: ``axis`` in world axes (any length but zero), beyond 360 deg means
    more turns.
    """

    axis: tuple[float, float, float]
    angle_deg: float


@dataclass(frozen=True)
class Waypoint:
    """One of several goals in a row, asked of the object where the one before left it: as the keys of ``[goal]``, at most one of
    ``rotation`` and ``orientation_wxyz`` (a goal attitude in the world).
    """

    rotation: Rotation | None = None
    orientation_wxyz: tuple[float, float, float, float] | None = None
    translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class GoalSection:
    """The goal; at most one of ``rotation`` and ``orientation_wxyz`` (a goal attitude, shortest way) is
    given.  A file may say ``orientation_wxyz = "random"``: reading draws the numbers from the problem's seed.
    """

    kind: Literal["object_manipulation", "grasp_adjustment", "dextrous_manipulation"] = "object_manipulation"
    """A file that leaves it out gets what the other keys ask for: a motion, contacts, or both."""
    rotation: Rotation | None = None
    orientation_wxyz: tuple[float, float, float, float] | None = None
    translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    contacts_deg: tuple[ContactSpec, ...] | None = None
    order: Literal["object_first", "grasp_first", "simultaneous"] = "object_first"
    """Which comes first in a dextrous manipulation: the paper's (a), (b), (c)."""
    keep_object: bool = False
    """Grasp adjustment only: whether the object has to be back where it was at the end."""
    waypoints: tuple[Waypoint, ...] | None = None
    """Several goals in a row, in the place of ``rotation``, ``orientation_wxyz`` and ``translation_m``; None: one goal."""

    __repr__ = brief_repr


@dataclass(frozen=True)
class WeightsSection:
    """What a plan costs: per placement, per radian of the object's path, for its worst load and for its smallest clearance."""

    placement: float = 1.0
    turn: float = 0.25
    load: float = 1.0
    clearance: float = 0.5


@dataclass(frozen=True)
class GaitSection:
    """What the planner may use (no ``primitives``: the contacts stay fixed), and how many search nodes it may open."""

    primitives: tuple[Literal["substitution", "rewind"], ...] = ("substitution", "rewind")
    node_budget: int = 2_000
    improvement: float = 1.0
    """How much longer than for the first plan the search goes on for one that costs less; within the budget."""
    weights: WeightsSection = WeightsSection()
    """What a plan costs."""

    __repr__ = brief_repr


@dataclass(frozen=True)
class Obstacle:
    """A static body in the world frame; ``size_m`` is a box's half sizes, (radius,) or (radius, half length
    along z).
    """

    kind: Literal["box", "sphere", "capsule"]
    pos_m: tuple[float, float, float]
    size_m: tuple[float, ...]

    __repr__ = brief_repr


@dataclass(frozen=True)
class ControlSection:
    """How the plan is carried out."""

    physics_profile: Literal["firm", "portable"] = "firm"
    speed_deg_s: float = 30.0
    """Object rotation speed while it moves."""
    force_solver: Literal["daqp", "osqp"] = "daqp"
    """Who solves for the contact forces of each tick: DAQP with OSQP behind it, or OSQP alone."""
    rate_hz: Literal["auto", 125, 250, 500, 1000] = "auto"
    """How often the controller is asked and a sample recorded; "auto": 250, more often where torsional friction is thin."""


@dataclass(frozen=True)
class ForcesSection:
    """How hard a contact presses that bears its full load; ``normal_floor_N <= normal_N <= normal_ceiling_N``."""

    normal_N: float = NormalForces.target
    """What a contact aims at; less where the object is so light that tips would stand too deep in it."""
    normal_floor_N: float = NormalForces.floor
    """Least normal force; a file that leaves it out gets less than this where ``normal_N`` is less than usual."""
    normal_ceiling_N: float = NormalForces.ceiling
    """Greatest normal force; a file that leaves it out gets ``normal_N`` where that is more."""


@dataclass(frozen=True)
class MarginsSection:
    """What plans leave to spare.  The judge's limits stay where they are: see ``[acceptance]`` for those."""

    joint_deg: float = JOINT_MARGIN_DEG
    """Distance of holding fingers' joints to their limits; free fingers keep 4 degrees, or this if it is less."""
    clearance_mm: float = CLEARANCE_MM
    """Distance between bodies that are not to touch."""
    cone_share: float = AdmissibleLimits.cone_share
    """Share of the believed friction cone that planned forces may use."""
    torque_share: float = AdmissibleLimits.torque_share
    """Share of the torque limits that planned forces may use; the controller may use 0.07 more."""


@dataclass(frozen=True)
class ProblemFields:
    """One manipulation problem: scene, overrides of it, start, goal, means, and the limits it is judged by.

    ``acceptance`` maps names of ``dexplan/sim/judge/limits.toml`` to numbers or booleans; reading a file fills in
    every default.
    """

    name: str
    goal: GoalSection
    scene: str = "three_finger_sphere"
    seed: int = 0
    summary: str = ""
    object: ObjectSection = field(default_factory=ObjectSection)
    hand: HandSection = field(default_factory=HandSection)
    friction: FrictionSection = field(default_factory=FrictionSection)
    start: StartSection = field(default_factory=StartSection)
    gait: GaitSection = field(default_factory=GaitSection)
    obstacles: tuple[Obstacle, ...] = ()
    control: ControlSection = field(default_factory=ControlSection)
    forces: ForcesSection = field(default_factory=ForcesSection)
    margins: MarginsSection = field(default_factory=MarginsSection)
    acceptance: Mapping[str, bool | float] = field(default_factory=FrozenMap)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "acceptance", FrozenMap(self.acceptance))

    def __str__(self) -> str:
        return self.as_toml().rstrip("\n")

    def as_dict(self) -> dict[str, Any]:
        """Return the problem as the plain dict that its TOML file holds, ``format`` and every default
        included.
        """
        return {"format": FORMAT, **_as_plain(self)}

    def as_toml(self) -> str:
        """Return the text of the problem's TOML file."""
        return tomli_w.dumps(self.as_dict())

    def save(self, path: str | Path) -> Path:
        """Write the problem as TOML, whole or not at all; floats keep every bit.  Returns the path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            temporary.write_bytes(self.as_toml().encode())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        return path


def compute_contact_directions(contacts: tuple[ContactSpec, ...]) -> tuple[Array | None, ...]:
    """Return for each finger the outward unit vector n_O (3,) from the object's centre to its contact, None
    where free.
    """
    directions: list[Array | None] = []
    for contact in contacts:
        if contact == "free":
            directions.append(None)
        elif isinstance(contact, ContactPoint):
            point = np.asarray(contact.point_m)
            directions.append(read_only(point / np.linalg.norm(point)))
        else:
            directions.append(read_only(direction_from_angles(contact[0], contact[1])))
    return tuple(directions)


def _as_plain(value: Any) -> Any:
    """Return ``value`` in TOML's types; fields that are None are left out."""
    if is_dataclass(value):
        pairs = ((f.name, getattr(value, f.name)) for f in fields(value))
        return {name: _as_plain(item) for name, item in pairs if item is not None}
    if isinstance(value, Mapping):
        return {key: _as_plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_as_plain(item) for item in value]
    return value
