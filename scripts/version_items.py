"""What is asked of one version of MuJoCo, and how: every item is answered by a process of that version's environment."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import venv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HOME = "3.17"
"""The minor version that CI installs, whose baselines all others are compared with."""
FREE = ("mujoco", "dm-control", "setuptools")
"""What the constraints do not fix in these environments: MuJoCo is what is asked about, each dm-control has a least MuJoCo of
its own, and what builds a package is none of its dependencies."""
EXTRAS = ("pytest", "hypothesis", "clarabel")
"""What the tests need besides the package."""
LONGEST_S = 3 * 3600.0
"""Seconds after which an item is given up."""
PROBE = """
import sys
from pathlib import Path
sys.path[:0] = ["tests", "tests/sim", "tests/testing"]
kind, name, out = sys.argv[1:]
if kind == "contacts":
    from test_contact_stability import describe
    now = describe(*name.split("."))
else:
    from stability_scenes import describe_scene
    now = describe_scene(name)
now.save(Path(out))
"""
VERSIONS = """
import importlib.metadata as m, mujoco
print(*(f"{p} {m.version(p)}" for p in ("mujoco", "dm-control", "mink", "numpy")), f"library {mujoco.mj_versionString()}")
"""

Row = dict[str, Any]


@dataclass(frozen=True)
class Item:
    """One question to one version: ``kind`` is contacts, scene, problem or tests; ``folder`` holds the environments."""

    mujoco: str
    kind: str
    name: str
    folder: Path

    @property
    def key(self) -> str:
        """The name of the item in the file of rows."""
        return f"{self.mujoco} {self.kind} {self.name}"


def name_python(folder: Path, version: str) -> Path:
    """Return the Python of a version's environment."""
    return folder / f"mujoco-{version}" / "bin" / "python"


def make_environment(folder: Path, version: str) -> str:
    """Make the environment of a version where there is none yet; returns its versions.

    The range of MuJoCo that the package asks for is left out, so that a version outside of it can be asked about; all other
    requirements hold, in the versions of ``constraints.txt``.  MuJoCo 4 is a package and a core of the same version: asking
    pip for a core alone keeps an older package beside it, so both are compared afterwards.
    """
    place, python = folder / f"mujoco-{version}", name_python(folder, version)
    done = place / "complete"
    if not done.is_file():
        venv.create(place, with_pip=True, clear=True)
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        wanted = [r for r in project["dependencies"] if not r.startswith(FREE)]
        wanted += [r for r in project["optional-dependencies"]["dev"] if r.startswith(EXTRAS)]
        fixed = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
        (place / "constraints.txt").write_text(
            "\n".join(line for line in fixed if line.partition("==")[0] not in FREE) + "\n", encoding="utf-8"
        )
        pip = [str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check"]
        _run(
            [
                *pip,
                "-c",
                str(place / "constraints.txt"),
                f"mujoco=={version}",
                "dm-control",
                "setuptools>=77",
                *wanted,
            ],
            ROOT,
        )
        _run([*pip, "--no-deps", "--no-build-isolation", "-e", str(ROOT)], ROOT)
        done.write_text("")
    told = _run([str(python), "-c", VERSIONS], folder).strip()
    package, library = re.search(r"mujoco (\S+)", told), re.search(r"library (\S+)", told)
    if package is None or library is None or package[1] != library[1]:
        raise SystemExit(f"MuJoCo's package and its library are of different versions: {told}")
    return told.partition(" library")[0]


def _run(command: Sequence[str], cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, env=_environment(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command[:6])} failed: {done.stderr.strip()[-800:]}")
    return done.stdout


def _environment() -> dict[str, str]:
    """Return the environment variables of a process of another Python."""
    left_out = ("PYTHONPATH", "PYTHONHOME", "DEXPLAN_RESTARTED", "VIRTUAL_ENV")
    return {k: v for k, v in os.environ.items() if k not in left_out} | {"OPENBLAS_NUM_THREADS": "1"}


def answer(item: Item) -> Row:
    """Return the row of an item: ``is_well`` and what is told of it, in a few words."""
    python = str(name_python(item.folder, item.mujoco))
    out = item.folder / "out" / item.mujoco / item.kind / re.sub(r"\W+", "_", item.name)
    out.parent.mkdir(parents=True, exist_ok=True)
    commands = {
        "contacts": [python, "-c", PROBE, "contacts", item.name, f"{out}.json"],
        "scene": [python, "-c", PROBE, "scene", item.name, f"{out}.json"],
        "problem": [python, "-m", "dexplan", "run", item.name, "--no-video", "--out", str(out)],
        "tests": [
            python,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--no-header",
            "--tb=line",
            item.name,
        ],
    }
    try:
        done = subprocess.run(
            commands[item.kind],
            cwd=ROOT,
            env=_environment(),
            capture_output=True,
            text=True,
            check=False,
            timeout=LONGEST_S,
        )
    except subprocess.TimeoutExpired:
        return {"key": item.key, "is_well": False, "told": f"not done after {LONGEST_S / 3600:.0f} h"}
    (out.parent / f"{out.name}.log").write_text(done.stdout + done.stderr, encoding="utf-8")
    last = next((line for line in reversed((done.stdout or done.stderr).splitlines()) if line.strip()), "")
    row: Row = {"key": item.key, "is_well": done.returncode == 0, "told": last}
    if item.kind == "tests":
        row["told"] = count_tests(done.stdout) or last
        row["failed"] = re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, flags=re.MULTILINE)
    elif item.kind in {"contacts", "scene"}:
        error = done.stderr.strip().splitlines()
        row["told"] = f"{out}.json" if done.returncode == 0 else (error[-1] if error else "no answer")
    return row


def count_tests(output: str) -> str:
    """Return "7 passed, 1 failed" of pytest's quiet output, "" where it has no progress lines."""
    marks = "".join(re.findall(r"^([.FEsxX]+) *\[ *\d+%\]$", output, flags=re.MULTILINE))
    words = {".": "passed", "F": "failed", "E": "with an error", "s": "skipped"}
    return ", ".join(f"{marks.count(mark)} {word}" for mark, word in words.items() if mark in marks)


def list_items(folder: Path, version: str, tests: Sequence[str], problems: Sequence[str]) -> Iterator[Item]:
    """Yield what is asked of a version, the cheap first."""
    for path in sorted((ROOT / "tests" / "testing" / "contact_baselines").glob(f"*.mujoco-{HOME}.json")):
        yield Item(version, "scene", path.name.removesuffix(f".mujoco-{HOME}.json"), folder)
    for path in sorted((ROOT / "tests" / "baselines").glob(f"*.mujoco-{HOME}.json")):
        yield Item(version, "contacts", path.name.removesuffix(f".mujoco-{HOME}.json"), folder)
    for name in problems:
        yield Item(version, "problem", name, folder)
    for name in tests:
        yield Item(version, "tests", name, folder)


if __name__ == "__main__":
    sys.exit("version_items is read by scripts/versions")
