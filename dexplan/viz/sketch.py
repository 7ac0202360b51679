"""Drawing over a picture: lines, areas and texts with smooth edges, by matplotlib's raster engine.

Coordinates are pixels from the upper left corner of the picture.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.colors import to_rgba
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.transforms import Affine2D
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from dexplan.spatial import Array

FONT = "DejaVu Sans"
"""Comes with matplotlib, so that texts look the same everywhere."""
ELLIPSIS = "…"
PAD = 3
"""Letters may reach so many pixels beyond their line's ends."""


_RULER = RendererAgg(1, 1, 72)


class Sketch:
    """A picture of ``width`` times ``height`` pixels to draw on; ``pixels`` (height, width, 4) are its own."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._renderer = RendererAgg(width, height, 72)
        self.pixels: NDArray[np.uint8] = np.asarray(self._renderer.buffer_rgba())
        self._upright = Affine2D().scale(1.0, -1.0).translate(0.0, height)

    def draw_polygon(
        self,
        points: ArrayLike,
        fill: str | None = None,
        line: str | None = None,
        width: float = 1.0,
        alpha: float = 1.0,
    ) -> None:
        """Draw a closed polygon (N, 2): its area in the colour ``fill``, its edge in ``line``, ``width`` pixels thick."""
        corners = np.asarray(points, dtype=float)
        self._draw(Path(np.vstack([corners, corners[:1]]), closed=True), fill, line, width, alpha)

    def draw_line(self, points: ArrayLike, color: str, width: float = 1.0, alpha: float = 1.0) -> None:
        """Draw an open line through points (N, 2)."""
        self._draw(Path(np.asarray(points, dtype=float)), None, color, width, alpha)

    def draw_box(
        self, x: float, y: float, width: float, height: float, fill: str, alpha: float = 1.0
    ) -> None:
        """Fill a rectangle whose upper left corner is (x, y)."""
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        self.draw_polygon(corners, fill, alpha=alpha)

    def draw_disc(
        self, center: ArrayLike, radius: float, fill: str | None, line: str | None = None, width: float = 1.0
    ) -> None:
        """Draw a disc, its edge in ``line``."""
        x, y = np.asarray(center, dtype=float)
        self._draw(Path.circle((x, y), radius), fill, line, width, 1.0)

    def draw_arc(
        self, center: ArrayLike, radius: float, span: Sequence[float], color: str, width: float
    ) -> None:
        """Draw an arc over ``span``: two angles [rad], clockwise from above the centre."""
        count = max(2, int(abs(span[1] - span[0]) / 0.05) + 2)
        angles = np.linspace(span[0], span[1], count)
        rim = np.stack([np.sin(angles), -np.cos(angles)], axis=1)
        self.draw_line(np.asarray(center) + radius * rim, color, width)

    def draw_text(
        self,
        x: float,
        y: float,
        text: str,
        size: float,
        color: str = "white",
        side: str = "left",
        is_bold: bool = False,
    ) -> float:
        """Write a line with its middle at height ``y``, from ``x`` on, up to it (``right``) or around it (``center``).

        Returns its width.
        """
        width = measure_text(text, size, is_bold)
        start = x - {"left": 0.0, "right": width, "center": 0.5 * width}[side]
        for part in _split_numbers(text):
            self._stamp(start, y, paint_text(part, size, is_bold), color)
            start += measure_text(part, size, is_bold)
        return width

    def _stamp(self, x: float, y: float, ink: NDArray[np.float32], color: str) -> None:
        """Lay ``ink`` (h, w), how much each pixel is covered, over the picture, from ``x`` on and around the height ``y``."""
        left, top = round(x) - PAD, round(y - 0.5 * ink.shape[0])
        rows = slice(max(top, 0), min(top + ink.shape[0], self.height))
        columns = slice(max(left, 0), min(left + ink.shape[1], self.width))
        if rows.start >= rows.stop or columns.start >= columns.stop:
            return
        cover = ink[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left, None]
        area = self.pixels[rows, columns, :3]
        full = 255.0 * np.array(as_rgba(color)[:3], dtype=np.float32)
        area[:] = (area + cover * (full - area)).astype(np.uint8)

    def fold_text(
        self, text: str, size: float, width: float, most: int = 1, is_bold: bool = False
    ) -> list[str]:
        """Return ``text`` in at most ``most`` lines of at most ``width`` pixels; what does not fit ends in an ellipsis."""
        lines: list[str] = [""]
        for word in text.split():
            longer = f"{lines[-1]} {word}".strip()
            if measure_text(longer, size, is_bold) <= width:
                lines[-1] = longer
            elif len(lines) < most and lines[-1]:
                lines.append(word)
            else:
                lines[-1] = self._cut(longer, size, width, is_bold)
                return lines
        if measure_text(lines[-1], size, is_bold) > width:
            lines[-1] = self._cut(lines[-1], size, width, is_bold)
        return lines

    def _cut(self, text: str, size: float, width: float, is_bold: bool) -> str:
        while text and measure_text(text + ELLIPSIS, size, is_bold) > width:
            text = text[:-1].rstrip()
        return text + ELLIPSIS

    def _draw(self, path: Path, fill: str | None, line: str | None, width: float, alpha: float) -> None:
        context: Any = self._renderer.new_gc()
        context.set_antialiased(True)
        context.set_alpha(alpha)
        context.set_joinstyle("round")
        context.set_capstyle("round")
        context.set_linewidth(width if line else 0.0)
        context.set_foreground(line or "black")
        self._renderer.draw_path(context, path, self._upright, as_rgba(fill) if fill else None)


def measure_text(text: str, size: float, is_bold: bool = False) -> float:
    """Return the width of a line [pixels]."""
    return sum(_measure(part, size, is_bold) for part in _split_numbers(text))


def _split_numbers(text: str) -> list[str]:
    """Return a text in pieces, its digits one by one: numbers that change are put together of digits that are painted once."""
    return [part for part in re.split(r"(\d)", text) if part]


@lru_cache(maxsize=1024)
def _measure(text: str, size: float, is_bold: bool) -> float:
    font = _load_font(size, is_bold)
    return float(_RULER.get_text_width_height_descent(text, font, False)[0])


@lru_cache(maxsize=512)
def paint_text(text: str, size: float, is_bold: bool) -> NDArray[np.float32]:
    """Return how much a line covers each pixel (h, w) [0 .. 1], ``PAD`` pixels wider on each side than it is."""
    height, width = 2 * round(0.9 * size), round(_measure(text, size, is_bold)) + 2 * PAD
    renderer = RendererAgg(width, height, 72)
    context = renderer.new_gc()
    context.set_foreground("black")
    # Half the height of capitals below the middle, whatever letters there are.
    baseline = round(0.5 * height + 0.36 * size)
    renderer.draw_text(context, PAD, baseline, text, _load_font(size, is_bold), 0.0)
    return (np.asarray(renderer.buffer_rgba())[..., 3] / 255.0).astype(np.float32)


@lru_cache(maxsize=64)
def _load_font(size: float, is_bold: bool) -> FontProperties:
    return FontProperties(family=FONT, size=size, weight="bold" if is_bold else "normal")


@lru_cache(maxsize=64)
def as_rgba(color: str) -> tuple[float, ...]:
    """Return a colour ``#rrggbb`` as red, green, blue and opacity."""
    return tuple(to_rgba(color))


def find_hull(points: Array) -> Array:
    """Return the corners (M, 2) of the convex hull of points (N, 2), in order; the points themselves where they have no area."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points
