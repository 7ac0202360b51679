"""How the place of contact moves: contact coordinates, Montana's equations, closest points, integration.

==================  =====================================================================================
``coordinates``     ``ContactCoordinates``: where two surfaces touch; ``compute_relative_pose`` and back
``montana``         ``compute_rates``: how contacts move under a relative twist; ``compute_twist`` backwards
``closest_points``  ``find_closest_points``: from a pose of two surfaces to coordinates and gap
``integration``     ``integrate_motion``, ``integrate_legs``: sixth order, changing charts on the way
==================  =====================================================================================

The theory stands in ``docs/theory.md``.  A tip of 18 mm rolls on a ball of 35 mm at 1 rad/s about the contact's y axis; the
contact moves on the ball at 1 / (1/18 + 1/35) mm/s:

>>> import numpy as np
>>> from dexplan.contact.kinematics.coordinates import build_coordinates
>>> from dexplan.contact.kinematics.montana import build_rolling_twist, compute_rates
>>> from dexplan.contact.surfaces.shapes import Sphere
>>> tip, ball = Sphere(0.018), Sphere(0.035)
>>> turned_round = np.diag([-1.0, 1.0, -1.0])
>>> at = build_coordinates(tip, ball, turned_round, np.array([0.018, 0.0, 0.0]), np.array([-0.035, 0.0, 0.0]))
>>> rates = compute_rates(tip, ball, at, build_rolling_twist(0.0, 1.0))
>>> float(np.round(1e3 * 0.035 * np.linalg.norm(rates[2:4]), 2))
11.89
"""

__all__ = ["closest_points", "coordinates", "integration", "montana"]
