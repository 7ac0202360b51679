"""docs/paper_map.md: every definition, result, theorem, primitive and figure of the paper, where it is built, what tests it."""

from __future__ import annotations

import ast
import importlib
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MAP = ROOT / "docs" / "paper_map.md"
OPEN = "not built yet"

ITEMS = (
    # §1
    "Object manipulation", "Grasp adjustment", "Dextrous manipulation", "Orders (a), (b), (c)",
    "Fixed contacts reach a limit", "Framework", "From three fingers to two",
    # §2
    "Assumptions", "Workspace WS", "Dextrous workspace", "Hand workspace", "Free, contact and collision space",
    "Rotation limit of the fingertips",
    # §2.1
    "Surface point p(u, v)", "Configurations g_O, g_f", "Palm configuration", "CWS_i", "Grasp", "Antipodal", "FC_i",
    "Symmetry of two-finger grasps", "CWS_i_j", "CWS_i_jk",
    # §2.2
    "Grasping and free fingers", "Contact models", "Theorem 1", "Limiting finger", "Finger rewind", "Finger substitution",
    "One pair of FC regions",
    # §3
    "Friction angle", "Result 1", "Result 2", "Result 3", "Great circles", "Figure 1", "Theory 2", "Nonholonomic rolling",
    "Figure 2", "Re-rotation after D", "Any coordinate system", "Nearly two-finger grasps", "Theory 3",
    # §4
    "Clockwise order", "Figure 3", "Figure 4", "Figure 5",
    # §5
    "General objects", "Finger chains", "Contact force optimization", "Uncertainty", "Dynamic constraints",
)  # fmt: skip
"""What the paper defines, states or shows, in its order; the map has one row for each, and may have more."""


@dataclass(frozen=True)
class Row:
    """One line of the map: item of the paper, dotted names in the code, tests as path::name, remark."""

    item: str
    where: str
    code: tuple[str, ...]
    tests: tuple[str, ...]
    remark: str


def read_rows() -> list[Row]:
    rows = []
    for line in MAP.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if (
            not line.startswith("|")
            or len(cells) != 5
            or cells[0] in ("Item", "")
            or set(cells[0]) <= {"-", ":"}
        ):
            continue
        item, where, code, tests, remark = cells
        rows.append(Row(item, where, tuple(_quoted(code)), tuple(_quoted(tests)), remark))
    return rows


def _quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


ROWS = read_rows()


def test_every_item_of_the_paper_has_its_row() -> None:
    listed = [row.item for row in ROWS]
    assert len(listed) == len(set(listed)), "an item stands twice"
    assert not [item for item in ITEMS if item not in listed]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.item)
def test_row_points_at_what_is_there(row: Row) -> None:
    """A row names code and a test that exist, or says that it is not built yet; never both, never neither."""
    is_open = OPEN in row.remark
    assert is_open != bool(row.code and row.tests), f"{row.item}: name code and tests, or say {OPEN!r}"
    for name in row.code:
        assert _is_defined(name), f"{row.item}: no {name}"
    for name in row.tests:
        assert _is_test(name), f"{row.item}: no {name}"


def _is_defined(name: str) -> bool:
    """Return whether a dotted name (a module, or a name in one) or a built-in problem's file is there."""
    if name.startswith(("dexplan/", "scripts/")):
        return (ROOT / name).is_file()
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            value: object = importlib.import_module(".".join(parts[:count]))
        except ImportError:
            continue
        for part in parts[count:]:
            if not hasattr(value, part):
                return False
            value = getattr(value, part)
        return True
    return False


def _is_test(name: str) -> bool:
    """Return whether ``path::function`` or ``path::Class::function`` names a test that pytest would collect."""
    path, *names = name.split("::")
    if not names or not (ROOT / path).is_file():
        return False
    nodes: list[ast.stmt] = ast.parse((ROOT / path).read_text(encoding="utf-8")).body
    for wanted in names:
        found = [n for n in nodes if isinstance(n, ast.FunctionDef | ast.ClassDef) and n.name == wanted]
        if not found:
            return False
        nodes = found[0].body
    return names[-1].startswith("test_")


def test_the_map_is_read_with_care() -> None:
    """A checker that finds everything is none."""
    assert not _is_defined("dexplan.planning.no_such_room")
    assert not _is_defined("dexplan.spatial.no_such_name")
    assert _is_defined("dexplan.spatial.hat")
    assert not _is_test("tests/test_paper.py::test_that_nobody_wrote")
    assert not _is_test("tests/test_paper.py::read_rows")
    assert _is_test("tests/test_paper.py::test_the_map_is_read_with_care")
