"""Endurance in words and as a figure: the errors of goal after goal."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dexplan.viz.palette import ALARM, INK, get_finger_color
from dexplan.witness.endurance import POSITION_LIMIT_MM, ROTATION_LIMIT_DEG, Endurance


def describe(run: Endurance) -> Iterator[str]:
    """Yield the outcome line by line."""
    yield f"{run.name}: goal   turn  places  planned in   at end               on the way"
    for g in run.goals:
        errors = "not reached"
        if g.position_mm is not None:
            errors = f"{g.position_mm:.4f} mm {g.rotation_deg:.4f} deg  {g.position_way_mm:.4f} mm {g.rotation_way_deg:.4f} deg"
        mark = "" if g.is_met else "  NOT MET"
        yield f"{g.number:{len(run.name) + 6}d} {g.turn_deg:6.1f} {g.placements:7d} {g.planning_s:9.2f} s   {errors}{mark}"
    met = sum(g.is_met for g in run.goals)
    yield f"{met} of {run.chain.asked} goals met in {run.trace['time'][-1]:.0f} s of one rollout"
    for text in (run.chain.reason, run.failure, ", ".join(c.name for c in run.report.failures)):
        if text:
            yield f"  {text}"


def draw(runs: tuple[Endurance, ...], path: str | os.PathLike[str]) -> Path:
    """Write the errors per goal as a PNG, whole or not at all; return its path."""
    figure = Figure(figsize=(11.0, 3.4 * len(runs) + 0.6), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(runs), 2, squeeze=False)
    for row, run in zip(axes, runs, strict=True):
        panels = (
            ("position_mm", "position_way_mm", POSITION_LIMIT_MM, "position error [mm]"),
            ("rotation_deg", "rotation_way_deg", ROTATION_LIMIT_DEG, "rotation error [°]"),
        )
        for ax, (end, way, limit, label) in zip(row, panels, strict=True):
            reached = [g for g in run.goals if g.reached_s is not None]
            numbers = [g.number for g in reached]
            for key, marker, color, text in (
                (way, "^", get_finger_color(0), "largest on the way"),
                (end, "o", get_finger_color(1), "at the goal"),
            ):
                values = [max(getattr(g, key), 1e-6) for g in reached]
                ax.plot(numbers, values, marker, color=color, markersize=5, label=text)
            for g in run.goals:
                if g.reached_s is None:
                    ax.axvline(g.number, color=ALARM, linewidth=1.0)
            ax.axhline(limit, color=ALARM, linewidth=1.2, label="limit")
            ax.set_yscale("log")
            ax.set_xlim(0.5, run.chain.asked + 0.5)
            ax.xaxis.set_major_locator(MaxNLocator(integer=True))
            ax.set_xlabel("goal")
            ax.set_ylabel(label)
            ax.spines[["top", "right"]].set_visible(False)
            ax.grid(axis="y", color="#DDDDDD", linewidth=0.6)
        met = sum(g.is_met for g in run.goals)
        row[0].set_title(
            f"{run.name}: {met} of {run.chain.asked} goals met in one rollout of {run.trace['time'][-1]:.0f} s",
            loc="left",
            fontsize=10,
            color=INK,
        )
        row[1].legend(fontsize=8, frameon=False, loc="upper right", bbox_to_anchor=(1.0, 0.97))
    figure.tight_layout()
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f".{target.name}.partial")
    try:
        figure.savefig(partial, format="png")
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return target
