"""How much a command says: ``-q`` the last line alone, ``-v`` also what is being done and how long it took."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from enum import IntEnum


class Voice(IntEnum):
    """How much is said."""

    QUIET = 0
    NORMAL = 1
    VERBOSE = 2


_VOICE: ContextVar[Voice] = ContextVar("voice", default=Voice.NORMAL)


@contextmanager
def speaking(voice: Voice) -> Iterator[None]:
    """Let everything inside say as much as ``voice`` allows."""
    token = _VOICE.set(voice)
    logger, told = logging.getLogger("dexplan"), _Told(logging.INFO)
    level = logger.level
    if voice is Voice.VERBOSE:
        logger.addHandler(told)
        logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(told)
        logger.setLevel(level)
        _VOICE.reset(token)


class _Told(logging.Handler):
    """Tells on stderr what the package's log says."""

    def emit(self, record: logging.LogRecord) -> None:
        """Tell one line."""
        explain(record.getMessage())


def get_voice() -> Voice:
    """Return how much is said here."""
    return _VOICE.get()


def say(text: object) -> None:
    """Print a result on stdout, unless the command is quiet."""
    if get_voice() > Voice.QUIET:
        print(text, flush=True)


def conclude(text: object) -> None:
    """Print the last line on stdout, which is there however quiet the command is."""
    print(text, flush=True)


def note(text: str) -> None:
    """Print on stderr what was done beside what was asked for, unless the command is quiet."""
    if get_voice() > Voice.QUIET:
        print(f"dexplan: {text}", file=sys.stderr)


def complain(text: str) -> None:
    """Print on stderr what could not be done, however quiet the command is."""
    print(f"dexplan: {text}", file=sys.stderr)


def explain(text: str) -> None:
    """Print on stderr what is being done, where the command is verbose."""
    if get_voice() is Voice.VERBOSE:
        print(f"dexplan: {text}", file=sys.stderr, flush=True)


@contextmanager
def timing(work: str) -> Iterator[None]:
    """Say in a verbose command how long the work inside took: by the clock, and on the processor."""
    began, spent = time.perf_counter(), time.process_time()
    explain(f"{work} ...")
    yield
    taken, used = time.perf_counter() - began, time.process_time() - spent
    explain(f"{work}: {taken:.2f} s, {used:.2f} s of processor time")
