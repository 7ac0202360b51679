"""How far long work has come: a bar on stderr, where that is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[float], None]
"""``progress(share)``: how much of the work is done, 0 to 1."""


@contextmanager
def show_progress(label: str) -> Iterator[Progress | None]:
    """Yield a callback that draws a bar on stderr, or None where stderr is not a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(total=1.0, desc=label, leave=False, bar_format="{l_bar}{bar}| {elapsed}<{remaining}") as bar:

        def advance(share: float) -> None:
            bar.update(share - bar.n)

        yield advance
