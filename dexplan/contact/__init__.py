"""How two surfaces touch, slide and roll on each other: friction and geometry of contacts, numpy alone.

=============  ====================================================================================
``friction``   ``HardFinger``, ``SoftFinger``: which forces a contact transmits, as cones and pyramids
``surfaces``   ``Sphere``, ``Plane``, ``Cylinder``, ``Ellipsoid``: surfaces seen through charts
``bodies``     convex bodies that answer ``project``: nearest points, mass, sites to land on
``kinematics`` Montana's contact equations, and closest points of two surfaces
``rolling``    ``roll_to``, great circles, rolling triangles: ways of a tip that rolls
=============  ====================================================================================

A contact frame C has z **into** the object; forces act **on** the object.  How much of its cone does a contact use, of which
1 N shears, 2 N press, and friction is 0.5 with 2.5 mm of torsion?

>>> from dexplan.contact.friction import SoftFinger
>>> float(SoftFinger(0.5, 0.0025).utilisation([1.0, 0.0, 2.0, 0.0]))
1.0
"""

__all__ = ["bodies", "friction", "kinematics", "rolling", "surfaces"]
