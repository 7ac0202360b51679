"""Shapes as charts: points, normals and curvature of a surface, to second order.

=============  ============================================================================
``surface``    ``AbstractSurface``: what a shape has to answer; ``ChartGeometry``: the answer
``shapes``     ``Sphere``, ``Plane``, ``Cylinder``, ``Ellipsoid``, and what tells them by name
=============  ============================================================================

The outward normal of a ball of 35 mm, at latitude and longitude zero of its first chart, and its curvature [1/m]:

>>> from dexplan.contact.surfaces.shapes import Sphere
>>> there = Sphere(0.035).geometry(0.0, 0.0, 0)
>>> there.normal.round(3).tolist(), there.curvature.round(2).tolist()
([1.0, 0.0, 0.0], [[28.57, 0.0], [0.0, 28.57]])
"""

__all__ = ["ellipsoid", "flat", "shapes", "sphere", "surface"]
