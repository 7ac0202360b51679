"""What callers can do wrong.  Each message names the fact that was wrong and what would be accepted.

A caller's mistake raises one of these; physics' answer (no plan, a failed check) is a value with a status.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

MOST_DECIMALS = 9
"""Numbers that differ are told apart by at most so many decimals; what agrees in all of them is written out in full."""


class DexplanError(Exception):
    """Base of every error that a caller can mend.  It can be pickled, so that a worker process can hand it on."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to make the error again from its sentence, whatever its ``__init__`` takes."""
        return _restore, (type(self), self.args, self.__dict__)


class ProblemError(DexplanError):
    """A problem cannot be read: names the file, the key, the value and what would be accepted."""

    def __init__(self, source: str, key: str, fact: str, accepted: str) -> None:
        where = f"{source}: {key}" if key else source
        super().__init__(f"{where}: {fact}; {accepted}")
        self.source, self.key = source, key


class UnknownNameError(DexplanError):
    """A name that nothing answers to; lists the names that do, and which of them is near."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        known = sorted(known)
        near = [k for k in known if k.lower() == name.lower()] or difflib.get_close_matches(name, known, n=1)
        guess = f"; did you mean {near[0]!r}?" if near else ""
        shown = name if len(name) <= 100 else f"{name[:97]}..."
        super().__init__(f"unknown {kind} {shown!r}; known: {', '.join(known)}{guess}")


class RunFolderError(DexplanError):
    """A run folder lacks a file or holds one that cannot be read."""

    def __init__(self, path: str, fact: str, accepted: str) -> None:
        super().__init__(f"{path}: {fact}; {accepted}")


class SceneError(DexplanError):
    """A MuJoCo scene, a state or controls that cannot be measured: names the file or argument, and what would be accepted."""

    def __init__(self, source: str, fact: str, accepted: str) -> None:
        super().__init__(f"{source}: {' '.join(fact.split())}; {accepted}")


class ControllerError(DexplanError):
    """A user's controller cannot be used: names it, when it happened, what was wrong, and what would be accepted.

    What was recorded until then is the attribute ``trace``, where there is any.
    """

    def __init__(self, name: str, fact: str, accepted: str, time: float | None = None) -> None:
        moment = "" if time is None else f" at {time:.3f} s"
        super().__init__(f"controller {name}: {' '.join(fact.split())}{moment}; {accepted}")
        self.name, self.time = name, time


class OutputError(DexplanError):
    """The operating system does not let the output be written: a full disk, a missing right."""


class RenderError(DexplanError):
    """No offscreen renderer could be started; says what to install."""


def _restore(kind: type[DexplanError], args: tuple[Any, ...], fields: dict[str, Any]) -> DexplanError:
    error = kind.__new__(kind)
    error.args = args
    error.__dict__.update(fields)
    return error


def spell_apart(value: float, bound: float, decimals: int = 1) -> tuple[str, str]:
    """Return two numbers that are compared as text, with as many decimals as it takes to see that they differ.

    A message may say "1.96 mm, and 2.00 mm have to be left", but not "2.0 mm, and 2.0 mm have to be left".
    """
    for count in range(decimals, MOST_DECIMALS + 1):
        texts = f"{value:.{count}f}", f"{bound:.{count}f}"
        if texts[0] != texts[1]:
            return texts
    return repr(float(value)), repr(float(bound))
