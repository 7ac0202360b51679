"""The configuration space of the hand around an object: free, contact and collision [paper §2].

A configuration q of all joints is *free* where no fingertip touches the object and nothing else touches anything; it is in
*contact* where fingertips, and nothing but fingertips, touch the object; all others are in *collision*.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array

TOUCH = 2e-4
"""A tip counts as touching from this far above the surface to this deep in it [m]: soft tips give way by up to 0.15 mm."""


@dataclass(frozen=True)
class Configuration:
    """Where a configuration lies in the hand's configuration space.

    ``kind``: "free", "contact" or "collision"; ``touching``: the fingers whose tips touch the object; ``clearance`` [m]: the
    smallest distance between bodies that do not touch, negative in a collision, never more than the probe sees (20 mm);
    ``nearest``: their names.
    """

    kind: Literal["free", "contact", "collision"]
    touching: tuple[int, ...]
    clearance: float
    nearest: str

    @property
    def is_allowed(self) -> bool:
        """Whether the hand may be there: free, or touching the object with fingertips alone."""
        return self.kind != "collision"


def classify(hand: HandModel, q: Array, X_WO: Array | None = None) -> Configuration:
    """Return where the hand is at ``q`` (F, J) [rad], the object at ``X_WO`` (4, 4) (default: its home).

    Fingers, object, floor and obstacles count.  A tip within :data:`TOUCH` of the object's surface touches it; one that is
    deeper collides with it.  Joint limits are no part of this; :class:`Admissibility` knows them.
    Raises ValueError for a ``q`` of another shape or with values that are not finite.
    """
    shape = (len(hand.fingers), hand.fingers[0].chain.n_joints)
    if np.shape(q) != shape or not np.isfinite(q).all():
        raise ValueError(
            f"q of shape {np.shape(q)} is no posture of the hand; {shape} finite joint angles [rad] are accepted"
        )
    X = hand.object.X_WO_home if X_WO is None else X_WO
    gaps = compute_tip_gaps(hand, q, X)
    touching = tuple(int(i) for i in np.flatnonzero(np.abs(gaps) <= TOUCH))
    clearance, nearest = hand.probe.compute_clearance(q, X, touching)
    if clearance <= 0.0:
        return Configuration("collision", touching, clearance, nearest)
    return Configuration("contact" if touching else "free", touching, clearance, nearest)


def compute_tip_gaps(hand: HandModel, q: Array, X_WO: Array) -> Array:
    """Return the distance (F,) [m] of every fingertip to the object's surface, negative inside it.

    Tips are spheres around their frames' origins, so the nearest point to the centre decides.
    """
    gaps = np.empty(len(hand.fingers))
    for i, finger in enumerate(hand.fingers):
        p_O = X_WO[:3, :3].T @ (finger.pose_at(q[i])[:3, 3] - X_WO[:3, 3])
        gaps[i] = hand.object.body.project(p_O).distance - finger.tip_radius
    return gaps
