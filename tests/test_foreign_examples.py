"""The examples of other people's controllers run, and the documentation shows what they print."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "foreign_controller.md").read_text(encoding="utf-8")
LONGEST = 90
"""Lines of an example: one page."""
NUMBER = re.compile(r"\d+(\.\d+)?(e[+-]\d+)?")


def _without_numbers(text: str) -> list[str]:
    return NUMBER.sub("#", text).split()


@pytest.mark.parametrize("name", ["foreign_controller", "follow_a_turn"])
def test_an_example_is_a_page_that_prints_what_the_documentation_shows(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ROOT / "examples" / f"{name}.py"
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST
    runpy.run_path(str(path), run_name="__main__")
    printed = capsys.readouterr().out
    (shown,) = re.findall(rf"```\n\$ python examples/{name}\.py\n(.*?)```", PAGE, flags=re.DOTALL)
    assert _without_numbers(shown) == _without_numbers(printed)
    assert [line.split()[0] for line in printed.splitlines()] == (
        ["PASS", "FAIL", "PASS"] if name == "foreign_controller" else ["PASS"]
    )


def test_the_code_of_the_page_is_the_examples() -> None:
    """What is quoted stands in the example, line by line."""
    lines = {
        line.strip()
        for name in ("foreign_controller", "follow_a_turn")
        for line in (ROOT / "examples" / f"{name}.py").read_text(encoding="utf-8").splitlines()
    }
    (quoted,) = re.findall(r"```python\n# examples/.*?\n(.*?)```", PAGE, flags=re.DOTALL)
    assert {line.strip() for line in quoted.splitlines()} - {"", "..."} <= lines
