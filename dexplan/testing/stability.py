"""Record how contacts behave and check it later: of a run folder, or of a foreign scene with its controls."""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from dexplan.errors import SceneError
from dexplan.testing.baseline import NAME, Baseline, Drift, compare, find_baseline, name_file
from dexplan.testing.doctor import load_run, measure_run
from dexplan.testing.measurement import Measurement
from dexplan.testing.quantities import describe_run
from dexplan.testing.scene_run import SceneRun
from dexplan.testing.stepping import measure_contacts

TIP = "/tip"
"""How the models of run folders name the geoms of fingertips: ``<finger>/tip``; their object is ``object/surface``."""
RUN_ACCEPTED = "accepted: a folder written by 'dexplan run', or an MJCF file"


@dataclass(frozen=True)
class Checked:
    """The outcome of one check: the drift from a baseline; None where there was none to compare with."""

    name: str
    drift: Drift | None
    seconds: float

    @property
    def is_passed(self) -> bool:
        """Whether there was a baseline and the contacts are where it says."""
        return self.drift is not None and self.drift.is_within

    def table(self) -> str:
        """Return the drift, or that there is no baseline."""
        return (
            f"{self.name}: no baseline; dexplan stability record writes it"
            if self.drift is None
            else self.drift.table()
        )

    def save_junit(self, path: Path) -> None:
        """Write the outcome as a JUnit report with one test case."""
        suite = ET.Element(
            "testsuite",
            name="dexplan stability",
            tests="1",
            failures=str(int(not self.is_passed)),
            errors="0",
        )
        case = ET.SubElement(
            suite, "testcase", classname="stability", name=self.name, time=f"{self.seconds:.3f}"
        )
        if not self.is_passed:
            ET.SubElement(case, "failure", message="contacts have drifted").text = self.table()
        else:
            ET.SubElement(case, "system-out").text = self.table()
        path.parent.mkdir(parents=True, exist_ok=True)
        ET.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)


def measure_source(run: SceneRun, name: str | None) -> Baseline:
    """Return what a run folder or a scene shows, under ``name``, by default that of the folder or file."""
    source = run.scene
    measured = measure_folder(source) if source.is_dir() else measure_run(run, *load_run(run))
    chosen = name or source.resolve().name.removesuffix(source.suffix if source.is_file() else "")
    if not NAME.fullmatch(chosen):
        raise SceneError("--name", f"{chosen!r} is no file name", "accepted: letters, digits, '.', '_', '-'")
    return describe_run(chosen, measured)


def measure_folder(folder: Path) -> Measurement:
    """Return the contacts of a run folder, by replaying its model, state and controls."""
    model_path, trace_path = folder / "model.xml", folder / "trace.npz"
    for path in (model_path, trace_path):
        if not path.is_file():
            raise SceneError(str(folder), f"it has no {path.name}", RUN_ACCEPTED)
    try:
        model = mujoco.MjModel.from_xml_string(model_path.read_text(encoding="utf-8"))
        with np.load(trace_path, allow_pickle=False) as trace:
            state, ctrl = trace["initial_state"], trace["ctrl"]
            steps = int(trace["physics_steps_per_sample"])
    except (ValueError, KeyError, OSError, EOFError) as error:
        raise SceneError(str(folder), f"its model or trace cannot be read ({error})", RUN_ACCEPTED) from error
    tips = [model.geom(g).name for g in range(model.ngeom) if model.geom(g).name.endswith(TIP)]
    return measure_contacts(model, state, ctrl, tips=tips, object="object/surface", steps_per_sample=steps)


def record(run: SceneRun, name: str | None, folder: Path) -> Path:
    """Measure and write the baseline of the installed MuJoCo; returns its path."""
    now = measure_source(run, name)
    path = folder / name_file(now.name, now.versions["mujoco"])
    now.save(path)
    return path


def check(run: SceneRun, name: str | None, folder: Path) -> Checked:
    """Measure and compare with the stored baseline."""
    began = time.perf_counter()
    now = measure_source(run, name)
    found = find_baseline(folder, now.name, now.versions["mujoco"])
    drift = None
    if found is not None:
        path, is_own = found
        drift = compare(Baseline.load(path), now, path.name, is_same_version=is_own)
    return Checked(now.name, drift, time.perf_counter() - began)
