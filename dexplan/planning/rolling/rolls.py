"""The roll of one finger as a plan has it: along a great circle, on a ball in closed form, on other smooth bodies integrated."""

from __future__ import annotations

import numpy as np

from dexplan.contact.rolling.curves import roll_turning
from dexplan.contact.rolling.on_body import roll_on_body
from dexplan.contact.rolling.path import RollingPath
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.contacts import Placement
from dexplan.plans.tip_roll import TipRoll
from dexplan.spatial import Array, rotate_about


def get_direction(hand: HandModel, placement: Placement) -> Array:
    """Return in which direction (3,) from the object's origin a contact is, in object axes; on a ball the normal."""
    if hand.object.is_isotropic:
        return placement.normal_O
    return np.asarray(placement.point_O / np.linalg.norm(placement.point_O))


def build_roll(hand: HandModel, placement: Placement, toward: Array, angle: float, count: int) -> TipRoll:
    """Return the roll of one finger along a great circle of directions from the object's origin.

    Args:
        placement: where it touches.
        toward: direction (3,) in object axes; the contact moves towards it along the great circle through both.
        angle: how far the contact moves as seen from the origin [rad]; negative: away.
        count: number of samples K.
    """
    finger = hand.fingers[placement.finger]
    if not hand.object.is_isotropic:
        start = get_direction(hand, placement)
        axis = np.cross(start, toward)
        turns = [rotate_about(axis / np.linalg.norm(axis), a) for a in np.linspace(0.0, angle, count)]
        directions = np.stack(turns) @ start
        return as_roll(
            placement.finger, roll_on_body(hand.object.body, finger.tip_radius, placement.X_OF, directions)
        )
    radius = float(np.linalg.norm(placement.point_O))
    heading, way = np.sign(angle) * toward, [radius * abs(angle)]
    path = roll_turning(finger.tip_radius, radius, placement.X_OF, heading, [0.0], way, count)
    return as_roll(placement.finger, path)


def as_roll(finger: int, path: RollingPath, leg: int | None = None) -> TipRoll:
    """Return a path of pure rolling as the way of one finger: all of it, or one leg between two corners."""
    samples = slice(None) if leg is None else slice(path.corners[leg], path.corners[leg + 1] + 1)
    return TipRoll(finger, path.X_OF[samples], path.n_O[samples])


def end_placement(hand: HandModel, roll: TipRoll, placement: Placement, q: Array) -> Placement:
    """Return where a finger touches after its roll."""
    normal, tip_radius = roll.normal_O[-1], hand.fingers[roll.finger].tip_radius
    if hand.object.is_isotropic:
        point = float(np.linalg.norm(placement.point_O)) * normal
    else:
        point = roll.X_OF[-1][:3, 3] - tip_radius * normal
    return Placement(roll.finger, point, normal, roll.X_OF[-1], q)
