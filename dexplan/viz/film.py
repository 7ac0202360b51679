"""What a film may be asked for, and what it is once it has been made: values without a renderer."""

from __future__ import annotations

import base64
import os
from dataclasses import dataclass
from pathlib import Path

from dexplan.errors import DexplanError, UnknownNameError
from dexplan.sim.trace import Trace

SIZE = (1280, 720)
FPS = 25.0
GIF_FPS = 20.0
"""A GIF counts in hundredths of a second; more pictures would not keep the time of the run."""
CLOSE_UP = "closeup"
"""A camera that no model has: near the object, which it follows."""
CAMERAS = ("overview", CLOSE_UP)
LARGEST_EMBEDDED = 24 << 20
"""Bytes of a film that a notebook carries inside itself; a larger one is linked."""
LEAST_SIDE, LARGEST_SIDE, MOST_FPS = 64, 4096, 120.0


class FilmOptionError(DexplanError):
    """A film was asked for in a way that none can be made."""


@dataclass(frozen=True)
class Quality:
    """How much work goes into a picture.

    ``samples`` per pixel smooth its edges, ``slices`` make a ball round, ``shadow`` is the side of the shadow map [pixels] (0: no
    shadows), ``crf`` and ``preset`` are the encoder's: less is better, slower is smaller.
    """

    samples: int
    slices: int
    shadow: int
    crf: int
    preset: str


QUALITIES = {
    "draft": Quality(0, 16, 0, 26, "ultrafast"),
    "normal": Quality(4, 20, 0, 20, "veryfast"),
    "fine": Quality(4, 40, 2048, 16, "medium"),
}
"""On a software renderer smooth edges double the time of a picture, shadows double it again."""


@dataclass(frozen=True)
class FilmOptions:
    """How a run is drawn.

    ``size`` is width and height [pixels]; ``cameras`` are one or two, side by side: cameras of the model (``overview``, ``top``,
    ``side``) or ``closeup``; ``fps`` are pictures per second; ``quality`` is one of ``draft``, ``normal``, ``fine``; ``is_told``
    is whether captions, gait strip, gauges and legends are drawn around the views; ``speed`` is how many times as fast as the
    run the film is.

    Raises FilmOptionError or UnknownNameError for what no film can be made of.
    """

    size: tuple[int, int] = SIZE
    cameras: tuple[str, ...] = CAMERAS
    fps: float = FPS
    quality: str = "normal"
    is_told: bool = True
    speed: float = 1.0

    def __post_init__(self) -> None:
        if not all(LEAST_SIDE <= side <= LARGEST_SIDE for side in self.size):
            width, height = self.size
            raise FilmOptionError(
                f"size {width}x{height}: each side of {LEAST_SIDE} to {LARGEST_SIDE} pixels is accepted"
            )
        if len(self.cameras) not in (1, 2):
            raise FilmOptionError(f"{len(self.cameras)} cameras: one, or two side by side, are accepted")
        if not 1.0 <= self.fps <= MOST_FPS:
            raise FilmOptionError(f"{self.fps:g} pictures per second: 1 to {MOST_FPS:g} of them are accepted")
        if not 0.01 <= self.speed <= 100.0:
            raise FilmOptionError(f"{self.speed:g} times as fast: 0.01 to 100 times are accepted")
        if self.quality not in QUALITIES:
            raise UnknownNameError("quality", self.quality, QUALITIES)


def parse_size(text: str) -> tuple[int, int]:
    """Return ``1280x720`` as width and height.  Raises FilmOptionError for anything else."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise FilmOptionError(
            f"size {text!r} is no size; accepted: width x height in pixels, such as 1280x720"
        )
    return int(width), int(height)


def count_pictures(trace: Trace, options: FilmOptions) -> int:
    """Return of how many pictures a film of ``trace`` is."""
    time = trace["time"]
    return max(1, round(float(time[-1] - time[0]) * options.fps / options.speed)) if len(time) else 1


@dataclass(frozen=True)
class Film:
    """A film that has been made: where it is, how large [pixels], how long [s] and of how many pictures a second.

    A notebook shows it; ``str()`` and functions that take paths see its path.
    """

    path: Path
    size: tuple[int, int]
    duration: float
    fps: float

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def __str__(self) -> str:
        return str(self.path)

    def _repr_html_(self) -> str:
        """Return the film as HTML, inside the page where it is not too large."""
        is_gif = self.path.suffix.lower() == ".gif"
        try:
            is_small = self.path.stat().st_size <= LARGEST_EMBEDDED
            content = self.path.read_bytes() if is_small else b""
        except OSError:
            return f"<p>the film {self.path} is gone</p>"
        kind = "image/gif" if is_gif else "video/mp4"
        source = self.path.as_uri() if self.path.is_absolute() else str(self.path)
        if is_small:
            source = f"data:{kind};base64,{base64.b64encode(content).decode()}"
        width = min(self.size[0], 960)
        if is_gif:
            return f'<img src="{source}" width="{width}" alt="film of a run">'
        return f'<video controls loop muted width="{width}" src="{source}"></video>'
