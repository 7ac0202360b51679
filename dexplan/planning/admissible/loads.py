"""Which pairs of soft contacts carry the load?  Thousands at once, in closed form up to two numbers.

Two soft contacts have eight force components against six equations of balance, so the forces are f = f_0 + N z with two free
numbers z: the squeeze along the chord and an exchange of torsion.  For every squeeze on a grid the torsion that uses the cones
least is found by weighted least squares.  The answer is a set of forces that balance the load, so it proves that a pair
holds; that a pair does not hold is known up to the grid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dexplan.brief import brief_repr
from dexplan.contact.friction import SoftFinger
from dexplan.grasp.wrench import compute_wrench
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, lock_arrays

SQUEEZES = 8
"""Squeezes tried between the least and the greatest normal force."""
BALANCING = 3
"""Rounds in which the two contacts' shares of the cone are balanced against one another."""


@dataclass(frozen=True, eq=False)
class PairLoads:
    """Forces of N pairs, first contact then second.

    ``utilisation`` (N,) is the least share of the believed cone found, inf where no squeeze keeps the normal forces in bounds.
    ``forces`` (N, 2, 3) [N] in W and ``torsions`` (N, 2) [N m] about the inward normals act **on the object**; they use the
    smallest squeeze that is surely carried, else the one with the least utilisation.
    """

    utilisation: Array
    forces: Array
    torsions: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)


def compute_object_wrench(hand: HandModel, axis_W: Array | None, R_WO: Array | None = None) -> Array:
    """Return the wrench (6,) [N, N m] that holds the object and accelerates it about the unit ``axis_W``, about its origin.

    ``R_WO`` (3, 3): its attitude; None for an object that is the same in any, as a homogeneous ball is.
    """
    alpha = np.zeros(3) if axis_W is None else hand.acceleration * axis_W
    R = np.eye(3) if R_WO is None else R_WO
    return compute_wrench(hand.object.mass_properties, R, angular_acceleration=alpha)


def sure_share(hand: HandModel) -> float:
    """Return the utilisation up to which the force QP surely finds forces: its pyramid keeps at least that much of the cone."""
    return hand.limits.cone_share * hand.friction.facet_inradius


def compute_pair_loads(
    hand: HandModel, first: Array, second: Array, wrench: Array, arms: tuple[Array, Array] | None = None
) -> PairLoads:
    """Return the loads of pairs whose contacts have the outward normals ``first`` and ``second`` (N, 3) in W.

    ``wrench`` (6,) is what the contacts have to exert about the object's origin; ``arms``: where the contacts are from there,
    (N, 3) each [m] in W, None on a ball.
    """
    friction, limits = hand.friction, hand.limits
    if arms is None:
        surface = hand.object.surface
        arms = surface.radial(first), surface.radial(second)
    p1, p2 = arms
    d = p2 - p1
    length = np.linalg.norm(d, axis=1)
    squared = np.maximum(length**2, 1e-12)
    force, torque = wrench[:3], wrench[3:]
    # Moments about the chord: only torsion can bear them.  t (N, 2) about the inward normals, least norm and null direction.
    along = -np.stack([(first * d).sum(1), (second * d).sum(1)], axis=1)
    asked = ((torque - np.cross(p2, force)) * d).sum(1)
    size = np.maximum((along**2).sum(1), 1e-18)
    t0 = along * (asked / size)[:, None]
    t1 = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.sqrt(size)[:, None]
    # Moments across it: (p1 - p2) x F1 = v gives F1 = d x v / |d|^2 + squeeze along d.
    v0 = torque - np.cross(p2, force) + t0[:, :1] * first + t0[:, 1:] * second
    v1 = t1[:, :1] * first + t1[:, 1:] * second
    base, change = np.cross(d, v0) / squared[:, None], np.cross(d, v1) / squared[:, None]
    unit = d / np.sqrt(squared)[:, None]
    # Normal forces a + c * squeeze of both contacts, and the squeezes that keep them in bounds.
    a = np.stack([-(first * base).sum(1), -(second * (force - base)).sum(1)], axis=1)
    c = np.maximum(np.stack([-(first * unit).sum(1), (second * unit).sum(1)], axis=1), 1e-6)
    low, high = ((limits.normal_floor - a) / c).max(1), ((limits.normal_ceiling - a) / c).min(1)
    share = np.linspace(0.02, 0.98, SQUEEZES)
    squeeze = low[:, None] + share * (high - low)[:, None]
    # Tangential force and torsion over their capacities, (N, S, 2, 4), are affine in the torsion exchange s.
    F1 = base[:, None] + squeeze[..., None] * unit[:, None]
    normals = np.stack([first, second], axis=1)
    F = np.stack([F1, force - F1], axis=2)
    dF = np.stack([change, -change], axis=1)
    x = _scale(friction, F, np.broadcast_to(t0[:, None], F.shape[:3]), normals[:, None])
    dx = _scale(friction, dF, t1, normals)[:, None]
    pressed = -(F * normals[:, None]).sum(-1)
    dpressed = -(dF * normals).sum(-1)[:, None]
    # Scaled by its normal force, each contact's part counts in proportion to its share of the cone.
    bent, straight = (x * dx).sum(-1), (dx * dx).sum(-1)
    weight = 1.0 / np.maximum(pressed, 1e-3) ** 2
    s = np.zeros(squeeze.shape)
    used = np.full(F.shape[:3], np.inf)
    for _ in range(BALANCING):
        s = -(weight * bent).sum(-1) / np.maximum((weight * straight).sum(-1), 1e-18)
        now = np.maximum(pressed + s[..., None] * dpressed, 1e-6)
        used = np.linalg.norm(x + s[..., None, None] * dx, axis=-1) / now
        weight = weight * np.maximum(used, 1e-3)
    bounded = (now >= limits.normal_floor - 1e-9) & (now <= limits.normal_ceiling + 1e-9)
    u = np.where(bounded.all(-1) & (high > low)[:, None], used.max(-1), np.inf)
    utilisation = u.min(1)
    sure = u <= sure_share(hand)
    pick = np.where(sure.any(1), sure.argmax(1), u.argmin(1))
    rows = np.arange(len(u))
    s_best = s[rows, pick]
    forces = F[rows, pick] + s_best[:, None, None] * dF
    return PairLoads(utilisation, forces, t0 + s_best[:, None] * t1)


def _scale(friction: SoftFinger, F: Array, torsion: Array, normals: Array) -> Array:
    """Return tangential force and torsion over what one newton of normal force can carry of them (..., 4)."""
    tangential = F - (F * normals).sum(-1, keepdims=True) * normals
    return np.concatenate(
        [tangential / friction.sliding, torsion[..., None] / friction.torsional],
        axis=-1,
    )


def compute_contact_torques(J: Array, offset: Array, force: Array, torsion: Array, normal: Array) -> Array:
    """Return the joint torques (N, J) [N m] with which a finger exerts forces (N, 3) and torsions (N,) on the object.

    ``J`` (N, 6, J) of the tip's centre, ``offset`` (N, 3) [m] from there to the contact, ``normal`` (N, 3) outward; all in W.
    """
    moment = np.cross(offset, force) - torsion[:, None] * normal
    return np.einsum("nij,ni->nj", J[:, :3], force) + np.einsum("nij,ni->nj", J[:, 3:], moment)
