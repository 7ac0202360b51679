"""Patterns on the object and on the fingertips, by which turning and rolling are seen: colours of directions, numpy alone.

The object carries one arrow from pole to pole, which repeats after a whole turn only; fingertips carry meridians, of which one
is broad.
"""

from __future__ import annotations

import numpy as np

from dexplan.spatial import Array

IVORY, SHADE, GRID, STRIPE = (240, 232, 214), (214, 203, 180), (196, 183, 156), (24, 38, 70)
"""The object's upper half, its lower half, the lines on it, its arrow."""
LINE = np.radians(0.8)
"""Half width of a thin line [rad]."""
BAND = np.radians(5.0)
"""Half width of the object's arrow [rad]."""
HEAD_TIP, HEAD_END, HEAD_WIDTH = np.radians([-14.0, 12.0, 15.0])
"""The arrow's head: elevation of its point, elevation of its broad end, half width there [rad]."""
TIP_INK = (250, 250, 250)
BACK = np.radians(91.0)
"""What is further from a tip's pole is its flat back [rad]."""
TIP_LINE, TIP_BAND = np.radians(1.6), np.radians(4.5)


def build_cube_directions(n: int) -> Array:
    """Return the directions (6, n, n, 3) of the texels of a cube texture, faces in MuJoCo's order."""
    u = (np.arange(n) + 0.5) / n * 2.0 - 1.0
    s, t = np.meshgrid(u, u)
    one = np.ones_like(s)
    faces = ((one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one))
    directions = np.stack([np.stack(face, axis=-1) for face in faces])
    unit: Array = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return unit


def paint_object(n_O: Array) -> Array:
    """Return the colours (..., 3) [0 .. 255] of the object where its outward normals in object axes are ``n_O`` (..., 3)."""
    x, y, z = np.moveaxis(n_O, -1, 0)
    elevation, azimuth = np.arcsin(z.clip(-1.0, 1.0)), np.arctan2(y, x)
    color = np.where((z > 0.0)[..., None], np.array(IVORY, dtype=float), np.array(SHADE, dtype=float))
    flat = np.sqrt(np.maximum(1.0 - z**2, 1e-12))
    step = np.radians(30.0)
    off = np.abs((azimuth + 0.5 * step) % step - 0.5 * step) * flat
    rings = np.abs((elevation + 0.5 * step) % step - 0.5 * step)
    color[(off < LINE) | ((rings < LINE) & (np.abs(elevation) < np.radians(80.0)))] = GRID
    # The arrow runs over the meridian of azimuth 0, from the upper pole to the lower, its head at the equator.
    beside = np.arcsin(np.abs(y).clip(0.0, 1.0))
    head = HEAD_WIDTH * (elevation - HEAD_TIP) / (HEAD_END - HEAD_TIP)
    is_head = (elevation > HEAD_TIP) & (elevation < HEAD_END) & (beside < head)
    is_shaft = (elevation >= HEAD_END) & (beside < BAND)
    is_tail = (elevation <= HEAD_TIP) & (beside < 2.5 * LINE)
    color[(x > 0.0) & (is_head | is_shaft | is_tail)] = STRIPE
    color[z > np.cos(BAND)] = STRIPE
    return color


def paint_tip(n_F: Array, color: Array) -> Array:
    """Return the colours (..., 3) [0 .. 255] of a fingertip of ``color`` (3,) [0 .. 1] at outward normals ``n_F`` (..., 3).

    z of the tip's frame is its pole.  Meridians stand 45 degrees apart, circles of latitude 30 degrees.
    """
    x, y, z = np.moveaxis(n_F, -1, 0)
    angle, azimuth = np.arccos(z.clip(-1.0, 1.0)), np.arctan2(y, x)
    skin = np.broadcast_to(255.0 * color, n_F.shape).copy()
    step = np.radians(45.0)
    off = np.abs((azimuth + 0.5 * step) % step - 0.5 * step) * np.sin(angle)
    rings = np.abs((angle + np.radians(15.0)) % np.radians(30.0) - np.radians(15.0))
    is_line = (off < TIP_LINE) | ((rings < TIP_LINE) & (angle > 0.2))
    skin[is_line] = 0.35 * skin[is_line] + 0.65 * np.array(TIP_INK)
    skin[np.abs(azimuth) * np.sin(angle) < TIP_BAND] = TIP_INK
    # The flat side to which the stem leads.
    skin[angle > BACK] = 0.75 * 255.0 * color
    return skin
