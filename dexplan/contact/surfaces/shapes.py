"""The surfaces at hand, each with closed forms for its charts."""

from __future__ import annotations

from dexplan.contact.surfaces.ellipsoid import Ellipsoid
from dexplan.contact.surfaces.flat import Cylinder, Plane
from dexplan.contact.surfaces.sphere import Sphere

__all__ = ["Cylinder", "Ellipsoid", "Plane", "Sphere"]
