"""Rows of numbered frames, like the paper's figures 3, 4 and 5: one picture per action of a run, in order."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

from dexplan.errors import RunFolderError
from dexplan.plans.actions import Action, Hold, MoveObject, Relocate, Roll
from dexplan.plans.plan import Plan
from dexplan.run_folder import check_replaceable, list_stills
from dexplan.sim.trace import Trace
from dexplan.viz.canvas import SOFTWARE
from dexplan.viz.film import FilmOptions
from dexplan.viz.palette import INK, get_finger_color
from dexplan.viz.timeline import build_action_spans
from dexplan.viz.video import STILL, render_frames

FIGURES = ("fig3_rewind", "fig4_substitution", "fig5_dextrous")
"""The built-in problems of the paper's figures 3, 4 and 5."""
CAMERA = "top"
"""The paper looks down on the ball."""
FRAME_SIZE = (720, 720)
COLUMNS = 6
MOST_FRAMES = 12
MOST_STILLS = 999
"""Pictures that are drawn of one run at most; their names count to as many."""
CROP = 0.5
"""Share of the picture, around its middle, that is shown: the ball and the fingertips."""


@dataclass(frozen=True)
class Frame:
    """One numbered picture: its moment [s] and what has just been done."""

    number: int
    time: float
    caption: str
    fingers: tuple[int, ...]
    """The fingers that hold the object then."""


def choose_frames(trace: Trace, plan: Plan, most: int = MOST_FRAMES) -> tuple[Frame, ...]:
    """Return the start of the run and the end of every action but holds; at most ``most``, from the beginning.

    The last sample of an action shows what it did: the finger that came down, the turn that was made.  Raises ValueError for
    ``most`` below 1.
    """
    if most < 1:
        raise ValueError(f"{most} frames make no row; 1 or more are accepted")
    return _list_frames(trace, plan)[:most]


def _list_frames(trace: Trace, plan: Plan) -> tuple[Frame, ...]:
    """Return all frames that there are."""
    times, start = trace["time"], float(trace["time"][0])
    holding = tuple(i for i, c in enumerate(plan.start_contacts) if c is not None)
    frames = [Frame(1, start, "start", holding)]
    for span in build_action_spans(trace):
        if not 0 <= span.action_index < len(plan.actions) or isinstance(
            plan.actions[span.action_index], Hold
        ):
            continue
        action = plan.actions[span.action_index]
        inside = np.flatnonzero(trace["action_index"] == span.action_index)
        holding = tuple(i for i, c in enumerate(action.contacts_end) if c is not None)
        caption = describe_step(plan, action)
        frames.append(Frame(len(frames) + 1, float(times[inside[-1]]), caption, holding))
    return tuple(frames)


def describe_step(plan: Plan, action: Action) -> str:
    """Return an action in a few words, for instance ``finger 3 placed`` or ``turned by 84 deg``."""
    match action:
        case MoveObject():
            return f"turned by {np.degrees(action.motion.angle):.0f}°"
        case Relocate():
            return f"{_speak(plan.fingers[action.finger])} {'placed' if action.is_placing else 'lifted'}"
        case Roll():
            return " and ".join(_speak(plan.fingers[roll.finger]) for roll in action.rolls) + " rolled"
        case Hold():
            return action.name


def draw_frames(
    trace: Trace,
    plan: Plan,
    path: str | os.PathLike[str],
    *,
    most: int = MOST_FRAMES,
    columns: int = COLUMNS,
    camera: str = CAMERA,
) -> Path:
    """Write the rows of numbered frames of a run as one PNG, whole or not at all; return its path.

    Raises RenderError where nothing can be drawn on this machine, ValueError for ``columns`` or ``most`` below 1.
    """
    if columns < 1:
        raise ValueError(f"{columns} columns make no row; 1 or more are accepted")
    frames = choose_frames(trace, plan, most)
    with tempfile.TemporaryDirectory(prefix="dexplan-") as folder:
        options = FilmOptions(FRAME_SIZE, (camera,), quality="fine", is_told=False)
        paths = render_frames(trace, [f.time for f in frames], folder, plan=plan, options=options)
        pictures = [_crop(imread(p)) for p in paths]
    figure = _compose(frames, pictures, columns, len(_list_frames(trace, plan)))
    target = Path(path)
    partial = target.with_name(f".{target.name}.partial")
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        figure.savefig(partial, format="png", metadata={"Software": SOFTWARE})
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return target


def draw_run_frames(folder: str | os.PathLike[str], most: int = MOST_FRAMES, camera: str = CAMERA) -> Path:
    """Write ``frames.png`` into a run folder; return its path.  Raises RunFolderError for anything but a run folder."""
    folder = Path(folder)
    check_replaceable(folder / "frames.png")
    trace, plan = _load_run(folder)
    return draw_frames(trace, plan, folder / "frames.png", most=most, camera=camera)


def draw_stills(
    folder: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    every: float | None = None,
    camera: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Path, ...]:
    """Draw pictures of the run in ``folder`` into ``out``, ``frame_001.png`` and so on; return their paths.

    Without ``every`` [s]: the start of the run and the end of every action but holds.  ``camera`` None: the film's.  Pictures
    of an older run in ``out`` make room, all of them.  Raises RunFolderError for anything but a run folder, and where a file in
    the way is not ours; RenderError where nothing can be drawn on this machine.
    """
    trace, plan = _load_run(Path(folder))
    start, span = float(trace["time"][0]), float(trace["time"][-1] - trace["time"][0])
    count = len(_list_frames(trace, plan)) if every is None else int(min(span / every + 1e-9, 1e9)) + 1
    if count > MOST_STILLS:
        fact = f"{count} pictures would be drawn"
        raise RunFolderError(str(folder), fact, f"at most {MOST_STILLS} are; take more time between them")
    if every is None:
        times = [frame.time for frame in _list_frames(trace, plan)]
    else:
        times = [start + k * every for k in range(count)]
    target = Path(out)
    old = list_stills(target)
    for path in {*old, *(target / f"frame_{k:03d}.png" for k in range(1, len(times) + 1))}:
        check_replaceable(path)
    options = STILL if camera is None else replace(STILL, cameras=(camera,))
    paths = render_frames(trace, times, target, plan=plan, options=options, progress=progress)
    for path in {*old} - {*paths}:
        path.unlink(missing_ok=True)
    return paths


def check_drawable(folder: Path) -> None:
    """Raise RunFolderError for a folder without a trace and a plan."""
    for name in ("trace.npz", "plan.json"):
        if not (folder / name).is_file():
            raise RunFolderError(
                str(folder / name), "there is no such file", "a folder written by `dexplan run` is needed"
            )


def _load_run(folder: Path) -> tuple[Trace, Plan]:
    check_drawable(folder)
    return Trace.load(folder / "trace.npz"), Plan.load(folder / "plan.json")


def _compose(frames: Sequence[Frame], pictures: Sequence[np.ndarray], columns: int, total: int) -> Figure:
    columns = min(columns, len(frames))
    rows = -(-len(frames) // columns)
    figure = Figure(figsize=(2.4 * columns, 2.75 * rows), dpi=110, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False).flat
    for ax in axes:
        ax.axis("off")
    for ax, frame, picture in zip(figure.axes, frames, pictures, strict=False):
        ax.imshow(picture, interpolation="antialiased")
        box = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": INK, "linewidth": 0.8}
        ax.text(
            0.04, 0.95, str(frame.number), transform=ax.transAxes, va="top", fontsize=11, color=INK, bbox=box
        )
        # A dot per finger that holds, in the colour of its tip.
        for place, finger in enumerate(frame.fingers):
            ax.plot(
                0.95 - 0.07 * (len(frame.fingers) - 1 - place),
                0.93,
                "o",
                transform=ax.transAxes,
                markersize=7,
                markerfacecolor=get_finger_color(finger),
                markeredgecolor="white",
            )
        ax.set_title(frame.caption, y=-0.1, fontsize=9, color=INK)
    if total > len(frames):
        # Nobody should take the last picture for the end of the run.
        more = f"… {total - len(frames)} more"
        figure.text(0.99, 0.02 / rows, more, ha="right", va="bottom", fontsize=8, style="italic", color=INK)
    figure.subplots_adjust(left=0.01, right=0.99, top=0.99, bottom=0.09 / rows, wspace=0.03, hspace=0.14)
    return figure


def _crop(picture: np.ndarray) -> np.ndarray:
    height, width = picture.shape[:2]
    dy, dx = round(0.5 * (1.0 - CROP) * height), round(0.5 * (1.0 - CROP) * width)
    return picture[dy : height - dy, dx : width - dx]


def _speak(name: str) -> str:
    return name.replace("_", " ")
