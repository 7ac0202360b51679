"""Ways of a fingertip that rolls without sliding: great circles, triangles on the tip, and the shortest of them.

==============  =====================================================================================
``roll_to``     ``roll_to``: from a contact to another one within the tip's limits, or why not
``curves``      ``roll_along``, ``roll_turning`` on balls in closed form, ``roll_over`` on any surface
``on_body``     ``roll_on_body``: on any smooth convex body, along the curve that a ray sweeps
``manoeuvre``   ``RollingTriangle``, the paper's longitude-equator manoeuvre, repeated and re-rotated
``candidates``  ``RollLimits``: what a tip may do while it rolls
``path``        ``RollingPath``: the answer, sampled so that a controller can follow it
==============  =====================================================================================

A tip of 18 mm touches a ball of 35 mm with its pole, and rolls 20 degrees along it, which is 12.2 mm:

>>> import numpy as np
>>> from dexplan.contact.rolling.candidates import RollLimits
>>> from dexplan.contact.rolling.roll_to import roll_to
>>> from dexplan.contact.surfaces.shapes import Sphere
>>> X_OF = np.eye(4)
>>> X_OF[:3, :3] = np.diag([1.0, -1.0, -1.0])  # the tip's pole looks down at the ball
>>> X_OF[2, 3] = 0.035 + 0.018
>>> goal = [np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))]
>>> found = roll_to(X_OF, goal, Sphere(0.018), Sphere(0.035), RollLimits(np.radians(80.0), np.radians(75.0)))
>>> found.status, round(1e3 * found.total_length, 1)
('found', 12.2)
"""

from dexplan.moved import forward

__all__ = ["candidates", "curves", "manoeuvre", "on_body", "path", "roll_to", "turning"]

__getattr__ = forward(__name__, ["dexplan.contact.rolling.curves"])
