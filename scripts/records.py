"""Rows of evidence in a file of JSON lines, written after every item, so that an interrupted script goes on where it was."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Protocol, TypeVar

from dexplan.pool import answer_as_done


class Keyed(Protocol):
    """An item that a key names from one call to the next."""

    @property
    def key(self) -> str:
        """The name."""
        ...


Item = TypeVar("Item", bound=Keyed)
Row = dict[str, Any]


def read_rows(path: Path) -> dict[str, Row]:
    """Return the rows that were written before, by key; none where there is no file.  A torn last line is left out."""
    rows: dict[str, Row] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                row = json.loads(line)
            except json.JSONDecodeError:
                continue
            rows[row["key"]] = row
    return rows


def answer_all(
    items: Iterable[Item], answer: Callable[[Item], Row], path: Path, workers: int
) -> Iterator[Row]:
    """Yield the row of every item as it comes, those in the file at ``path`` first; new ones are appended to it."""
    rows, left = read_rows(path), []
    for item in items:
        if item.key in rows:
            yield rows[item.key]
        else:
            left.append(item)
    path.parent.mkdir(parents=True, exist_ok=True)
    torn = path.exists() and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as file:
        if torn and path.stat().st_size:
            file.write("\n")
        for _, row in answer_as_done(answer, left, workers):
            file.write(json.dumps(row) + "\n")
            file.flush()
            yield row
