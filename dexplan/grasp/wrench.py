"""The wrench that contacts have to exert on an object, held or moved: Newton and Euler, once, for any body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dexplan.brief import brief_repr
from dexplan.spatial import GRAVITY, Array, cross_all, lock_arrays, read_only

DOWN = read_only(np.array([0.0, 0.0, -GRAVITY]))
"""Gravity's acceleration (3,) [m/s^2] in world axes."""


@dataclass(frozen=True, eq=False)
class MassProperties:
    """``mass`` [kg], centre of mass ``com`` (3,) [m] and ``inertia`` (3, 3) [kg m^2] about that centre, in the object's axes.

    Raises ValueError for a mass that is not positive, an inertia that is not symmetric, and principal moments that no body has:
    negative ones, or one greater than the sum of the others.
    """

    mass: float
    com: Array
    inertia: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name, shape in (("com", (3,)), ("inertia", (3, 3))):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"{name} is {value.tolist()}; finite numbers {shape} are accepted")
            object.__setattr__(self, name, value)
        lock_arrays(self)
        if not (np.isfinite(self.mass) and self.mass > 0.0):
            raise ValueError(f"mass is {self.mass} kg; a positive finite one is accepted")
        if np.abs(self.inertia - self.inertia.T).max() > 1e-9 * np.abs(self.inertia).max():
            raise ValueError(f"inertia {self.inertia.tolist()} is not symmetric; a symmetric one is accepted")
        moments = np.linalg.eigvalsh(self.inertia)
        if moments[0] < 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
            raise ValueError(
                f"no body has the principal moments {moments.tolist()} kg m^2; none may be negative or exceed the sum of the "
                "other two"
            )


def compute_wrench(
    body: MassProperties,
    R_WO: ArrayLike,
    *,
    angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    acceleration: ArrayLike = (0.0, 0.0, 0.0),
    angular_acceleration: ArrayLike = (0.0, 0.0, 0.0),
    gravity: ArrayLike = DOWN,
) -> Array:
    """Return the wrench (..., 6) [N, N m] that the contacts exert together, about the object's **origin**, in world axes.

    With c the centre of mass from the origin and I the inertia about it, both in world axes:

        f   = m (a + alpha x c + w x (w x c) - g)
        tau = c x f + I alpha + w x (I w)

    All arguments but ``body`` may be stacked (...).

    Args:
        body: mass, centre of mass, inertia.
        R_WO: attitude (..., 3, 3) of the object.
        angular_velocity: w (..., 3) [rad/s], world axes.
        acceleration: a (..., 3) [m/s^2] of the object's origin, world axes.
        angular_acceleration: alpha (..., 3) [rad/s^2], world axes.
        gravity: g (..., 3) [m/s^2], world axes; where down is if the whole scene is turned or accelerated.
    """
    R = np.asarray(R_WO, dtype=np.float64)
    w, a, alpha, g = (
        np.asarray(v, dtype=np.float64)
        for v in (angular_velocity, acceleration, angular_acceleration, gravity)
    )
    c = R @ body.com
    inertia = R @ body.inertia @ R.swapaxes(-1, -2)
    f = body.mass * (a + cross_all(alpha, c) + cross_all(w, cross_all(w, c)) - g)
    spin = (inertia @ w[..., None])[..., 0]
    tau = (inertia @ alpha[..., None])[..., 0] + cross_all(c, f) + cross_all(w, spin)
    return np.concatenate(np.broadcast_arrays(f, tau), axis=-1)
