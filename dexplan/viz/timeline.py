"""What pictures say about a run or a plan: who holds when, which action it is, how far the object has turned.

Pure functions of values, without a drawing library, so that the text forms cost nothing to import.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from dexplan.plans.actions import Action
from dexplan.plans.phases import MAY, MUST
from dexplan.plans.plan import Plan
from dexplan.sim import contact_table
from dexplan.sim.trace import Trace
from dexplan.spatial import Array

HOLDS, ROLLS, FREE, BOTH, LIMITS = "#", "~", ".", "+", "!"
"""Characters of the gait diagram as text."""
_UPWARDS = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class GaitRow:
    """One finger of a gait diagram: its name and the spans of time [s] in which it touched the object."""

    finger: str
    holding: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Span:
    """A stretch of a run during which one action was carried out, from ``start`` to ``end`` [s]."""

    action_index: int
    start: float
    end: float


def read_finger_names(trace: Trace) -> tuple[str, ...]:
    """Return the fingers' names in the order of the trace's columns, read off its model's tips."""
    return contact_table.read_finger_names(trace.model_xml)


def build_gait_rows(trace: Trace) -> tuple[GaitRow, ...]:
    """Return when each finger touched, as measured.

    A sample speaks for the time until the next one; a span at the end of the run ends with the last sample.
    """
    time, active = trace["time"], trace["contact_active"]
    rows = []
    for finger, name in enumerate(read_finger_names(trace)):
        runs = [(a, b) for touches, a, b in _find_runs(active[:, finger]) if touches]
        holding = tuple((float(time[a]), float(time[min(b, len(time) - 1)])) for a, b in runs)
        rows.append(GaitRow(name, holding))
    return tuple(rows)


def build_action_spans(trace: Trace) -> tuple[Span, ...]:
    """Return the actions of a run in the order in which they were carried out."""
    time = trace["time"]
    last = len(time) - 1
    return tuple(
        Span(int(k), float(time[a]), float(time[min(b, last)]))
        for k, a, b in _find_runs(trace["action_index"])
    )


def gait_text(source: Trace | Plan, width: int = 100) -> str:
    """Return the gait diagram as text, a line per finger, at most ``width`` characters wide.

    Of a plan: a column per phase, grouped by action under its number, folded where it gets too long.
    Of a trace: a character per equal stretch of time.
    """
    return _trace_text(source, width) if isinstance(source, Trace) else _plan_text(source, width)


def choose_axis(plan: Plan | None) -> Array:
    """Return the world axis (3,) about which to count the turn: the goal's, its attitude's, or upwards."""
    if plan is None:
        return np.array(_UPWARDS)
    if plan.axis_W is not None:
        return plan.axis_W
    turn = Rotation.from_matrix(plan.X_WO_goal[:3, :3] @ plan.X_WO_start[:3, :3].T).as_rotvec()
    angle = float(np.linalg.norm(turn))
    return turn / angle if angle > 1e-6 else np.array(_UPWARDS)


def compute_turned_angle(pose7: ArrayLike, axis_W: ArrayLike) -> Array:
    """Return how far (T,) [rad] poses (T, 7) have turned about ``axis_W`` (3,) since the first.

    Whole turns count.  The twist of each attitude about the axis is unwrapped, so a wobble about other axes
    does not add up.
    """
    rotations = Rotation.from_quat(np.asarray(pose7, dtype=np.float64)[:, 3:], scalar_first=True)
    quat = (rotations * rotations[0].inv()).as_quat(scalar_first=True)
    axis = np.asarray(axis_W, dtype=np.float64)
    return np.unwrap(2.0 * np.arctan2(quat[:, 1:] @ (axis / np.linalg.norm(axis)), quat[:, 0]))


class _Run(NamedTuple):
    """A stretch of equal values: from the index ``start`` until before ``stop``."""

    value: Any
    start: int
    stop: int


def _find_runs(values: NDArray[Any]) -> Iterator[_Run]:
    """Yield each stretch of equal values."""
    if len(values) == 0:
        return
    edges = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist(), len(values)]
    for a, b in pairwise(edges):
        yield _Run(values[a], a, b)


def _trace_text(trace: Trace, width: int) -> str:
    names = read_finger_names(trace)
    if trace.sample_count == 0:
        return "\n".join(names)
    margin = max(map(len, names), default=0) + 2
    columns = min(max(width - margin, 10), trace.sample_count)
    lines = []
    for finger, name in enumerate(names):
        stretches = np.array_split(trace["contact_active"][:, finger], columns)
        lines.append(name.ljust(margin) + "".join(map(_as_character, stretches)))
    time = trace["time"]
    ruler = f"{time[0]:.1f} s".ljust(columns)
    end = f"{time[-1]:.1f} s"
    lines.append(" " * margin + ruler[: max(columns - len(end), 0)] + end)
    lines += textwrap.wrap(f"{HOLDS} touches   {FREE} free   {BOTH} both within one character", width)
    return "\n".join(line.rstrip() for line in lines)


def _as_character(touches: NDArray[np.bool_]) -> str:
    if touches.all():
        return HOLDS
    return BOTH if touches.any() else FREE


def _plan_text(plan: Plan, width: int) -> str:
    margin = max((len(name) for name in plan.fingers), default=0) + 2
    blocks = [_plan_block(action, k, len(plan.fingers)) for k, action in enumerate(plan.actions)]
    sheets: list[list[list[str]]] = []
    used = width
    for block in blocks:
        if used + len(block[0]) + 1 > width:
            sheets.append([])
            used = margin
        sheets[-1].append(block)
        used += len(block[0]) + 1
    lines = []
    for sheet in sheets:
        heads = ["action", *plan.fingers]
        for row, head in enumerate(heads):
            lines.append((head.ljust(margin) + " ".join(block[row] for block in sheet)).rstrip())
        lines.append("")
    key = f"{HOLDS} holds   {ROLLS} rolls   {FREE} free   {BOTH} begins or ends to touch   {LIMITS} its limit ended the motion"
    return "\n".join([*lines, *textwrap.wrap(key, width)])


def _plan_block(action: Action, index: int, finger_count: int) -> list[str]:
    """Return the action's number and a character per phase for each finger, all of one length."""
    rows = [str(index + 1)]
    for finger in range(finger_count):
        rolls = any(roll.finger == finger for roll in action.rolls)
        marks = {MUST: ROLLS if rolls else HOLDS, MAY: BOTH}
        row = "".join(marks.get(phase.touch[finger], FREE) for phase in action.phases)
        # The mark stands behind the phases, so that it hides none of them.
        rows.append(row + LIMITS if finger == action.limiting_finger else row)
    length = max(map(len, rows))
    return [row.ljust(length) for row in rows]
