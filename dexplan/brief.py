"""How a value shows itself in one line: its name and what a reader can take in; arrays and long tuples by their size."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

LONGEST = 200
"""Characters of a ``repr``; what does not fit is left out, field by field."""
LONGEST_TEXT = 40
FEW = 4
"""Numbers that are shown; more are counted."""


def brief_repr(self: Any) -> str:
    """Return the ``repr`` of a dataclass with arrays: ``Name(field=...)``, at most ``LONGEST`` characters, always the same.

    Use: ``__repr__ = brief_repr`` in the class.
    """
    shown = ((f.name, getattr(self, f.name, None)) for f in fields(self) if f.repr)
    return show(type(self).__name__, shown)


def show(name: str, facts: Iterable[tuple[str, object]]) -> str:
    """Return ``name(key=value, ...)``, with as many facts as fit."""
    parts: list[str] = []
    used = len(name) + len("(, ...)")
    for key, value in facts:
        part = f"{key}={shorten(value)}"
        used += len(part) + 2
        if used > LONGEST:
            parts.append("...")
            break
        parts.append(part)
    return f"{name}({', '.join(parts)})"


def shorten(value: object) -> str:
    """Return a value as a few characters: small ones as they are, others by kind and size."""
    if isinstance(value, np.ndarray):
        if value.ndim == 0:
            return shorten(value[()])
        if value.ndim == 1 and value.size <= FEW and value.dtype.kind in "fiub":
            return "[" + ", ".join(f"{x:.4g}" for x in value) + "]"
        return f"array{value.shape}".replace(",)", ")")
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool) or value is None:
        return str(value)
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, str):
        return repr(value if len(value) <= LONGEST_TEXT else value[: LONGEST_TEXT - 3] + "...")
    if isinstance(value, Mapping):
        return f"{{{len(value)}}}"
    if isinstance(value, tuple | list):
        few = [shorten(item) for item in value[:FEW]]
        text = f"({', '.join(few)})"
        return text if len(value) <= FEW and len(text) <= LONGEST_TEXT else f"<{len(value)}>"
    if is_dataclass(value) or not isinstance(value, int):
        return type(value).__name__
    return repr(value)
