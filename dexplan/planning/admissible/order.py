"""Whether fingers stand around the object in the order of their bases [paper §4]."""

from __future__ import annotations

import numpy as np

from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array

ORDER_GAP = float(np.radians(4.0))
"""Neighbouring fingertips keep at least this much azimuth between them: nearer, their order would be a matter of noise."""


def keeps_order(hand: HandModel, normals: dict[int, Array]) -> bool:
    """Return whether fingers touching along ``normals`` (3,) in W stand around the object in the order of their bases.

    The paper's fingers never change their relative (clockwise) positions [paper §4].  Order is taken around the vertical.
    """
    if len(normals) < 3:
        return True
    center = hand.object.X_WO_home[:2, 3]
    bases = {i: hand.fingers[i].chain.offsets[0][:2, 3] - center for i in normals}
    order = sorted(normals, key=lambda i: np.arctan2(bases[i][1], bases[i][0]))
    azimuths = np.array([np.arctan2(normals[i][1], normals[i][0]) for i in order])
    # In order, the steps from finger to finger are all positive and make one turn.
    steps = np.mod(np.roll(azimuths, -1) - azimuths, 2.0 * np.pi)
    return bool(steps.min() >= ORDER_GAP and abs(steps.sum() - 2.0 * np.pi) < 1e-6)
