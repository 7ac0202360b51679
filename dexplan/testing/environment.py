"""Is this machine fit for dexplan?  One line per thing that users have been stopped by."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

RENDER = "import mujoco\nc = mujoco.GLContext(64, 64)\nc.make_current()\nprint('drawn')"
RENDER_TIMEOUT_S = 60.0
"""A renderer that has not begun by then hangs."""
LEAST_PYTHON = (3, 11)


@dataclass(frozen=True)
class Finding:
    """One line: what was looked at, whether it is as it has to be, and what is there or what to do."""

    subject: str
    is_well: bool
    told: str

    def __str__(self) -> str:
        return f"{'ok  ' if self.is_well else 'FAIL'}  {self.subject}: {self.told}"


def check_environment(cache: Path, work: Path) -> list[Finding]:
    """Return what was found; ``cache`` is the folder of kept workspaces, ``work`` the one that runs would be written to."""
    return [
        _check_python(),
        *_check_packages(),
        _check_mujoco_parts(),
        _check_renderer(),
        _check_folder("cache", cache),
        _check_folder("working folder", work),
    ]


def _check_python() -> Finding:
    version = ".".join(map(str, sys.version_info[:3]))
    is_well = sys.version_info >= LEAST_PYTHON
    return Finding("Python", is_well, version if is_well else f"{version}; 3.11 or later is needed")


def _check_packages() -> list[Finding]:
    """Check the packages that dexplan's own metadata ask for, extras aside."""
    try:
        asked = metadata.requires("dexplan") or []
        own = metadata.version("dexplan")
    except metadata.PackageNotFoundError:
        return [Finding("dexplan", False, "it is not installed; pip install dexplan, or pip install -e .")]
    out, missing = [Finding("dexplan", True, own)], []
    found = []
    for line in asked:
        name, needed = re.match(r"[\w.-]+", line), line.partition(";")
        if name is None or "extra" in needed[2]:
            continue
        try:
            installed = metadata.version(name[0])
        except metadata.PackageNotFoundError:
            missing.append(needed[0].strip())
            continue
        if not _is_in_range(installed, needed[0]):
            missing.append(f"{needed[0].strip()} ({installed} is installed)")
        found.append(f"{name[0]} {installed}")
    told = ", ".join(found) if not missing else f"pip install {', '.join(missing)}"
    return [*out, Finding("packages", not missing, told)]


def _is_in_range(installed: str, line: str) -> bool:
    """Return whether a version is within what a requirement such as ``mujoco>=3.16,<4`` says."""
    have = _as_numbers(installed)
    for sign, bound in re.findall(r"(>=|<=|==|!=|<|>)\s*([\w.]+)", line):
        want = _as_numbers(bound)
        size = max(len(have), len(want))
        a, b = (v + (0,) * (size - len(v)) for v in (have, want))
        is_met = {"<": a < b, ">": a > b, ">=": a >= b, "<=": a <= b, "==": a == b, "!=": a != b}
        if not is_met[sign]:
            return False
    return True


def _as_numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version.partition("+")[0]))


def _check_mujoco_parts() -> Finding:
    """Check that MuJoCo's Python package and its library are of one version: they can be installed apart."""
    import mujoco

    package, library = metadata.version("mujoco"), str(mujoco.mj_versionString())
    if _as_numbers(package)[:3] == _as_numbers(library)[:3]:
        return Finding("MuJoCo", True, f"{package}, its library as well")
    fact = f"the package is {package} and its library {library}"
    return Finding("MuJoCo", False, f"{fact}; pip uninstall mujoco mujoco-core, then pip install mujoco")


def _check_renderer() -> Finding:
    """Draw nothing, without a window, in a process of its own: MuJoCo chooses its platform once."""
    for backend in ("egl", "osmesa"):
        environment = {**os.environ, "MUJOCO_GL": backend, "PYOPENGL_PLATFORM": backend}
        try:
            done = subprocess.run(
                [sys.executable, "-c", RENDER],
                env=environment,
                capture_output=True,
                text=True,
                timeout=RENDER_TIMEOUT_S,
            )
        except (OSError, subprocess.TimeoutExpired):
            continue
        if done.returncode == 0 and "drawn" in done.stdout:
            return Finding("renderer", True, f"{backend} draws without a window")
    return Finding("renderer", False, "no video can be made; apt-get install libegl1 libgl1")


def _check_folder(subject: str, folder: Path) -> Finding:
    """Check that files can be written to ``folder``, or to the nearest folder above it that exists."""
    nearest = next((place for place in [folder, *folder.absolute().parents] if place.is_dir()), Path("/"))
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        return Finding(subject, False, f"{folder} cannot be written ({error.strerror})")
    return Finding(subject, True, f"{folder} can be written")
