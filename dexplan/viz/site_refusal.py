"""Why a problem about a body that is no ball was refused: on the body itself, where each finger lands and what was asked of it.

Upper rows: the body from the side of each finger and from behind, at the start, at the goal, or both.  Lower row: every two
contacts asked for, looked at across the line between them, with both friction cones.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from dexplan.brief import brief_repr
from dexplan.contact.bodies.names import name_body
from dexplan.contact.bodies.sites import Sites
from dexplan.grasp.pairs import measure_chord_lean
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.separation import compute_pair_angle_max
from dexplan.planning.contacts.landings import list_sites
from dexplan.spatial import Array, angles_from_direction, lock_arrays
from dexplan.viz.body_view import Sight, draw_body, draw_dots, look_from
from dexplan.viz.palette import ALARM, INK, get_finger_color
from dexplan.viz.site_reach import ASIDE, find_landings

REACH = 2.6
"""Length of a drawn cone, in units of the body's size."""
ASKED_SIZE, OTHER_SIZE = 11, 5


@dataclass(frozen=True, eq=False)
class SitePairSection:
    """Two contacts at ``points`` (2, 3) [m] with the **outward** ``normals`` (2, 3); the line between them leans by ``lean``
    [rad] off one of them, ``most`` by friction alone and ``kept`` with the planner's margin.
    """

    fingers: tuple[int, int]
    points: Array
    normals: Array
    lean: float
    most: float
    kept: float

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        lock_arrays(self)

    def __str__(self) -> str:
        lean, kept, most = (np.degrees(a) for a in (self.lean, self.kept, self.most))
        words = f"the line leans {lean:.0f}° off a normal, {kept:.0f}° allowed"
        if self.lean > self.most:
            return f"{words}:\na cone misses the other contact by {lean - most:.1f}°"
        if self.lean > self.kept:
            return f"{words}:\nthe cones reach {most:.0f}°, but without a margin"
        return f"{words}:\nthe cones meet"


def find_site_sections(hand: HandModel, points: tuple[Array | None, ...]) -> list[SitePairSection]:
    """Return a section for every two contacts asked for, ``points`` (3,) [m] on the object, one per finger."""
    limits = hand.limits
    most = compute_pair_angle_max(hand.friction)
    kept = compute_pair_angle_max(hand.friction.scaled(limits.cone_share)) - limits.closure_margin
    found = []
    for i, j in combinations(range(len(points)), 2):
        first, second = points[i], points[j]
        if first is None or second is None:
            continue
        both = np.stack([first, second])
        normals = hand.object.body.normal_at(both)
        lean = float(measure_chord_lean(both, normals))
        found.append(SitePairSection((i, j), both, normals, lean, most, kept))
    return found


def draw_landings(
    figure: Figure, hand: HandModel, X_WO: Array, asked: tuple[Array | None, ...] | None, place: Array
) -> None:
    """Draw for each finger the body at ``X_WO`` (4, 4) from its side and from behind, where it lands, and what is asked of it.

    ``asked`` are points (3,) [m] on the object; ``place`` (left, bottom, width, height) is the part of the figure.
    """
    body, sites = hand.object.body, list_sites(hand)
    left, bottom, width, height = (float(x) for x in place)
    each = width / len(hand.fingers)
    for finger in range(len(hand.fingers)):
        lands = find_landings(hand, finger, sites, X_WO)[0]
        home = hand.p_WF_home[finger] - X_WO[:3, 3]
        azimuth = float(angles_from_direction(home / np.linalg.norm(home))[0])
        for k, at in enumerate((azimuth, azimuth + 180.0)):
            at_left = left + finger * each + 0.5 * k * each
            ax = figure.add_axes((at_left, bottom, 0.5 * each, 0.86 * height))
            sight = look_from(at + ASIDE, X_WO[:3, :3])
            draw_body(ax, body, sight)
            for rows, look in (
                (~lands, {"markersize": 2.4, "markerfacecolor": "none", "markeredgecolor": "#8A8A8A"}),
                (lands, {"markersize": 4.5, "color": get_finger_color(finger), "markeredgewidth": 0.0}),
            ):
                draw_dots(ax, sight, sites.points[rows], sites.normals[rows], **look)
            _mark_asked(ax, hand, sight, X_WO, asked or (), finger)
            side = "from its side" if k == 0 else "from behind"
            ax.text(
                0.5, 0.0, side, transform=ax.transAxes, fontsize=7.5, ha="center", va="top", color="#666666"
            )
        title = f"finger {finger + 1} lands on {100.0 * lands.mean():.0f} % of the {name_body(body)}"
        at_top = bottom + 0.88 * height
        figure.text(left + (finger + 0.5) * each, at_top, title, fontsize=10, color=INK, ha="center")


def _mark_asked(
    ax: Axes, hand: HandModel, sight: Sight, X_WO: Array, asked: tuple[Array | None, ...], finger: int
) -> None:
    for other, point in enumerate(asked):
        if point is None:
            continue
        one = Sites(point[None], hand.object.body.normal_at(point[None]))
        if other != finger:
            draw_dots(ax, sight, one.points, one.normals, markersize=OTHER_SIZE, color="#555555", zorder=6)
            continue
        is_there = bool(find_landings(hand, finger, one, X_WO)[0][0])
        look: dict[str, Any] = {"markersize": ASKED_SIZE, "markeredgecolor": "white", "zorder": 7}
        look |= {"color": INK, "marker": "o"} if is_there else {"color": ALARM, "marker": "X"}
        draw_dots(ax, sight, one.points, one.normals, **look)


def draw_site_section(ax: Axes, hand: HandModel, section: SitePairSection) -> None:
    """Draw the body looked at across the line between two contacts: tips, cones, and the line."""
    chord = section.points[1] - section.points[0]
    right = chord / np.linalg.norm(chord)
    up = section.normals.sum(axis=0)
    up -= (up @ right) * right
    if np.linalg.norm(up) < 1e-6:
        up = np.cross(np.roll(right, 1), right)
    up /= np.linalg.norm(up)
    sight = Sight(np.stack([right, up, np.cross(right, up)]))
    body = hand.object.body
    outline = draw_body(ax, body, sight)
    at, is_kept = 1e3 * sight.project(section.points), section.lean <= section.kept
    for k, finger in enumerate(section.fingers):
        color, radius = get_finger_color(finger), hand.fingers[finger].tip_radius
        inward = sight.project(-section.normals[k])
        edges = np.arctan2(inward[1], inward[0]) + section.most * np.array([-1.0, 1.0])
        reach = 1e3 * REACH * body.bound
        corners = [at[k], *(at[k] + reach * np.array([np.cos(e), np.sin(e)]) for e in edges)]
        cone = Polygon(corners, facecolor=color, alpha=0.3, edgecolor=color, linewidth=1.4, zorder=3)
        ax.add_patch(cone)
        cone.set_clip_path(outline)
        center = 1e3 * sight.project(section.points[k] + radius * section.normals[k])
        look: dict[str, Any] = {"ha": "center", "va": "center", "color": "white", "weight": "bold"}
        circle = np.linspace(0.0, 2.0 * np.pi, 40)
        rim = center + 1e3 * radius * np.stack([np.cos(circle), np.sin(circle)], axis=1)
        ax.add_patch(Polygon(rim, facecolor=color, alpha=0.85, edgecolor="white", zorder=4))
        ax.text(center[0], center[1], str(finger + 1), fontsize=12, zorder=5, **look)
    color, style = (INK, "-") if section.lean <= section.most else (ALARM, "--")
    ax.plot(*at.T, color=color, linewidth=2.2, linestyle=style, marker="o", markersize=6, zorder=6)
    first, second = (finger + 1 for finger in section.fingers)
    title = f"{'✓' if is_kept else '✗'} fingers {first} and {second}: {section}"
    ax.set_title(title, fontsize=10, color=INK if is_kept else ALARM)
    tips = max(finger.tip_radius for finger in hand.fingers)
    reach = 1e3 * (body.bound + 2.2 * tips)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-0.85 * reach, 0.95 * reach)


def list_keys() -> list[Patch | Line2D]:
    """Return what the marks mean, for a legend."""
    ring: dict[str, Any] = {"marker": "o", "linestyle": ""}
    cross: dict[str, Any] = {"marker": "X", "linestyle": ""}
    return [
        Line2D([], [], color="#777777", markersize=5, label="the finger lands here", **ring),
        Line2D(
            [],
            [],
            markerfacecolor="none",
            markeredgecolor="#8A8A8A",
            markersize=3,
            label="it does not",
            **ring,
        ),
        Line2D([], [], color=INK, markersize=9, label="contact asked of it", **ring),
        Line2D([], [], color=ALARM, markersize=10, label="asked of it, out of reach", **cross),
        Line2D([], [], color="#555555", markersize=5, label="contacts of the others", **ring),
    ]
