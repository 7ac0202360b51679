"""All checks, one report: the independent judgement of a run.

``validate_run`` steps MuJoCo itself from the recorded initial state and controls and judges what it sees; the
plan is read as data and no code of planner or controller is used.
"""

from __future__ import annotations

import json
import math
import os
import platform
import time
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib import metadata, resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from dexplan.errors import RunFolderError
from dexplan.sim import (
    checks,
    checks_contact,
    checks_force_audit,
    checks_forces,
    checks_physics,
    checks_rolling,
)
from dexplan.sim.checks_case import MAY, Case, CheckResult, find_runs
from dexplan.sim.replay import Replay, replay
from dexplan.sim.trace import Trace

FORMAT = 1
"""The report format this package reads and writes."""

CHECKS: tuple[tuple[str, Callable[[Case], CheckResult]], ...] = (
    ("replay_matches", checks.check_replay_matches),
    ("trace_consistent", checks.check_trace_consistent),
    ("physics_untouched", checks_physics.check_physics_untouched),
    ("phases_in_order", checks.check_phases_in_order),
    ("reference_position_error_max", checks.check_reference_position),
    ("reference_rotation_error_max", checks.check_reference_rotation),
    ("reference_speed_max", checks.check_reference_speed),
    ("object_support_other", checks_contact.check_object_support_other),
    ("not_dropped", checks.check_not_dropped),
    ("position_error_max", checks.check_position_error_max),
    ("rotation_error_max", checks.check_rotation_error_max),
    ("position_error_final", checks.check_position_error_final),
    ("rotation_error_final", checks.check_rotation_error_final),
    ("turned_angle", checks.check_turned_angle),
    ("contact_error_final", checks.check_contact_error_final),
    ("contact_schedule", checks_contact.check_contact_schedule),
    ("contact_region_error_max", checks_contact.check_contact_region),
    ("finger_order_kept", checks_contact.check_finger_order_kept),
    ("plan_force_closure", checks_forces.check_plan_force_closure),
    ("plan_load_margin", checks_forces.check_plan_load_margin),
    ("force_qp_feasible", checks_force_audit.check_force_qp_feasible),
    ("force_cone_margin_min", checks_forces.check_force_cone_margin_min),
    ("friction_utilisation_max", checks_forces.check_friction_utilisation_max),
    ("coulomb_slip_max", checks_contact.check_coulomb_slip_max),
    ("creep_rate_max", checks_contact.check_creep_rate_max),
    ("rolling_error_max", checks_rolling.check_rolling_error_max),
    ("roll_path_error_max", checks_rolling.check_roll_path_error_max),
    ("penetration_max", checks_contact.check_penetration_max),
    ("tip_contact_angle_max", checks_contact.check_tip_contact_angle_max),
    ("force_prediction_error", checks_forces.check_force_prediction_error),
    ("tip_tracking_error_max", checks_forces.check_tip_tracking_error_max),
    ("ik_at_limit", checks_forces.check_ik_at_limit),
    ("free_finger_clearance_min", checks_contact.check_free_finger_clearance),
    ("unexpected_contacts", checks_contact.check_unexpected_contacts),
    ("joint_limit_margin_min", checks_forces.check_joint_limit_margin_min),
    ("torque_utilisation_max", checks_forces.check_torque_utilisation_max),
)
"""Every check in the order of the report."""

NOT_APPLICABLE: Mapping[str, tuple[Callable[[Mapping[str, Any]], bool], str]] = {
    "turned_angle": (lambda problem: not problem["goal"].get("rotation"), "the goal names no axis and angle"),
    "contact_error_final": (
        lambda problem: not problem["goal"].get("contacts_deg"),
        "the goal names no contacts",
    ),
    "contact_region_error_max": (
        lambda problem: not problem["object"].get("allowed_regions"),
        "contacts are allowed everywhere",
    ),
    "rolling_error_max": (lambda problem: "radius_m" not in problem["object"], "the object is no sphere"),
    "position_error_final": (
        lambda problem: (
            problem["goal"]["kind"] == "grasp_adjustment" and not problem["goal"].get("keep_object")
        ),
        "the goal is a grasp",
    ),
    "rotation_error_final": (
        lambda problem: (
            problem["goal"]["kind"] == "grasp_adjustment" and not problem["goal"].get("keep_object")
        ),
        "the goal is a grasp",
    ),
}
"""Checks that some problems do not ask for: when, and why.  Decided from the problem alone."""

HEADLINES = (
    ("turned_angle", "turn off by"),
    ("position_error_max", "position within"),
    ("rotation_error_max", "rotation within"),
    ("friction_utilisation_max", "friction used"),
    ("coulomb_slip_max", "slip"),
)
"""What the one-line summary of a passed run tells."""


@dataclass(frozen=True, eq=False)
class ValidationReport:
    """The judgement of one run: ``verdict`` is "pass" iff no check fails; the rest is what one needs to
    believe it.

    ``physics`` are the parameters simulated under, ``timing`` seconds simulated and spent, ``versions`` of
    what judged.
    """

    name: str
    verdict: Literal["pass", "fail"]
    checks: tuple[CheckResult, ...]
    physics: Mapping[str, Any]
    timing: Mapping[str, Any]
    versions: Mapping[str, str]
    seed: int
    format: int = FORMAT

    def __post_init__(self) -> None:
        object.__setattr__(self, "checks", tuple(self.checks))
        for key in ("physics", "timing", "versions"):
            object.__setattr__(self, key, MappingProxyType(json.loads(json.dumps(dict(getattr(self, key))))))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ValidationReport) and self.as_dict() == other.as_dict()

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, name: str) -> CheckResult:
        """Return the result of the check ``name``; KeyError where there is none."""
        for check in self.checks:
            if check.name == name:
                return check
        raise KeyError(name)

    @property
    def is_passed(self) -> bool:
        """Whether the physics confirms the plan."""
        return self.verdict == "pass"

    @property
    def failures(self) -> tuple[CheckResult, ...]:
        """The checks that failed, in order."""
        return tuple(check for check in self.checks if check.status == "fail")

    def as_dict(self) -> dict[str, Any]:
        """Return the report as JSON data (``report.json``)."""
        return {
            "format": self.format,
            "name": self.name,
            "verdict": self.verdict,
            "checks": [asdict(check) for check in self.checks],
            "physics": dict(self.physics),
            "timing": dict(self.timing),
            "versions": dict(self.versions),
            "seed": self.seed,
        }

    def summary_line(self) -> str:
        """Return one line: PASS with a few numbers, or FAIL with the first check that failed."""
        if self.is_passed:
            told = [(word, check) for name, word in HEADLINES for check in self.checks if check.name == name]
            parts = [
                f"{word} {_spell(c.value)} {c.unit}".replace(" –", "")
                for word, c in told
                if c.value is not None
            ]
            return f"PASS {self.name}: {', '.join(parts)}"
        first = self.failures[0]
        value = "without a value" if first.value is None else f"{_spell(first.value)} {first.unit}"
        limit = "" if first.limit is None else f" (limit {_spell(first.limit)})"
        moment = "" if first.worst_time_s is None else f" at {first.worst_time_s:.2f} s"
        note = f": {first.note}" if first.value is None and first.note else ""
        return f"FAIL {first.name} {value}{limit}{moment}{note}"

    def table(self) -> str:
        """Return all checks as aligned text."""
        heads = ("check", "status", "value", "limit", "unit", "at s", "note")
        rows = [heads] + [
            (
                c.name,
                c.status.replace("_", " "),
                _spell(c.value),
                _spell(c.limit),
                c.unit,
                "" if c.worst_time_s is None else f"{c.worst_time_s:.2f}",
                c.note,
            )
            for c in self.checks
        ]
        widths = [max(len(row[i]) for row in rows) for i in range(len(heads))]
        return "\n".join(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in rows
        )

    def save(self, path: str | Path) -> Path:
        """Write report.json, whole or not at all.  Returns the path."""
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            text = json.dumps(self.as_dict(), indent=1, ensure_ascii=False, allow_nan=False)
            temporary.write_text(text + "\n", encoding="utf-8")
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        return path

    @classmethod
    def load(cls, path: str | Path) -> ValidationReport:
        """Read a report that :meth:`save` wrote; equal to it.  Raises RunFolderError for anything else."""
        accepted = "a report.json as `dexplan validate` writes it is needed"
        try:
            data = json.loads(Path(path).read_text(encoding="utf-8"))
            if data["format"] != FORMAT:
                raise RunFolderError(
                    str(path), f"it has report format {data['format']}", f"format {FORMAT} is read here"
                )
            results = tuple(CheckResult(**check) for check in data.pop("checks"))
            return cls(checks=results, **data)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise RunFolderError(str(path), f"it cannot be read as a report ({error})", accepted) from error


def validate_run(
    problem: Mapping[str, Any],
    plan: Mapping[str, Any],
    trace: Trace,
    limits: Mapping[str, bool | float] | None = None,
) -> ValidationReport:
    """Replay ``trace`` and judge it: ``problem`` and ``plan`` as the data of their files.

    ``limits`` stand over the problem's ``[acceptance]``, which stands over the packaged defaults.  A bad run
    is a verdict; RunFolderError is raised only where there is nothing to step: no controls, or a model that
    does not compile.
    """
    began = time.perf_counter()
    for name in ("initial_state", "ctrl", "physics_steps_per_sample"):
        if name not in trace:
            raise RunFolderError("trace.npz", f"it lacks {name}", "a trace that can be replayed is needed")
    replayed = replay(
        trace.model_xml,
        trace["initial_state"],
        trace["ctrl"],
        int(trace["physics_steps_per_sample"]),
        trace.columns.get("xfrc_applied"),
    )
    stepped = time.perf_counter()
    numbers = {**load_default_limits(), **problem.get("acceptance", {}), **(limits or {})}
    case = Case(
        problem, plan, trace.columns, replayed, numbers, np.asarray(trace["initial_state"], dtype=np.float64)
    )
    results = run_checks(case)
    timing = {
        "simulated_s": case.sample_count * case.sample_time,
        "replay_s": round(stepped - began, 3),
        "checks_s": round(time.perf_counter() - stepped, 3),
        **_describe_quiet(case),
    }
    return ValidationReport(
        name=str(problem.get("name", "")),
        verdict="fail" if any(result.status == "fail" for result in results) else "pass",
        checks=results,
        physics=_describe_physics(problem, replayed, case.sample_time),
        timing=timing,
        versions={
            "python": platform.python_version(),
            **{name: _version(name) for name in ("dexplan", "mujoco", "numpy", "osqp", "scipy")},
        },
        seed=int(problem.get("seed", 0)),
    )


def run_checks(case: Case) -> tuple[CheckResult, ...]:
    """Return the results of all checks, those that the problem does not ask for marked so."""
    results = []
    for name, check in CHECKS:
        is_idle, why = NOT_APPLICABLE.get(name, (None, ""))
        if is_idle is not None and is_idle(case.problem):
            results.append(CheckResult(name, "not_applicable", None, None, "", note=why))
        else:
            results.append(check(case))
    return tuple(results)


def load_default_limits() -> dict[str, bool | float]:
    """Return every limit with its default, from the packaged limits.toml."""
    return dict(_read_limits())


@lru_cache
def _read_limits() -> Mapping[str, bool | float]:
    text = resources.files("dexplan.sim").joinpath("limits.toml").read_text(encoding="utf-8")
    return MappingProxyType(tomllib.loads(text))


def _describe_physics(problem: Mapping[str, Any], replayed: Replay, sample_time: float) -> dict[str, Any]:
    """Return what the run was simulated under, read from the compiled model where it is there."""
    model, friction = replayed.world.model, problem["friction"]
    # Hertz: mu_t = (3 pi/16) mu a for a patch of radius a.
    patch = 16 * friction["torsional_m"] / (3 * math.pi * friction["sliding"])
    return {
        "profile": problem["control"]["physics_profile"],
        "timestep_s": replayed.world.timestep,
        "control_period_s": sample_time,
        "gravity_m_s2": model.opt.gravity.tolist(),
        "impratio": float(model.opt.impratio),
        "noslip_iterations": int(model.opt.noslip_iterations),
        "sliding_friction": friction["sliding"],
        "torsional_friction_m": friction["torsional_m"],
        "friction_safety": friction["safety"],
        "implied_patch_radius_mm": 1e3 * patch,
        "object_mass_kg": replayed.world.object_mass,
        "hand_mass_kg": float(model.body_mass.sum() - replayed.world.object_mass),
        "joint_armature_max_kg_m2": float(model.dof_armature.max(initial=0.0)),
        "joint_damping_max_N_m_s": float(model.dof_damping.max(initial=0.0)),
        "torque_limit_max_N_m": float(
            np.where(np.isfinite(replayed.world.torque_limit), replayed.world.torque_limit, -1).max(
                initial=0.0
            )
        ),
    }


def _describe_quiet(case: Case) -> dict[str, Any]:
    """Return how much of the run is not quiet [s], in all and per touch window of one finger."""
    loud = float((~case.quiet).sum()) * case.sample_time
    relocations = sum(len(find_runs(case.required[:, k] == MAY)) for k in range(case.finger_count))
    return {
        "non_quiet_s": round(loud, 6),
        "touch_windows": relocations,
        "non_quiet_s_per_touch_window": round(loud / relocations, 6) if relocations else None,
    }


def _spell(value: float | None) -> str:
    """Return a number with four digits, nothing for None."""
    return "" if value is None else f"{value:.4g}"


def _version(name: str) -> str:
    """Return the installed version of a package."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
