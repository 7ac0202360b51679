"""Contact behaviour against stored baselines, one file per run and MuJoCo version: drift is shown quantity by quantity.

The plans that are run are stored too, so that a better planner does not look like a worse contact.
``scripts/baselines`` measures again and writes the files of the installed version; with ``--plans`` it plans anew first.
"""

from __future__ import annotations

import re
import sys
import warnings
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from short_runs import (
    HOLDS,
    PROFILES,
    build_plan_reference,
    hold_problem,
    plan_of,
    simulate,
    turn_problem,
)

from dexplan import pipeline
from dexplan.plans.plan import Plan
from dexplan.problems.problem import Problem
from dexplan.problems.read import load_problem
from dexplan.sim.judge.validate import ValidationReport
from dexplan.sim.trace import Trace
from dexplan.testing.baseline import (
    RELATIVE,
    Baseline,
    Quantity,
    as_key,
    compare,
    find_baseline,
    make_baseline,
    name_file,
)

FOLDER = Path(__file__).parent.parent / "baselines"
PACKAGES = ("mujoco", "mink", "osqp", "daqp", "numpy", "scipy")
RUNS = (*HOLDS, "substitution", "full_turn")
FLOORS = {
    "position_error_max_mm": 0.001,
    "rotation_error_max_deg": 0.005,
    "friction_utilisation_max": 0.01,
    "coulomb_slip_max_mm": 0.005,
    "creep_rate_max_um_s": 0.2,
    "penetration_max_um": 2.0,
    "normal_force_end_N": 0.05,
}
"""A quantity may move by a tenth of its baseline or by this much, whichever is more."""
UNITS = dict(zip(FLOORS, ("mm", "deg", "-", "mm", "um/s", "um", "N"), strict=True))
GROSS = {
    "position_error_max_mm": 0.5,
    "rotation_error_max_deg": 0.75,
    "friction_utilisation_max": 0.95,
    "coulomb_slip_max_mm": 0.1,
    "creep_rate_max_um_s": 150.0,
    "penetration_max_um": 200.0,
    "normal_force_end_N": 12.0,
}
"""What another version of MuJoCo, of which there is no baseline yet, may show at most."""


def make_problem(run: str, profile: str) -> Problem:
    """Return the problem of one of :data:`RUNS`."""
    if run in HOLDS:
        return hold_problem(run, profile)
    if run == "substitution":
        return turn_problem(profile)
    return load_problem("fig4_substitution", {"control.physics_profile": profile})


@lru_cache
def judged_run(run: str, profile: str) -> tuple[Trace, ValidationReport]:
    """Return the run of the stored plan and its judgement, simulated once per process."""
    problem, plan = make_problem(run, profile), Plan.load(FOLDER / "plans" / f"{run}.json")
    trace = simulate(problem, build_plan_reference(problem, plan))
    return trace, pipeline.validate(problem, plan, trace)


def measure(run: str, profile: str) -> dict[str, Quantity]:
    """Return the quantities of a run; nothing measured is NaN."""
    trace, report = judged_run(run, profile)
    out: dict[str, float] = {}
    for name in FLOORS:
        check = re.sub("_(mm|deg|um_s|um|N)$", "", name)
        if check != "normal_force_end":
            value = report[check].value
            out[name] = float("nan") if value is None else value
    for k, force in enumerate(trace["contact_force"][-1, :, 2], start=1):
        if np.isfinite(force):
            out[f"normal_force_end_N.finger_{k}"] = float(force)
    kind = {name: name.split(".")[0] for name in out}
    return {
        name: Quantity(value, UNITS[kind[name]], RELATIVE, FLOORS[kind[name]]) for name, value in out.items()
    }


def describe(run: str, profile: str) -> Baseline:
    """Return a run as a baseline keeps it."""
    return make_baseline(f"{run}.{profile}", measure(run, profile), None, *PACKAGES)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("run", RUNS)
def test_contacts_behave_as_they_did(run: str, profile: str) -> None:
    found = find_baseline(FOLDER, f"{run}.{profile}", version("mujoco"))
    assert found is not None, "no baselines are stored; run scripts/baselines"
    path, is_own = found
    now = describe(run, profile)
    drift = compare(Baseline.load(path), now, path.name, is_same_version=is_own)
    if is_own:
        assert drift.is_within, drift.table()
        return
    warnings.warn(drift.table(), stacklevel=1)
    for name, quantity in now.quantities.items():
        assert quantity.value <= GROSS[name.split(".")[0]], drift.table()


def test_every_run_has_its_baseline() -> None:
    stored = [Baseline.load(path) for path in FOLDER.glob("*.json")]
    runs = {f"{run}.{profile}" for run in RUNS for profile in PROFILES}
    for minor in {as_key(baseline.versions["mujoco"]) for baseline in stored}:
        assert {b.name for b in stored if as_key(b.versions["mujoco"]) == minor} == runs
    for baseline in stored:
        assert (FOLDER / name_file(baseline.name, baseline.versions["mujoco"])).is_file()
        assert {name.split(".")[0] for name in baseline.quantities} == set(FLOORS)
        for name, quantity in baseline.quantities.items():
            assert (quantity.relative, quantity.floor) == (RELATIVE, FLOORS[name.split(".")[0]])


def write_plans() -> None:
    """Plan every run anew."""
    (FOLDER / "plans").mkdir(parents=True, exist_ok=True)
    for run in RUNS:
        plan_of(make_problem(run, PROFILES[0])).save(FOLDER / "plans" / f"{run}.json")


def write_baselines() -> None:
    """Measure every run and write the files of the installed version; a run that loses the object is refused."""
    for run in RUNS:
        for profile in PROFILES:
            trace, report = judged_run(run, profile)
            print(f"{run}.{profile}: {report.summary_line()}", file=sys.stderr, flush=True)
            if trace.meta["failure"]:
                raise SystemExit(f"{run}, {profile}: {trace.meta['failure']}")
            now = describe(run, profile)
            found = find_baseline(FOLDER, now.name, version("mujoco"))
            if found is not None:
                print(compare(Baseline.load(found[0]), now, found[0].name, is_same_version=found[1]).table())
            now.save(FOLDER / name_file(now.name, version("mujoco")))


if __name__ == "__main__":
    if "--plans" in sys.argv[1:] or not (FOLDER / "plans").is_dir():
        write_plans()
    write_baselines()
