"""Evidence scripts go on where they were interrupted, and do nothing twice."""

from __future__ import annotations

import runpy
from dataclasses import dataclass
from pathlib import Path

RECORDS = runpy.run_path(str(Path(__file__).resolve().parents[1] / "scripts" / "records.py"))


@dataclass(frozen=True)
class Item:
    """An item of evidence."""

    key: str


def answer(item: Item) -> dict[str, object]:
    """Return the row of an item; an item that was answered before must not come here again."""
    if item.key.startswith("once"):
        raise AssertionError(f"{item.key} was answered before")
    return {"key": item.key, "value": len(item.key)}


def test_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_text('{"key": "once", "value": 4}\n{"key": "torn", "val', encoding="utf-8")
    assert set(RECORDS["read_rows"](path)) == {"once"}
    rows = list(
        RECORDS["answer_all"]([Item("once"), Item("new")], answer, path, 1)
    )  # goes on behind the torn line
    assert [row["key"] for row in rows] == ["once", "new"]
    assert set(RECORDS["read_rows"](path)) == {"once", "new"}
