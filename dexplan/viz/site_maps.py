"""What a hand can do around a body that is no ball: on the body itself, where each finger lands and what it holds with whom.

The body is drawn from the side of each finger and from behind, a dot per site: filled where the finger lands (and holds alone
with the partner asked for), open where it does not.  Below, what of that also carries this object with these joints.
"""

from __future__ import annotations

import math
import os
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dexplan.contact.bodies.names import name_body, name_flats
from dexplan.contact.bodies.sites import EDGE_BAND
from dexplan.planning.admissible.hand import HandModel
from dexplan.spatial import Array, angles_from_direction
from dexplan.viz.body_view import draw_body, draw_dots, look_from
from dexplan.viz.canvas import write_picture
from dexplan.viz.palette import ALARM, INK, get_finger_color
from dexplan.viz.pattern import has_edges
from dexplan.viz.site_reach import ASIDE, BEYOND, Flags, SitePair, SiteReach, compute_site_reach

VIEW = 1.75
"""Side of one view [in]."""
TOP, BETWEEN, LOADS = 1.1, 0.45, 4.1
"""Room for the heading, above each row of views, and for the loads below [in]."""
LOST = "#9A9A9A"
"""Of sites that a finger lands on but cannot hold from with the partner asked for."""


# -- numbers -----------------------------------------------------------------------------------------------------------------


def describe_site_reach(hand: HandModel) -> str:
    """Return in words and numbers where ``hand`` lands on a body and what it carries, a line per finger and per pair."""
    reach, friction = compute_site_reach(hand), hand.friction
    thing, count = name_body(hand.object.body), len(reach.sites)
    least, kept = math.degrees(reach.lean_max), math.degrees(reach.lean_kept)
    lines = [
        f"believed friction: sliding {friction.sliding:.3f}, torsional {1e3 * friction.torsional:.2f} mm; two contacts hold "
        f"where the line between them is within {least:.1f} deg of both normals ({kept:.1f} deg with the planner's margin)",
        "",
        f"where each finger lands on the {thing} with the tip's pole on the contact, of {count} places all over it"
        f"{_tell_edges(hand)}",
        "",
    ]
    lines += [_describe_finger(hand, reach, finger) for finger in range(len(hand.fingers))]
    lines += ["", f"two fingers holding the {thing}, at home at rest, the others at home"]
    lines += [
        "            pairs of places that hold   admissible   largest load margin   torque share   most refusals"
    ]
    lines += [_describe_pair(hand, reach, pair) for pair in reach.pairs]
    return "\n".join(lines)


def _tell_edges(hand: HandModel) -> str:
    """Return what is said of places beside edges, where there are edges."""
    return f", none within {1e3 * EDGE_BAND:.0f} mm of an edge" if has_edges(hand.object.body) else ""


def _describe_finger(hand: HandModel, reach: SiteReach, finger: int) -> str:
    lands, others = reach.lands[finger], [k for k in range(len(hand.fingers)) if k != finger]
    words = f"  {hand.fingers[finger].name:<9} {lands.sum():3d} ({100.0 * lands.mean():2.0f} %)"
    for other in others:
        words += f", holds with {other + 1} from {reach.holds(finger, (other,)).sum()}"
    if len(others) == 2:
        words += f", with either from {reach.holds(finger, tuple(others)).sum()}"
    return words + _describe_faces(hand, reach, lands)


def _describe_faces(hand: HandModel, reach: SiteReach, lands: Flags) -> str:
    """Return on how many places of each lettered face a finger lands; nothing where there is no such face."""
    letters = name_flats(hand.object.body)
    told = [
        f"{letter} {(lands & (reach.face == k)).sum()}/{(reach.face == k).sum()}"
        for k, letter in enumerate(letters)
        if letter and (lands & (reach.face == k)).any()
    ]
    return f"; by face: {', '.join(told)}" if told else ""


def _describe_pair(hand: HandModel, reach: SiteReach, pair: SitePair) -> str:
    names = " ".join(hand.fingers[f].name.removeprefix("finger_") for f in pair.fingers)
    ok = pair.is_admissible
    line = f"  fingers {names} {pair.count:8d}{'':<19}{ok.sum():3d} of {len(ok):<4d}"
    if ok.any():
        best = int(np.nanargmax(np.where(ok, pair.load, np.nan)))
        line += f"  {pair.load[best]:10.2f}         {np.nanmin(pair.torque[ok]):.2f} to {np.nanmax(pair.torque[ok]):.2f}"
    else:
        line += f"{'none':>12}"
    if pair.refusals:
        line += f"   {max(pair.refusals, key=lambda r: pair.refusals[r])}"
    elif not len(ok):
        line += "   no two places that the two reach are opposite each other"
    return line


# -- picture -----------------------------------------------------------------------------------------------------------------


def draw_site_reach(hand: HandModel, path: str | os.PathLike[str]) -> Path:
    """Write where ``hand`` lands on a body and holds it as a PNG, whole or not at all; return its path."""
    reach, count = compute_site_reach(hand), len(hand.fingers)
    maps = _list_maps(count)
    width = 2.0 * VIEW * len(maps[0]) + 0.4
    height = TOP + count * (VIEW + BETWEEN) + (LOADS if reach.pairs else 0.3)
    figure = Figure(figsize=(width, height), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    center = hand.object.X_WO_home[:3, 3]
    for finger, row in enumerate(maps):
        azimuth = float(angles_from_direction(_unit(hand.p_WF_home[finger] - center))[0])
        bottom = height - TOP - (finger + 1) * (VIEW + BETWEEN) + 0.1
        for column, (title, partners) in enumerate(row):
            left = 0.2 + 2.0 * VIEW * column
            for k, (at, words) in enumerate(((azimuth, "from its side"), (azimuth + 180.0, "from behind"))):
                ax = figure.add_axes(
                    ((left + k * VIEW) / width, bottom / height, VIEW / width, VIEW / height)
                )
                _draw_sites(ax, hand, reach, finger, partners, at + ASIDE)
                ax.text(
                    0.5,
                    -0.01,
                    words,
                    transform=ax.transAxes,
                    fontsize=7.5,
                    ha="center",
                    va="top",
                    color="#666666",
                )
            shown = reach.holds(finger, partners)
            text = f"{title}: {shown.sum()} of {len(shown)}"
            at_top = (bottom + VIEW + 0.02) / height
            figure.text((left + VIEW) / width, at_top, text, fontsize=10, color=INK, ha="center", va="bottom")
    if reach.pairs:
        place = {"left": 0.05, "right": 0.985, "top": (LOADS - 1.2) / height, "bottom": 0.6 / height}
        grid = figure.add_gridspec(1, len(reach.pairs), wspace=0.10, **place)
        for k, pair in enumerate(reach.pairs):
            _draw_loads(figure.add_subplot(grid[0, k]), hand, reach, pair, k == 0)
    _write_headings(figure, hand, reach)
    return write_picture(canvas, path)


def _list_maps(n: int) -> list[list[tuple[str, tuple[int, ...]]]]:
    """Return per finger the titles of its maps and the partners that each asks for."""
    rows = []
    for i in range(n):
        others = [j for j in range(n) if j != i]
        row: list[tuple[str, tuple[int, ...]]] = [(f"finger {i + 1} lands", ())]
        row += [(f"{i + 1} holds with {j + 1}", (j,)) for j in others]
        row += [(f"{i + 1} holds with {j + 1} and with {k + 1}", (j, k)) for j, k in combinations(others, 2)]
        rows.append(row)
    return rows


def _draw_sites(
    ax: Axes, hand: HandModel, reach: SiteReach, finger: int, partners: tuple[int, ...], azimuth: float
) -> None:
    sight = look_from(azimuth, hand.object.X_WO_home[:3, :3])
    draw_body(ax, hand.object.body, sight)
    lands, shown = reach.lands[finger], reach.holds(finger, partners)
    looks: tuple[tuple[Flags, dict[str, Any]], ...] = (
        (
            ~lands,
            {
                "markersize": 2.6,
                "markerfacecolor": "none",
                "markeredgecolor": "#8A8A8A",
                "markeredgewidth": 0.5,
            },
        ),
        (lands & ~shown, {"markersize": 4.0, "color": LOST, "markeredgewidth": 0.0}),
        (
            shown,
            {
                "markersize": 5.5,
                "color": get_finger_color(finger),
                "markeredgecolor": "white",
                "markeredgewidth": 0.4,
            },
        ),
    )
    for rows, look in looks:
        draw_dots(ax, sight, reach.sites.points[rows], reach.sites.normals[rows], **look)


def _draw_loads(ax: Axes, hand: HandModel, reach: SiteReach, pair: SitePair, is_first: bool) -> None:
    i, j = pair.fingers
    ok, lean = pair.is_admissible, np.degrees(pair.lean)
    high, kept = math.degrees(reach.lean_kept + BEYOND), math.degrees(reach.lean_kept)
    ax.axvspan(kept, high, color="#F0F0F0", linewidth=0.0, zorder=0)
    ax.axvline(kept, color=INK, linewidth=1.0, linestyle="--", zorder=1)
    ax.text(kept + 0.3, 0.97, "leans too far", rotation=90, fontsize=9, va="top", color=INK, zorder=2)
    ax.axhline(hand.limits.torque_share, color=ALARM, linewidth=1.0, linestyle=":", zorder=1)
    ax.plot(
        lean[ok], pair.load[ok], marker="o", linestyle="", markersize=8, zorder=3,
        color=get_finger_color(i), markeredgecolor=get_finger_color(j), markeredgewidth=2.4,
    )  # fmt: skip
    ax.plot(lean[ok], pair.torque[ok], marker=".", linestyle="", markersize=5, color=ALARM, zorder=2)
    refused = np.full((~ok).sum(), -0.05)
    ax.plot(lean[~ok], refused, marker="x", linestyle="", markersize=5, color="#777777", zorder=3)
    ax.set_xlim(-0.5, high)
    ax.set_ylim(-0.1, 1.0)
    ax.set_title(f"fingers {i + 1} and {j + 1}: {ok.sum()} of {len(ok)} placements admissible", fontsize=10)
    ax.set_xlabel("how far the line between the contacts leans off their normals", fontsize=9)
    ax.xaxis.set_major_formatter("{x:.0f}°")
    ax.tick_params(labelsize=8, labelleft=is_first)
    if is_first:
        ax.set_ylabel("share [–]", fontsize=9)
    ax.grid(color="#DDDDDD", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _write_headings(figure: Figure, hand: HandModel, reach: SiteReach) -> None:
    height, thing = figure.get_figheight(), name_body(hand.object.body)
    count = len(reach.sites)

    def write(words: str, below: float, size: float, **look: Any) -> None:  # noqa: ANN401 - matplotlib's own
        figure.text(0.02, 1.0 - below / height, words, fontsize=size, va="center", **look)

    write("What the hand can do here", 0.30, 16, weight="bold")
    what = f"The {thing} at home with {count} places to land on{_tell_edges(hand)}; each finger "
    what += "sees it from its own side and from behind."
    write(what, 0.62, 10.5)
    ring: dict[str, Any] = {"marker": "o", "linestyle": ""}
    keys = [
        *(
            Line2D([], [], **ring, color=get_finger_color(k), label=f"finger {k + 1} lands (and holds)")
            for k in range(len(hand.fingers))
        ),
        Line2D([], [], **ring, color=LOST, markersize=4, label="lands, cannot hold with the partner"),
        Line2D(
            [],
            [],
            **ring,
            markersize=3,
            markerfacecolor="none",
            markeredgecolor="#8A8A8A",
            label="does not land",
        ),
    ]
    look: dict[str, Any] = {"frameon": False, "fontsize": 9, "columnspacing": 1.2, "handletextpad": 0.5}
    figure.legend(
        handles=keys, loc="center left", bbox_to_anchor=(0.01, 1.0 - 0.90 / height), ncols=len(keys), **look
    )
    if not reach.pairs:
        return
    friction = hand.friction
    words = (
        f"Load per pair: the {1e3 * hand.object.mass:.0f} g {thing} held by two fingers, believed friction "
    )
    words += f"{friction.sliding:.2f} and {1e3 * friction.torsional:.1f} mm.\n"
    words += "Two contacts hold alone where the line between them is within "
    words += f"{math.degrees(reach.lean_max):.1f}° of both normals; planning keeps to {math.degrees(reach.lean_kept):.1f}°."
    write(words, height - LOADS + 0.30, 10.5, linespacing=1.4)
    marks = [
        Line2D([], [], **ring, color="white", markeredgecolor=INK, label="load margin, admissible"),
        Line2D([], [], marker=".", linestyle="", color=ALARM, label="largest torque share; dotted: limit"),
        Line2D([], [], marker="x", linestyle="", color="#777777", label="refused"),
    ]
    at = (0.01, (LOADS - 0.75) / height)
    figure.legend(handles=marks, loc="center left", bbox_to_anchor=at, ncols=3, **look)


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v))
