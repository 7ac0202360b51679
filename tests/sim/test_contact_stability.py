"""Contact behaviour against stored baselines, one file per MuJoCo version: drift is shown quantity by quantity.

The plans that are run are stored too, so that a better planner does not look like a worse contact.
``scripts/baselines`` measures again and writes the file of the installed version; with ``--plans`` it plans anew first.
"""

from __future__ import annotations

import json
import re
import sys
import warnings
from collections.abc import Mapping
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

FOLDER = Path(__file__).parent.parent / "baselines"
PACKAGES = ("mujoco", "mink", "osqp", "daqp", "numpy", "scipy")
RUNS = (*HOLDS, "substitution", "full_turn")
RELATIVE = 0.10
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

Quantities = Mapping[str, float]
Row = tuple[str, float, float, float]


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


def measure(run: str, profile: str) -> dict[str, float]:
    """Return the quantities of a run; nothing measured is NaN."""
    trace, report = judged_run(run, profile)
    out = {}
    for name in FLOORS:
        check = re.sub("_(mm|deg|um_s|um|N)$", "", name)
        if check != "normal_force_end":
            value = report[check].value
            out[name] = float("nan") if value is None else value
    for k, force in enumerate(trace["contact_force"][-1, :, 2], start=1):
        if np.isfinite(force):
            out[f"normal_force_end_N.finger_{k}"] = float(force)
    return out


def as_key(text: str) -> tuple[int, ...]:
    """Return "3.17.0" as (3, 17)."""
    return tuple(int(part) for part in text.split(".")[:2])


def find_baseline(installed: str, folder: Path = FOLDER) -> tuple[Path, bool] | None:
    """Return the baseline for a MuJoCo version and whether it is that version's own; else the nearest older, then newer."""
    stored = {as_key(p.stem.removeprefix("mujoco-")): p for p in sorted(folder.glob("mujoco-*.json"))}
    wanted = as_key(installed)
    if wanted in stored:
        return stored[wanted], True
    older = [key for key in stored if key < wanted]
    if stored:
        return stored[max(older) if older else min(stored)], False
    return None


def find_drift(baseline: Quantities, now: Quantities) -> list[Row]:
    """Return (quantity, baseline, now, share of what is allowed) of every quantity; beyond 1 it moved too far."""
    rows = []
    for name in sorted({*baseline, *now}):
        was, value = baseline.get(name, float("nan")), now.get(name, float("nan"))
        allowed = max(RELATIVE * abs(was), FLOORS[name.split(".")[0]])
        change = abs(value - was) / allowed
        rows.append((name, was, value, change if np.isfinite(change) else float("inf")))
    return rows


def tabulate(title: str, rows: list[Row]) -> str:
    """Return the drift as text, worst first."""
    lines = [title, f"{'quantity':32}{'baseline':>12}{'now':>12}{'change':>12}"]
    for name, was, now, share in sorted(rows, key=lambda row: -row[3]):
        mark = "  <-- beyond tolerance" if share > 1.0 else ""
        lines.append(f"{name:32}{was:12.5g}{now:12.5g}{now - was:+12.3g}{mark}")
    return "\n".join(lines)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("run", RUNS)
def test_contacts_behave_as_they_did(run: str, profile: str) -> None:
    installed = version("mujoco")
    found = find_baseline(installed)
    assert found is not None, "no baselines are stored; run scripts/baselines"
    path, is_own = found
    stored = json.loads(path.read_text(encoding="utf-8"))
    now = measure(run, profile)
    rows = find_drift(stored["runs"][f"{run}.{profile}"], now)
    changed = [
        f"{name} {stored['versions'].get(name)} -> {version(name)}"
        for name in PACKAGES
        if stored["versions"].get(name) != version(name)
    ]
    title = f"{run}, {profile}, against {path.name}; versions: {', '.join(changed) or 'as in the baseline'}"
    if is_own:
        assert max(row[3] for row in rows) <= 1.0, tabulate(title, rows)
        return
    warnings.warn(tabulate(title, rows), stacklevel=1)
    for name, value in now.items():
        assert value <= GROSS[name.split(".")[0]], tabulate(title, rows)


def test_every_run_has_its_baseline() -> None:
    for path in FOLDER.glob("mujoco-*.json"):
        stored = json.loads(path.read_text(encoding="utf-8"))
        assert set(stored["runs"]) == {f"{run}.{profile}" for run in RUNS for profile in PROFILES}
        assert as_key(stored["versions"]["mujoco"]) == as_key(path.stem.removeprefix("mujoco-"))
        for quantities in stored["runs"].values():
            assert {name.split(".")[0] for name in quantities} == set(FLOORS)
            assert np.isfinite(list(quantities.values())).all()


def test_nearest_older_baseline_stands_in(tmp_path: Path) -> None:
    assert find_baseline("3.17.0", tmp_path) is None
    for name in ("3.9", "3.16", "4.1"):
        (tmp_path / f"mujoco-{name}.json").write_text("{}")
    for installed, stem, is_own in (
        ("3.16.2", "3.16", True),
        ("3.17.0", "3.16", False),
        ("3.10.0", "3.9", False),
        ("4.0.0", "3.16", False),
        ("3.8.1", "3.9", False),
    ):
        assert find_baseline(installed, tmp_path) == (tmp_path / f"mujoco-{stem}.json", is_own)


def test_drift_is_relative_with_floors_and_told_in_a_table() -> None:
    was = {"penetration_max_um": 100.0, "coulomb_slip_max_mm": 0.0, "normal_force_end_N.finger_1": 5.0}
    now = {"penetration_max_um": 109.0, "coulomb_slip_max_mm": 0.006, "normal_force_end_N.finger_2": 5.0}
    share = {row[0]: row[3] for row in find_drift(was, now)}
    assert share["penetration_max_um"] == pytest.approx(0.9)
    assert share["coulomb_slip_max_mm"] == pytest.approx(1.2)
    # A finger that no longer touches, or one that should not, is as far off as can be.
    assert share["normal_force_end_N.finger_1"] == share["normal_force_end_N.finger_2"] == float("inf")
    text = tabulate("drift", find_drift(was, now)).splitlines()
    assert [line.endswith("beyond tolerance") for line in text[2:]] == [True, True, True, False]
    assert text[-1].split() == ["penetration_max_um", "100", "109", "+9"]


def write_plans() -> None:
    """Plan every run anew."""
    (FOLDER / "plans").mkdir(parents=True, exist_ok=True)
    for run in RUNS:
        plan_of(make_problem(run, PROFILES[0])).save(FOLDER / "plans" / f"{run}.json")


def write_baselines() -> Path:
    """Measure every run and write the installed version's file; a run that loses the object is refused."""
    runs = {}
    for run in RUNS:
        for profile in PROFILES:
            print(f"{run}.{profile}", file=sys.stderr, flush=True)
            trace, report = judged_run(run, profile)
            print(report.summary_line(), file=sys.stderr, flush=True)
            if trace.meta["failure"]:
                raise SystemExit(f"{run}, {profile}: {trace.meta['failure']}")
            runs[f"{run}.{profile}"] = {name: float(f"{v:.6g}") for name, v in measure(run, profile).items()}
    installed = version("mujoco")
    path = FOLDER / f"mujoco-{'.'.join(map(str, as_key(installed)))}.json"
    found = find_baseline(installed)
    if found is not None:
        stored = json.loads(found[0].read_text(encoding="utf-8"))["runs"]
        for name, quantities in runs.items():
            print(tabulate(f"{name}, against {found[0].name}", find_drift(stored.get(name, {}), quantities)))
    content = {"versions": {name: version(name) for name in PACKAGES}, "runs": runs}
    FOLDER.mkdir(exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path


if __name__ == "__main__":
    if "--plans" in sys.argv[1:] or not (FOLDER / "plans").is_dir():
        write_plans()
    print(write_baselines())
