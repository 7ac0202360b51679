r"""What holding fingers leave of a motion to torsional friction: which grips may carry the object, and which can only hold it.

A contact that rolls fixes the velocity of one point of the object to that of the finger::

    J_c qdot = v + w x (p - o)        J_c = J_v + r [n]x J_w

three rows for the twist (v, w) of the object.  A soft contact may give a fourth one, the spin about its normal
(``n . J_w qdot = n . w``), but only where the finger's joints can follow the spin, too: a finger that cannot *pivots*, its
torsional friction is overcome, and the row is gone.  Stacked, the rows that are left say what the fingers decide:

- six independent rows: the fingers decide the object's whole motion; the grip may carry.
- fewer: the twist in the null space is *loose*, only friction that is overcome anyway resists it.  Two contacts that pivot have
  rank five and leave the turn about their chord.

An object at rest asks nothing of the joints, so no contact pivots and two soft ones hold it: "move on three, hold on two" for
fingers of three joints is a result, and so is that two fingers of six joints may carry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dexplan.brief import brief_repr
from dexplan.spatial import Array, hat, lock_arrays

LENGTH = 0.06
"""A length of 60 mm counts as one radian, as everywhere in this room."""
FOLLOWED = 1e-2
"""Pivot per unit of the object's twist below which a finger is said to follow the spin, and sliding below which it follows the
point [-].  A rounding error is far below; 0.01 of a turn by 90 degrees is a pivot by one degree."""
INDEPENDENT = 0.05
"""Smallest singular value of the stacked rows from which the fingers decide the object's motion [-]."""


@dataclass(frozen=True, eq=False)
class HeldContacts:
    """N contacts that hold the object at one moment, in world axes.

    ``points`` (N, 3) [m], **outward** unit ``normals`` (N, 3) of the object; ``jacobians``: per contact (6, J) of the tip's
    centre; ``tip_radii`` (N,) [m]; ``is_soft``: whether contacts resist spin by torsional friction.
    """

    points: Array
    normals: Array
    jacobians: tuple[Array, ...]
    tip_radii: Array
    is_soft: bool = True

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def compute_rows(self, k: int) -> tuple[Array, Array]:
        """Return J_c (3, J) of the contact's point and the spin row (J,) of contact number ``k``."""
        J, n = self.jacobians[k], self.normals[k]
        return J[:3] + self.tip_radii[k] * hat(n) @ J[3:], n @ J[3:]


@dataclass(frozen=True, eq=False)
class Steering:
    """What holding fingers decide of a motion of the object.

    ``pivots`` (N,) [rad/s, or per unit of the twist]: how fast each tip turns about the outward normal against the object;
    ``slides`` (N,) [m/s] how fast contact points would slide, 0 but for fingers near a singular posture; ``is_kept`` (N,) which
    contacts keep the row of their spin.  ``strength`` is the smallest singular value of the rows that are kept; ``loose`` (6,)
    the unit twist (v in 60 mm, w) that they resist least.
    """

    pivots: Array
    slides: Array
    strength: float
    loose: Array
    is_kept: NDArray[np.bool_]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def may_carry(self) -> bool:
        """Whether the fingers follow the motion and nothing of the object's motion is left to friction that is overcome."""
        return self.strength >= INDEPENDENT and bool((self.slides <= FOLLOWED * LENGTH).all())


def compute_steering(contacts: HeldContacts, center: Array, twist: Array) -> Steering:
    """Return what fingers decide of the object's motion while they carry it with a twist; ask it :attr:`Steering.may_carry`.

    Args:
        contacts: those that hold.
        center: a point (3,) [m] of the object, world axes; its centre of mass, say.
        twist: (6,), velocity of that point in units of 60 mm, and angular velocity, world axes.  Its size does not matter
            to what is loose, unless it is zero: the object at rest.
    """
    v, w = LENGTH * twist[:3], twist[3:]
    rows: list[Array] = []
    count = len(contacts.points)
    pivots, slides, is_kept = np.zeros(count), np.zeros(count), np.zeros(count, dtype=bool)
    size = max(float(np.linalg.norm(twist)), 1e-12)
    for k, (point, n) in enumerate(zip(contacts.points, contacts.normals, strict=True)):
        J_c, spin = contacts.compute_rows(k)
        arm = point - center
        wanted = (v + np.cross(w, arm)) / LENGTH
        # Rolling first; what more joints leave free follows the spin.
        first = J_c / LENGTH
        inverse = np.linalg.pinv(first, rcond=1e-6)
        qdot = inverse @ wanted
        free = spin - spin @ inverse @ first
        missing = n @ w - spin @ qdot
        if (room := float(free @ free)) > 1e-9 * float(spin @ spin) + 1e-15:
            qdot = qdot + free * (missing / room)
        pivots[k] = (spin @ qdot - n @ w) / size
        slides[k] = LENGTH * float(np.linalg.norm(first @ qdot - wanted)) / size
        rows.append(np.hstack([np.eye(3), -hat(arm) / LENGTH]))
        is_kept[k] = contacts.is_soft and abs(pivots[k]) <= FOLLOWED
        if is_kept[k]:
            rows.append(np.concatenate([np.zeros(3), n])[None])
    _, sizes, directions = np.linalg.svd(np.vstack(rows))
    strength = float(sizes[5]) if len(sizes) == 6 else 0.0
    return Steering(pivots, slides, strength, directions[-1], is_kept)
