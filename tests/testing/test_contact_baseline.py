"""Baselines as a user meets them: a project of its own, five lines of test, friction lowered by a fifth."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import pytest
from foreign_scenes import pinch, pinch_controls

from dexplan.errors import DexplanError
from dexplan.testing import measure_contacts
from dexplan.testing.baseline import Baseline, Quantity, compare, find_baseline, make_baseline, name_file
from dexplan.testing.quantities import describe_run

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("dexplan", "models", "pyproject.toml", "README.md", "LICENSE")
OLDEST_SETUPTOOLS = 77
SCENE = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0" cone="elliptic" impratio="100"/>
  <default><geom friction="MU 0.01 0.0001" condim="4" solref="0.004 1"/></default>
  <worldbody>
    <body name="left" pos="-.04 0 0"><joint name="left" type="slide" axis="1 0 0"/>
      <geom type="sphere" size=".01" mass=".1"/></body>
    <body name="right" pos=".04 0 0"><joint name="right" type="slide" axis="-1 0 0"/>
      <geom type="sphere" size=".01" mass=".1"/></body>
    <body name="ball"><freejoint/><site name="middle"/><geom type="sphere" size=".03" mass=".05"/></body>
  </worldbody>
  <actuator><motor joint="left"/><motor joint="right"/><motor site="middle" gear="0 0 1 0 0 0"/></actuator>
</mujoco>
"""
TEST = """
import mujoco, numpy as np
from dexplan.testing import measure_contacts

def test_pinch(contact_baseline):
    model = mujoco.MjModel.from_xml_path("scene.xml")
    measured = measure_contacts(model, None, np.tile([2, 2, 1.0], (300, 1)), tips=["left", "right"], object="ball")
    contact_baseline.check("pinch", measured)
"""


def install_listed(site: Path) -> None:
    """Copy what a wheel would install: the packages that are listed, their data, and the entry points."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    tool = settings["tool"]["setuptools"]
    for package in tool["packages"]:
        source = ROOT / tool["package-dir"].get(package, package.replace(".", "/"))
        target = site / package.replace(".", "/")
        target.mkdir(parents=True, exist_ok=True)
        for pattern in ["*.py", *tool["package-data"].get(package, [])]:
            for file in source.glob(pattern):
                (target / file.relative_to(source)).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, target / file.relative_to(source))
    info = site / "dexplan-0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: dexplan\nVersion: 0\n")
    points = settings["project"]["entry-points"]["pytest11"]
    (info / "entry_points.txt").write_text(
        "[pytest11]\n" + "".join(f"{k} = {v}\n" for k, v in points.items())
    )


def install_wheel(site: Path) -> None:
    """Build the wheel from a copy of the sources, without the network, and install it."""
    if int(version("setuptools").split(".")[0]) < OLDEST_SETUPTOOLS:
        pytest.skip("this environment's setuptools is too old; scripts/setup installs a newer one")
    home = site.parent / "source"
    home.mkdir()
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, home / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, home / name)
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check"]
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", str(home / "out"), "."]
    subprocess.run(build, cwd=home, check=True)
    (wheel,) = (home / "out").glob("dexplan-*.whl")
    install = [*pip, "install", "--no-deps", "--no-index", "--target", str(site), str(wheel)]
    subprocess.run(install, cwd=home, check=True)


@pytest.fixture(scope="module", params=[install_listed, install_wheel], ids=["listed", "wheel"])
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with dexplan installed in it, and nothing else."""
    place = tmp_path_factory.mktemp("home") / "site"
    place.mkdir()
    request.param(place)
    return place


def run_pytest(site: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def test_a_users_project_passes_and_fails_when_friction_is_lowered(site: Path, tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(SCENE.replace("MU", "0.5"))
    (tmp_path / "test_grasp.py").write_text(TEST)
    missing = run_pytest(site, tmp_path)
    assert missing.returncode == 1
    assert "pytest --contact-baseline-update writes it" in missing.stdout
    where = run_pytest(site, tmp_path, "--contact-baseline-update", "--junitxml=junit.xml")
    assert where.returncode == 0, where.stdout
    (stored,) = (tmp_path / "contact_baselines").iterdir()
    content = json.loads(stored.read_text())
    assert content["format"] == 1
    assert content["versions"]["mujoco"]
    assert content["platform"]
    used = content["quantities"]["left on ball: utilisation_max"]
    assert used["value"] == pytest.approx(0.5, rel=0.05)
    assert used["unit"] == "-"
    again = run_pytest(site, tmp_path)
    assert again.returncode == 0, again.stdout
    (tmp_path / "scene.xml").write_text(SCENE.replace("MU", "0.4"))
    slippery = run_pytest(site, tmp_path, "--junitxml=junit.xml")
    assert slippery.returncode == 1
    assert "beyond tolerance" in (tmp_path / "junit.xml").read_text()
    lines = [line for line in slippery.stdout.splitlines() if "beyond tolerance" in line]
    assert any("left on ball: utilisation_max" in line and "0.5" in line for line in lines), slippery.stdout
    assert "Traceback" not in slippery.stdout


def test_the_plugin_is_declared_and_light() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert settings["project"]["entry-points"]["pytest11"] == {"dexplan": "dexplan.testing.plugin"}
    code = "import sys, dexplan.testing.plugin\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert not {"mujoco", "numpy", "scipy"} & set(done.stdout.split())


def test_a_lost_grasp_changes_the_verdict_under_any_version() -> None:
    model = pinch()

    def describe(load: float) -> Baseline:
        controls = pinch_controls(300, load=load)
        measured = measure_contacts(model, None, controls, tips=["left", "right"], object="thing")
        return describe_run("pinch", measured)

    held, dropped = describe(0.5), describe(3.0)
    for is_same_version in (True, False):
        drift = compare(held, dropped, "there", is_same_version=is_same_version)
        assert not drift.is_within
        assert "left on thing: verdict: " in drift.table()


def test_numbers_warn_but_do_not_fail_under_another_version() -> None:
    was = make_baseline("run", {"slip_mm": Quantity(1.0, "mm")})
    now = make_baseline("run", {"slip_mm": Quantity(2.0, "mm")})
    older = replace(was, versions={**was.versions, "mujoco": "3.9.0"})
    assert not compare(was, now, "x", is_same_version=True).is_within
    drift = compare(older, now, "x", is_same_version=False)
    assert drift.is_within
    assert drift.has_moved
    assert f"mujoco 3.9.0 -> {now.versions['mujoco']}" in drift.table()


def test_drift_is_relative_with_floors_and_told_in_a_table() -> None:
    was = make_baseline(
        "run", {"depth": Quantity(100.0), "slip": Quantity(0.0, floor=0.005), "gone": Quantity(5.0, "N")}
    )
    now = make_baseline("run", {"depth": Quantity(109.0), "slip": Quantity(0.006), "new": Quantity(5.0, "N")})
    drift = compare(was, now, "run.json", is_same_version=True)
    share = {row.name: row.share for row in drift.rows}
    assert share["depth"] == pytest.approx(0.9)
    assert share["slip"] == pytest.approx(1.2)
    # What is no longer there, or was not there before, is as far off as can be.
    assert share["gone"] == share["new"] == float("inf")
    text = drift.table().splitlines()
    assert [line.endswith("beyond tolerance") for line in text[2:]] == [True, True, True, False]
    assert text[-1].split() == ["depth", "100", "109", "+9", "-"]


def test_nearest_older_baseline_stands_in(tmp_path: Path) -> None:
    assert find_baseline(tmp_path, "a", "3.17.0") is None
    for stored in ("3.9", "3.16", "4.1"):
        (tmp_path / f"a.mujoco-{stored}.json").write_text("{}")
    (tmp_path / "b.mujoco-3.17.json").write_text("{}")
    for installed, nearest, is_own in (
        ("3.16.2", "3.16", True),
        ("3.17.0", "3.16", False),
        ("3.10.0", "3.9", False),
        ("4.0.0", "3.16", False),
        ("3.8.1", "3.9", False),
    ):
        assert find_baseline(tmp_path, "a", installed) == (tmp_path / f"a.mujoco-{nearest}.json", is_own)
    assert name_file("a", "3.17.0") == "a.mujoco-3.17.json"


def test_baselines_round_trip(tmp_path: Path) -> None:
    baseline = make_baseline("run", {"depth_mm": Quantity(1.23456789, "mm", 0.2, 0.01)}, {"verdict": "stuck"})
    baseline.save(tmp_path / "there" / "run.json")
    assert Baseline.load(tmp_path / "there" / "run.json") == baseline
    assert baseline.quantities["depth_mm"].value == 1.23457


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "is no JSON"),
        ("[]", "lacks or misspells"),
        ('{"format": 9}', "format 9; accepted: a contact baseline of format 1"),
        ('{"format": 1, "name": "a"}', "lacks or misspells"),
        (
            '{"format": 1, "name": "a", "words": {}, "versions": {}, "platform": "", "quantities": {"a": {"value": NaN}}}',
            "no tolerable quantity",
        ),
    ],
)
def test_what_is_no_baseline_is_said_in_one_line(text: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(DexplanError, match=told) as caught:
        Baseline.load(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "measured", "told"),
    [
        ("a/b", {"x": 1.0}, "is no file name"),
        ("a", {"x": float("nan")}, "x is nan"),
        ("a", {"x": "wide"}, "is no number"),
        ("a", 3.0, "float cannot be kept"),
    ],
)
def test_what_cannot_be_kept_is_said_in_one_line(name: str, measured: object, told: str) -> None:
    with pytest.raises(DexplanError, match=told):
        describe_run(name, measured)  # type: ignore[arg-type]
