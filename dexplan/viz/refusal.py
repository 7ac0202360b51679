"""One picture per refusal: what each finger can touch and what was asked of it, and whether friction cones meet.

Upper rows: the object's surface unrolled, azimuth across and elevation up, at the start, at the goal, or both, as the refusal is
about one of them.  Lower row: a section through every two contacts; two fingers hold alone where the line between their contacts
lies inside both friction cones.
"""

from __future__ import annotations

import os
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dexplan.builders import build_hand, build_scene
from dexplan.contact.bodies.smooth import BallBody
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.regions.regions import Regions, compute_regions
from dexplan.planning.regions.spherical import SphericalRegion
from dexplan.plans.plan import Plan
from dexplan.plans.status import Status
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.spatial import Array, angles_from_direction, direction_from_angles
from dexplan.viz.canvas import write_picture
from dexplan.viz.palette import ALARM, INK, get_finger_color, tint
from dexplan.viz.sections import Asked, draw_section, find_sections
from dexplan.viz.site_refusal import draw_landings, draw_site_section, find_site_sections, list_keys

PIXEL_DEG = 1.5
WIDTH = 14.0
MAP_HEIGHT, SECTION_HEIGHT, HEADING, LINE = 2.1, 3.6, 1.45, 0.17
"""Heights of a row of maps, of the row of sections, of the heading, and of each line of the reason in it [in]."""
MOST_LINES, LINE_LENGTH = 6, 165
"""How much of the reason the heading has room for: lines, and characters in one."""
CLOSURE = "Two fingers hold alone where the line between their contacts lies inside both friction cones."
BALL_WORDS = "What each finger can touch with the pole of its tip: the object's surface unrolled, azimuth across and elevation up"
BODY_WORDS = (
    "Where each finger can land with the pole of its tip, on places all over the object, none beside an edge"
)
"""What the upper rows show."""
ABOUT_START = frozenset(
    {
        Status.OBJECT_TOO_LIGHT,
        Status.BLOCKED,
        Status.START_UNREACHABLE,
        Status.START_NOT_ALLOWED,
        Status.START_INADMISSIBLE,
        Status.NO_ADMISSIBLE_PAIR,
        Status.NO_FORCE_CLOSURE_PAIR,
    }
)
ABOUT_GOAL = frozenset(
    {
        Status.GOAL_UNREACHABLE,
        Status.GOAL_NOT_ALLOWED,
        Status.GOAL_CONTACTS_UNREACHABLE,
        Status.GOAL_GRASP_INADMISSIBLE,
    }
)
"""Refusals that are about one end; any other is about the way between them, and both are shown."""


@dataclass(frozen=True)
class _Stage:
    """A pose ``X_WO`` (4, 4) of the object that is shown: its name, and the contacts asked for (None: left to the planner)."""

    name: str
    X_WO: Array
    asked: Asked | None


def draw_refused_problem(problem: Problem, plan: Plan, path: str | os.PathLike[str]) -> Path:
    """Write the picture of why ``plan`` refuses ``problem``; return its path.  See :func:`draw_refusal`."""
    start, goal = problem.start.contacts_deg, problem.goal.contacts_deg
    hand = build_hand(problem, build_scene(problem))
    asked: list[Asked | None] = [
        None if given is None or isinstance(given, str) else compute_contact_directions(given)
        for given in (start, goal)
    ]
    if not isinstance(hand.object.body, BallBody):
        radial = hand.object.body.radial
        asked = [None if a is None else tuple(None if d is None else radial(d) for d in a) for a in asked]
    return draw_refusal(hand, plan, asked[0], asked[1], path, problem.name)


def draw_refusal(
    hand: HandModel,
    plan: Plan,
    start: Asked | None,
    goal: Asked | None,
    path: str | os.PathLike[str],
    name: str = "",
) -> Path:
    """Write what ``hand`` can reach and hold of what was asked as a PNG, 1400 pixels wide, whole or not at all; return its path.

    ``start`` and ``goal`` are the contacts that the problem asks for, None where it leaves them to the planner or names none: on
    a ball outward normals, on any other body points [m], in object axes.
    """
    stages, reason = _choose_stages(plan, start, goal), _fold(plan.reason)
    if isinstance(hand.object.body, BallBody):
        figure = _draw_on_ball(hand, stages, HEADING + LINE * len(reason))
        what, keys = BALL_WORDS, _list_keys()
    else:
        figure = _draw_on_body(hand, stages, HEADING + LINE * len(reason))
        what, keys = BODY_WORDS, list_keys()
    _write_heading(figure, plan, reason, name)
    _write_keys(figure, 0.62 + LINE * len(reason), what, keys)
    return write_picture(FigureCanvasAgg(figure), path)


def _draw_on_body(hand: HandModel, stages: list[_Stage], heading: float) -> Figure:
    """Return the figure of where fingers land on a body, and of the pairs of contacts asked for."""
    # The last pose at which contacts were asked for: a problem may name those of its start alone.
    last = next((stage for stage in reversed(stages) if stage.asked is not None), stages[-1])
    sections = [] if last.asked is None else find_site_sections(hand, last.asked)
    top = MAP_HEIGHT * len(stages) + (SECTION_HEIGHT if sections else 0.0)
    height = heading + top
    figure = Figure(figsize=(WIDTH, height), dpi=100, facecolor="white")
    for stage in stages:
        place = np.array([0.03, (top - MAP_HEIGHT + 0.1) / height, 0.96, (MAP_HEIGHT - 0.1) / height])
        draw_landings(figure, hand, stage.X_WO, stage.asked, place)
        middle = (top - 0.5 * MAP_HEIGHT) / height
        figure.text(0.012, middle, stage.name, rotation=90, fontsize=11, va="center")
        top -= MAP_HEIGHT
    if sections:
        where: dict[str, Any] = {
            "left": 0.02,
            "right": 0.985,
            "top": (top - 0.9) / height,
            "bottom": 0.1 / height,
        }
        grid = figure.add_gridspec(1, len(sections), wspace=0.05, **where)
        for k, section in enumerate(sections):
            draw_site_section(figure.add_subplot(grid[0, k]), hand, section)
        words = (
            f"{CLOSURE}\nLooked at across the line between the contacts asked for, {last.name}, to scale; "
        )
        words += f"believed friction {hand.friction.sliding:.2f}"
        figure.text(0.02, (top - 0.02) / height, words, fontsize=10.5, va="top", linespacing=1.5)
    return figure


def _draw_on_ball(hand: HandModel, stages: list[_Stage], heading: float) -> Figure:
    """Return the figure of the regions on a ball, and of sections through every two contacts."""
    count, last, allowed = len(hand.fingers), stages[-1], hand.object.allowed_regions
    regions = [compute_regions(hand, stage.X_WO, allowed=allowed) for stage in stages]
    sections = find_sections(hand, regions[-1], last.asked)
    top = MAP_HEIGHT * len(stages) + (SECTION_HEIGHT if sections else 0.0)
    height = heading + top
    figure = Figure(figsize=(WIDTH, height), dpi=100, facecolor="white")
    for stage, known in zip(stages, regions, strict=True):
        lower = top - MAP_HEIGHT + 0.62
        place: dict[str, Any] = {"left": 0.075, "right": 0.985, "top": top / height, "bottom": lower / height}
        grid = figure.add_gridspec(1, count, wspace=0.1, **place)
        for finger in range(count):
            _draw_map(figure.add_subplot(grid[0, finger]), hand, known, stage.asked or (), finger)
        figure.text(0.012, 0.5 * (top + lower) / height, stage.name, rotation=90, fontsize=11, va="center")
        top -= MAP_HEIGHT
    if sections:
        place = {"left": 0.02, "right": 0.985, "top": (top - 0.9) / height, "bottom": 0.1 / height}
        grid = figure.add_gridspec(1, len(sections), wspace=0.05, **place)
        for k, section in enumerate(sections):
            draw_section(figure.add_subplot(grid[0, k]), hand, section)
        is_asked = last.asked is not None
        what = "the contacts asked for" if is_asked else "their widest reachable contacts"
        words = f"{CLOSURE}\nSection through {what}, {last.name}, to scale; believed friction {hand.friction.sliding:.2f}: "
        words += sections[0].rule
        figure.text(0.02, (top - 0.02) / height, words, fontsize=10.5, va="top", linespacing=1.5)
    return figure


def _choose_stages(plan: Plan, start: Asked | None, goal: Asked | None) -> list[_Stage]:
    stages = []
    if plan.status not in ABOUT_GOAL:
        stages.append(_Stage("at the start", plan.X_WO_start, start))
    if plan.status not in ABOUT_START:
        stages.append(_Stage("at the goal", plan.X_WO_goal, goal))
    return stages


def _draw_map(ax: Axes, hand: HandModel, regions: Regions, asked: Asked, finger: int) -> None:
    """Draw what one finger can touch, and where it and the others are asked to; the finger's own azimuth is in the middle."""
    region, R_WO = regions.contactable[finger], regions.X_WO[:3, :3]
    home = hand.p_WF_home[finger] - hand.object.X_WO_home[:3, 3]
    middle = float(angles_from_direction(home / np.linalg.norm(home))[0])
    azimuth = np.arange(-180.0 + PIXEL_DEG / 2, 180.0, PIXEL_DEG)
    elevation = np.arange(-90.0 + PIXEL_DEG / 2, 90.0, PIXEL_DEG)
    # Rows times R_WO: from world axes, in which the map is drawn, into the object's.
    grid_O = direction_from_angles(*np.meshgrid(azimuth + middle, elevation)) @ R_WO
    if region.is_empty:
        look: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontsize": 11,
            "color": ALARM,
            "weight": "bold",
        }
        ax.text(0.0, 0.0, "reaches nothing here", **look)
    else:
        margin = region.estimate_margin(grid_O)
        ax.contourf(
            azimuth, elevation, margin, [0.0, 10.0], colors=[tint(get_finger_color(finger))], zorder=1
        )
        ax.contour(azimuth, elevation, margin, [0.0], colors=[INK], linewidths=0.8, zorder=2)
    for other, normal in enumerate(asked):
        if normal is None:
            continue
        place = angles_from_direction(R_WO @ normal)
        x, y = _wrap(float(place[0]) - middle), float(place[1])
        if other == finger:
            _mark_own(ax, region, normal, x, y)
        else:
            ax.plot([x], [y], marker="o", markersize=5, color=get_finger_color(other), alpha=0.6, zorder=3)
    ax.set_xlim(-180.0, 180.0)
    ax.set_ylim(-90.0, 90.0)
    ticks = np.arange(-120.0, 121.0, 60.0)
    ax.set_xticks(ticks, [f"{round(_wrap(t + middle))}°" for t in ticks.tolist()], fontsize=8)
    ax.set_yticks([-60, 0, 60], ["-60°", "0°", "60°"], fontsize=8)
    ax.grid(color="#CCCCCC", linewidth=0.4, zorder=0)
    share = 100.0 * region.area / (4.0 * np.pi)
    ax.set_title(f"finger {finger + 1} can touch {share:.0f} % of the object", fontsize=10, color=INK)


def _mark_own(ax: Axes, region: SphericalRegion, normal: Array, x: float, y: float) -> None:
    """Mark the contact asked of a finger: a dot inside its region, a cross and how far it is outside."""
    if region.contains(normal[None])[0]:
        ax.plot([x], [y], marker="o", markersize=11, color=INK, markeredgecolor="white", zorder=4)
        return
    ax.plot([x], [y], marker="X", markersize=13, color=ALARM, markeredgecolor="white", zorder=4)
    nearest = region.find_nearest(normal)
    if nearest is None:
        return
    side = "left" if x < -100 else "right" if x > 100 else "center"
    look: dict[str, Any] = {"color": ALARM, "weight": "bold", "fontsize": 9, "ha": side, "zorder": 5}
    ax.annotate(
        f"out of reach by {np.degrees(nearest[1]):.0f}°",
        (x, y),
        xytext=({"left": -8, "right": 8, "center": 0}[side], 11 if y < 50 else -18),
        textcoords="offset points",
        annotation_clip=False,
        bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 0.8},
        **look,
    )


def _wrap(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0


def _fold(reason: str) -> list[str]:
    """Return a reason in lines, the last one cut where there are too many."""
    lines = textwrap.wrap(" ".join(reason.split()), LINE_LENGTH)
    return (
        lines if len(lines) <= MOST_LINES else [*lines[: MOST_LINES - 1], f"{lines[MOST_LINES - 1][:-2]} …"]
    )


def _write_heading(figure: Figure, plan: Plan, reason: list[str], name: str) -> None:
    height = figure.get_figheight()

    def write(words: str, inches: float, size: float, color: str = INK, weight: str = "normal") -> None:
        look: dict[str, Any] = {
            "fontsize": size,
            "color": color,
            "weight": weight,
            "va": "top",
            "parse_math": False,
        }
        figure.text(0.02, 1.0 - inches / height, words, **look)

    title = f"{name}: refused, {plan.status}" if name else f"refused, {plan.status}"
    write(title if len(title) <= 95 else f"{title[:94]}…", 0.15, 16, ALARM, "bold")
    write("\n".join(reason), 0.48, 10.5)


def _write_keys(figure: Figure, below: float, words: str, keys: list[Patch | Line2D]) -> None:
    """Write, so far below the top [in], what the upper rows show, and what their marks mean."""
    height = figure.get_figheight()
    figure.text(0.02, 1.0 - below / height, words, fontsize=10.5, color=INK, va="top")
    figure.legend(
        handles=keys,
        loc="center left",
        bbox_to_anchor=(0.01, 1.0 - (below + 0.36) / height),
        ncols=len(keys),
        frameon=False,
        fontsize=9.5,
    )


def _list_keys() -> list[Patch | Line2D]:
    dot: dict[str, Any] = {"marker": "o", "linestyle": ""}
    cross: dict[str, Any] = {"marker": "X", "linestyle": ""}
    return [
        Patch(facecolor="#BBBBBB", edgecolor=INK, label="can touch"),
        Line2D([], [], color=INK, markersize=9, label="contact asked of it", **dot),
        Line2D([], [], color=ALARM, markersize=10, label="asked of it, out of reach", **cross),
        Line2D([], [], color="#888888", markersize=5, label="contacts of the others", **dot),
    ]
