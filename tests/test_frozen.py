"""Frozen values are really frozen: nobody can write into an array of a value that somebody else holds."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from dexplan import pipeline
from dexplan.contact.kinematics.coordinates import ContactCoordinates
from dexplan.grasp.closed_forms.pair import IndependentCones
from dexplan.planning.admissible.hand import HandModel
from dexplan.plans.plan import Plan
from dexplan.problems.read import load_problem
from dexplan.scene.description import ContactCone
from dexplan.spatial import lock_arrays

ROOMS = ("contact", "grasp", "kinematics", "plans", "scene", "planning")
PLANNED = ("hold_three", "fig3_rewind", "adjust_grasp", "fixed_contacts")
"""Problems whose planning makes values of most classes."""


def _find_values() -> list[type]:
    """Return every frozen dataclass of the rooms that names an array among its fields."""
    found = set()
    for room in ROOMS:
        package = importlib.import_module(f"dexplan.{room}")
        for info in pkgutil.walk_packages(package.__path__, f"dexplan.{room}."):
            module = importlib.import_module(info.name)
            for _, cls in inspect.getmembers(module, dataclasses.is_dataclass):
                types = " ".join(str(f.type) for f in dataclasses.fields(cls))
                has_arrays = re.search(r"Array|Flags|Indices", types) is not None
                if cls.__module__ == info.name and cls.__dataclass_params__.frozen and has_arrays:
                    found.add(cls)
    return sorted(found, key=_name)


def _name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__name__}"


def _find_open_arrays(value: Any) -> list[str]:
    """Return the names of fields with arrays that can be written; also in tuples and mappings of arrays."""
    found = []
    for field in dataclasses.fields(value):
        held = getattr(value, field.name)
        items = held.values() if isinstance(held, dict) else held if isinstance(held, tuple) else [held]
        if any(isinstance(item, np.ndarray) and item.flags.writeable for item in items):
            found.append(f"{_name(type(value))}.{field.name}")
    return found


@pytest.fixture(scope="module")
def seen() -> Iterator[dict[type, set[str]]]:
    """Make values of as many classes as can be: class -> its fields that were found open.  Every instance made is looked at."""
    found: dict[type, set[str]] = {}
    patch = pytest.MonkeyPatch()
    for cls in _find_values():

        def look(self: Any, *args: Any, make: Any = cls.__init__, **kwargs: Any) -> None:
            make(self, *args, **kwargs)
            found.setdefault(type(self), set()).update(_find_open_arrays(self))

        patch.setattr(cls, "__init__", look)
    for name in PLANNED:
        problem = load_problem(name, {"gait.improvement": 0.0, "object.mass_kg": 0.061})
        plan = pipeline.plan(problem)
        assert plan.is_solved, (name, plan.reason)
        Plan.from_dict(plan.as_dict())
    IndependentCones(np.array([0.0, 0.0, 2.0]), 0.3)
    ContactCone(np.array([0.0, 0.0, 2.0]), 0.3)
    ContactCoordinates(*np.zeros((5, 3)))
    yield found
    patch.undo()


@pytest.mark.parametrize("cls", _find_values(), ids=_name)
def test_arrays_of_frozen_values_are_locked(cls: type, seen: dict[type, set[str]]) -> None:
    """Every instance made while plans are made; a class of which there is none locks its arrays when it is made."""
    if cls in seen:
        assert not seen[cls]
    else:
        assert "lock_arrays(self)" in inspect.getsource(cls.__post_init__)


def test_planning_makes_most_of_the_values(seen: dict[type, set[str]]) -> None:
    assert len(seen) > 0.6 * len(_find_values())


def test_homes_are_copied_by_who_writes(hand: HandModel) -> None:
    for array in (hand.q_home, hand.p_WF_home, hand.fingers[0].q_home):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


@dataclasses.dataclass(frozen=True, eq=False)
class _Value:
    array: np.ndarray
    pair: tuple[np.ndarray, int]
    ways: dict[int, np.ndarray]

    def __post_init__(self) -> None:
        lock_arrays(self)


def test_locking_copies_what_can_be_written_and_nothing_else() -> None:
    mine, locked = np.zeros(3), np.arange(4)
    locked.setflags(write=False)
    value = _Value(mine, (mine, 1), {0: locked, 1: mine})
    assert not _find_open_arrays(value)
    mine[:] = 7.0
    assert value.array.sum() == value.pair[0].sum() == value.ways[1].sum() == 0.0
    assert value.ways[0] is locked
    assert value.pair[1] == 1
