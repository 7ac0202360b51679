"""One picture per run: who held when, how hard, how near to slipping, how exactly, and how near to each limit."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.spatial.transform import Rotation

from dexplan.plans.plan import Plan
from dexplan.sim.judge.report import HEADLINES
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.viz import summary_panels as panels
from dexplan.viz.canvas import write_picture
from dexplan.viz.check_words import FAILED, describe_check, list_used_limits, spell, spell_beside, spell_limit
from dexplan.viz.curves import Curves, compute_curves, find_arrivals, read_limit
from dexplan.viz.palette import ALARM, INK, UNJUDGED, tint
from dexplan.viz.timeline import build_action_spans, build_gait_rows

WIDTH = 14.0
"""Of the picture, in inches of 100 pixels."""
TOP, BETWEEN, BELOW = 2.3, 0.22, 0.35
"""Room above the first panel for the heading and the actions' names, between panels, and below the last one [in]."""
LINE, KEYS = 0.16, 1.08
"""Height of what is said beside the verdict, a line of it, and from the keys down to the first panel [in]."""
LINE_LENGTH = 190
"""Characters in a line of what is said beside the verdict."""
MOST_BARS = 9
"""How many checks the summary compares with their limits."""
LEAST_SHIFT = 1e-4
"""A goal nearer than this to the start [m] asks for no shift."""


@dataclass(frozen=True)
class _Panel:
    """A panel of the summary: what it shows, its height [in]."""

    kind: str
    height: float
    finger: int = 0


def draw_summary(
    problem: Mapping[str, Any] | None,
    plan: Plan,
    trace: Trace,
    report: ValidationReport | None,
    path: str | os.PathLike[str],
) -> Path:
    """Write the summary of a run as a PNG, 1400 pixels wide, whole or not at all; return its path.

    ``problem`` is the data of ``problem.toml``, whose limits are drawn; without it those of the package are.
    """
    curves = compute_curves(problem, plan, trace)
    spans, rows = build_action_spans(trace), build_gait_rows(trace)
    goal_limit = read_limit(problem, f"contact_error_final_{curves.goal_unit}")
    arrivals = find_arrivals(curves, goal_limit)
    used = () if report is None else list_used_limits(report)[:MOST_BARS]
    shown = _choose_panels(plan, len(rows))
    said = () if report is None else _fold(report.reservations)
    heading = TOP + LINE * max(len(said) - 2, 0)
    bars_height = 0.24 * len(used) + 0.9 if used else 0.0
    height = heading + sum(p.height + BETWEEN for p in shown) + BELOW + bars_height
    figure = Figure(figsize=(WIDTH, height), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    axes: list[Axes] = []
    top = height - heading
    for panel in shown:
        place = (0.075, (top - panel.height) / height, 0.785, panel.height / height)
        ax = figure.add_axes(place, sharex=axes[0] if axes else None)
        top -= panel.height + BETWEEN
        axes.append(ax)
        panels.style_panel(ax)
        panels.shade_actions(ax, spans)
        ax.tick_params(labelbottom=panel is shown[-1])
        match panel.kind:
            case "gait":
                panels.draw_gait(ax, plan, rows, spans, arrivals)
                panels.label_actions(ax, plan, spans)
            case "force":
                panels.draw_force(ax, curves, panel.finger)
            case "friction":
                panels.draw_utilisation(ax, curves, read_limit(problem, "friction_utilisation_max"))
            case "goals":
                panels.draw_goals(ax, curves, plan, goal_limit, arrivals)
            case "errors":
                limits = (
                    read_limit(problem, f"{n}") for n in ("position_error_max_mm", "rotation_error_max_deg")
                )
                panels.draw_errors(ax, curves, *limits)
            case "turned":
                goal = _find_goal_turn(plan)
                panels.draw_progress(
                    ax, curves.time, curves.turned_deg, curves.turned_reference_deg, goal, "deg"
                )
                ax.set_ylabel("object\nturned [°]", fontsize=9)
            case "shifted":
                goal = 1e3 * _measure_shift(plan)
                panels.draw_progress(
                    ax, curves.time, curves.shifted_mm, curves.shifted_reference_mm, goal, "mm"
                )
                ax.set_ylabel("object\nshifted [mm]", fontsize=9)
    axes[-1].set_xlabel("time [s]", fontsize=10)
    if used:
        bottom = 0.35 / height
        bars = figure.add_axes((0.225, bottom, 0.645, (bars_height - 0.75) / height))
        panels.style_panel(bars)
        panels.draw_used_limits(bars, used)
    _write_heading(figure, problem, plan, trace, report)
    _draw_keys(figure, plan, curves, heading - KEYS)
    return write_picture(canvas, path)


def _choose_panels(plan: Plan, finger_count: int) -> list[_Panel]:
    """Return the panels from top to bottom: what this plan has nothing of is left out."""
    shown = [_Panel("gait", 0.38 * finger_count + 0.2)]
    shown += [_Panel("force", 0.72, finger) for finger in range(finger_count)]
    shown.append(_Panel("friction", 1.5))
    if any(contact is not None for contact in plan.goal_contacts or ()):
        shown.append(_Panel("goals", 1.2))
    shown.append(_Panel("errors", 1.2))
    shown.append(_Panel("turned", 1.1))
    if _measure_shift(plan) > LEAST_SHIFT:
        shown.append(_Panel("shifted", 0.9))
    return shown


def _measure_shift(plan: Plan) -> float:
    return float(np.linalg.norm(plan.X_WO_goal[:3, 3] - plan.X_WO_start[:3, 3]))


def _find_goal_turn(plan: Plan) -> float | None:
    """Return the turn that is asked for [deg]; None for a goal that is a grasp."""
    if plan.goal_kind == "grasp_adjustment":
        return None
    if plan.turned_angle is not None:
        return float(np.degrees(plan.turned_angle))
    turn = Rotation.from_matrix(plan.X_WO_goal[:3, :3] @ plan.X_WO_start[:3, :3].T)
    return float(np.degrees(turn.magnitude()))


def describe_goal(plan: Plan) -> str:
    """Return what is asked for in a few words, for instance ``object manipulation, turn by +360°``."""
    words = plan.goal_kind.replace("_", " ")
    turn = _find_goal_turn(plan)
    if turn is not None and abs(turn) > 0.05:
        words += (
            f", turn by {turn:+.0f}°"
            if plan.turned_angle is not None
            else f", {turn:.0f}° to a goal attitude"
        )
    if _measure_shift(plan) > LEAST_SHIFT:
        words += f", shift by {1e3 * _measure_shift(plan):.0f} mm"
    return words


def describe_verdict(report: ValidationReport) -> str:
    """Return the verdict in one line with two digits: the numbers that matter, or what failed first."""
    if report.is_passed:
        known = {check.name: check for check in report.checks}
        told = [(word, known[name]) for name, word in HEADLINES if name in known]
        parts = [
            f"{word} {spell(check.value, check.unit)}" for word, check in told if check.value is not None
        ]
        return "✓ PASS" + (f": {', '.join(parts)}" if parts else "")
    failed = [check for check in report.checks if check.status == FAILED]
    if not failed:
        return "✗ FAIL"
    first = failed[0]
    words = f"✗ FAIL: {describe_check(first.name).title} ({first.name})"
    if first.value is not None:
        words += f" {spell_beside(first.value, first.limit, first.unit)}"
    if first.limit is not None:
        words += f", limit {spell_limit(first.limit, first.unit)}"
    if first.worst_time_s is not None:
        words += f", at {first.worst_time_s:.2f} s"
    return words + (f"; {len(failed) - 1} more" if len(failed) > 1 else "")


def _write_heading(
    figure: Figure,
    problem: Mapping[str, Any] | None,
    plan: Plan,
    trace: Trace,
    report: ValidationReport | None,
) -> None:
    name = "run" if problem is None else str(problem.get("name", "run"))
    failure = trace.meta.get("failure")
    if report is not None:
        line = describe_verdict(report)
    else:
        line = "not judged yet" if failure is None else f"not judged yet; {failure}"
    is_bad = failure is not None or (report is not None and not report.is_passed)
    color = ALARM if is_bad else INK
    height = figure.get_figheight()

    def write(words: str, inches: float, size: float, **look: Any) -> None:  # noqa: ANN401 - matplotlib's own
        figure.text(0.075, 1.0 - inches / height, words, fontsize=size, va="center", parse_math=False, **look)

    write(_cut(f"{name}: {describe_goal(plan)}", 95), 0.26, 16, weight="bold")
    write(_cut(line, 140), 0.56, 12, color=color, weight="bold" if is_bad else "normal")
    for k, said in enumerate(() if report is None else _fold(report.reservations)):
        write(said, 0.78 + LINE * k, 9, color=ALARM)


def _fold(sentences: tuple[str, ...]) -> tuple[str, ...]:
    """Return sentences as lines; nothing of what has to be said beside a verdict is cut off."""
    return tuple(line for sentence in sentences for line in textwrap.wrap(sentence, LINE_LENGTH))


def _cut(line: str, length: int) -> str:
    return line if len(line) <= length else line[: length - 1] + "…"


def _draw_keys(figure: Figure, plan: Plan, curves: Curves, below: float) -> None:
    height = figure.get_figheight()
    loud = 100.0 * float(np.mean(~curves.is_quiet)) if len(curves.is_quiet) else 0.0
    keys: list[Line2D | Patch] = [
        Line2D([], [], color=tint("#777777"), lw=panels.PLANNED_WIDTH, label="planned (wide, pale)"),
        Line2D([], [], color=INK, lw=panels.MEASURED_WIDTH, label="measured (thin, dark)"),
        Patch(
            facecolor=UNJUDGED,
            label=f"not judged for friction and forces: a contact changes ({loud:.0f} % of the time)",
        ),
    ]
    if any(action.limiting_finger is not None for action in plan.actions):
        keys.append(
            Line2D([], [], color=INK, marker="X", linestyle="", markersize=8, label="finger that ends a turn")
        )
    if any(action.rolls for action in plan.actions):
        keys.append(Patch(facecolor="#888888", edgecolor="white", hatch="////", label="rolls"))
    if any(contact is not None for contact in plan.goal_contacts or ()):
        star: dict[str, Any] = {
            "marker": "*",
            "linestyle": "",
            "markersize": 13,
            "color": "white",
            "markeredgecolor": INK,
        }
        keys.append(Line2D([], [], **star, label="at its goal contact, to stay"))
    figure.legend(
        handles=keys,
        loc="center left",
        bbox_to_anchor=(0.07, 1.0 - below / height),
        ncols=len(keys),
        frameon=False,
        fontsize=9.5,
        handlelength=1.8,
        columnspacing=1.4,
    )
