"""What the hand can do around its object: maps of reach and force closure, and the load of every pair of fingers.

The maps are the paper's regions on the object's surface: where finger i can touch (CWS_i), where a partner of its contacts
would have to be (FC_i), where it can hold with one partner (CWS_i_j) and with either of two (CWS_i_jk, the double
force-closure region).  Whether a force-closed pair also carries *this* object with *these* joints is another question; its
answers stand below, pair by pair.  These maps are a ball's; around any other body sites take their place (``site_maps``).
"""

from __future__ import annotations

import math
import os
from functools import reduce
from itertools import combinations
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dexplan.contact.bodies.smooth import BallBody
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.spherical import SphericalRegion
from dexplan.spatial import Array, angles_from_direction, direction_from_angles
from dexplan.viz.canvas import write_picture
from dexplan.viz.palette import ALARM, INK, as_rgb, get_finger_color
from dexplan.viz.reach import BELOW_DEG, PairLoads, Reach, compute_reach
from dexplan.viz.site_maps import describe_site_reach, draw_site_reach

PIXEL_DEG = 1.5
HATCH, LOST = "#AAAAAA", "#DDDDDD"
"""FC regions; what a finger reaches but cannot hold with the partner asked for."""


# -- numbers -----------------------------------------------------------------------------------------------------------------


def describe_reach(hand: HandModel) -> str:
    """Return in words and numbers what ``hand`` reaches and carries, a line per finger and a line per pair."""
    if not isinstance(hand.object.body, BallBody):
        return describe_site_reach(hand)
    reach = compute_reach(hand)
    friction, limits = hand.friction, hand.limits
    lines = [
        f"believed friction: sliding {friction.sliding:.3f}, torsional {1e3 * friction.torsional:.2f} mm; "
        f"two contacts are force closed from {math.degrees(reach.phi_min):.1f} deg apart",
        "",
        "reach with the tip's pole on the contact (joint margin "
        f"{math.degrees(limits.joint_margin):.3g} deg, away from postures in which the finger cannot move every way)",
        "            of the surface   azimuth from its own   elevation           any orientation   double region",
    ]
    others = [[j for j in range(len(hand.fingers)) if j != i] for i in range(len(hand.fingers))]
    for i, (finger, workspace) in enumerate(zip(hand.fingers, hand.workspaces, strict=True)):
        area = reach.regions.contactable[i].area / (4.0 * math.pi)
        double = [reach.regions.double(i, j, k) for j, k in combinations(others[i], 2)]
        share = reduce(SphericalRegion.__or__, double).area / (4.0 * math.pi) if double else 0.0
        lines.append(
            f"  {finger.name:<9} {100 * area:4.1f} % {4 * math.pi * area:5.2f} sr   "
            f"{_describe_span(reach, i):<44}"
            f"{f'{workspace.dextrous_positions} of {workspace.sampled_positions}':<18}{100 * share:4.1f} %"
        )
    lines += [
        "  (any orientation: sampled tip positions that are reached with every pole and any spin)",
        "",
        "two fingers holding on the equator, the object at home at rest, the others at home",
        "            admissible   smallest angle   largest load margin   torque share   most refusals",
    ]
    lines += [_describe_pair(hand, loads) for loads in reach.loads]
    return "\n".join(lines)


def _describe_span(reach: Reach, finger: int) -> str:
    region = reach.regions.contactable[finger]
    if region.is_empty:
        return "nothing"
    azimuth, elevation = angles_from_direction(region.directions[region.mask])
    off = _wrap(azimuth - reach.azimuths[finger])
    # Near the poles azimuth says nothing.
    off = off[np.abs(elevation) < 60.0] if (np.abs(elevation) < 60.0).any() else off
    return f"{off.min():+4.0f} to {off.max():+4.0f} deg         {elevation.min():+4.0f} to {elevation.max():+4.0f} deg"


def _describe_pair(hand: HandModel, loads: PairLoads) -> str:
    names = " ".join(hand.fingers[f].name.removeprefix("finger_") for f in loads.fingers)
    ok = loads.is_admissible
    line = f"  fingers {names}  {ok.sum():3d} of {len(ok):<4d}"
    if ok.any():
        best = int(np.nanargmax(np.where(ok, loads.load, np.nan)))
        line += (
            f"  {np.degrees(loads.angle[ok].min()):6.0f} deg        "
            f"{loads.load[best]:.2f} at {np.degrees(loads.angle[best]):.0f} deg       "
            f"{np.nanmin(loads.torque[ok]):.2f} to {np.nanmax(loads.torque[ok]):.2f}"
        )
    else:
        line += f"{'none':>8}"
    if loads.refusals:
        reason = max(loads.refusals, key=lambda r: loads.refusals[r])
        line += f"   {reason}"
    elif not len(ok):
        line += "   on the equator the two reach no allowed contacts that are far enough apart"
    return line


def _wrap(angle_deg: Array) -> Array:
    """Return angles in [-180, 180) degrees."""
    return np.asarray((np.asarray(angle_deg) + 180.0) % 360.0 - 180.0)


# -- picture -----------------------------------------------------------------------------------------------------------------


def draw_reach(hand: HandModel, path: str | os.PathLike[str]) -> Path:
    """Write the maps of ``hand`` and its pair loads as a PNG, whole or not at all; return its path."""
    if not isinstance(hand.object.body, BallBody):
        return draw_site_reach(hand, path)
    reach, n = compute_reach(hand), len(hand.fingers)
    columns = _list_maps(n)
    n_columns = max(len(row) for row in columns)
    figure = Figure(figsize=(4.1 * n_columns + 0.6, 2.45 * n + 5.2), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    height = figure.get_figheight()
    top, split = 1.0 - 1.15 / height, 4.1 / height
    maps = figure.add_gridspec(
        n, n_columns, left=0.05, right=0.985, top=top, bottom=split + 0.55 / height, hspace=0.42, wspace=0.14
    )
    for i, row in enumerate(columns):
        for column, (title, partners) in enumerate(row):
            _draw_map(figure.add_subplot(maps[i, column]), reach, i, partners, title, column == 0)
    if reach.loads:
        bottom = figure.add_gridspec(
            1,
            len(reach.loads),
            left=0.05,
            right=0.985,
            top=split - 0.55 / height,
            bottom=0.6 / height,
            wspace=0.10,
        )
        for k, loads in enumerate(reach.loads):
            _draw_loads(figure.add_subplot(bottom[0, k]), hand, reach, loads, k == 0)
    _write_headings(figure, hand, reach, split)
    return write_picture(canvas, path)


def _list_maps(n: int) -> list[list[tuple[str, tuple[int, ...]]]]:
    """Return per finger the titles of its maps and the partners that each asks for; no partners: reach and FC."""
    rows = []
    for i in range(n):
        others = [j for j in range(n) if j != i]
        row: list[tuple[str, tuple[int, ...]]] = [(f"finger {i + 1} can touch: CWS$_{i + 1}$", ())]
        row += [(f"{i + 1} holds with {j + 1}: CWS$_{{{i + 1},{j + 1}}}$", (j,)) for j in others]
        row += [
            (f"{i + 1} holds with {j + 1} and with {k + 1}: CWS$_{{{i + 1},{j + 1}{k + 1}}}$", (j, k))
            for j, k in combinations(others, 2)
        ]
        rows.append(row)
    return rows


def _draw_map(
    ax: Axes, reach: Reach, finger: int, partners: tuple[int, ...], title: str, is_first: bool
) -> None:
    """Draw one region over azimuth and elevation; the finger's own azimuth is in the middle."""
    regions, middle = reach.regions, float(reach.azimuths[finger])
    azimuth = np.arange(-180.0 + PIXEL_DEG / 2, 180.0, PIXEL_DEG)
    elevation = np.arange(-90.0 + PIXEL_DEG / 2, 90.0, PIXEL_DEG)
    grid = direction_from_angles(*np.meshgrid(azimuth + middle, elevation))
    own = regions.contactable[finger].estimate_margin(grid)
    shown = regions.contactable[finger]
    for partner in partners:
        shown = shown & regions.closure[partner]
    color = get_finger_color(finger)
    picture = np.zeros((*own.shape, 4))  # transparent
    if not partners:
        # Where a partner of this finger would have to touch.
        closure = np.clip(regions.closure[finger].estimate_margin(grid), -1.0, 1.0)
        hatch = ax.contourf(azimuth, elevation, closure, [0.0, 2.0], colors="none", hatches=["///"], zorder=1)
        hatch.set_edgecolor(HATCH)
        hatch.set_linewidth(0.0)
    else:
        picture[own >= 0.0] = [*as_rgb(LOST), 1.0]
    picture[shown.estimate_margin(grid) >= 0.0] = [*as_rgb(color), 1.0]
    ax.imshow(
        picture,
        extent=(-180.0, 180.0, -90.0, 90.0),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        zorder=2,
    )
    ax.contour(azimuth, elevation, own, [0.0], colors=[INK], linewidths=0.8, zorder=3)
    for other, own_azimuth in enumerate(reach.azimuths):
        place = float(_wrap(own_azimuth - middle))
        ax.plot(
            [place], [0.0], marker="o", markersize=6, color=get_finger_color(other), zorder=4,
            markeredgecolor="white", markeredgewidth=1.0,
        )  # fmt: skip
    ax.set_xlim(-180.0, 180.0)
    ax.set_ylim(-90.0, 90.0)
    ticks = np.arange(-180.0, 181.0, 60.0)
    ax.set_xticks(ticks, [f"{round(t)}°" for t in _wrap(ticks + middle).tolist()], fontsize=8)
    ax.set_yticks([-60, -30, 0, 30, 60], ["-60°", "-30°", "0°", "30°", "60°"] if is_first else [], fontsize=8)
    ax.grid(color="#BBBBBB", linewidth=0.4, zorder=2)
    ax.set_title(f"{title}, {100 * shown.area / (4.0 * math.pi):.0f} %", fontsize=10, color=INK)
    ax.spines[["top", "right"]].set_visible(False)


def _draw_loads(ax: Axes, hand: HandModel, reach: Reach, loads: PairLoads, is_first: bool) -> None:
    i, j = loads.fingers
    ok, phi = loads.is_admissible, np.degrees(loads.angle)
    low = math.degrees(reach.phi_min) - BELOW_DEG
    ax.axvspan(low, math.degrees(reach.phi_min), color="#F0F0F0", linewidth=0.0, zorder=0)
    ax.axvline(math.degrees(reach.phi_min), color=INK, linewidth=1.0, linestyle="--", zorder=1)
    ax.text(low + 0.6, 0.97, "cones miss", rotation=90, fontsize=9, va="top", color=INK, zorder=2)
    ax.axhline(hand.limits.torque_share, color=ALARM, linewidth=1.0, linestyle=":", zorder=1)
    # Torques depend on where a pair stands, not on its angle alone; a little sideways shift tells placements apart.
    shift = np.random.default_rng(0).uniform(-0.8, 0.8, len(phi))
    ax.plot(
        phi[ok], loads.load[ok], marker="o", linestyle="", markersize=8, zorder=3,
        color=get_finger_color(i), markeredgecolor=get_finger_color(j), markeredgewidth=2.4,
    )  # fmt: skip
    ax.plot(
        (phi + shift)[ok], loads.torque[ok], marker=".", linestyle="", markersize=5, color=ALARM, zorder=2
    )
    ax.plot(
        (phi + shift)[~ok], np.full((~ok).sum(), -0.05), marker="x", linestyle="", markersize=5,
        color="#777777", zorder=3,
    )  # fmt: skip
    if ok.any():
        smallest = float(phi[ok].min())
        ax.annotate(
            f"admissible from {smallest:.0f}°",
            (smallest, 0.0),
            xytext=(smallest + 3.0, -0.05),
            fontsize=9,
            ha="left",
            va="center",
            color=INK,
            zorder=5,
        )
    ax.set_xlim(low, 182.0)
    ax.set_ylim(-0.1, 1.0)
    ax.set_title(f"fingers {i + 1} and {j + 1}: {ok.sum()} of {len(ok)} placements admissible", fontsize=10)
    ax.set_xlabel("angle between the two contacts", fontsize=9)
    ax.xaxis.set_major_formatter("{x:.0f}°")
    ax.tick_params(labelsize=8, labelleft=is_first)
    if is_first:
        ax.set_ylabel("share [–]", fontsize=9)
    ax.grid(color="#DDDDDD", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _write_headings(figure: Figure, hand: HandModel, reach: Reach, split: float) -> None:
    height = figure.get_figheight()
    figure.text(
        0.05, 1.0 - 0.30 / height, "What the hand can do here", fontsize=16, weight="bold", va="center"
    )
    figure.text(
        0.05,
        1.0 - 0.60 / height,
        "Regions on the object at home, azimuth across and elevation up, as shares of its surface.  "
        "Holes: joint limits, and postures in which the finger could not move every way.",
        fontsize=10.5,
        va="center",
    )
    radius = 1e3 * float(np.linalg.norm(hand.object.surface.radial(np.array([1.0, 0.0, 0.0]))))
    figure.text(
        0.05,
        split,
        f"Load per pair: a {1e3 * hand.object.mass:.0f} g object of {radius:.0f} mm held by two fingers on its equator, "
        f"believed friction {hand.friction.sliding:.2f} and {1e3 * hand.friction.torsional:.1f} mm; "
        f"force closure from {math.degrees(reach.phi_min):.1f}°",
        fontsize=10.5,
        va="center",
    )
    bases = [
        Line2D([], [], marker="o", linestyle="", color=get_finger_color(k), label=f"place of finger {k + 1}")
        for k in range(len(hand.fingers))
    ]
    keys = [
        *bases,
        Patch(facecolor="white", edgecolor=INK, label="can touch (outline)"),
        Patch(facecolor="white", edgecolor=INK, hatch="////", label="FC: a partner may touch here"),
    ]
    figure.legend(
        handles=keys, loc="center right", bbox_to_anchor=(0.99, 1.0 - 0.30 / height), ncols=len(keys),
        frameon=False, fontsize=9, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip
    marks = [
        Line2D(
            [],
            [],
            marker="o",
            linestyle="",
            color="white",
            markeredgecolor=INK,
            label="load margin, admissible",
        ),
        Line2D([], [], marker=".", linestyle="", color=ALARM, label="largest torque share; dotted: limit"),
        Line2D([], [], marker="x", linestyle="", color="#777777", label="refused"),
    ]
    figure.legend(
        handles=marks, loc="center right", bbox_to_anchor=(0.99, split - 0.22 / height), ncols=3,
        frameon=False, fontsize=9, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip
