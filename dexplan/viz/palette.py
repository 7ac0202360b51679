"""Colours that mean the same in every picture; from the colour-blind-safe palette of Okabe and Ito (2008)."""

from __future__ import annotations

import numpy as np

from dexplan.spatial import Array

FINGER_COLORS = ("#0072B2", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442")
"""Finger after finger; the object is orange, so that none of the first three is lost in front of it."""

ACTION_SHADES = {
    "hold": "#E4E4E4",
    "move_object": "#FBF4B4",
    "roll": "#D5EDE4",
    "place": "#D3EAF7",
    "lift": "#F6DCCB",
}
"""Backgrounds behind curves, pale versions of the palette's grey, yellow, bluish green, sky blue and vermilion."""

OTHER_SHADE = "#FFFFFF"
INK = "#222222"
ALARM = "#D55E00"


def get_finger_color(finger: int) -> str:
    """Return the colour of a finger as ``#rrggbb``; beyond the palette's end it starts again."""
    return FINGER_COLORS[finger % len(FINGER_COLORS)]


def as_rgb(color: str) -> Array:
    """Return ``#rrggbb`` as red, green and blue (3,), shares of one."""
    return np.array([int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)])


SHARE_COLORS = ("#DCE6EE", "#F2C14E", "#E8743B", "#8F1D21")
"""How much of the friction is used, from nothing to all: pale, yellow, orange, dark red, each darker than the one before, so that
it can be told without seeing hues."""


def get_share_color(share: float) -> str:
    """Return the colour of a share of friction used, 0 to 1, as ``#rrggbb``; above 1 that of 1."""
    stops = np.stack([as_rgb(color) for color in SHARE_COLORS])
    at = np.clip(share, 0.0, 1.0) * (len(stops) - 1)
    k = min(int(at), len(stops) - 2)
    rgb = stops[k] + (at - k) * (stops[k + 1] - stops[k])
    return "#" + "".join(f"{round(255 * x):02X}" for x in rgb)
