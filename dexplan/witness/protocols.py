"""Protocols of public benchmarks, asked of three fingers: which goals they draw, and what counts as met.

**Goals of attitude**, as Gymnasium-Robotics draws them for ``HandManipulateBlock``, ``Egg`` and ``Pen`` [Plappert et al. 2018,
arXiv 1802.09464; ``envs/shadow_dexterous_hand/manipulate.py``]: a turn by an angle uniform within half a turn either way, about
an axis with coordinates uniform between -1 and 1 (``xyz``), about the vertical (``z``), or about the vertical after one of the
24 attitudes that map the axes on one another (``parallel``); met within 10 mm and 0.1 rad.  The pen's turn about its own axis
does not count.  Gymnasium asks for no position in these; here the object's centre has to be where it was.

**Waypoints**, as task A of the in-hand track of the Robotic Grasping and Manipulation Competition asks for them (ICRA 2024):
positions of an upright cylinder within a cube around where it is grasped, one after another; each is planned from where the
one before was reached, without knowing the next.

Everywhere the object starts at home, its axes those of the world, in a grasp that the planner chooses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.brief import brief_repr
from dexplan.problems.problem import GoalSection, Problem, Waypoint
from dexplan.problems.read import build_problem
from dexplan.spatial import VERTICAL, Array

Draw = Callable[[np.random.Generator], GoalSection]
"""Draws what is asked of the object at home."""

NEAR_MM, NEAR_DEG = 10.0, float(np.degrees(0.1))
"""Gymnasium's ``distance_threshold`` and ``rotation_threshold``."""
NEAR_WAYPOINT_MM = 5.0
"""How near a waypoint counts as reached."""
FAR, FAR_SUMMED = 0.020, 0.012
"""Half the sides of the cubes [m] in which waypoints are: those that are to be reached, those whose errors are added."""
REACHED, SUMMED = 12, 10
"""How many of either there are in a row."""
ACROSS_MM = (60, 80, 100)
"""The cylinders, across; all are 80 mm tall and weigh 80 g."""


@dataclass(frozen=True, eq=False)
class Protocol:
    """One kind of goals about one object, and what counts as met.

    ``near_mm``: distance of the object's centre from the goal's; ``near_deg``: angle between the object and the goal, None where
    the attitude does not count.  ``own_axis_counts``: whether a turn about the object's own axis, z of its frame, does.
    """

    name: str
    summary: str
    asked_of: Mapping[str, Any]
    """The problem file without a goal."""
    draw: Draw
    near_mm: float
    near_deg: float | None
    own_axis_counts: bool = True
    is_row: bool = False
    """Whether an item has several goals in a row."""

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class Item:
    """One question of a protocol; ``number`` is the seed that its goal was drawn from, and nothing else was."""

    protocol: str
    number: int
    problem: Problem

    __repr__ = brief_repr

    @property
    def key(self) -> str:
        """Its name among those of all protocols."""
        return self.problem.name


def draw_items(protocol: Protocol, count: int, seed: int = 0) -> Iterator[Item]:
    """Yield ``count`` items, each from a seed of its own, ``seed`` and on."""
    for number in range(seed, seed + count):
        name = f"{protocol.name}_{number}"
        # A problem file names a goal: this one asks for nothing and is replaced.
        told = {"format": 1, "name": name, "goal": {"translation_m": [0.0, 0.0, 0.0]}, **protocol.asked_of}
        base = build_problem(told, protocol.name)
        goal = protocol.draw(np.random.default_rng(number))
        yield Item(protocol.name, number, replace(base, seed=number, summary=protocol.summary, goal=goal))


def draw_attitude(rng: np.random.Generator) -> GoalSection:
    """Draw Gymnasium's ``xyz``."""
    return _as_goal(_draw_turn(rng))


def draw_about_vertical(rng: np.random.Generator) -> GoalSection:
    """Draw Gymnasium's ``z``."""
    return _as_goal(Rotation.from_rotvec(rng.uniform(-np.pi, np.pi) * VERTICAL))


def draw_parallel(rng: np.random.Generator) -> GoalSection:
    """Draw Gymnasium's ``parallel``."""
    about = Rotation.from_rotvec(rng.uniform(-np.pi, np.pi) * VERTICAL)
    mapped = Rotation.create_group("O")
    return _as_goal(about * mapped[int(rng.integers(len(mapped)))])


def draw_axis(rng: np.random.Generator) -> GoalSection:
    """Draw Gymnasium's ``xyz`` where a turn about the object's own axis does not count: the nearest attitude with that axis."""
    axis: Array = _draw_turn(rng).apply(VERTICAL)
    across = np.cross(VERTICAL, axis)
    size = float(np.linalg.norm(across))
    level = across / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    return _as_goal(Rotation.from_rotvec(np.arctan2(size, axis[2]) * level))


def draw_waypoints(rng: np.random.Generator, count: int, far: float) -> GoalSection:
    """Draw positions in a row, uniform within the cube that reaches ``far`` [m] along each axis."""
    return GoalSection(waypoints=as_waypoints(rng.uniform(-far, far, (count, 3))))


def as_waypoints(positions: Array) -> tuple[Waypoint, ...]:
    """Return ``positions`` (N, 3) [m] of the object's centre, from where it starts, as the waypoints of a problem."""
    steps = np.diff(positions, axis=0, prepend=np.zeros((1, 3)))
    return tuple(Waypoint(translation_m=(float(x), float(y), float(z))) for x, y, z in steps)


def read_positions(problem: Problem) -> Array:
    """Return where the waypoints of a problem want the object's centre (N, 3) [m], from where it starts."""
    steps = [waypoint.translation_m for waypoint in problem.goal.waypoints or (problem.goal,)]
    return np.cumsum(np.array(steps), axis=0)


def _draw_turn(rng: np.random.Generator) -> Rotation:
    angle, axis = rng.uniform(-np.pi, np.pi), rng.uniform(-1.0, 1.0, 3)
    return Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))


def _as_goal(turn: Rotation) -> GoalSection:
    w, x, y, z = (float(v) for v in turn.as_quat(canonical=True, scalar_first=True))
    return GoalSection(orientation_wxyz=(w, x, y, z))


# -- the protocols ---------------------------------------------------------------------------------------------------------

_TIPS = {"tip_radii_m": [0.012, 0.012, 0.012]}
_BLOCK = {
    "object": {"shape": {"kind": "box", "half_sizes_m": [0.025, 0.025, 0.025]}, "mass_kg": 0.071},
    "hand": _TIPS,
}
_EGG = {
    "object": {"shape": {"kind": "ellipsoid", "semi_axes_m": [0.030, 0.030, 0.040]}, "mass_kg": 0.151},
}
_PEN = {
    "object": {"shape": {"kind": "capsule", "radius_m": 0.008, "half_length_m": 0.100}, "mass_kg": 0.042},
    "hand": _TIPS,
}


def _stand_cylinder(across_mm: int) -> Mapping[str, Any]:
    shape = {"kind": "cylinder", "radius_m": 0.0005 * across_mm, "half_length_m": 0.040}
    return {"object": {"shape": shape, "mass_kg": 0.080}, "hand": _TIPS}


def _list_protocols() -> Iterator[Protocol]:
    near = (NEAR_MM, NEAR_DEG)
    block, egg, pen = (
        "a cube of 50 mm and 71 g",
        "an egg of 30/30/40 mm and 151 g",
        "a pen of 16 by 216 mm and 42 g",
    )
    yield Protocol("block_z", f"{block}: any turn about the vertical", _BLOCK, draw_about_vertical, *near)
    yield Protocol("block_parallel", f"{block}: any face up, and any turn", _BLOCK, draw_parallel, *near)
    yield Protocol("block_xyz", f"{block}: any attitude", _BLOCK, draw_attitude, *near)
    yield Protocol("egg_xyz", f"{egg}: any attitude", _EGG, draw_attitude, *near)
    yield Protocol(
        "pen_xyz", f"{pen}: any direction of its axis", _PEN, draw_axis, *near, own_axis_counts=False
    )
    for across in ACROSS_MM:
        asked_of, limits = _stand_cylinder(across), (NEAR_WAYPOINT_MM, None)
        cylinder = f"an upright cylinder {across} mm across"
        reach = partial(draw_waypoints, count=REACHED, far=FAR)
        told = f"{cylinder}: {REACHED} waypoints within {1e3 * FAR:.0f} mm per axis"
        yield Protocol(f"cylinder_{across}_reach", told, asked_of, reach, *limits, is_row=True)
        add = partial(draw_waypoints, count=SUMMED, far=FAR_SUMMED)
        told = f"{cylinder}: sum of errors at {SUMMED} waypoints within {1e3 * FAR_SUMMED:.0f} mm per axis"
        yield Protocol(f"cylinder_{across}_sum", told, asked_of, add, *limits, is_row=True)


PROTOCOLS: Mapping[str, Protocol] = MappingProxyType({p.name: p for p in _list_protocols()})
"""All protocols by name."""
