"""From a drawn figure to a file, whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg

SOFTWARE = "dexplan"
"""Stands in the metadata of every picture, by which a later run knows what it may replace."""


def write_picture(canvas: FigureCanvasAgg, path: str | os.PathLike[str]) -> Path:
    """Write the canvas as a PNG at ``path``, its folder made where it is missing; return the path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        canvas.print_png(partial, metadata={"Software": SOFTWARE})
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)
    return target
