"""Rolling without planner or simulator: how a spherical fingertip gets from one contact on a ball to another one."""

import numpy as np

from dexplan.contact.rolling.candidates import RollLimits
from dexplan.contact.rolling.manoeuvre import build_longitude_equator
from dexplan.contact.rolling.roll_to import roll_to
from dexplan.contact.surfaces.shapes import Sphere

tip, ball = Sphere(0.018), Sphere(0.035)  # radii [m]
limits = RollLimits(tip_polar_limit=np.radians(80.0), tip_rotation_limit=np.radians(75.0))

X_OF = np.eye(4)  # the fingertip in the ball's frame: above it, its pole looking down
X_OF[:3, :3] = np.diag([1.0, -1.0, -1.0])
X_OF[2, 3] = ball.radius + tip.radius


def at(angle_deg: float) -> np.ndarray:
    """Return the direction from the ball's centre that is so far from the top."""
    return np.array([np.sin(np.radians(angle_deg)), 0.0, np.cos(np.radians(angle_deg))])


for angle in (20.0, 60.0):
    found = roll_to(X_OF, at(angle), tip, ball, limits)
    path = found.paths[-1]
    rolled, off = 1e3 * found.total_length, np.degrees(path.polar_angle.max())
    print(f"{angle:.0f} degrees: {found.kind}, {rolled:.1f} mm, up to {off:.1f} degrees off the tip's pole")

triangle = build_longitude_equator(0.012, 0.040, np.radians(60.0))  # the paper's manoeuvre A-B-C-D
rolled, ahead = 1e3 * triangle.total_length, 1e3 * triangle.displacement_length
print(f"A-B-C-D rolls {rolled:.1f} mm and gets {ahead:.2f} mm ahead on the ball")
