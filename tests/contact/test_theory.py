"""docs/theory.md names a test for each formula: they exist."""

from __future__ import annotations

import re
from pathlib import Path

HERE = Path(__file__).resolve().parent
THEORY = HERE.parents[1] / "docs" / "theory.md"


def test_every_test_that_the_theory_names_exists() -> None:
    named = re.findall(r"`(test_\w+\.py)::(test_\w+)`", THEORY.read_text(encoding="utf-8"))
    assert len(named) > 25
    missing = [
        f"{file}::{name}" for file, name in named if f"def {name}(" not in (HERE / file).read_text("utf-8")
    ]
    assert not missing


def test_every_section_names_a_test() -> None:
    sections = THEORY.read_text(encoding="utf-8").split("\n## ")[1:]
    assert all("`test_" in section for section in sections)
