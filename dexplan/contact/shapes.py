"""The surfaces at hand, each with closed forms for its charts."""

from __future__ import annotations

from dexplan.contact.ellipsoid import Ellipsoid
from dexplan.contact.flat import Cylinder, Plane
from dexplan.contact.sphere import Sphere

__all__ = ["Cylinder", "Ellipsoid", "Plane", "Sphere"]
