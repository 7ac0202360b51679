"""What users install: a wheel, in an environment of its own, asked to run a built-in problem from a folder of the user's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("dexplan", "models", "pyproject.toml", "README.md", "LICENSE")
OLDEST_SETUPTOOLS = 77


def _run(command: list[str], cwd: Path) -> str:
    """Run a command as a user's shell would, without this process's import path; return its output."""
    environment = {key: value for key, value in os.environ.items() if key not in {"PYTHONPATH", "PYTHONHOME"}}
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from a copy of the sources without the network."""
    if int(version("setuptools").split(".")[0]) < OLDEST_SETUPTOOLS:
        pytest.skip("this environment's setuptools is too old; scripts/setup installs a newer one")
    home = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, home / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, home / name)
    quiet = ["-q", "--disable-pip-version-check", "--no-deps", "--no-build-isolation"]
    _run([sys.executable, "-m", "pip", "wheel", *quiet, "-w", str(home / "out"), "."], home)
    (built,) = (home / "out").glob("dexplan-*.whl")
    return built


def test_the_wheel_holds_what_the_package_reads(wheel: Path) -> None:
    there = set(zipfile.ZipFile(wheel).namelist())
    wanted = {f"dexplan/models/{file.name}" for file in (ROOT / "models").glob("*.xml")}
    for pattern in ("*.py", "*.toml", "py.typed"):
        wanted |= {file.relative_to(ROOT).as_posix() for file in (ROOT / "dexplan").rglob(pattern)}
    assert wanted <= there
    assert not [name for name in there if name.startswith(("tests/", "scripts/"))]
    (points,) = (name for name in there if name.endswith("entry_points.txt"))
    assert "[pytest11]\ndexplan = dexplan.testing.plugin" in zipfile.ZipFile(wheel).read(points).decode()


def test_an_installed_wheel_holds_the_ball(wheel: Path, tmp_path: Path) -> None:
    """Dependencies come from the environment that runs the tests; dexplan from the wheel alone."""
    place = tmp_path / "environment"
    venv.create(place, with_pip=False)
    python = place / "bin" / "python"
    offline = ["--no-deps", "--no-index", "-q", "--disable-pip-version-check"]
    _run([sys.executable, "-m", "pip", "--python", str(python), "install", *offline, str(wheel)], tmp_path)
    # A path in a .pth file is searched, and no .pth file in it is read: an editable dexplan there stays out.
    site = next((place / "lib").glob("python*/site-packages"))
    folders = [path for path in sys.path if path.endswith(("site-packages", "dist-packages"))]
    (site / "dependencies.pth").write_text("\n".join(folders) + "\n", encoding="utf-8")

    folder = tmp_path / "elsewhere"
    folder.mkdir()
    where = _run([str(python), "-c", "import dexplan; print(dexplan.__file__, dexplan.__version__)"], folder)
    assert where.startswith(str(site))
    assert where.split()[-1] == wheel.name.split("-")[1]
    said = _run([str(place / "bin" / "dexplan"), "run", "hold_two"], folder)
    assert said.splitlines()[-1].startswith("PASS hold_two")
    assert {file.name for file in (folder / "runs" / "hold_two").iterdir()} >= {
        "plan.json",
        "trace.npz",
        "report.json",
    }
