"""Regions on the object: who can touch where, and who can hold with whom [paper §2.1, §2.2].

Regions of outward normals, in object axes, at an object pose g_O: ``CWS_i`` where finger i can touch, ``FC_i`` the points
antipodal to some point of ``CWS_i``, ``CWS_i_j = CWS_i and FC_j``, and the double force-closure region ``CWS_i_jk = CWS_i and
FC_j and FC_k``.  For a sphere, which looks the same from every side, they depend on the attitude only through the axes they are
told in: what a finger reaches is computed once per position, friction and attitude are free.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np

from dexplan.brief import brief_repr
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.regions.contactable import ContactLimits, Toucher, compute_contactable
from dexplan.planning.regions.spherical import SphericalRegion, build_cap, build_closure
from dexplan.scene.description import ContactCone
from dexplan.spatial import Array, invert_pose, lock_arrays, make_pose, read_only


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of all fingers at one object pose ``X_WO`` (4, 4), in object axes.

    ``contactable[i]`` is CWS_i: finger i touches with the tip's pole along the normal at some spin, within the planner's limits
    of joint range and dexterity.  ``theta`` [rad] is the largest angle between a normal and a chord that counts as force closed.
    """

    X_WO: Array
    theta: float
    contactable: tuple[SphericalRegion, ...]

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    @property
    def directions(self) -> Array:
        """The grid's directions (V, 3) in object axes."""
        return self.contactable[0].directions

    @property
    def phi_min(self) -> float:
        """Smallest central angle [rad] of a pair that is force closed: 180 deg - 2 theta [paper §3, result 2]."""
        return float(np.pi - 2.0 * self.theta)

    @cached_property
    def closure(self) -> tuple[SphericalRegion, ...]:
        """FC_i of every finger: the points antipodal to some point of CWS_i."""
        return tuple(
            build_closure(region, self.theta, f"FC_{i + 1}") for i, region in enumerate(self.contactable)
        )

    def pair(self, i: int, j: int) -> SphericalRegion:
        """Return CWS_i_j: where finger i can touch and hold with finger j somewhere."""
        return (self.contactable[i] & self.closure[j]).named(f"CWS_{i + 1}_{j + 1}")

    def double(self, i: int, j: int, k: int) -> SphericalRegion:
        """Return the double force-closure region CWS_i_jk: where finger i can hold with j and also with k."""
        return (self.contactable[i] & self.closure[j] & self.closure[k]).named(f"CWS_{i + 1}_{j + 1}{k + 1}")


def compute_regions(
    hand: HandModel,
    X_WO: Array,
    *,
    X_WP: Array | None = None,
    theta: float | None = None,
    allowed: tuple[ContactCone, ...] = (),
) -> Regions:
    """Return the regions of ``hand`` around its object at the pose ``X_WO`` (4, 4), or upright at a position (3,) [m].

    ``X_WP`` (4, 4) is the palm's pose (the hand's own axes by default); only where the object is in the palm matters.  ``theta``
    [rad] defaults to atan mu of the believed friction.  ``allowed`` cones on the object cut CWS_i to where contacts may be made.
    Raises ValueError for an object that is not a sphere: on others the antipodal point of x is not -x, and attitude matters.
    """
    surface = hand.object.surface
    X_WO = make_pose(p=X_WO) if np.shape(X_WO) == (3,) else np.asarray(X_WO, dtype=np.float64)
    X_PO = X_WO if X_WP is None else invert_pose(np.asarray(X_WP)) @ X_WO
    limits = ContactLimits(hand.limits.joint_margin, hand.limits.dexterity)
    # Positions that agree to a tenth of a nanometre share one computation.
    R_GO = read_only(X_PO[:3, :3])
    cones = [build_cap(cone.axis_O, cone.half_angle, R_GO) for cone in allowed]
    touchers = tuple(
        Toucher(workspace, _as_tuple(home), surface.radius + finger.tip_radius)
        for finger, workspace, home in zip(hand.fingers, hand.workspaces, hand.p_WF_home, strict=True)
    )
    contactable = []
    for i, level in enumerate(compute_contactable(touchers, limits, _as_tuple(np.round(X_PO[:3, 3], 10)))):
        region = SphericalRegion(level, R_GO, f"CWS_{i + 1}")
        if cones:
            region = (region & reduce(SphericalRegion.__or__, cones)).named(f"CWS_{i + 1} where allowed")
        contactable.append(region)
    angle = compute_pair_angle_max(hand.friction) if theta is None else theta
    return Regions(read_only(X_WO), angle, tuple(contactable))


def _as_tuple(point: Array) -> tuple[float, ...]:
    return tuple(float(v) for v in point + 0.0)  # no negative zeros: they are keys of a cache
