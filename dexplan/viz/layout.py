"""Where things stand in a picture: a header of words, one or two views, a gait strip and gauges below."""

from __future__ import annotations

from dataclasses import dataclass

from dexplan.viz.film import FilmOptions
from dexplan.viz.stage import View

HEADER, FOOTER = 64, 146
"""Heights in a picture of 720 lines [pixels]."""
LEAST_FOOTED = 340
"""A picture with fewer lines has no room for gait strip and gauges."""
STRIP_SHARE = 0.64
"""Of the footer's width is the gait strip's."""
LEAST_LEGEND = 0.7
"""At a smaller scale a legend would hide what it explains."""
GAP = 2


@dataclass(frozen=True)
class Box:
    """A rectangle of a picture [pixels]."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True)
class Layout:
    """The parts of a picture; without a header or footer these are of no height.

    ``scale`` is that of texts and marks, 1 in a picture of 1280 x 720.
    """

    views: tuple[View, ...]
    header: Box
    strip: Box
    gauges: Box
    scale: float


def lay_out(options: FilmOptions) -> Layout:
    """Return where everything stands in a picture."""
    width, height = options.size
    count = len(options.cameras)
    scale = min(width / (1280.0 if count > 1 else 800.0), height / 720.0)
    header = max(26, round(HEADER * scale)) if options.is_told else 0
    footer = round(FOOTER * max(scale, 0.5)) if options.is_told and height >= LEAST_FOOTED else 0
    tall = height - header - footer
    each = (width - GAP * (count - 1)) // count
    views = [
        # The last view takes what is left over.
        View(name, k * (each + GAP), header, each if k + 1 < count else width - k * (each + GAP), tall)
        for k, name in enumerate(options.cameras)
    ]
    split = round(STRIP_SHARE * width)
    return Layout(
        tuple(views),
        Box(0, 0, width, header),
        Box(0, height - footer, split, footer),
        Box(split, height - footer, width - split, footer),
        scale,
    )
