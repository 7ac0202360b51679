"""The panels of a run's summary: who holds, how hard, how near to slipping, how exactly, how far; and how near to each limit.

A pale thick line is what was planned, a thin dark one what was measured, in every panel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from dexplan.plans.actions import MoveObject, Roll
from dexplan.plans.plan import Plan
from dexplan.spatial import Array
from dexplan.viz.check_words import UsedLimit, spell, spell_limit
from dexplan.viz.curves import Curves, Flags
from dexplan.viz.palette import ALARM, BAND, GUIDE, INK, UNJUDGED, get_finger_color, get_finger_dash, tint
from dexplan.viz.timeline import GaitRow, Span

LEAST_NUMBER_SHARE = 0.009
"""An action shorter than this share of the run gets no number."""
LEAST_LABEL_SHARE = 0.014
"""An action shorter than this share of the run gets its number, and no word beside it."""
LEAST_LIMIT_SHARE = 0.09
"""An action shorter than this share of the run has no room for the name of its limit."""
LEAST_TIME_STEP = 1e-3
"""The axis of time is at least this long [s]."""
LEAST_SHARE_PCT = 0.1
"""Errors below this share of their limit [%] are not drawn."""
PLANNED_WIDTH, MEASURED_WIDTH = 5.0, 1.1


def style_panel(ax: Axes) -> None:
    """Give a panel the look that all share."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.set_axisbelow(True)
    ax.grid(axis="y", color="#DDDDDD", linewidth=0.6)
    ax.tick_params(labelsize=9)


def shade_actions(ax: Axes, spans: tuple[Span, ...]) -> None:
    """Draw a neutral band behind every second action, and a line where each begins."""
    for k, span in enumerate(spans):
        if k % 2:
            ax.axvspan(span.start, span.end, color=BAND, linewidth=0.0, zorder=0)
        if k:
            ax.axvline(span.start, color=GUIDE, linewidth=0.5, zorder=0.5)


def shade_unjudged(ax: Axes, curves: Curves) -> None:
    """Hatch the stretches that the judge leaves out in what this panel shows."""
    for start, end in find_stretches(curves.time, ~curves.is_quiet):
        ax.axvspan(start, end, facecolor=UNJUDGED, edgecolor="none", linewidth=0.0, zorder=0.6)


def find_stretches(time: Array, mask: Flags) -> list[tuple[float, float]]:
    """Return start and end [s] of every stretch in which ``mask`` (T,) is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    last = len(time) - 1
    return [(float(time[a]), float(time[min(b, last)])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def label_actions(ax: Axes, plan: Plan, spans: tuple[Span, ...]) -> None:
    """Write above a panel which action is where: its number, counted from 1, and what it does."""
    length = spans[-1].end - spans[0].start if spans else 0.0
    for span in spans:
        share = (span.end - span.start) / length if length else 0.0
        if share < LEAST_NUMBER_SHARE or not 0 <= span.action_index < len(plan.actions):
            continue
        words = f"{span.action_index + 1}"
        if share >= LEAST_LABEL_SHARE:
            words += f"  {describe_briefly(plan, span.action_index)}"
        ax.annotate(
            words,
            (0.5 * (span.start + span.end), 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 5),
            textcoords="offset points",
            ha="center",
            va="bottom",
            rotation=90,
            fontsize=9,
            parse_math=False,
        )


def describe_briefly(plan: Plan, action_index: int) -> str:
    """Return an action in two or three words: ``turn +76°``, ``place 3``, ``lift 1``, ``roll 2, 3``, ``hold``."""
    action = plan.actions[action_index]
    if isinstance(action, MoveObject):
        if abs(action.motion.angle) > 1e-4:
            return f"turn {np.degrees(action.motion.angle):+.0f}°"
        return f"shift {1e3 * float(np.linalg.norm(action.motion.shift_W)):.0f} mm"
    if isinstance(action, Roll):
        return f"roll {', '.join(str(roll.finger + 1) for roll in action.rolls)}"
    finger = getattr(action, "finger", None)
    return action.name if finger is None else f"{action.name} {finger + 1}"


def draw_gait(
    ax: Axes,
    plan: Plan,
    rows: tuple[GaitRow, ...],
    spans: tuple[Span, ...],
    arrivals: tuple[float | None, ...],
) -> None:
    """Draw a bar for every touch, hatched while the tip rolls, what ended each turn, and when goal contacts are reached."""
    for k, row in enumerate(rows):
        ax.axhline(k, color="#999999", linewidth=0.8, zorder=1)
        bars = [(start, end - start) for start, end in row.holding]
        ax.broken_barh(bars, (k - 0.3, 0.6), facecolors=get_finger_color(k), zorder=2)
    length = spans[-1].end - spans[0].start if spans else 0.0
    for span in spans:
        if not 0 <= span.action_index < len(plan.actions):
            continue
        action = plan.actions[span.action_index]
        for roll in action.rolls:
            bar: dict[str, Any] = {
                "facecolors": "none",
                "edgecolor": "white",
                "hatch": "////",
                "linewidth": 0.0,
            }
            ax.broken_barh([(span.start, span.end - span.start)], (roll.finger - 0.3, 0.6), zorder=3, **bar)
        if action.limiting_finger is not None and isinstance(action, MoveObject):
            mark: dict[str, Any] = {"marker": "X", "markersize": 9, "markeredgecolor": "white"}
            ax.plot([span.end], [action.limiting_finger], color=INK, zorder=4, clip_on=False, **mark)
            if action.limit and span.end - span.start >= LEAST_LIMIT_SHARE * length:
                words = f"stops: {action.limit.replace('_', ' ')}"
                _write_beside(ax, words, span.end, action.limiting_finger, -8)
    for finger, time in enumerate(arrivals):
        if time is not None:
            star: dict[str, Any] = {"marker": "*", "markersize": 15, "markeredgecolor": INK, "color": "white"}
            ax.plot([time], [finger], zorder=5, clip_on=False, **star)
    ax.set_yticks(range(len(rows)), [name_finger(k) for k in range(len(rows))])
    for k, label in enumerate(ax.get_yticklabels()):
        label.set_color(get_finger_color(k))
        label.set_fontweight("bold")
    ax.grid(visible=False)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    if spans:
        ax.set_xlim(spans[0].start, max(spans[-1].end, spans[0].start + LEAST_TIME_STEP))


def name_finger(finger: int) -> str:
    """Return what a finger is called in pictures, counted from 1."""
    return f"finger {finger + 1}"


def _write_beside(ax: Axes, words: str, time: float, row: float, offset: float) -> None:
    ax.annotate(
        words,
        (time, row),
        xytext=(offset, 0),
        textcoords="offset points",
        ha="right" if offset < 0 else "left",
        va="center",
        fontsize=8,
        color=INK,
        zorder=5,
        parse_math=False,
        bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.0},
    )


def draw_force(ax: Axes, curves: Curves, finger: int) -> None:
    """Draw one finger's normal force: planned as a wide pale line, measured as a thin dark one."""
    shade_unjudged(ax, curves)
    color = get_finger_color(finger)
    planned, measured = curves.normal_force_reference[:, finger], curves.normal_force[:, finger]
    ax.plot(curves.time, planned, color=tint(color), linewidth=PLANNED_WIDTH, zorder=3, solid_capstyle="butt")
    ax.plot(curves.time, measured, color=INK, linewidth=MEASURED_WIDTH, zorder=4)
    ax.set_ylabel(f"finger {finger + 1}\nforce [N]", fontsize=9, color=color)
    known = curves.normal_force_reference[np.isfinite(curves.normal_force_reference)]
    known = known if len(known) else curves.normal_force[np.isfinite(curves.normal_force)]
    # Touch-down peaks last a sample or two; the curves matter.
    ax.set_ylim(0.0, 1.2 * float(np.max(known, initial=1.0)))
    ax.locator_params(axis="y", nbins=4)


def draw_utilisation(ax: Axes, curves: Curves, limit: float) -> None:
    """Draw which share of the friction cone each contact uses, boldly where it is judged, against its limit."""
    shade_unjudged(ax, curves)
    worst: list[tuple[float, float, int]] = []
    for k in range(curves.utilisation.shape[1]):
        used = curves.utilisation[:, k]
        shown = np.minimum(used, 1.12)
        color, dash = get_finger_color(k), get_finger_dash(k)
        ax.plot(curves.time, shown, color=color, linewidth=0.7, alpha=0.7, zorder=2)
        judged = np.where(curves.is_quiet, used, np.nan)
        ax.plot(
            curves.time,
            np.where(curves.is_quiet, shown, np.nan),
            color=color,
            linewidth=2.2,
            dashes=dash,
            zorder=3,
        )
        if np.isfinite(judged).any():
            sample = int(np.nanargmax(judged))
            worst.append((float(judged[sample]), float(curves.time[sample]), k))
    draw_limit(ax, limit, f"limit {spell_limit(limit)}")
    ax.axhline(1.0, color=ALARM, linewidth=1.2)
    _label_right(ax, 1.0, "slides at 1", ALARM, 5)
    if worst:
        value, time, finger = max(worst)
        ax.plot(
            [time], [min(value, 1.12)], marker="o", markersize=9, markerfacecolor="none", color=INK, zorder=5
        )
        _write_beside(ax, f"most: {spell(value)}, finger {finger + 1}", time, min(value, 1.12) - 0.14, 8)
    ax.set_ylim(0.0, 1.12)
    ax.set_ylabel("share of\nfriction used", fontsize=9)


def draw_limit(ax: Axes, limit: float, words: str) -> None:
    """Draw the line of a limit, its name at the right."""
    ax.axhline(limit, color=INK, linewidth=1.0, linestyle="--", zorder=4)
    _label_right(ax, limit, words, INK, -2)


def _label_right(ax: Axes, value: float, words: str, color: str, offset: float) -> None:
    ax.annotate(
        words,
        (1.0, value),
        xycoords=("axes fraction", "data"),
        xytext=(6, offset),
        textcoords="offset points",
        fontsize=9,
        va="center",
        color=color,
        parse_math=False,
        annotation_clip=False,
    )


def draw_errors(ax: Axes, curves: Curves, position_limit: float, rotation_limit: float) -> None:
    """Draw the errors of position and attitude as shares of their limits, on a scale that shows both."""
    lines = (
        (curves.position_error_mm, position_limit, "position", "mm", INK, (None, None)),
        (curves.rotation_error_deg, rotation_limit, "attitude", "deg", ALARM, (4, 1.5)),
    )
    ax.set_yscale("log")
    for k, (error, limit, name, unit, color, dash) in enumerate(lines):
        share = 100.0 * error / limit if limit else np.full_like(error, np.nan)
        worst = float(np.max(error[np.isfinite(error)], initial=0.0))
        ax.plot(
            curves.time, np.maximum(share, 0.5 * LEAST_SHARE_PCT), color=color, linewidth=1.3, dashes=dash
        )
        words = f"{name}: largest\n{spell(worst, unit)}, limit {spell_limit(limit, unit)}"
        ax.annotate(
            words, (1.0, 0.62 - 0.42 * k), xycoords="axes fraction", xytext=(6, 0), textcoords="offset points",
            fontsize=9, va="center", color=color, annotation_clip=False,
        )  # fmt: skip
    ax.axhline(100.0, color=INK, linewidth=1.0, linestyle="--")
    finite = [e[np.isfinite(e)] / max(limit, 1e-12) for e, limit, *_ in lines]
    top = max(200.0, 150.0 * max(float(np.max(share, initial=0.0)) for share in finite))
    ax.set_ylim(LEAST_SHARE_PCT, top)
    ticks = {0.1: "0.1 %", 1.0: "1 %", 10.0: "10 %", 100.0: "limit"}
    ax.set_yticks(list(ticks), list(ticks.values()))
    ax.minorticks_off()
    ax.set_ylabel("error of the object\n(share of limit)", fontsize=9)


def draw_goals(
    ax: Axes, curves: Curves, plan: Plan, limit: float, arrivals: tuple[float | None, ...]
) -> None:
    """Draw how far each contact is from its goal contact, and when it comes there to stay."""
    shown = [k for k, contact in enumerate(plan.goal_contacts or ()) if contact is not None]
    ax.set_yscale("log")
    least, most = 0.05, 180.0
    for k in shown:
        off = np.maximum(curves.goal_error[:, k], least)
        ax.plot(
            curves.time, off, color=get_finger_color(k), linewidth=2.2, dashes=get_finger_dash(k), zorder=3
        )
        time = arrivals[k] if k < len(arrivals) else None
        if time is not None:
            ax.plot([time], [limit], marker="*", markersize=14, color="white", markeredgecolor=INK, zorder=5)
    if np.isfinite(limit):
        draw_limit(ax, limit, f"limit {spell_limit(limit, curves.goal_unit)}")
    ax.set_ylim(least, most)
    ticks = [0.1, 1.0, 10.0, 100.0]
    ax.set_yticks(ticks, [spell_limit(tick, curves.goal_unit) for tick in ticks])
    ax.minorticks_off()
    ax.set_ylabel("contact to\nits goal", fontsize=9)


def draw_progress(
    ax: Axes, time: Array, measured: Array, planned: Array, goal: float | None, unit: str
) -> None:
    """Draw how far the object has come: planned wide and pale, measured thin and dark, the goal as a line."""
    ax.plot(time, planned, color=tint("#777777"), linewidth=PLANNED_WIDTH, solid_capstyle="butt", zorder=2)
    ax.plot(time, measured, color=INK, linewidth=1.3, zorder=3)
    finite = measured[np.isfinite(measured)]
    if goal is not None:
        ax.axhline(goal, color=INK, linewidth=1.0, linestyle="--")
        _label_right(ax, goal, f"goal {spell(goal, unit)}", INK, 0)
    ends = [
        0.0,
        *([goal] if goal is not None else []),
        float(finite.min(initial=0.0)),
        float(finite.max(initial=0.0)),
    ]
    room = 0.08 * max(max(ends) - min(ends), 1e-3)
    ax.set_ylim(min(ends) - room, max(ends) + room)


def draw_used_limits(ax: Axes, used: tuple[UsedLimit, ...]) -> None:
    """Draw a bar per check: how much of its limit it used, the value and the limit beside it."""
    for row, item in enumerate(used):
        share = min(item.share, 1.15)
        color = ALARM if item.is_failed else "#8A8A8A"
        ax.barh(
            row, share, height=0.62, color=color, hatch="////" if item.is_failed else "", edgecolor="white"
        )
        words = f"{item}" + ("  ✗ fails" if item.is_failed else "")
        ax.text(
            max(share, 0.0) + 0.008, row, words, va="center", fontsize=9, color=INK, parse_math=False,
            weight="bold" if item.is_failed else "normal",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )  # fmt: skip
    ax.axvline(1.0, color=INK, linewidth=1.0, linestyle="--")
    ax.set_yticks(range(len(used)), [item.title for item in used], fontsize=9)
    ax.set_ylim(len(used) - 0.4, -0.6)
    ax.set_xlim(0.0, 1.3)
    ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "25 %", "50 %", "75 %", "limit"])
    ax.grid(visible=False)
    ax.grid(axis="x", color="#DDDDDD", linewidth=0.6)
    ax.set_title("Nearest to their limits: how much of its limit each check used", fontsize=10, loc="left")
