"""README and ``docs/``: every code block runs and prints what the page shows, generated parts are current, pictures are ours."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pages import EXAMPLES, LANGUAGES, PAGES, ROOT, RUN, Block, Reader, compare, read_blocks, read_console
from references import find_marks, rewrite

BY_PAGE = {page: read_blocks(page) for page in PAGES}
RUNNING = [
    page for page, blocks in BY_PAGE.items() if any(b.language in RUN and not b.is_slow for b in blocks)
]
README_LINES, EXAMPLE_LINES = 80, 90
SOURCES = (*(ROOT / "scripts").iterdir(), *(ROOT / "dexplan" / "viz").glob("*.py"), *EXAMPLES.glob("*.py"))
COMMANDS = re.compile(r"^\s*(\$ |dexplan |scripts/|pip |python |pytest )", re.MULTILINE)
LINK = re.compile(r"!?\[[^]]*\]\(([^)#\s]+)[^)]*\)")


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that the processes of one test session share."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if base.name.startswith("popen-") else base) / "kept_runs"


@pytest.mark.parametrize("page", RUNNING, ids=lambda page: page.stem)
def test_a_page_does_what_it_says(page: Path, tmp_path: Path, kept: Path) -> None:
    reader = Reader(tmp_path, kept)
    for block in BY_PAGE[page]:
        if block.language in RUN and not block.is_slow:
            reader.run(block)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_nothing_that_could_run_is_mere_text(page: Path) -> None:
    for block in BY_PAGE[page]:
        assert block.language in LANGUAGES, f"{block}: say the language, one of {', '.join(LANGUAGES)}"
        assert block.language in RUN or not COMMANDS.search(block.text), f"{block}: make it a console block"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_generated_parts_are_current(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == rewrite(text), "run scripts/docs"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if not re.match(r"https?://|mailto:", target):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_picture_is_made_by_a_script() -> None:
    """The name of a picture stands in what makes it; drawings in SVG are their own source."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in SOURCES if path.is_file())
    pictures = {target for page in PAGES for target in LINK.findall(page.read_text(encoding="utf-8"))}
    for name in {Path(p).name for p in pictures if p.endswith((".png", ".gif"))}:
        assert name in text or Path(name).stem in text, f"nothing makes {name}"


def test_every_example_stands_on_a_page() -> None:
    shown = {mark for page in PAGES for mark in find_marks(page.read_text(encoding="utf-8"))}
    for example in EXAMPLES.glob("*.py"):
        assert len(example.read_text(encoding="utf-8").splitlines()) <= EXAMPLE_LINES, (
            "an example is one page"
        )
        assert f"examples/{example.name}" in shown, f"{example.name} is on no page, so that nothing runs it"


def test_readme_is_a_door() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= README_LINES


def _block(text: str, language: str = "console", output: str | None = None) -> Block:
    return Block(ROOT / "README.md", 1, language, text, {}, output)


def test_the_reader_is_a_strict_one(tmp_path: Path) -> None:
    """A checker that finds everything right is none."""
    reader = Reader(tmp_path, tmp_path / "kept")
    reader.run(_block("print(1 + 1)\n", "python", "2\n"))
    with pytest.raises(AssertionError, match="prints something else"):
        reader.run(_block("print(1 + 1)\n", "python", "3\n"))
    with pytest.raises(AssertionError, match="prints something else"):
        reader.run(_block("print(1 + 1)\n", "python"))
    with pytest.raises(AssertionError, match="ends with 2, not 0"):
        reader.run(_block("$ dexplan plan nosuch\n"))
    with pytest.raises(AssertionError, match="mark the block slow"):
        reader.run(_block("$ rm -r runs\n"))
    with pytest.raises(Exception, match="did you mean"):
        reader.run(_block("[friction]\nslidign = 1.0\n", "toml"))
    compare(_block(""), "a\n...\nPASS ...\n", "a\nb\nc\nPASS all\n")
    assert read_console(_block("$ a \\\n  b\nc\n$ d\n")) == [("a   b", "c\n"), ("d", "")]
