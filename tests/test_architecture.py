"""docs/architecture.md says of every room what the enforced table says, and the pages for newcomers name what exists."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rooms import FIRST_MARK, LAST_MARK, ROOMS, describe_rooms, read_sentence, rewrite

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("docs/architecture.md", "docs/glossary.md", "docs/limitations.md", "CONTRIBUTING.md")
FOLDERS = ("", "dexplan/", "tests/", "docs/", "dexplan/planning/tasks/", "dexplan/sim/judge/")
"""Where a path that a page names may begin."""


def test_the_table_of_rooms_is_the_enforced_one() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert FIRST_MARK in page
    assert LAST_MARK in page
    assert page == rewrite(page), "run scripts/architecture"


def test_every_room_says_what_it_answers() -> None:
    assert all(read_sentence(room).endswith((".", "?")) for room in ROOMS)
    assert all(f"| `{room}` | " in describe_rooms() for room in ROOMS)


@pytest.mark.parametrize("page", PAGES)
def test_pages_name_what_exists(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    named = re.findall(r"`([\w/]+(?:\.(?:py|md|toml)|(?<=/)))`|(scripts/\w+)|\]\(([\w/]+\.png)\)", text)
    assert named
    for path in {next(filter(None, groups)) for groups in named} - {
        "problems/NAME.toml",
        "planning/tasks/NAME.py",
    }:
        assert any((ROOT / folder / path).exists() for folder in FOLDERS), f"{page} names {path}"


def test_contributing_lists_every_script() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    scripts = [path.name for path in (ROOT / "scripts").iterdir() if path.is_file() and not path.suffix]
    assert not [name for name in scripts if not re.search(rf"\b{name}\b", text)]
