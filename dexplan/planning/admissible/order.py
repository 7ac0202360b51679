"""Whether fingers stand around the object in the order of their bases [paper §4]."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array

ORDER_GAP = float(np.radians(4.0))
"""Neighbouring fingertips keep at least this much azimuth between them: nearer, their order would be a matter of noise."""


def keeps_order(hand: HandModel, normals: dict[int, Array]) -> bool:
    """Return whether fingers touching along ``normals`` (3,) in W stand around the object in the order of their bases.

    The paper's fingers never change their relative (clockwise) positions [paper §4].  Order is taken around the vertical.
    """
    return bool(keep_order(hand, normals))


def keep_order(hand: HandModel, normals: Mapping[int, Array]) -> NDArray[np.bool_]:
    """Return, as ``keeps_order``, an answer (...) for each of many directions (..., 3) of fingers at once."""
    if len(normals) < 3:
        return np.ones(np.broadcast_shapes(*(n.shape[:-1] for n in normals.values())), dtype=bool)
    center = hand.object.X_WO_home[:2, 3]
    bases = {i: hand.fingers[i].chain.offsets[0][:2, 3] - center for i in normals}
    order = sorted(normals, key=lambda i: np.arctan2(bases[i][1], bases[i][0]))
    angles = [np.arctan2(normals[i][..., 1], normals[i][..., 0]) for i in order]
    azimuths = np.stack(np.broadcast_arrays(*angles))
    # In order, the steps from finger to finger are all positive and make one turn.
    steps = np.mod(np.roll(azimuths, -1, axis=0) - azimuths, 2.0 * np.pi)
    one_turn = np.abs(steps.sum(axis=0) - 2.0 * np.pi) < 1e-6
    return np.asarray((steps.min(axis=0) >= ORDER_GAP) & one_turn)
