"""Statics without planner or simulator: can two soft fingers hold this ball, how safely, and with which forces?"""

import numpy as np

from dexplan.contact.friction import SoftFinger
from dexplan.grasp.closure import check_force_closure, compute_load_margin
from dexplan.grasp.force.problem import ForceLimits, ForceProblem, ForceSettings
from dexplan.grasp.force.solver import ForceSolver
from dexplan.grasp.grasp import Grasp, compute_grasp_map, contact_on_sphere

RADIUS, WEIGHT = 0.035, 0.060 * 9.81  # m, N
# mu [-], and mu_t [m]: the torque about the normal that each newton of pressure lets a soft fingertip bear
friction = SoftFinger(0.55, 0.0025)


def hold(apart_deg: float) -> Grasp:
    """Return a grasp of two fingers on the ball's equator, so far apart."""
    azimuths = np.radians([0.0, apart_deg])
    directions = np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros(2)], axis=1)
    return Grasp(tuple(contact_on_sphere(i, n_O, RADIUS, friction) for i, n_O in enumerate(directions)))


# What the fingers give the ball, about its centre: minus its weight.
lift = np.array([0.0, 0.0, WEIGHT, 0.0, 0.0, 0.0])
for apart in (120.0, 130.0, 140.0, 180.0):
    closed = check_force_closure(hold(apart))
    loaded = compute_load_margin(hold(apart), lift, 5.5)
    print(f"{apart:.0f} degrees: force closed {closed.is_closed}, load margin {loaded.margin:+.3f}")

grasp = hold(140.0)
limits = ForceLimits(np.full(2, 4.0), np.full(2, 12.0))  # least and greatest normal forces [N]
settings = ForceSettings(grasp.models)
found = ForceSolver(settings).solve(
    ForceProblem(settings, compute_grasp_map(grasp), lift, limits, np.full(2, 5.5))
)
print(found.status)
for forces in found.forces:
    print("t1 {:+.2f} N, t2 {:+.2f} N, n {:+.2f} N, torque {:+.4f} N m".format(*forces + 0.0))
    print(f"uses {friction.utilisation(forces):.2f} of its friction cone")
