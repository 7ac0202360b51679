"""Habits that settings state are kept: lists of exceptions only shrink, and tested versions lie within the ranges stated."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXCEPTIONS: dict[str, list[str]] = SETTINGS["tool"]["ruff"]["lint"]["per-file-ignores"]
MOST_EXCEPTIONS = 28
"""How many lines the list of exceptions has at most.  This number only shrinks."""


def _find(path: str, code: str) -> str:
    """Return what ruff finds of one rule in one file, exceptions left out."""
    command = [
        sys.executable,
        "-m",
        "ruff",
        "check",
        "--config",
        "lint.per-file-ignores={}",
        "--select",
        code,
        path,
    ]
    done = subprocess.run([*command, "-q"], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode in {0, 1}, done.stderr
    return done.stdout


@pytest.mark.parametrize("path", [path for path in EXCEPTIONS if "*" not in path])
def test_exceptions_to_lint_rules_are_needed(path: str) -> None:
    for code in EXCEPTIONS[path]:
        assert _find(path, code), f"{path} keeps {code}: take it off the list in pyproject.toml"


def test_the_list_of_exceptions_only_shrinks() -> None:
    assert len(EXCEPTIONS) <= MOST_EXCEPTIONS


def _read_constraints() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return dict(line.split("==") for line in lines if not line.startswith("#"))


@pytest.mark.parametrize(
    "text", [*SETTINGS["project"]["dependencies"], *SETTINGS["project"]["optional-dependencies"]["dev"]]
)
def test_the_tested_set_lies_within_the_ranges(text: str) -> None:
    wanted = Requirement(text)
    assert wanted.specifier.contains(_read_constraints()[wanted.name.lower().replace("_", "-")])
    assert not any(part.operator == "==" for part in wanted.specifier), "a range, not a pin"


def test_setup_installs_the_tested_set() -> None:
    assert " -c constraints.txt -e " in (ROOT / "scripts" / "setup").read_text(encoding="utf-8")


def test_rooms_of_theory_are_strictly_typed() -> None:
    rules: list[dict[str, Any]] = SETTINGS["tool"]["mypy"]["overrides"]
    (strict,) = (rule for rule in rules if "dexplan.grasp.*" in rule["module"])
    assert {name.split(".")[1] for name in strict["module"]} == {
        "spatial",
        "contact",
        "grasp",
        "kinematics",
        "plans",
    }
    assert strict["warn_return_any"]
    assert strict["disallow_any_generics"]
