"""Convex bodies as fingertips meet them: nearest points and outward normals, mass, and sites to land on.

==============  ============================================================================
``body``        ``ConvexBody``: what a shape has to answer; ``Projection``, ``Solid``: answers
``smooth``      ``BallBody``, ``EllipsoidBody``, ``CapsuleBody``: no edges
``edged``       ``BoxBody``, ``CylinderBody`` with a sharp or a rounded rim
``polyhedron``  ``PolyhedronBody``: the hull of points, for prisms and meshes
``sites``       ``build_sites``: even samples of the surface, away from edges
``names``       ``name_body``, ``name_flats``, ``name_place``: what a body and its faces are called
==============  ============================================================================

A tip of 12 mm beside a cube of 60 mm, its centre 42 mm from the cube's, touches the middle of a face:

>>> import numpy as np
>>> from dexplan.contact.bodies.edged import BoxBody
>>> found = BoxBody(0.03, 0.03, 0.03).project([0.042, 0.0, 0.0])
>>> found.point.tolist(), found.normal.tolist(), round(float(found.distance), 6)
([0.03, 0.0, 0.0], [1.0, 0.0, 0.0], 0.012)
"""

__all__ = ["body", "edged", "names", "polyhedron", "sites", "smooth"]
