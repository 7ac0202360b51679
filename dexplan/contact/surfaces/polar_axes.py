"""Three charts from one: a chart with poles on z, turned so that its poles lie on x or y.

Chart 0 has its poles on z, chart 1 on x, chart 2 on y.  Turning cycles the axes, so that handedness stays.
"""

from __future__ import annotations

import numpy as np

from dexplan.contact.surfaces.surface import Charts
from dexplan.spatial import Array

CHART_COUNT = 3

_TO_CHART = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])
_FROM_CHART = np.array([[0, 1, 2], [2, 0, 1], [1, 2, 0]])

POLE_AXES = _TO_CHART[:, 2]
"""The body axis (z, x, y) on which the poles of each chart lie."""


def to_chart_axes(p: Array, chart: Charts) -> Array:
    """Return vectors (..., 3) of the body's axes in the axes of each vector's chart, whose third is the pole's."""
    return _gather(p, _TO_CHART[chart])


def from_chart_axes(q: Array, chart: Charts) -> Array:
    """Return vectors (..., 3) of the axes of each vector's chart in the body's axes."""
    return _gather(q, _FROM_CHART[chart])


def _gather(p: Array, order: Charts) -> Array:
    shape = np.broadcast_shapes(p.shape, order.shape)
    p = np.broadcast_to(p, shape)
    if order.size == 3:  # one chart for all
        return p[..., order.ravel()]
    return np.take_along_axis(p, np.broadcast_to(order, shape), axis=-1)
