"""Sections through two contacts: does each friction cone hit the other contact, so that two fingers hold alone?"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from scipy.spatial import cKDTree

from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.regions.regions import Regions
from dexplan.spatial import Array
from dexplan.viz.palette import ALARM, INK, get_finger_color

Asked = tuple[Array | None, ...]
"""Per finger the outward normal (3,) of the contact that was asked for, in object axes; None where there is none."""
REACH = 2.15
"""Length of a drawn cone, in radii of the object: it crosses all of it."""


@dataclass(frozen=True)
class PairSection:
    """Two contacts in the plane through them and the object's centre, whose ``angle`` apart [rad] says whether they hold alone.

    ``needed`` [rad]: from here on the line between the contacts lies in both cones of half-angle ``cone`` [rad]; ``kept`` [rad]:
    from here on with the margin that the planner keeps.
    """

    fingers: tuple[int, int]
    angle: float
    cone: float
    needed: float
    kept: float

    @property
    def missed(self) -> float:
        """By how much each cone misses the other contact [rad]; negative where the cone hits the contact."""
        return 0.5 * (self.needed - self.angle)

    @property
    def rule(self) -> str:
        """How far apart two contacts have to be, by friction alone and with the margin that planning keeps."""
        needed, kept = np.degrees(self.needed), np.degrees(self.kept)
        return f"cones meet from {needed:.0f}° apart, planning asks for {kept:.0f}° to keep a margin"

    def __str__(self) -> str:
        angle, needed, kept = (np.degrees(a) for a in (self.angle, self.needed, self.kept))
        words = f"{angle:.0f}° apart, {kept:.0f}° asked for"
        if self.angle < self.needed:
            return f"{words}:\neach cone misses the other contact by {np.degrees(self.missed):.1f}°"
        if self.angle < self.kept:
            return f"{words}:\nthe cones meet from {needed:.0f}° on, but without a margin"
        return f"{words}:\nthe cones meet"


def find_sections(hand: HandModel, regions: Regions, asked: Asked | None) -> list[PairSection]:
    """Return a section for every two contacts asked for; without any, for the widest that every two fingers can reach."""
    cone, limits = compute_pair_angle_max(hand.friction), hand.limits
    kept = compute_pair_angle_max(hand.friction.scaled(limits.cone_share)) - limits.closure_margin
    found = []
    for i, j in combinations(range(len(hand.fingers)), 2):
        if asked is None:
            angle = find_widest(regions, i, j)
        else:
            n, m = asked[i], asked[j]
            angle = None if n is None or m is None else _measure_angle(n, m)
        if angle is not None:
            found.append(PairSection((i, j), angle, cone, np.pi - 2.0 * cone, np.pi - 2.0 * kept))
    return found


def find_widest(regions: Regions, i: int, j: int) -> float | None:
    """Return the largest angle [rad] between contacts that fingers i and j reach; None where one of them reaches nothing."""
    first, second = (regions.contactable[k] for k in (i, j))
    own, others = first.directions[first.mask], second.directions[second.mask]
    if not len(own) or not len(others):
        return None
    distance, _ = cKDTree(-others).query(own)
    return float(np.pi - 2.0 * np.arcsin(min(0.5 * float(distance.min()), 1.0)))


def _measure_angle(n: Array, m: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(n, m)), n @ m))


def draw_section(ax: Axes, hand: HandModel, section: PairSection) -> None:
    """Draw two fingertips on the object, to scale, their friction cones, and the line between the contacts."""
    half = 0.5 * section.angle
    radius = float(np.linalg.norm(hand.object.surface.radial(np.array([1.0, 0.0, 0.0]))))
    is_hit, is_kept = section.angle >= section.needed, section.angle >= section.kept
    ax.add_patch(Circle((0.0, 0.0), 1.0, facecolor="#FBF3E4", edgecolor=INK, linewidth=1.0, zorder=1))
    points = []
    for side, finger in zip((-1.0, 1.0), section.fingers, strict=True):
        normal = np.array([side * np.sin(half), np.cos(half)])
        color, tip = get_finger_color(finger), hand.fingers[finger].tip_radius / radius
        edges = np.arctan2(-normal[1], -normal[0]) + section.cone * np.array([-1.0, 1.0])
        corners = [normal, *(normal + REACH * np.array([np.cos(e), np.sin(e)]) for e in edges)]
        cone = Polygon(corners, facecolor=color, alpha=0.22, edgecolor=color, linewidth=1.4, zorder=2)
        ax.add_patch(cone)
        cone.set_clip_path(Circle((0.0, 0.0), 1.0, transform=ax.transData))
        x, y = ((1.0 + tip) * normal).tolist()
        ax.add_patch(
            Circle((x, y), tip, facecolor=color, alpha=0.85, edgecolor="white", linewidth=1.0, zorder=3)
        )
        look: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "color": "white",
            "weight": "bold",
            "fontsize": 12,
        }
        ax.text(x, y, str(finger + 1), zorder=4, **look)
        points.append(normal)
    x_line, y_line = np.array(points).T
    color, style = (INK, "-") if is_hit else (ALARM, "--")
    ax.plot(x_line, y_line, color=color, linewidth=2.2, linestyle=style, zorder=5)
    ax.plot(x_line, y_line, marker="o", linestyle="", markersize=6, color=INK, zorder=6)
    first, second = (finger + 1 for finger in section.fingers)
    title = f"{'✓' if is_kept else '✗'} fingers {first} and {second}: {section}"
    ax.set_title(title, fontsize=10, color=INK if is_kept else ALARM)
    ax.set_aspect("equal")
    ax.set_xlim(-2.3, 2.3)
    ax.set_ylim(-1.1, 2.15)
    ax.axis("off")
