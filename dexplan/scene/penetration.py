"""How deep a fingertip stands in the object when it presses: MuJoCo's contact at rest, in closed form.

A contact row of MuJoCo holds ``a + R f = a_ref``, where ``a`` is the acceleration of the two surfaces along the normal.
At rest ``a = 0`` and the reference acceleration is that of a spring, ``a_ref = k d(r) r`` at depth ``r``, with the impedance
``d`` of ``solimp`` and ``k = 1 / (d_max t zeta)^2`` for ``solref = (t, zeta)``.  The regularisation is ``R = (1 - d) / d A``
with ``A`` the sum of the two bodies' inverse masses (``body_invweight0``).  So

    f(r) = k r d(r)^2 / ((1 - d(r)) A).

The spring is one of accelerations: at the same force a light object is entered in proportion to its inverse mass, nearly.
[MuJoCo, Computation: Parameters of the constraint solver]
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from dexplan.scene.scene import Scene

DEPTH_MAX = 0.1
"""Depths are looked for up to here [m]; contacts of this depth are no contacts."""


def compute_resting_force(scene: Scene, finger: int, depth: float) -> float:
    """Return the normal force [N] with which ``finger`` presses at rest when its tip stands ``depth`` [m] in the object."""
    model, tip = scene.model, int(scene.tip_geoms[finger])
    stiffness, inverse_mass, solimp = _read_contact(model, tip, scene.object_geom)
    d = compute_impedance(solimp, depth)
    return stiffness * depth * d**2 / ((1.0 - d) * inverse_mass)


def predict_penetration(scene: Scene, finger: int, force: float) -> float:
    """Return how deep [m] the tip of ``finger`` stands in the object at rest under the normal ``force`` [N]."""
    low, high = 0.0, DEPTH_MAX
    # The force grows with the depth, so halving finds the depth to the last digit.
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if compute_resting_force(scene, finger, middle) < force else (low, middle)
    return high


def compute_force_at(scene: Scene, depth: float) -> float:
    """Return the greatest normal force [N] under which no finger's tip stands deeper than ``depth`` [m] in the object."""
    return min(compute_resting_force(scene, i, depth) for i in range(scene.n_fingers))


def compute_impedance(solimp: tuple[float, float, float, float, float], depth: float) -> float:
    """Return the impedance d (0..1) of a contact ``depth`` [m] deep, for MuJoCo's ``solimp``."""
    start, end, width, midpoint, power = solimp
    x = min(depth / width, 1.0) if width > mujoco.mjMINVAL else 1.0
    if power == 1.0 or x in (0.0, 1.0):
        share = x
    elif x <= midpoint:
        share = x**power / midpoint ** (power - 1.0)
    else:
        share = 1.0 - (1.0 - x) ** power / (1.0 - midpoint) ** (power - 1.0)
    return start + share * (end - start)


class _Spring(NamedTuple):
    """What MuJoCo's contact is as a spring: stiffness k [1/s^2], inverse mass A [1/kg] and ``solimp``."""

    stiffness: float
    inverse_mass: float
    solimp: tuple[float, float, float, float, float]


def _read_contact(model: mujoco.MjModel, first: int, second: int) -> _Spring:
    """Return the spring of the contact of two geoms of equal ``solmix``."""
    geoms = [first, second]
    time, damping = model.geom_solref[geoms].mean(axis=0)
    solimp = model.geom_solimp[geoms].mean(axis=0)
    low, high = mujoco.mjMINIMP, mujoco.mjMAXIMP
    start, end = np.clip(solimp[:2], low, high)
    # MuJoCo refuses stiffer contacts than the time step can carry ("refsafe").
    time = max(float(time), 2.0 * model.opt.timestep)
    stiffness = 1.0 / (end * time * damping) ** 2
    inverse_mass = float(model.body_invweight0[model.geom_bodyid[geoms], 0].sum())
    return _Spring(stiffness, inverse_mass, (start, end, *map(float, solimp[2:])))
