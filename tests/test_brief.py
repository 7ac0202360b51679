"""Values show themselves in a line; print tells what a reader wants to know."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
from typing import Any

import numpy as np
import pytest

from dexplan.brief import LONGEST, brief_repr, shorten
from dexplan.problems.read import list_problems, load_problem
from dexplan.scene.library import load_scene
from dexplan.sim.trace import Trace

ROOMS = ("contact", "grasp", "kinematics", "plans", "scene", "control", "sim")
"""Rooms whose values with arrays all have to be brief; of ``planning`` the ones that leave it are listed below."""
PUBLIC = {
    "planning.admissible.hand": ("HandModel",),
    "planning.contacts.orbits": ("Orbit",),
    "planning.regions.regions": ("Regions",),
    "problems.problem": ("Problem", "HandSection", "GoalSection", "StartSection"),
}


def _find_values() -> list[type]:
    """Return every dataclass of the rooms that has an array, a model or text of a file among its fields."""
    found = []
    for room in ROOMS:
        package = importlib.import_module(f"dexplan.{room}")
        for info in pkgutil.walk_packages(package.__path__, f"dexplan.{room}."):
            module = importlib.import_module(info.name)
            for _, cls in inspect.getmembers(module, dataclasses.is_dataclass):
                types = " ".join(str(f.type) for f in dataclasses.fields(cls))
                is_public = cls.__module__ == info.name and not cls.__name__.startswith("_")
                if is_public and any(word in types for word in ("Array", "Flags", "Indices", "MjModel")):
                    found.append(cls)
    for module_name, names in PUBLIC.items():
        module = importlib.import_module(f"dexplan.{module_name}")
        found += [getattr(module, name) for name in names]
    return sorted(set(found), key=lambda cls: (cls.__module__, cls.__name__))


@pytest.mark.parametrize("cls", _find_values(), ids=lambda cls: f"{cls.__module__}.{cls.__name__}")
def test_values_with_arrays_are_brief(cls: type) -> None:
    assert cls.__repr__ is brief_repr or "__repr__" in vars(cls)
    assert "__create_fn__" not in cls.__repr__.__qualname__


def _make_values() -> dict[str, Any]:
    scene = load_scene()
    problem = load_problem("fig5_dextrous")
    trace = Trace(
        "<mujoco/>", {"time": np.arange(500) * 0.004, "qpos": np.zeros((500, 25))}, {"problem": "p"}
    )
    return {
        "problem": problem,
        "goal": problem.goal,
        "hand": problem.hand,
        "scene": scene,
        "finger": scene.fingers[0],
        "chain": scene.fingers[0].chain,
        "object": scene.object,
        "trace": trace,
        "surface": scene.object.surface,
    }


def test_repr_is_short_and_repeats_itself() -> None:
    first, second = _make_values(), _make_values()
    for name, value in first.items():
        text = repr(value)
        assert len(text) <= LONGEST, name
        assert "\n" not in text
        assert text == repr(second[name])
        assert type(value).__name__ in text


@pytest.mark.parametrize("name", list_problems())
def test_print_shows_a_problem_as_its_file(name: str) -> None:
    problem = load_problem(name)
    assert str(problem).startswith("format = 1\n")
    assert f'name = "{name}"' in str(problem)
    assert len(repr(problem)) <= LONGEST


def test_shorten() -> None:
    told = {
        "array(3, 4)": np.zeros((3, 4)),
        "array(9)": np.zeros(9),
        "[1, 0.5]": np.array([1.0, 0.5]),
        "<900>": list(range(900)),
        "(1, 2)": (1, 2),
        "{2}": {"a": 1, "b": 2},
        "'" + 37 * "x" + "...'": 1000 * "x",
        "0.3333": 1 / 3,
        "7": np.int64(7),
        "None": None,
        "True": True,
    }
    for text, value in told.items():
        assert shorten(value) == text
