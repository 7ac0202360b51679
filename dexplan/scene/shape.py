"""The shape of the object as a plain value: its kind and a few lengths, from which model text and body are made."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import BallBody, CapsuleBody, EllipsoidBody
from dexplan.errors import UnknownNameError
from dexplan.spatial import Array

Triple = tuple[float, float, float]

KINDS = {
    "sphere": ("radius",),
    "ellipsoid": ("semi_axis_x", "semi_axis_y", "semi_axis_z"),
    "capsule": ("radius", "half_length"),
    "cylinder": ("radius", "half_length", "rim"),
    "box": ("half_size_x", "half_size_y", "half_size_z"),
    "polyhedron": (),
}
"""Kind of a shape -> what its ``sizes`` are [m]; capsule and cylinder lie along z, a rim of 0 is sharp."""
AROUND, ALONG_RIM = 96, 9
"""Corners of the polyhedron that stands for a cylinder with a rounded rim: around it, and along the quarter circle of a rim."""


@dataclass(frozen=True)
class Shape:
    """A convex body about its origin: its ``kind``, ``sizes`` [m] as :data:`KINDS` names them, and the ``vertices`` [m] whose
    hull a polyhedron is.

    Raises UnknownNameError for another kind, ValueError for another number of sizes or lengths that no such body has.
    """

    kind: str
    sizes: tuple[float, ...] = ()
    vertices: tuple[Triple, ...] = ()

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UnknownNameError("shape", self.kind, KINDS)
        names = KINDS[self.kind]
        if len(self.sizes) != len(names):
            raise ValueError(f"{self.kind} with the sizes {self.sizes}; {', '.join(names)} are accepted")
        if bool(self.vertices) != (self.kind == "polyhedron"):
            raise ValueError(
                f"{self.kind} with {len(self.vertices)} vertices; a polyhedron alone has vertices"
            )
        self.as_body()

    @classmethod
    def ball(cls, radius: float) -> Shape:
        """Return the ball of ``radius`` [m]."""
        return cls("sphere", (radius,))

    @property
    def curvature(self) -> float:
        """The greatest mean curvature of what is round [1/m], which bounds contact patches; 0 for a ball, whose friction is
        bounded by the tip alone, and for bodies of faces.
        """
        match self.kind:
            case "ellipsoid":
                # At the end of the longest axis c both are greatest: c / a^2 and c / b^2.
                a, b, c = sorted(self.sizes)
                return 0.5 * (c / a**2 + c / b**2)
            case "capsule":
                return 1.0 / self.sizes[0]
            case "cylinder":
                radius, _, rim = self.sizes
                return 0.5 * (1.0 / radius + (1.0 / rim if rim > 0.0 else 0.0))
        return 0.0

    def as_body(self) -> ConvexBody:
        """Return the body."""
        match self.kind:
            case "sphere":
                return BallBody(*self.sizes)
            case "ellipsoid":
                return EllipsoidBody(*self.sizes)
            case "capsule":
                return CapsuleBody(*self.sizes)
            case "cylinder":
                return CylinderBody(*self.sizes)
            case "box":
                return BoxBody(*self.sizes)
        return PolyhedronBody(np.array(self.vertices))


def tessellate_cylinder(body: CylinderBody) -> Array:
    """Return the vertices (V, 3) [m] of a polyhedron that stands for a cylinder with a rounded rim.

    On the mantle its corners lie as far outside the cylinder as the middles of its sides lie inside,
    ``radius (pi / AROUND)^2 / 4``: 8 um on a radius of 30 mm.  Along the rim its sides lie inside by 0.5 % of the rim:
    20 um of 4 mm.
    """
    around = 2.0 * pi * np.arange(AROUND) / AROUND
    along = np.linspace(0.0, 0.5 * pi, ALONG_RIM)
    # Halfway between the polygon inside the circle and the one around it.
    wider = 2.0 / (1.0 + np.cos(pi / AROUND))
    rho = wider * (body.radius - body.rim * (1.0 - np.cos(along)))
    z = body.half_length - body.rim * (1.0 - np.sin(along))
    ring = np.stack([np.cos(around), np.sin(around)], axis=-1)
    upper = np.concatenate(
        [np.column_stack([r * ring, np.full(AROUND, h)]) for r, h in zip(rho, z, strict=True)]
    )
    return np.concatenate([upper, upper * [1.0, 1.0, -1.0]])
