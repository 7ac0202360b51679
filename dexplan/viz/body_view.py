"""A body as it is seen from far away: its outline, its faces with their letters, and dots on its surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from dexplan.brief import brief_repr
from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.names import name_flats
from dexplan.icosphere import build_icosphere
from dexplan.spatial import Array, direction_from_angles, lock_arrays
from dexplan.viz.coat import find_outline
from dexplan.viz.palette import INK
from dexplan.viz.pattern import TINTS, place_letter
from dexplan.viz.sketch import find_hull
from dexplan.viz.skins import IVORY

ELEVATION = 25.0
"""From where bodies are looked at [deg]."""


@dataclass(frozen=True, eq=False)
class Sight:
    """Axes (right, up, towards the viewer) as rows (3, 3), in the body's axes."""

    axes: Array

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def project(self, points: Array) -> Array:
        """Return where points (..., 3) [m] are seen (..., 2) [m]."""
        return np.asarray(points @ self.axes[:2].T)

    def sees(self, normals: Array) -> Array:
        """Return whether the surface is seen where its outward normals are (..., 3)."""
        return np.asarray(normals @ self.axes[2] > 0.02)


def look_from(azimuth_deg: float, R_WO: Array, elevation_deg: float = ELEVATION) -> Sight:
    """Return the view of a body at the attitude ``R_WO`` (3, 3) from a world azimuth, upwards in the picture."""
    towards = direction_from_angles(azimuth_deg, elevation_deg)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return Sight(np.stack([right, np.cross(towards, right), towards]) @ R_WO)


def draw_body(ax: Axes, body: ConvexBody, sight: Sight) -> Polygon:
    """Draw a body's outline and the faces that are seen, in millimetres; return the outline."""
    rim = sight.project(body.support(build_icosphere(3).vertices))
    look: dict[str, Any] = {"edgecolor": INK, "linewidth": 1.0, "zorder": 1}
    outline = Polygon(1e3 * find_hull(rim), facecolor=_as_color(IVORY), **look)
    ax.add_patch(outline)
    letters = name_flats(body)
    for k, flat in enumerate(body.flats):
        if not sight.sees(flat.normal):
            continue
        corners = 1e3 * sight.project(find_outline(body, k))
        ax.add_patch(
            Polygon(
                corners, facecolor=_as_color(TINTS[k % len(TINTS)]), edgecolor=INK, linewidth=0.6, zorder=1.5
            )
        )
        letter = place_letter(body, flat, letters[k])
        if letter is not None:
            look = {
                "ha": "center",
                "va": "center",
                "fontsize": 11,
                "color": INK,
                "weight": "bold",
            }
            x, y = (1e3 * sight.project(letter.middle)).tolist()
            ax.text(
                x,
                y,
                letter.text,
                zorder=5,
                path_effects=[withStroke(linewidth=3, foreground="white")],
                **look,
            )
    reach = 1.04e3 * body.bound
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.set_aspect("equal")
    ax.axis("off")
    return outline


def draw_dots(ax: Axes, sight: Sight, points: Array, normals: Array, **look: Any) -> None:  # noqa: ANN401 - matplotlib's own
    """Draw dots at points (N, 3) [m] of the surface that are seen."""
    x, y = 1e3 * sight.project(points[sight.sees(normals)]).T
    ax.plot(x, y, linestyle="", **{"marker": "o", "zorder": 3, **look})


def _as_color(color: Sequence[float]) -> tuple[float, ...]:
    return tuple(part / 255.0 for part in color)
