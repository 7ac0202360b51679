"""The page that compares releases of MuJoCo: what its rows say, and that everything stored is asked about."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from dexplan.testing.baseline import Baseline, Quantity

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "scripts"))
import version_items  # noqa: E402 - a script's module, found by the line above
import version_page  # noqa: E402

STORED = ROOT / "tests" / "testing" / "contact_baselines" / "torsion_slips.mujoco-3.17.json"


def test_everything_stored_is_asked_about(tmp_path: Path) -> None:
    items = list(version_items.list_items(tmp_path, "4.0.0", ["tests/scene"], ["hold_two"]))
    kinds = [item.kind for item in items]
    assert kinds.count("scene") == len(list(STORED.parent.glob("*.json")))
    assert kinds.count("contacts") == len(list((ROOT / "tests" / "baselines").glob("*.mujoco-3.17.json")))
    assert [item.key for item in items[-2:]] == ["4.0.0 problem hold_two", "4.0.0 tests tests/scene"]
    assert len({item.key for item in items}) == len(items)


@pytest.mark.parametrize(
    ("output", "told"),
    [
        ("..s.  [ 50%]\n.F..E [100%]\n= FAILURES =", "6 passed, 1 failed, 1 with an error, 1 skipped"),
        ("ImportError: no such thing", ""),
    ],
)
def test_tests_are_counted(output: str, told: str) -> None:
    assert version_items.count_tests(output) == told


def test_the_page_says_what_moved_and_what_failed(tmp_path: Path) -> None:
    was = Baseline.load(STORED)
    name = next(iter(was.quantities))
    moved = replace(
        was, quantities={**was.quantities, name: Quantity(2.0 * was.quantities[name].value + 1.0)}
    )
    word = next(iter(was.words))
    paths = {}
    for key, baseline in (
        ("same", was),
        ("moved", moved),
        ("lost", replace(was, words={**was.words, word: "lost"})),
    ):
        paths[key] = tmp_path / f"{key}.json"
        baseline.save(paths[key])
    rows = [
        {"key": "3.17.0 scene torsion_slips", "is_well": True, "told": str(paths["same"])},
        {"key": "3.18.0 scene torsion_slips", "is_well": True, "told": str(paths["moved"])},
        {"key": "4.0.0 scene torsion_slips", "is_well": True, "told": str(paths["lost"])},
        {
            "key": "4.0.0 problem hold_two",
            "is_well": True,
            "told": "PASS hold_two: friction used 0.72, slip 0 mm",
        },
        {"key": "3.18.0 problem hold_two", "is_well": False, "told": "FAIL hold_two: not_dropped | 3 mm"},
        {"key": "3.18.0 tests tests/a", "is_well": False, "told": "1 failed", "failed": ["tests/a.py::b"]},
    ]
    page = tmp_path / "page.md"
    version_page.write_page(
        page, {v: f"mujoco {v} mink 1" for v in ("4.0.0", "3.17.0", "3.18.0")}, json.loads(json.dumps(rows))
    )
    lines = page.read_text(encoding="utf-8").splitlines()
    assert "| | MuJoCo 3.17.0 | MuJoCo 3.18.0 | MuJoCo 4.0.0 |" in lines
    (scene,) = (line for line in lines if line.startswith("| torsion_slips"))
    cells = [cell.strip() for cell in scene.split("|")[2:-1]]
    assert cells[0] == "the same"
    assert name.rpartition(": ")[2] in cells[1]
    assert "became lost" in cells[2]
    assert (
        "| hold_two | not asked | **failed**: FAIL not_dropped / 3 mm | PASS, friction used 0.72 |" in lines
    )
    assert "* 3.18.0: `tests/a.py::b`" in lines
