"""The front door of every room: its sentence, its modules, and examples that run."""

from __future__ import annotations

import ast
import doctest
import importlib
import inspect
import pydoc
from pathlib import Path

import pytest
from rooms import ROOMS

PACKAGE = Path(__file__).resolve().parents[1] / "dexplan"
DOORS = sorted(path for path in PACKAGE.rglob("__init__.py") if path.parent != PACKAGE)
FOR_USERS = {"testing"}
"""Rooms whose door lists the names that users import, loaded when they are first used, as those of ``dexplan`` itself are."""
LISTS = [path for path in DOORS if path.parent.name not in FOR_USERS]
LONGEST_SENTENCE = 130


def _dotted(path: Path) -> str:
    return ".".join(["dexplan", *path.relative_to(PACKAGE).parts[:-1]])


def _read(path: Path) -> tuple[str, list[str]]:
    """Return the text and ``__all__`` of a door; it consists of nothing else but old names for one release."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    text = ast.get_docstring(tree) or ""
    body = [node for node in tree.body[1:] if "forward" not in ast.unparse(node)]
    assert len(body) == 1, f"{path}: a door has a docstring and __all__, and nothing else that runs"
    (names,) = body
    assert isinstance(names, ast.Assign)
    assert ast.unparse(names.targets[0]) == "__all__"
    return text, ast.literal_eval(names.value)


def test_every_room_has_a_door() -> None:
    rooms = {room for room in ROOMS if (PACKAGE / room.replace(".", "/")).is_dir()}
    assert {_dotted(path).removeprefix("dexplan.") for path in DOORS} == rooms


@pytest.mark.parametrize("room", sorted(FOR_USERS))
def test_names_for_users_are_there(room: str) -> None:
    module = importlib.import_module(f"dexplan.{room}")
    assert module.__all__ == sorted(set(module.__all__)) == dir(module)
    for name in module.__all__:
        value = getattr(module, name)
        assert (value if inspect.ismodule(value) else inspect.getmodule(value)).__name__.startswith(
            f"dexplan.{room}."
        )
    assert len((module.__doc__ or "").splitlines()[0]) <= LONGEST_SENTENCE


@pytest.mark.parametrize("path", LISTS, ids=_dotted)
def test_a_door_says_what_is_behind_it(path: Path) -> None:
    text, names = _read(path)
    sentence = text.splitlines()[0]
    assert len(sentence) <= LONGEST_SENTENCE
    assert sentence.endswith((".", "?"))
    assert names == sorted(set(names))
    for name in names:
        assert (path.parent / f"{name}.py").is_file() or (path.parent / name / "__init__.py").is_file(), name
    named = [line.split("``")[1] for line in text.splitlines() if line.startswith("``") and "``  " in line]
    assert not set(named) - set(names), "the text names a module that is not in __all__"


@pytest.mark.parametrize("path", DOORS, ids=_dotted)
def test_examples_run(path: Path) -> None:
    found = doctest.testmod(importlib.import_module(_dotted(path)))
    assert found.failed == 0
    if "." not in _dotted(path).removeprefix("dexplan."):
        assert found.attempted > 0, "a room shows how it is used"


def test_help_is_a_page_to_start_from() -> None:
    page = pydoc.plain(pydoc.render_doc("dexplan.grasp"))
    for word in (
        "Statics of a held object",
        "check_force_closure",
        "ForceSolver",
        ">>> ",
        "PACKAGE CONTENTS",
    ):
        assert word in page
