"""What ``[object]`` of a problem file holds: which body it is, its mass, and where it may be touched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dexplan.brief import brief_repr

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class AllowedRegion:
    """A cone of directions from the object's centre, in the object frame, around ``axis`` (any length but zero)."""

    axis: tuple[float, float, float]
    half_angle_deg: float


@dataclass(frozen=True)
class ShapeSection:
    """A convex body about the object's origin, in the object frame; which lengths it has follows from its ``kind``.

    A mesh stands for the convex hull of ``vertices_m``.  A file may name an OBJ or STL file by ``path`` instead, scaled and moved
    by ``scale`` and ``origin_m``: reading replaces these by the hull's vertices, ``taken_from`` and ``mesh_volume_m3``.
    """

    kind: Literal["ellipsoid", "capsule", "cylinder", "box", "mesh"]
    semi_axes_m: Triple | None = None
    half_sizes_m: Triple | None = None
    radius_m: float | None = None
    half_length_m: float | None = None
    rim_m: float | None = None
    """A cylinder's edges are rounded by this; 0 is sharp."""
    path: str | None = None
    scale: float | None = None
    origin_m: Triple | None = None
    vertices_m: tuple[Triple, ...] | None = None
    taken_from: str | None = None
    """Name of the file that the vertices were read from."""
    mesh_volume_m3: float | None = None
    """Volume inside the mesh that the vertices are the hull of."""

    __repr__ = brief_repr


@dataclass(frozen=True)
class ObjectSection:
    """The object: a ball of ``radius_m``, or a body of another ``shape``; homogeneous unless ``com_m`` or ``inertia_kg_m2`` say
    otherwise.
    """

    radius_m: float | None = 0.035
    """None where a shape is given."""
    shape: ShapeSection | None = None
    mass_kg: float = 0.060
    com_m: Triple | None = None
    """Centre of mass in the object frame; left out: a homogeneous body's."""
    inertia_kg_m2: tuple[Triple, Triple, Triple] | None = None
    """About the centre of mass, object axes; left out: a homogeneous body's.  A file may give the three principal moments."""
    allowed_regions: tuple[AllowedRegion, ...] = ()
    """Contacts may only be made inside one of these cones; none means anywhere."""

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        if self.shape is not None:
            object.__setattr__(self, "radius_m", None)
