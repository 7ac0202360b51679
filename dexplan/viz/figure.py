"""One picture per run: who held when, how hard, how near to slipping, and where the object went."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dexplan.plans.plan import Plan
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.spatial import Array
from dexplan.viz.canvas import write_picture
from dexplan.viz.curves import Curves, compute_curves
from dexplan.viz.palette import ACTION_SHADES, ALARM, INK, OTHER_SHADE, get_finger_color
from dexplan.viz.timeline import GaitRow, Span, build_action_spans, build_gait_rows

UTILISATION_LIMIT = 0.9
"""Where the summary draws the line when the problem names none."""
LEAST_LABEL_SHARE = 0.018
"""An action shorter than this share of the run gets no number."""
LEAST_ERROR = 0.01
"""The axes of errors reach at least this far [mm], [deg]."""
LEAST_LIMIT_SHARE = 0.06
"""An action shorter than this share of the run has no room for the name of its limit."""


def draw_summary(
    problem: Mapping[str, Any] | None,
    plan: Plan,
    trace: Trace,
    report: ValidationReport | None,
    path: str | os.PathLike[str],
) -> Path:
    """Write the summary of a run as a PNG of 1400 x 1200 pixels, whole or not at all; return its path.

    ``problem`` is the data of ``problem.toml``; without it frictions are read from the trace's model.
    """
    curves = compute_curves(problem, plan, trace)
    spans = build_action_spans(trace)
    figure = Figure(figsize=(14.0, 12.0), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        5,
        1,
        height_ratios=[1.5, 1.5, 1.2, 1.2, 1.0],
        hspace=0.16,
        left=0.07,
        right=0.93,
        top=0.88,
        bottom=0.05,
    )
    gait = figure.add_subplot(grid[0])
    axes = [gait, *(figure.add_subplot(grid[k], sharex=gait) for k in range(1, 5))]
    for ax in axes:
        _shade_actions(ax, plan, spans)
        ax.tick_params(labelbottom=ax is axes[-1])
        ax.spines[["top", "right"]].set_visible(False)
        ax.set_axisbelow(True)
        ax.grid(axis="y", color="#DDDDDD", linewidth=0.6)
    rows = build_gait_rows(trace)
    _draw_gait(axes[0], plan, rows, spans)
    _draw_forces(axes[1], curves, rows)
    _draw_utilisation(axes[2], curves, _read_limit(problem))
    _draw_errors(axes[3], curves)
    _draw_turn(axes[4], curves)
    _write_heading(figure, problem, plan, trace, report)
    _draw_keys(figure, plan, rows, has_planned="contact_force_reference" in trace)
    return write_picture(canvas, path)


def _read_limit(problem: Mapping[str, Any] | None) -> float:
    acceptance = {} if problem is None else problem.get("acceptance", {})
    return float(acceptance.get("friction_utilisation_max", UTILISATION_LIMIT))


def _shade_actions(ax: Axes, plan: Plan, spans: tuple[Span, ...]) -> None:
    for span in spans:
        ax.axvspan(span.start, span.end, color=_shade(plan, span), linewidth=0.0, zorder=0)


def _shade(plan: Plan, span: Span) -> str:
    if not 0 <= span.action_index < len(plan.actions):
        return OTHER_SHADE
    return ACTION_SHADES.get(plan.actions[span.action_index].name, OTHER_SHADE)


def _draw_gait(ax: Axes, plan: Plan, rows: tuple[GaitRow, ...], spans: tuple[Span, ...]) -> None:
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
        if span.end - span.start >= LEAST_LABEL_SHARE * length:
            middle = 0.5 * (span.start + span.end)
            ax.annotate(
                str(span.action_index + 1),
                (middle, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 2),
                textcoords="offset points",
                ha="center",
                fontsize=9,
            )
        if action.limiting_finger is not None:
            mark: dict[str, Any] = {"marker": "X", "markersize": 9, "markeredgecolor": "white"}
            ax.plot([span.end], [action.limiting_finger], color=INK, zorder=4, clip_on=False, **mark)
            if action.limit and span.end - span.start >= LEAST_LIMIT_SHARE * length:
                _write_limit(ax, action.limit, span.end, action.limiting_finger)
    ax.set_yticks(range(len(rows)), [row.finger for row in rows])
    for k, label in enumerate(ax.get_yticklabels()):
        label.set_color(get_finger_color(k))
    ax.set_ylim(len(rows) - 0.5, -0.5)
    if spans:
        ax.set_xlim(spans[0].start, max(spans[-1].end, spans[0].start + 1e-3))


def _write_limit(ax: Axes, limit: str, time: float, row: int) -> None:
    ax.annotate(
        limit.replace("_", " "),
        (time, row),
        xytext=(-7, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize=8,
        color=INK,
        zorder=5,
        parse_math=False,
        bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.0},
    )


def _draw_forces(ax: Axes, curves: Curves, rows: tuple[GaitRow, ...]) -> None:
    for k in range(len(rows)):
        color = get_finger_color(k)
        ax.plot(curves.time, curves.normal_force[:, k], color=color, linewidth=_width(k), zorder=3)
        ax.plot(
            curves.time,
            curves.normal_force_reference[:, k],
            color=INK,
            linewidth=0.9,
            linestyle=":",
            zorder=4,
        )
    ax.set_ylabel("normal force [N]")
    known = curves.normal_force_reference[np.isfinite(curves.normal_force_reference)]
    known = known if len(known) else curves.normal_force[np.isfinite(curves.normal_force)]
    # Touch-down peaks last a sample or two; the curves matter.
    ax.set_ylim(0.0, 1.35 * float(np.max(known, initial=1.0)))


def _width(finger: int) -> float:
    # Later fingers are drawn over earlier ones, thinner, so that equal curves can be told.
    return max(2.6 - 0.7 * finger, 0.8)


def _draw_utilisation(ax: Axes, curves: Curves, limit: float) -> None:
    for k in range(curves.utilisation.shape[1]):
        ax.plot(
            curves.time,
            np.minimum(curves.utilisation[:, k], 1.15),
            color=get_finger_color(k),
            linewidth=_width(k),
        )
    ax.axhline(limit, color=INK, linewidth=0.9, linestyle="--")
    ax.axhline(1.0, color=ALARM, linewidth=1.2)
    ends: dict[str, Any] = {
        "xycoords": ("axes fraction", "data"),
        "textcoords": "offset points",
        "fontsize": 9,
        "va": "center",
    }
    ax.annotate(f"limit {limit:g}", (1.0, limit), xytext=(4, -3), **ends)
    ax.annotate("slides", (1.0, 1.0), xytext=(4, 4), color=ALARM, **ends)
    ax.set_ylim(0.0, 1.15)
    ax.set_ylabel("friction used [–]")


def _draw_errors(ax: Axes, curves: Curves) -> None:
    ax.plot(curves.time, curves.position_error_mm, color=INK, linewidth=1.2)
    ax.set_ylabel("position error [mm]")
    ax.set_ylim(0.0, _find_top(curves.position_error_mm))
    right = ax.twinx()
    right.plot(curves.time, curves.rotation_error_deg, color=ALARM, linewidth=1.2, linestyle="--")
    right.set_ylabel("rotation error [°]", color=ALARM)
    right.tick_params(axis="y", colors=ALARM)
    right.tick_params(labelbottom=False)
    right.set_ylim(0.0, _find_top(curves.rotation_error_deg))
    right.spines[["top"]].set_visible(False)


def _find_top(errors: Array) -> float:
    """Return where an axis of errors ends; rounding errors are not blown up to fill it."""
    return 1.08 * float(np.max(errors[np.isfinite(errors)], initial=LEAST_ERROR))


def _draw_turn(ax: Axes, curves: Curves) -> None:
    ax.plot(curves.time, curves.turned_deg, color=INK, linewidth=1.6, label="measured")
    ax.plot(
        curves.time,
        curves.turned_reference_deg,
        color=ALARM,
        linewidth=1.0,
        linestyle="--",
        label="reference",
    )
    ax.set_ylabel("turned [°]")
    ax.set_xlabel("time [s]")
    ax.legend(loc="upper left", frameon=False, fontsize=9, ncols=2)


def _write_heading(
    figure: Figure,
    problem: Mapping[str, Any] | None,
    plan: Plan,
    trace: Trace,
    report: ValidationReport | None,
) -> None:
    name = "run" if problem is None else str(problem.get("name", "run"))
    goal = plan.goal_kind.replace("_", " ")
    turn = "" if plan.turned_angle is None else f", {np.degrees(plan.turned_angle):+.0f}°"
    figure.text(
        0.07, 0.979, f"{name}: {goal}{turn}", fontsize=16, weight="bold", va="center", parse_math=False
    )
    failure = trace.meta.get("failure")
    if report is not None:
        line = report.verdict_line()
    else:
        line = "not judged yet" if failure is None else f"not judged yet; {failure}"
    is_bad = failure is not None or (report is not None and not report.is_passed)
    color = ALARM if is_bad else INK
    figure.text(0.07, 0.955, _cut(line, 150), fontsize=11, color=color, va="center", parse_math=False)
    for k, line in enumerate(() if report is None else _fit(report.reservations)):
        place = 0.938 - 0.013 * k
        figure.text(0.07, place, line, fontsize=9, color=ALARM, va="center", parse_math=False)


def _fit(lines: tuple[str, ...]) -> list[str]:
    """Return ``lines`` as the two that there is room for above the legend: as they are, or one after the other."""
    if len(lines) <= 2:
        return [_cut(line, 190) for line in lines]
    return textwrap.wrap("; ".join(lines), 190, max_lines=2, placeholder=" …")


def _cut(line: str, length: int) -> str:
    return line if len(line) <= length else line[: length - 1] + "…"


def _draw_keys(figure: Figure, plan: Plan, rows: tuple[GaitRow, ...], has_planned: bool) -> None:
    actions = [Patch(facecolor=shade, label=kind) for kind, shade in ACTION_SHADES.items()]
    fingers = [
        Line2D([], [], color=get_finger_color(k), lw=4, label=row.finger) for k, row in enumerate(rows)
    ]
    others: list[Line2D | Patch] = [
        Line2D([], [], color=INK, marker="X", linestyle="", markersize=8, label="limiting finger"),
    ]
    if has_planned:
        others.append(Line2D([], [], color=INK, linestyle=":", label="planned force"))
    if any(action.rolls for action in plan.actions):
        others.append(Patch(facecolor="#888888", edgecolor="white", hatch="////", label="rolls"))
    handles = [*fingers, *others, *actions]
    figure.legend(
        handles=handles,
        loc="center left",
        bbox_to_anchor=(0.065, 0.908),
        ncols=len(handles),
        frameon=False,
        fontsize=9.5,
        handlelength=1.6,
        columnspacing=1.4,
    )
