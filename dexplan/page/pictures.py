"""Pictures of moments of a run, small enough for a page."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.image import imread, imsave

from dexplan.errors import RenderError
from dexplan.plans.plan import Plan
from dexplan.sim.trace import Trace
from dexplan.viz.film import FilmOptions
from dexplan.viz.video import render_frames

JPEG_QUALITY = 72
"""Of pictures in a page: lower and captions blur, higher and pages of long runs outgrow their bound."""
MOST_PICTURES = 60
"""A longer plan shows a picture of every second, third, ... action, so that a page stays small."""
MOST_MOMENTS = 12
"""Failing checks beyond this share the pictures of the actions."""


ACTION = FilmOptions(size=(800, 400), is_told=False)
"""Beside an action in words: what a film says in captions stands there already."""
MOMENT = FilmOptions()
"""Where a check fails: with captions and gauges, as in the film."""
SCENE = FilmOptions(size=(960, 600), cameras=("overview",), is_told=False)
"""Before anything moves."""


@dataclass(frozen=True)
class Pictures:
    """JPEG data by moment [s] (the moments asked for), or in ``missing`` why there are none."""

    by_time: tuple[tuple[float, bytes], ...] = ()
    missing: str = ""

    def get(self, time: float | None) -> bytes | None:
        """Return the picture of a moment that was asked for."""
        return None if time is None else dict(self.by_time).get(time)


def draw_pictures(
    trace: Trace, plan: Plan | None, times: Sequence[float], options: FilmOptions = ACTION
) -> Pictures:
    """Return pictures of the run at ``times`` [s]; where this machine cannot draw, none and why."""
    wanted = sorted(set(times))
    try:
        with tempfile.TemporaryDirectory(prefix="dexplan-") as folder:
            paths = render_frames(trace, wanted, folder, plan=plan, options=options)
            return Pictures(tuple(zip(wanted, map(_as_jpeg, paths), strict=True)))
    except RenderError as error:
        return Pictures(missing=" ".join(str(error).split()))


def _as_jpeg(path: Path) -> bytes:
    stream = io.BytesIO()
    options = {"quality": JPEG_QUALITY, "optimize": True}
    imsave(stream, imread(path)[..., :3], format="jpg", pil_kwargs=options)
    return stream.getvalue()


def choose_times(trace: Trace, plan: Plan) -> dict[int, float]:
    """Return which actions get a picture, by index from 0, and when [s]: at its last sample, which shows what an action did."""
    actions, times = trace["action_index"], trace["time"]
    last = {int(k): float(times[np.flatnonzero(actions == k)[-1]]) for k in np.unique(actions)}
    shown = [k for k in sorted(last) if 0 <= k < len(plan.actions)]
    stride = -(-len(shown) // MOST_PICTURES) if shown else 1
    return {k: last[k] for k in shown if k % stride == 0 or k == shown[-1]}
