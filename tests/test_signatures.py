"""Signatures that can be read: at most seven arguments, and no bare tuples of three or more values.  Parsed, not executed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "dexplan"
ROOMS = (
    "contact",
    "control",
    "grasp",
    "kinematics",
    "planning",
    "plans",
    "problems",
    "scene",
    "sim",
    "testing",
    "viz",
)
MOST_ARGUMENTS, LONGEST_TUPLE = 7, 2
TOO_MANY: dict[str, set[str]] = {}
"""File -> functions with more arguments.  This list only shrinks."""
BARE: dict[str, set[str]] = {}
"""File -> functions that return a bare tuple of more values.  This list only shrinks."""

FILES = sorted(path for room in ROOMS for path in (PACKAGE / room).rglob("*.py"))


def _name(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


def _find_functions(tree: ast.AST, in_class: bool = False) -> Iterator[tuple[ast.FunctionDef, bool]]:
    """Yield each function and whether it is a method."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield node, in_class
        yield from _find_functions(node, isinstance(node, ast.ClassDef))


def _count_arguments(function: ast.FunctionDef, is_method: bool) -> int:
    """Return how many arguments a caller may give; ``self`` and ``cls`` are not among them."""
    arguments = function.args
    names = [a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    own = is_method and names[:1] in (["self"], ["cls"])
    return len(names) - own + (arguments.vararg is not None) + (arguments.kwarg is not None)


def _returns_bare_tuple(function: ast.FunctionDef) -> bool:
    """Return whether a longer tuple of single values stands anywhere in the type returned; ``tuple[X, ...]`` is a sequence."""
    if function.returns is None:
        return False
    return any(
        isinstance(node, ast.Subscript)
        and ast.unparse(node.value) == "tuple"
        and isinstance(node.slice, ast.Tuple)
        and len(node.slice.elts) > LONGEST_TUPLE
        for node in ast.walk(function.returns)
    )


def _find_long(tree: ast.AST) -> set[str]:
    return {
        f.name for f, is_method in _find_functions(tree) if _count_arguments(f, is_method) > MOST_ARGUMENTS
    }


def _find_bare(tree: ast.AST) -> set[str]:
    return {f.name for f, _ in _find_functions(tree) if _returns_bare_tuple(f)}


@pytest.mark.parametrize("path", FILES, ids=_name)
def test_signatures_are_short(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert _find_long(tree) == TOO_MANY.get(_name(path), set()), f"more than {MOST_ARGUMENTS} arguments"
    assert _find_bare(tree) == BARE.get(_name(path), set()), "a bare tuple; give the values a name"


def test_lists_name_files_that_are_there() -> None:
    assert {*TOO_MANY, *BARE} <= {_name(path) for path in FILES}


def test_the_checker_finds_what_it_looks_for() -> None:
    long = "def f(a, b, c, d, /, e, *, g, h, i): ...\nclass A:\n    def m(self, a, b, c, d, e, f, *args, **more): ..."
    assert _find_long(ast.parse(long)) == {"f", "m"}
    assert not _find_long(ast.parse("class A:\n    def m(self, a, b, c, d, e, f, g): ..."))
    bare = "def f() -> tuple[int, int, int]: ...\ndef g() -> dict[int, tuple[int, str, int]] | None: ..."
    assert _find_bare(ast.parse(bare)) == {"f", "g"}
    assert not _find_bare(ast.parse("def f() -> tuple[int, ...]: ...\ndef g() -> tuple[int, int]: ..."))
