"""Where a finger can touch the object: sites all over it, and whether and how a tip gets to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.sites import EDGE_BAND, Sites, build_sites
from dexplan.contact.bodies.smooth import BallBody
from dexplan.kinematics.chain import compute_joint_margin, compute_tip_pose
from dexplan.kinematics.spherical_wrist import estimate_dexterity, solve_tip_pose
from dexplan.kinematics.workspace import spread_directions
from dexplan.planning.admissible.aligned import build_touching
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.contacts import Placement
from dexplan.spatial import VERTICAL, Array, invert_pose, rotate_about

DIRECTIONS = 240
"""Directions around a ball at which intermediate landings are tried."""
SPACING = 0.15
"""Distance of sites on other bodies at most, in lengths of the cube of their volume: as many as directions around a ball."""
_BESIDE = 2e-4
"""Tips stand beside each other on a face with this much more than they have to keep [m]: a whole number of sites apart."""
TILTS = (0.0, float(np.radians(25.0)), -float(np.radians(25.0)))
"""How far poles are tilted off the normals, about the vertical, where a carry is ahead."""

FACING, ASIDE = 0.0, -0.5
"""Cosine between a site's normal and a finger's home from which on it is tried: places that face the finger, or those beside it
as well, which fingers reach on a cube.  With all of these every search is twice as wide."""


def list_sites(hand: HandModel) -> Sites:
    """Return the places all over the object at which landings are tried, none near an edge."""
    room = 2.0 * min(f.tip_radius for f in hand.fingers) + hand.limits.clearance + _BESIDE
    body = hand.object.body
    widest = SPACING * float(np.cbrt(body.solid.volume))
    return _spread_sites(body, room / np.ceil(room / widest))


@lru_cache(maxsize=8)
def _spread_sites(body: ConvexBody, spacing: float) -> Sites:
    if isinstance(body, BallBody):
        return find_sites(body, spread_directions(DIRECTIONS))
    return build_sites(body, spacing, EDGE_BAND)


def find_sites(body: ConvexBody, normals_O: Array) -> Sites:
    """Return the places of a body with the outward normals (N, 3); of a face with such a normal, one of its corners."""
    return Sites(body.support(normals_O), normals_O)


def build_landings(
    hand: HandModel,
    X_WO: Array,
    finger: int,
    normals_O: Array,
    points_O: Array | None = None,
    *,
    tilt: float = 0.0,
) -> list[Placement | None]:
    """Return how a finger touches along outward normals (N, 3) in object axes, its pole along them; None where it cannot.

    ``points_O`` (N, 3) [m]: where; None where normals say it, as on a ball.  ``tilt`` [rad] turns the pole off the normal, about
    the vertical: beside another finger, or near the end of a finger's way, that makes room.  A tip that can roll about its pole
    lands with that joint in the middle of its range.
    """
    if points_O is None:
        points_O = find_sites(hand.object.body, normals_O).points
    description, limits = hand.fingers[finger], hand.limits
    chain, workspace = description.chain, hand.workspaces[finger]
    if not len(workspace.postures) or not len(normals_O):
        return [None] * len(normals_O)
    X_WF = build_touching(hand, finger, X_WO, points_O, normals_O)
    if tilt:
        X_WF[:, :3, :3] = rotate_about(VERTICAL, tilt) @ X_WF[:, :3, :3]
    q, reached = solve_tip_pose(workspace, X_WF)
    if chain.has_tip_roll:
        q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
    usable = reached & (compute_joint_margin(chain, q) >= limits.joint_margin)
    usable[usable] = estimate_dexterity(chain, q[usable]) >= limits.dexterity
    X_OF = invert_pose(X_WO) @ compute_tip_pose(chain, q)
    return [
        Placement(finger, p, n, X, posture) if good else None
        for p, n, X, posture, good in zip(points_O, normals_O, X_OF, q, usable, strict=True)
    ]


def find_reach(
    hand: HandModel, poses: Sequence[Array], finger: int, facing: float = FACING
) -> NDArray[np.bool_]:
    """Return in which of K ``poses`` (4, 4) of the object a finger can touch which site: (K, N), with any tilt of the pole.

    As :func:`build_landings` says, for all poses at once.
    """
    sites, description, limits = list_sites(hand), hand.fingers[finger], hand.limits
    chain, workspace = description.chain, hand.workspaces[finger]
    found = np.zeros((len(poses), len(sites)), dtype=bool)
    for k, X_WO in enumerate(poses):
        found[k] = find_facing(hand, X_WO, finger, sites, facing)
    if not len(workspace.postures):
        return np.zeros_like(found)
    X_WF = np.concatenate(
        [
            build_touching(hand, finger, X, sites.points[row], sites.normals[row])
            for X, row in zip(poses, found, strict=True)
        ]
    )
    usable = np.zeros(len(X_WF), dtype=bool)
    for tilt in TILTS:
        asked = np.flatnonzero(~usable)
        X = X_WF[asked]
        X[:, :3, :3] = rotate_about(VERTICAL, tilt) @ X[:, :3, :3]
        q, reached = solve_tip_pose(workspace, X)
        if chain.has_tip_roll:
            q[:, -1] = 0.5 * (chain.lower[-1] + chain.upper[-1])
        asked, q = asked[reached], q[reached]
        fits = compute_joint_margin(chain, q) >= limits.joint_margin
        fits[fits] = estimate_dexterity(chain, q[fits]) >= limits.dexterity
        usable[asked[fits]] = True
    found[found] = usable
    return found


def find_facing(
    hand: HandModel, X_WO: Array, finger: int, sites: Sites, facing: float = FACING
) -> NDArray[np.bool_]:
    """Return at which sites (N,) of the object at ``X_WO`` (4, 4) a finger may touch, and whose normals have a cosine of more
    than ``facing`` to where the finger comes from.
    """
    home = hand.p_WF_home[finger] - X_WO[:3, 3]
    # Regions are of directions from the object's origin; only on a ball these are the normals.
    from_origin = sites.points / np.linalg.norm(sites.points, axis=1, keepdims=True)
    least = facing * float(np.linalg.norm(home))
    return np.asarray(hand.object.allows(from_origin) & (sites.normals @ X_WO[:3, :3].T @ home > least))


def land_again(hand: HandModel, X_WO: Array, placement: Placement) -> Placement | None:
    """Return the same contact, tip pose in the object and all, with the object at ``X_WO`` (4, 4); None out of reach."""
    description, limits = hand.fingers[placement.finger], hand.limits
    X_WF = (X_WO @ placement.X_OF)[None]
    q, reached = solve_tip_pose(hand.workspaces[placement.finger], X_WF, counts_spin=True)
    good = reached[0] and compute_joint_margin(description.chain, q[0]) >= limits.joint_margin
    if not good or float(estimate_dexterity(description.chain, q)[0]) < limits.dexterity:
        return None
    return replace(placement, q=q[0])
