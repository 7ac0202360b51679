"""How fast a pyramid gives way under a force, in closed form."""

from __future__ import annotations

import numpy as np

from dexplan.spatial import Array
from dexplan.testing.parties import Indices
from dexplan.testing.rows import ContactRows


def compute_pyramid_drift(rows: ContactRows, which: Indices, force: Array) -> Array:
    """Return the steady slip (N, 2) [m/s] along t1, t2 of pyramids under ``force`` (N, 3) in their contact frames.

    At rest an edge pushes with p = max(0, x -+ B mu v / R): x is what the depth pushes it with, the same for all edges.  With
    g_i = |f_i| / mu_i the two edges of a direction push 2 x together where g_i <= 2 x, and the stronger alone with g_i
    elsewhere, so that all push with the normal force where

        sum max(2 x, g_i) = f_n,  hence  x = min over j of (f_n - the sum of all but the j smallest g_i) / 2 j.

    The drift is then (R / B) g_i / 2 mu_i where both push, and (R / B) (g_i - x) / mu_i where one does.
    """
    has = (np.arange(1, 6) < rows.dim[which, None]) & (rows.friction[which] > 0.0)
    count = has.sum(axis=1)
    mu = np.where(has, rows.friction[which], 1.0)
    g = np.zeros_like(mu)
    g[:, :2] = np.where(has[:, :2], np.abs(force[:, :2]) / mu[:, :2], 0.0)
    # Directions without friction have no edges: as the largest of all they are never among the j smallest.
    ordered = np.sort(np.where(has, g, np.inf), axis=1)
    known = np.where(np.isfinite(ordered), ordered, 0.0)
    left = known.sum(axis=1, keepdims=True) - np.cumsum(known, axis=1)
    j = np.arange(1, 6)
    x = np.where(j <= count[:, None], (force[:, 2:] - left) / (2.0 * j), np.inf).min(axis=1)
    x = np.clip(x, 0.0, None)[:, None]
    speed = np.where(g[:, :2] <= 2.0 * x, 0.5 * g[:, :2], g[:, :2] - x) / mu[:, :2]
    return np.where(has[:, :2], rows.softness[which, None] * speed * np.sign(force[:, :2]), 0.0)
