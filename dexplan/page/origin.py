"""Where a run comes from: the physics it was simulated under, seed and versions, and the command that makes it again."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element

from dexplan.page.html import Child, build, build_facts, build_section
from dexplan.page.subject import Subject
from dexplan.problems.problem import Problem
from dexplan.problems.read import list_problems, load_problem
from dexplan.sim.judge.report import ValidationReport
from dexplan.sim.machine import describe_machine, describe_versions

PACKAGES = ("dexplan", "mujoco", "numpy", "osqp", "scipy")
_PHYSICS: Mapping[str, tuple[str, str]] = {
    "profile": ("physics profile", ""),
    "timestep_s": ("time step of the simulation", "s"),
    "control_period_s": ("time between two commands", "s"),
    "gravity_m_s2": ("gravity", "m/s²"),
    "impratio": ("impratio (friction against normal stiffness)", ""),
    "noslip_iterations": ("no-slip iterations", ""),
    "sliding_friction": ("sliding friction, simulated", ""),
    "torsional_friction_m": ("torsional friction, simulated", "m"),
    "friction_safety": ("planning believes friction divided by", ""),
    "implied_patch_radius_mm": ("contact patch that the torsional friction implies, radius", "mm"),
    "object_mass_kg": ("mass of the object", "kg"),
    "hand_mass_kg": ("mass of the hand", "kg"),
    "joint_armature_max_kg_m2": ("largest armature of a joint", "kg m²"),
    "joint_damping_max_N_m_s": ("largest damping of a joint", "N m s"),
    "torque_limit_max_N_m": ("largest torque of a servo", "N m"),
    "simulated_s": ("simulated", "s"),
    "non_quiet_s": ("of that, contacts were changing", "s"),
    "touch_windows": ("touches and lifts", ""),
    "non_quiet_s_per_touch_window": ("time per touch or lift", "s"),
    "speed_asked_deg_s": ("speed asked for", "°/s"),
    "speed_reached_deg_s": ("fastest speed of the reference", "°/s"),
    "speed_limited_by": ("speed", ""),
}
"""What the facts of a report are called, and their units."""
_OF_THE_CLOCK = frozenset({"replay_s", "checks_s"})
"""How long the judge took: not a fact of the run, and another number each time."""


def build_physics(subject: Subject) -> Element | None:
    """Return what the run was simulated under."""
    if subject.report is None:
        return None
    facts = {
        **subject.report.physics,
        **{k: v for k, v in subject.report.timing.items() if k not in _OF_THE_CLOCK},
    }
    return build_section("physics", "Physics", build_facts(_name_facts(facts)))


def _name_facts(facts: Mapping[str, Any]) -> list[tuple[Child, Child]]:
    rows: list[tuple[Child, Child]] = []
    for key, value in facts.items():
        label, unit = _PHYSICS.get(key, (key.replace("_", " "), ""))
        if value is not None:
            rows.append((label, f"{_spell(value)} {unit}".strip()))
    return rows


def _spell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return f"({', '.join(map(_spell, value))})"
    return str(value)


def find_command(problem: Problem) -> str:
    """Return the command that makes the run again; ``problem.toml`` in it is the file shown on the page."""
    if problem.name in list_problems():
        built_in = load_problem(problem.name)
        if built_in == problem:
            return f"dexplan run {shlex.quote(problem.name)}"
        if load_problem(problem.name, {"seed": problem.seed}) == problem:
            return f"dexplan run {shlex.quote(problem.name)} --seed {problem.seed}"
    return "dexplan run problem.toml"


def list_options(report: ValidationReport | None) -> list[str]:
    """Return the options with which a run was made that differed from its problem: another controller, another true world."""
    if report is None:
        return []
    options = ["--controller FILE.py:NAME"] if report.recorded.get("controller") else []
    untrue: Mapping[str, Any] = report.as_dict().get("untrue", {})
    options += [_spell_truth(key, x["true"]) for key, x in untrue.items()]
    return options


def _spell_truth(key: str, value: object) -> str:
    return "--true " + shlex.quote(f"{key}={_as_toml(value)}")


def _as_toml(value: object) -> str:
    """Return a value as ``--set`` and ``--true`` take it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(str(key))} = {_as_toml(x)}" for key, x in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_as_toml, value))}]"
    return json.dumps(value)


def build_origin(subject: Subject) -> Element:
    """Return how to make the run again: command, problem file, seed, versions and machine."""
    command, report = find_command(subject.problem), subject.report
    text = subject.problem.as_toml()
    parts: list[Child] = [build("pre", build("code", " ".join([command, *list_options(report)])))]
    if report is not None and report.recorded.get("controller"):
        words = f"The run was made by {report.recorded['controller']}, which is no part of dexplan: FILE.py:NAME stands for it."
        parts.append(build("p", words))
    if command.endswith(" problem.toml"):
        parts.append(build("p", "problem.toml is the file below; it also stands in the folder of this run."))
    same = "On the same machine with the same versions the run comes out the same to the last bit."
    parts.append(build("p", same, class_="note"))
    versions = describe_versions(*PACKAGES) if report is None else report.versions
    machine = describe_machine() if report is None else report.machine
    facts: list[tuple[Child, Child]] = [("seed", str(subject.problem.seed))]
    facts += [(name, str(version)) for name, version in versions.items()]
    facts += [(name.replace("_", " "), str(value)) for name, value in machine.items()]
    if report is not None and report.recorded.get("differences"):
        facts.append(("recorded elsewhere", "; ".join(report.recorded["differences"])))
    parts.append(build_facts(facts))
    summary = build("summary", "problem.toml, every default written out")
    parts.append(build("details", summary, build("pre", build("code", text))))
    return build_section("origin", "Make it again", parts)
