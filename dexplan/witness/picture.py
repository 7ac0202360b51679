"""The pictures of the witness: the phase diagram's four panels, and what became of grasps with one finger lifted."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from dexplan.viz.canvas import write_picture
from dexplan.viz.palette import ALARM, FINGER_COLORS, INK
from dexplan.witness.diagram import Boundary, CurvePoint, GridPoint, PhaseDiagram
from dexplan.witness.experiments import EXPERIMENTS, Experiment
from dexplan.witness.lifted import BAND, SPIN_BAND, LiftedFinger
from dexplan.witness.outcome import Kind

MARKS = {
    Kind.HOLD: ("o", FINGER_COLORS[1], "holds"),
    Kind.SPIN: ("D", FINGER_COLORS[0], "spins about the chord"),
    Kind.SLIP: ("^", FINGER_COLORS[2], "slips"),
    Kind.DROP: ("x", ALARM, "drops"),
}
"""Marker, colour and word of each outcome."""
UNITS = {"deg": "°", "r": " r", "N mm": " N mm", "N": " N"}
OUT_OF_REACH = "#BBBBBB"


# -- phase diagram -----------------------------------------------------------------------------------------------------------


def draw_diagram(diagram: PhaseDiagram, path: str | os.PathLike[str]) -> Path:
    """Write the phase diagram as a PNG, whole or not at all; return its path."""
    figure = Figure(figsize=(15.0, 12.4), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    panels = figure.add_gridspec(
        2, 2, left=0.06, right=0.985, top=0.84, bottom=0.055, hspace=0.24, wspace=0.16
    )
    for k, experiment in enumerate(EXPERIMENTS):
        _draw_panel(
            figure.add_subplot(panels[k // 2, k % 2]),
            experiment,
            [b for b in diagram.boundaries if b.experiment == experiment.name],
            [c for c in diagram.curves if c.experiment == experiment.name],
            [p for p in diagram.grid if p.experiment == experiment.name],
        )
    settings = diagram.settings
    figure.text(
        0.06,
        0.968,
        "The paper's theorems, witnessed by MuJoCo through the whole hand",
        fontsize=17,
        weight="bold",
    )
    figure.text(
        0.06,
        0.934,
        f"Three fingers of six joints, servos with force limits, gravity; a {1e3 * settings['object_mass_kg']:.0f} g ball of "
        f"{1e3 * settings['object_radius_m']:.0f} mm, mean normal force {settings['preload_N']:.0f} N, "
        f"soft fingers $\\mu_t = \\mu$ × {1e3 * settings['torsional_over_sliding_m']:.2f} mm.\n"
        "Each servo's command is worked out beforehand from posture, weight and wanted contact forces; no controller.",
        fontsize=10.5,
    )
    keys = [
        Line2D([], [], color=INK, linestyle="--", linewidth=1.4, label="closed form, without weight"),
        Line2D([], [], color=INK, linewidth=2.0, label="load aware: exact cone, weight, this preload"),
        Line2D(
            [], [], marker="s", color="white", markeredgecolor=INK, markeredgewidth=1.8, markersize=9,
            linestyle="", label="simulated boundary (bisection)",
        ),
        Patch(facecolor="#E9EEF2", label="demanded agreement"),
        *[
            Line2D([], [], marker=m, color=c, linestyle="", markersize=7, markeredgewidth=1.8, label=f"simulated: {word}")
            for m, c, word in MARKS.values()
        ],
        Line2D([], [], marker=".", color=OUT_OF_REACH, linestyle="", label="beyond servos or joints"),
    ]  # fmt: skip
    figure.legend(
        handles=keys, loc="upper left", bbox_to_anchor=(0.052, 0.927), ncols=5, frameon=False, fontsize=9.5,
        columnspacing=1.6, handletextpad=0.6,
    )  # fmt: skip
    return write_picture(canvas, path)


def _draw_panel(
    ax: Axes,
    experiment: Experiment,
    boundaries: Sequence[Boundary],
    curve: Sequence[CurvePoint],
    grid: Sequence[GridPoint],
) -> None:
    mus, closed, aware = np.array([(c.mu, c.closed_form, c.load_aware) for c in curve]).T
    demand = np.array([experiment.demand(c) for c in closed])
    ax.fill_between(mus, aware - demand, aware + demand, color="#E9EEF2", zorder=0, linewidth=0.0)
    ax.plot(mus, closed, color=INK, linestyle="--", linewidth=1.4, zorder=2)
    ax.plot(mus, aware, color=INK, linewidth=2.0, zorder=2)
    for kind, (marker, color, _) in MARKS.items():
        points = [(p.mu, p.x) for p in grid if p.outcome is not None and p.outcome.kind is kind]
        if points:
            ax.plot(
                *np.array(points).T, marker=marker, color=color, linestyle="", markersize=5.5, markeredgewidth=1.6,
                zorder=3,
            )  # fmt: skip
    beyond = [(p.mu, p.x) for p in grid if p.outcome is None]
    if beyond:
        ax.plot(*np.array(beyond).T, marker=".", color=OUT_OF_REACH, linestyle="", markersize=5, zorder=1)
    found = [(b.mu, b.simulated) for b in boundaries if b.simulated is not None]
    if found:
        ax.plot(
            *np.array(found).T, marker="s", color="white", markeredgecolor=INK, markeredgewidth=1.8, markersize=9,
            linestyle="", zorder=4,
        )  # fmt: skip
    unit = UNITS[experiment.unit]
    note = _describe_agreement(experiment, boundaries, unit)
    ax.set_title(f"{experiment.title}\n{note}", fontsize=11, loc="left")
    ax.set_xlabel("friction coefficient μ [–]", fontsize=10)
    ax.set_ylabel(f"{experiment.quantity} [{experiment.unit}]", fontsize=10)
    low, high = experiment.span
    room = 0.05 * (high - low)
    ax.set_xlim(0.16, 1.04)
    ax.set_ylim(low - room, high + room)
    ax.grid(color="#E4E4E4", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _describe_agreement(experiment: Experiment, boundaries: Sequence[Boundary], unit: str) -> str:
    """Return the largest difference between simulated and load-aware boundary, in the terms of the demand."""
    found = [b for b in boundaries if b.difference is not None]
    if not found:
        return "no boundary found"
    if experiment.name in ("torsion", "shear"):
        worst = max(abs(b.difference or 0.0) / b.load_aware for b in found)
        return f"simulated within {100 * worst:.2f} % of load aware (demanded: 10 %)"
    worst = max(abs(b.difference or 0.0) for b in found)
    digits = 3 if experiment.unit == "deg" else 4
    return f"simulated within {worst:.{digits}f}{unit} of load aware (demanded: {found[0].demand:g}{unit})"


# -- lifted fingers ----------------------------------------------------------------------------------------------------------


def draw_lifted(cases: Sequence[LiftedFinger], path: str | os.PathLike[str]) -> Path:
    """Write margins against outcomes of lifted fingers as a PNG, whole or not at all; return its path."""
    figure = Figure(figsize=(14.0, 7.2), dpi=100, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    clear = [c for c in cases if c.is_clear]
    figure.text(
        0.06,
        0.945,
        f"One finger lifted from {len(cases)} random three-finger grasps",
        fontsize=16,
        weight="bold",
    )
    figure.text(
        0.06,
        0.905,
        f"{sum(c.agrees for c in clear)} of {len(clear)} agree where the margins are clear of zero "
        f"(by {BAND:g}, the force balance of a spin by {SPIN_BAND:g}); "
        f"{sum(c.agrees for c in cases)} of {len(cases)} in all.",
        fontsize=11,
    )
    panels = figure.add_gridspec(
        1, 2, left=0.06, right=0.98, top=0.80, bottom=0.09, wspace=0.22, width_ratios=[1.6, 1.0]
    )
    _draw_margins(figure.add_subplot(panels[0, 0]), cases)
    _draw_table(figure.add_subplot(panels[0, 1]), cases)
    return write_picture(canvas, path)


def _draw_margins(ax: Axes, cases: Sequence[LiftedFinger]) -> None:
    low, high = -1.0, 1.0
    shades = {Kind.HOLD: "#E2F2EC", Kind.SPIN: "#DFECF6", Kind.DROP: "#F9E6DC"}
    ax.fill_between([0.0, high], 0.0, high, color=shades[Kind.HOLD], zorder=0, linewidth=0.0)
    ax.fill_between([0.0, high], low, 0.0, color=shades[Kind.SPIN], zorder=0, linewidth=0.0)
    ax.fill_between([low, 0.0], low, high, color=shades[Kind.DROP], zorder=0, linewidth=0.0)
    for x, y, word in (
        (0.70, 0.95, "predicted: holds"),
        (0.98, -0.97, "predicted: spins"),
        (-0.98, 0.95, "predicted: drops"),
    ):
        ax.text(
            x,
            y,
            word,
            fontsize=10,
            color=INK,
            ha="right" if x > 0 else "left",
            va="top" if y > 0 else "bottom",
        )
    for kind, (marker, color, word) in MARKS.items():
        points = [
            (np.clip(c.margin_pivot, low, high), np.clip(c.margin_pair, low, high))
            for c in cases
            if c.outcome.kind is kind
        ]
        if points:
            ax.plot(
                *np.array(points).T, marker=marker, color=color, linestyle="", markersize=7, markeredgewidth=1.7,
                label=f"{word} ({len(points)})", zorder=3, clip_on=False,
            )  # fmt: skip
    wrong = [(c.margin_pivot, c.margin_pair) for c in cases if not c.agrees]
    if wrong:
        ax.plot(
            *np.clip(np.array(wrong), low, high).T, marker="o", color="none", markeredgecolor=INK, markeredgewidth=1.6,
            markersize=15, linestyle="", label=f"not as predicted ({len(wrong)})", zorder=4, clip_on=False,
        )  # fmt: skip
    # Where the margins predict nothing clearly.
    ax.fill_between([0.0, high], -BAND, BAND, color="#00000018", zorder=0.5, linewidth=0.0)
    ax.fill_between([0.0, SPIN_BAND], low, -BAND, color="#00000018", zorder=0.5, linewidth=0.0)
    ax.fill_between([-BAND, 0.0], low, BAND, color="#00000018", zorder=0.5, linewidth=0.0)
    ax.axhline(0.0, color=INK, linewidth=0.8, zorder=1)
    ax.axvline(0.0, color=INK, linewidth=0.8, zorder=1)
    ax.set_xlim(low, high)
    ax.set_ylim(low, high)
    ax.set_xlabel("load margin of the pair if torsion were free [–]   (below −1 drawn at −1)", fontsize=10)
    ax.set_ylabel("load margin of the pair [–]", fontsize=10)
    ax.set_title(
        "what the margins of the remaining pair predict, and what MuJoCo shows", fontsize=11, loc="left"
    )
    ax.plot(
        [],
        [],
        marker="s",
        color="#B9C3CB",
        linestyle="",
        markersize=10,
        label="near zero: nothing clear predicted",
    )
    ax.legend(loc="upper left", bbox_to_anchor=(0.01, 0.94), fontsize=9.5, frameon=False)
    ax.spines[["top", "right"]].set_visible(False)


def _draw_table(ax: Axes, cases: Sequence[LiftedFinger]) -> None:
    rows, columns = (Kind.HOLD, Kind.SPIN, Kind.DROP), (Kind.HOLD, Kind.SPIN, Kind.SLIP, Kind.DROP)
    table = count_cases(cases)
    expected = {
        (Kind.HOLD, Kind.HOLD),
        (Kind.SPIN, Kind.SPIN),
        (Kind.DROP, Kind.SLIP),
        (Kind.DROP, Kind.DROP),
    }
    for i, predicted in enumerate(rows):
        for j, seen in enumerate(columns):
            counted, unclear = table[predicted, seen, True], table[predicted, seen, False]
            good = (predicted, seen) in expected
            color = "#E2F2EC" if good else ("#F9E6DC" if counted else "#F6F6F6")
            # A little smaller than its place: the gaps are the grid.
            ax.add_patch(Rectangle((j + 0.03, i + 0.03), 0.94, 0.94, facecolor=color, edgecolor="none"))
            ax.text(j + 0.5, i + 0.45, str(counted), ha="center", va="center", fontsize=17, color=INK)
            if unclear:
                ax.text(
                    j + 0.5,
                    i + 0.78,
                    f"+ {unclear} near zero",
                    ha="center",
                    va="center",
                    fontsize=9,
                    color="#555555",
                )
    ax.set_xlim(0.0, len(columns))
    ax.set_ylim(len(rows) + 0.9, 0.0)
    ax.set_xticks(np.arange(len(columns)) + 0.5, [MARKS[k][2].split()[0] for k in columns], fontsize=10.5)
    ax.set_yticks(np.arange(len(rows)) + 0.5, [MARKS[k][2].split()[0] for k in rows], fontsize=10.5)
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    ax.set_ylabel("predicted", fontsize=10.5)
    ax.set_title("observed", fontsize=10.5, pad=10)
    ax.text(
        0.0,
        len(rows) + 0.15,
        "Large: grasps whose margins are clear of zero;\nthe others are listed in lifted_fingers.json.\n"
        "A chord outside the cones lets tips slide:\nslip and drop are the same prediction.",
        fontsize=9,
        va="top",
        color="#555555",
    )


def count_cases(cases: Sequence[LiftedFinger]) -> Counter[tuple[str, str, bool]]:
    """Return how often each (predicted, observed, clear of zero) happened."""
    return Counter((c.predicted, str(c.outcome.kind), c.is_clear) for c in cases)
