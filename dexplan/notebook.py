"""How a value shows itself in a notebook: tables of text as HTML, every character of the text escaped, nothing loaded."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

CELL = "text-align:left;vertical-align:top"
"""Notebooks put numbers to the right; here a cell may be a sentence."""
MOST_ROWS = 200
"""Rows that are shown; the others are counted."""


def as_html_table(
    heads: Sequence[str], rows: Iterable[Sequence[object]], marked: Iterable[int] = (), caption: str = ""
) -> str:
    """Return a table of text as HTML; rows with the numbers ``marked`` (from 0) are bold.  No ``heads``: none are shown."""
    listed, bold = list(rows), set(marked)
    parts = ["<table>"]
    if caption:
        parts.append(f'<caption style="{CELL};caption-side:top"><b>{escape(caption)}</b></caption>')
    if heads:
        parts.append(_row("th", heads, False))
    parts += [_row("td", row, k in bold) for k, row in enumerate(listed[:MOST_ROWS])]
    if len(listed) > MOST_ROWS:
        parts.append(_row("td", [f"and {len(listed) - MOST_ROWS} more"], False))
    return "\n".join([*parts, "</table>"])


def as_html_lines(lines: Iterable[str]) -> str:
    """Return lines of text as HTML, one below the other."""
    return "".join(f"<div>{escape(line)}</div>\n" for line in lines)


def _row(kind: str, cells: Sequence[object], is_bold: bool) -> str:
    style = f"{CELL};font-weight:bold" if is_bold else CELL
    return (
        "<tr>" + "".join(f'<{kind} style="{style}">{escape(str(cell))}</{kind}>' for cell in cells) + "</tr>"
    )
