"""The layout that was asked for: models/ at the top of the repository, installed as dexplan/models; no package left out."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_package_is_installed() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    found = {".".join(d.parent.relative_to(ROOT).parts) for d in (ROOT / "dexplan").rglob("__init__.py")}
    assert set(settings["packages"]) == found | {"dexplan.models"}
    assert settings["package-dir"] == {"dexplan.models": "models"}


def test_models_stand_at_the_top_and_are_read_as_a_package() -> None:
    there = {file.name for file in (ROOT / "models").glob("*.xml")}
    read = {file.name for file in resources.files("dexplan.models").iterdir() if file.name.endswith(".xml")}
    assert there
    assert read == there
    assert not (ROOT / "dexplan" / "models").exists()
