"""What a scene is made of, as values without MuJoCo: fingers, hand, object, and the parameters they are built from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.smooth import BallBody
from dexplan.contact.surfaces.sphere import Sphere
from dexplan.errors import DexplanError
from dexplan.grasp.wrench import MassProperties
from dexplan.scene.finger_models import SIX_HINGES
from dexplan.scene.shape import Shape, Triple
from dexplan.spatial import Array, read_only

OBJECT, STANDING = -1, -2
"""Whose a body is that belongs to no finger: the object's own, or one that stands still (floor, obstacles)."""


USUAL_BALL = Shape.ball(0.035)
"""What the object is unless something else is asked for."""


@dataclass(frozen=True)
class Obstacle:
    """A static body in the world: ``kind`` box (half sizes), sphere (radius) or capsule (radius, half length) [m]."""

    kind: str
    position: tuple[float, float, float]
    size: tuple[float, ...]


@dataclass(frozen=True)
class Nearness:
    """The two bodies that are nearest to one another, of those that should not touch.

    ``distance`` [m], negative where they overlap, never more than what the probe sees; ``names`` of both in words and one
    by one as ``bodies``; ``owners``: a finger's number, :data:`OBJECT` or :data:`STANDING` for each, and nobody where nothing is
    near.
    """

    distance: float
    names: str
    owners: tuple[int, ...] = ()
    bodies: tuple[str, ...] = ()


@dataclass(frozen=True)
class SceneParameters:
    """Everything a scene's model text depends on.  SI units, angles in radians unless the name says otherwise."""

    scene: str = "three_finger_sphere"
    object_shape: Shape = USUAL_BALL
    object_mass: float = 0.060
    object_com: Triple | None = None
    """Centre of mass from the object's origin [m]; None: that of a homogeneous body."""
    object_inertia: tuple[Triple, Triple, Triple] | None = None
    """Inertia about the centre of mass in the object's axes [kg m^2]; None: that of a homogeneous body about its own centre."""
    tip_radii: tuple[float, ...] = (0.018, 0.018, 0.018)
    base_azimuths_deg: tuple[float, ...] = (0.0, 120.0, 240.0)
    joint_ranges_deg: tuple[tuple[str, float, float], ...] = ()
    sliding_friction: float = 0.55
    torsional_friction: float = 0.0025
    physics_profile: str = "firm"
    obstacles: tuple[Obstacle, ...] = ()
    finger: str = SIX_HINGES

    __repr__ = brief_repr


@dataclass(frozen=True, eq=False)
class ContactCone:
    """Part of the object's surface that contacts may use: directions from the object's origin within ``half_angle`` [rad] of the
    unit ``axis_O`` (3,).
    """

    axis_O: Array
    half_angle: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "axis_O", read_only(self.axis_O / np.linalg.norm(self.axis_O)))

    def contains(self, direction_O: Array) -> NDArray[np.bool_]:
        """Return whether contacts at unit ``direction_O`` (..., 3) from the origin, in object axes, lie in the cone (...)."""
        return np.asarray(direction_O @ self.axis_O >= np.cos(self.half_angle))


@dataclass(frozen=True, eq=False)
class ObjectDescription:
    """The manipulated object: its ``body``, a convex shape in the object's axes, mass and centre of mass, and home pose.

    The object's frame O is the body's.  ``allowed_regions``: contacts may only be made where one of them says so; none means
    anywhere.
    """

    body: ConvexBody
    mass_properties: MassProperties
    X_WO_home: Array = field(repr=False)
    allowed_regions: tuple[ContactCone, ...] = ()

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "X_WO_home", read_only(self.X_WO_home))

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.mass_properties.mass

    def weighing(self, mass: float) -> ObjectDescription:
        """Return the same body of another density, its ``mass`` [kg] and inertia in proportion."""
        own = self.mass_properties
        return replace(self, mass_properties=MassProperties(mass, own.com, mass / own.mass * own.inertia))

    @property
    def is_isotropic(self) -> bool:
        """Whether the object looks the same from all sides: then contacts are told apart by their normals alone."""
        return isinstance(self.body, BallBody)

    @cached_property
    def surface(self) -> Sphere:
        """The surface of a ball, for what is derived for balls alone; raises DexplanError for any other body."""
        if not isinstance(self.body, BallBody):
            raise DexplanError(
                f"asked of an object of kind {type(self.body).__name__} what holds on a ball alone; a BallBody is accepted"
            )
        return Sphere(self.body.radius)

    def allows(self, direction_O: Array) -> NDArray[np.bool_]:
        """Return whether contacts at unit ``direction_O`` (..., 3) from the origin, in object axes, may be made (...).

        On a ball these are the outward normals.
        """
        allowed = np.full(np.shape(direction_O)[:-1], not self.allowed_regions)
        for cone in self.allowed_regions:
            allowed |= cone.contains(direction_O)
        return allowed
