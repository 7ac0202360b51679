"""Nothing in planning decides by reading a sentence: no regular expressions, no substrings, no comparison with words."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

PLANNING = Path(__file__).resolve().parents[2] / "dexplan" / "planning"
READERS = {"startswith", "endswith", "removeprefix", "removesuffix", "find", "index", "partition"}
"""Methods of strings that tell one sentence from another."""
COLLECTIONS = {"primitives", "m"}
"""Names that stand for collections of keys wherever they are used: the gaits that may be used, and margins by their names."""
EXCEPTIONS: set[str] = set()
"""Places that may, as "file: code".  The list stays empty."""


def _is_words(node: ast.AST) -> bool:
    """Return whether a node is a text with a space in it, or one that is put together: what people read, not a key."""
    if isinstance(node, ast.JoinedStr):
        return True
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _is_spelled(node: ast.AST) -> bool:
    """Return whether a node makes a sentence of a value, or is one that values keep for people."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "str":
        return True
    return isinstance(node, ast.Attribute) and node.attr in {"reason", "words", "why", "names"}


def find_readers(tree: ast.Module) -> Iterator[str]:
    """Yield the code that reads sentences."""
    named = {
        target.id
        for node in tree.body
        if isinstance(node, ast.Assign) and _is_words(node.value)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = [a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            if {"re", "difflib", "fnmatch"} & set(modules):
                yield ast.unparse(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr in READERS and any(map(_is_text, node.args)):
                yield ast.unparse(node)
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for (a, b), op in zip(pairwise(sides), node.ops, strict=True):
                if isinstance(op, ast.In | ast.NotIn):
                    # A literal may be looked for among others, not inside of something that may be a message.
                    is_known = isinstance(b, ast.Name) and b.id in COLLECTIONS
                    wrong = _is_text(a) and not is_known and not isinstance(b, ast.Tuple | ast.Set | ast.List)
                elif isinstance(op, ast.Eq | ast.NotEq):
                    wrong = any(
                        _is_words(x) or _is_spelled(x) or (isinstance(x, ast.Name) and x.id in named)
                        for x in (a, b)
                    )
                else:
                    wrong = False
                if wrong:
                    yield ast.unparse(node)


@pytest.mark.parametrize(
    "path", sorted(PLANNING.rglob("*.py")), ids=lambda p: p.relative_to(PLANNING).as_posix()
)
def test_no_decision_reads_a_sentence(path: Path) -> None:
    name = path.relative_to(PLANNING).as_posix()
    found = {f"{name}: {code}" for code in find_readers(ast.parse(path.read_text(encoding="utf-8")))}
    assert not found - EXCEPTIONS


def test_the_list_of_exceptions_is_empty() -> None:
    assert not EXCEPTIONS


@pytest.mark.parametrize(
    "code",
    [
        "import re",
        "from re import sub",
        "refusal.startswith('finger')",
        "'too near' in refusal",
        "'joint' in str(refusal)",
        "'order' not in why",
        "plan.reason == other",
        "text == 'the end of its workspace'",
        "END = 'the end of its workspace'\nstop == END",
        "str(refusal) == other",
        "limit != f'the limit of {name}'",
    ],
)
def test_the_finder_finds_what_it_looks_for(code: str) -> None:
    assert list(find_readers(ast.parse(code))), code


@pytest.mark.parametrize(
    "code",
    ["kind == 'carry'", "order in ('a', 'b')", "status is Status.SOLVED", "f'{a} and {b}'", "3 in fingers"],
)
def test_keys_and_making_sentences_are_fine(code: str) -> None:
    assert not list(find_readers(ast.parse(code)))
