"""What is laid over a rendered picture: force arrows and goals inside the scene, and text on dark strips."""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dexplan.plans.plan import Plan
from dexplan.spatial import Array
from dexplan.viz.palette import as_rgb, get_finger_color

Picture = NDArray[np.uint8]

ARROW_LENGTH = 0.008
"""Length of a force arrow [m/N]."""
ARROW_WIDTH = 0.003
GOAL_RADIUS = 0.008
"""Of the knob on the object where a finger has to touch in the end [m]."""
GOAL_SHADE = 0.5
"""A goal is marked in its finger's colour, darkened to this share, as in the paper's figure 5."""
HIDDEN_SHARE = 0.8
"""How much of an arrow shines through what stands in front of it."""
FULL_BRIGHTNESS = 120.0
"""Of the brightest channel of an arrow's pixel that is wholly covered, whatever its finger."""
STRIP = (28, 30, 36)
STRIP_OPACITY = 0.78
LEAST_FORCE = 0.02


def add_force_arrows(
    scene: mujoco.MjvScene, X_WO: Array, point_O: Array, rotation_O: Array, force: Array
) -> None:
    """Append an arrow per contact force to a visual scene: from the contact along the force on the object.

    ``point_O`` (F, 3), ``rotation_O`` (F, 3, 3) and ``force`` (F, 4) are rows of a trace; fingers without
    contact are NaN.
    """
    for finger in range(len(force)):
        if not np.isfinite(force[finger, :3]).all() or scene.ngeom >= scene.maxgeom:
            continue
        f_W = X_WO[:3, :3] @ rotation_O[finger] @ force[finger, :3]
        if np.linalg.norm(f_W) < LEAST_FORCE:
            continue
        start = X_WO[:3, :3] @ point_O[finger] + X_WO[:3, 3]
        geom, shape = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_ARROW
        rgba = np.array([*as_rgb(get_finger_color(finger)), 1.0], dtype=np.float32)
        mujoco.mjv_initGeom(geom, shape, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
        mujoco.mjv_connector(geom, shape, ARROW_WIDTH, start, start + ARROW_LENGTH * f_W)
        # Its own colour whatever the lights do, so that it can be told by the legend.
        geom.emission = 0.8
        scene.ngeom += 1


def add_goal_marks(scene: mujoco.MjvScene, X_WO: Array, plan: Plan) -> None:
    """Append to a visual scene a dark knob on the object, at the pose ``X_WO`` (4, 4), for every goal contact of a plan."""
    for contact in plan.goal_contacts or ():
        if contact is None or scene.ngeom >= scene.maxgeom:
            continue
        geom, shape = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_SPHERE
        shade = GOAL_SHADE * as_rgb(get_finger_color(contact.finger))
        size, place = np.full(3, GOAL_RADIUS), X_WO[:3, :3] @ contact.point_O + X_WO[:3, 3]
        rgba = np.array([*shade, 1.0], dtype=np.float32)
        mujoco.mjv_initGeom(geom, shape, size, place, np.eye(3).ravel(), rgba)
        scene.ngeom += 1


def blend_hidden(picture: Picture, arrows: Picture) -> None:
    """Let ``arrows``, drawn alone on black, shine through ``picture`` (H, W, 3), in place."""
    brightness = arrows.max(axis=2)
    rows = np.flatnonzero(brightness.any(axis=1))
    if len(rows) == 0:
        return
    band = slice(rows[0], rows[-1] + 1)
    mask = brightness[band] > 0
    # Where edges are smoothed, an arrow's pixel is dark by as much as it covers less.
    cover = np.minimum(brightness[band][mask] / FULL_BRIGHTNESS, 1.0)[:, None]
    under, over = picture[band][mask], arrows[band][mask]
    picture[band][mask] = ((1.0 - HIDDEN_SHARE * cover) * under + HIDDEN_SHARE * over).astype(np.uint8)


def draw_caption(picture: Picture, left: str, right: str) -> None:
    """Write two texts on a strip along the lower edge of ``picture`` (H, W, 3), in place."""
    height, width = picture.shape[:2]
    strip = max(22, round(0.07 * height))
    share = round(0.6 * width)
    size = min(0.42 * strip, 0.021 * width)
    _lay(picture[-strip:, :share], paint_text(left, share, strip, size, "left"))
    _lay(picture[-strip:, share:], paint_text(right, width - share, strip, size, "right"))


def draw_legend(picture: Picture, names: tuple[str, ...]) -> None:
    """Write the fingers' names and colours into the upper left corner of ``picture`` (H, W, 3), in place."""
    height, width = picture.shape[:2]
    _lay(picture, _paint_legend(names, width, height))


@lru_cache(maxsize=16)
def paint_text(text: str, width: int, height: int, size: float, side: str) -> Picture:
    """Return white text on the strip's colour (height, width, 3), ``size`` pixels high, at one end."""
    figure, canvas = _open(width, height)
    margin = 0.5 * size / width
    x = margin if side == "left" else 1.0 - margin
    figure.text(x, 0.5, text, ha=side, va="center_baseline", color="white", fontsize=size, parse_math=False)
    return _read(canvas)


@lru_cache(maxsize=4)
def _paint_legend(names: tuple[str, ...], width: int, height: int) -> Picture:
    size = min(0.016 * width, 0.021 * height)
    line = 1.6 * size
    box_width = round(size * (0.62 * max(16, *map(len, names)) + 2.4))
    box_height = round(line * (len(names) + 1) + 0.6 * size)
    figure, canvas = _open(box_width, box_height)
    for k, name in enumerate((*names, f"force, {ARROW_LENGTH * 1e3:.0f} mm per N")):
        y = 1.0 - (0.3 * size + (k + 0.5) * line) / box_height
        if k < len(names):
            figure.text(
                0.5 * size / box_width, y, "■", va="center_baseline", color=get_finger_color(k), fontsize=size
            )
        x = (2.0 if k < len(names) else 0.5) * size / box_width
        figure.text(x, y, name, va="center_baseline", color="white", fontsize=size, parse_math=False)
    return _read(canvas)[:height, :width]


def _open(width: int, height: int) -> tuple[Figure, FigureCanvasAgg]:
    # At 72 dots per inch a point is a pixel.
    figure = Figure(figsize=(width / 72.0, height / 72.0), dpi=72, facecolor=[c / 255.0 for c in STRIP])
    return figure, FigureCanvasAgg(figure)


def _read(canvas: FigureCanvasAgg) -> Picture:
    canvas.draw()
    return np.array(canvas.buffer_rgba())[..., :3]


def _lay(picture: Picture, strip: Picture) -> None:
    """Lay ``strip`` over the upper left of ``picture``, which shines through its ground only."""
    area = picture[: strip.shape[0], : strip.shape[1]]
    ink = (np.abs(strip.astype(np.int16) - STRIP).max(axis=2, keepdims=True) / 160.0).clip(0.0, 1.0)
    opacity = STRIP_OPACITY + (1.0 - STRIP_OPACITY) * ink
    area[:] = (area + opacity * (strip - area.astype(np.float64))).astype(np.uint8)
