"""How far long work has come: a bar on stderr, where that is a terminal and the command is not quiet."""

from __future__ import annotations

import logging
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from dexplan.commands.voice import Voice, get_voice, timing

Progress = Callable[[float], None]
"""``progress(share)``: how much of the work is done, 0 to 1."""
PATIENCE = 0.5
"""Work that is done sooner [s] shows no bar: it would only flicker."""
PERIOD = 0.2
"""Time between two drawings [s]."""
BAR_WIDTH, WANDERER = 30, 6
"""Characters of a bar, and of the mark that wanders in one whose end is not known."""
CLEAR = "\r\x1b[K"
"""Takes the line off a terminal."""


@contextmanager
def show_progress(label: str) -> Iterator[Progress | None]:
    """Yield a callback that draws a bar, None where nobody would see it."""
    with timing(label):
        if not _is_seen():
            yield None
            return
        with _Bar(label, sys.stderr, 0.0) as bar:
            yield bar.advance


@contextmanager
def show_work(label: str) -> Iterator[None]:
    """Draw a bar for work of which nobody knows how much there is; what the work tells its log stands beside it."""
    with timing(label):
        if not _is_seen():
            yield
            return
        with _Bar(label, sys.stderr, None):
            yield


def _is_seen() -> bool:
    return sys.stderr is not None and sys.stderr.isatty() and get_voice() > Voice.QUIET


def draw_bar(label: str, share: float | None, seconds: float, columns: int, doing: str = "") -> str:
    """Return the bar as text of less than ``columns`` characters: label, bar, share (None: unknown), time [s], present work."""
    if share is None:
        place = int(2.0 * seconds) % (BAR_WIDTH - WANDERER + 1)
        bar, told = "." * place + "#" * WANDERER + "." * (BAR_WIDTH - WANDERER - place), ""
    else:
        share = min(max(share, 0.0), 1.0)
        filled = int(share * BAR_WIDTH)
        bar, told = "#" * filled + "." * (BAR_WIDTH - filled), f" {100.0 * share:3.0f} %"
    text = f"{label} [{bar}]{told} {_spell_time(seconds)}"
    if share is not None and 0.0 < share < 1.0:
        text += f", {_spell_time(seconds * (1.0 - share) / share)} to go"
    return f"{text}{f'  {doing}' if doing else ''}"[: max(columns - 1, 0)]


def _spell_time(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes}:{rest:02d}"


class _Bar(logging.Handler):
    """Draws itself from a thread of its own, so that work that tells nothing is seen to go on.

    As a handler of the package's log it shows what the work says it is doing.
    """

    def __init__(self, label: str, stream: TextIO, share: float | None) -> None:
        super().__init__(logging.INFO)
        self._label, self._stream, self._share = label, stream, share
        self._doing = ""
        self._began = time.monotonic()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._draw_on, daemon=True)
        self._logger = logging.getLogger("dexplan")
        self._level = self._logger.level

    def advance(self, share: float) -> None:
        """Note how much is done; drawing is the thread's business."""
        self._share = share

    def emit(self, record: logging.LogRecord) -> None:
        """Show what the work says."""
        self._doing = record.getMessage()

    def __enter__(self) -> _Bar:
        self._logger.addHandler(self)
        self._logger.setLevel(logging.INFO)
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end.set()
        self._thread.join()
        self._logger.setLevel(self._level)
        self._logger.removeHandler(self)
        self.close()

    def _draw_on(self) -> None:
        is_drawn = False
        wait = PATIENCE
        try:
            while not self._end.wait(wait):
                wait, is_drawn = PERIOD, True
                columns = shutil.get_terminal_size().columns
                seconds = time.monotonic() - self._began
                text = draw_bar(self._label, self._share, seconds, columns, self._doing)
                self._stream.write(f"{CLEAR}{text}")
                self._stream.flush()
            if is_drawn:
                self._stream.write(CLEAR)
                self._stream.flush()
        except (OSError, ValueError):
            # The terminal went away; the work goes on without a bar.
            return
