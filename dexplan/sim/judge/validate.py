"""All checks, one report: the independent judgement of a run.

``validate_run`` steps MuJoCo itself from the recorded initial state and controls and judges what it sees; the
plan is read as data and no code of planner or controller is used.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dexplan.sim.judge import (
    checks,
    checks_contact,
    checks_files,
    checks_force_audit,
    checks_forces,
    checks_physics,
    checks_rolling,
)
from dexplan.sim.judge.checks_case import MAY, Case, CheckResult, find_runs
from dexplan.sim.judge.groups import (
    GROUPS,
    OWN_GROUPS,
    choose_judged,
    find_group,
    read_controller,
    resolve_groups,
)
from dexplan.sim.judge.limits import find_loose_limits, load_default_limits, resolve_limits
from dexplan.sim.judge.object_shape import has_edges
from dexplan.sim.judge.recipe import check_times, read_recipe
from dexplan.sim.judge.replay import replay
from dexplan.sim.judge.report import ValidationReport
from dexplan.sim.judge.true_world import find_untold, find_untrue, join_world
from dexplan.sim.judge.world import read_world
from dexplan.sim.machine import describe_machine, describe_versions, find_differences
from dexplan.sim.trace import Trace

__all__ = [
    "CHECKS",
    "NOT_APPLICABLE",
    "ValidationReport",
    "load_default_limits",
    "run_checks",
    "validate_run",
]

CHECKS: tuple[tuple[str, Callable[[Case], CheckResult]], ...] = (
    ("replay_matches", checks.check_replay_matches),
    ("trace_consistent", checks.check_trace_consistent),
    ("physics_untouched", checks_physics.check_physics_untouched),
    ("files_agree", checks_files.check_files_agree),
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
    ("edge_distance_min", checks_contact.check_edge_distance),
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
    ("tip_rotation_max", checks_rolling.check_tip_rotation_max),
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
    "edge_distance_min": (
        lambda problem: not has_edges(problem["object"]),
        "the object has no sharp edge",
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


def validate_run(
    problem: Mapping[str, Any],
    plan: Mapping[str, Any],
    trace: Trace,
    limits: Mapping[str, bool | float] | None = None,
    groups: Iterable[str] | None = None,
    world: Mapping[str, Any] | None = None,
) -> ValidationReport:
    """Replay ``trace`` and judge it: ``problem`` and ``plan`` as the data of their files.

    ``groups`` names the groups of checks to judge (``groups.GROUPS``; None: all), which the verdict line tells where some are
    left out.  ``world`` is the data of a problem with the true parameters of the world (None: they are as ``problem`` has
    them).  What only dexplan's own controller could have recorded is "not recorded" where the record names another.

    ``limits`` stand over the problem's ``[acceptance]``, which stands over the packaged defaults.  A bad run
    is a verdict; RunFolderError is raised only where there is nothing to step: no controls, or a model that
    does not compile; ProblemError for limits that may not be set, for a world of another problem, and where nothing is
    recorded of all ``groups``; UnknownNameError for no group.
    """
    began = time.perf_counter()
    truth, controller = join_world(problem, world), read_controller(trace.meta)
    judged = choose_judged(resolve_groups(groups), controller)
    numbers = resolve_limits(problem.get("acceptance", {}), limits or {})
    recipe = read_recipe(trace.columns)
    check_times(trace.columns, recipe.physics_steps_per_sample, read_world(trace.model_xml).timestep)
    replayed = replay(trace.model_xml, *recipe)
    stepped = time.perf_counter()
    differences = find_differences(trace.meta)
    case = Case(
        truth,
        plan,
        trace.columns,
        replayed,
        numbers,
        recipe.initial_state,
        differences,
        (*trace.contradictions, *find_untold(problem, world, trace.meta)),
        believed=problem,
        controller=controller,
    )
    results = run_checks(case, resolve_groups(groups))
    timing = {
        "simulated_s": case.sample_count * case.sample_time,
        "replay_s": round(stepped - began, 3),
        "checks_s": round(time.perf_counter() - stepped, 3),
        **_describe_quiet(case),
        **_describe_speed(case),
    }
    return ValidationReport(
        name=str(problem.get("name", "")),
        verdict="fail" if any(result.status == "fail" for result in results) else "pass",
        checks=results,
        physics=_describe_physics(case),
        timing=timing,
        versions=describe_versions("dexplan", "mujoco", "numpy", "osqp", "scipy"),
        seed=int(problem.get("seed", 0)),
        machine=describe_machine(),
        recorded={
            "versions": trace.meta.get("versions"),
            "machine": trace.meta.get("machine"),
            "differences": differences,
            "controller": controller,
        },
        untrue=find_untrue(problem, world),
        loose_limits={
            limit.name: {"value": limit.value, "default": limit.default}
            for limit in find_loose_limits(numbers)
        },
        groups=judged,
    )


def run_checks(case: Case, groups: Iterable[str] = tuple(GROUPS)) -> tuple[CheckResult, ...]:
    """Return the results of all checks, those marked that the problem does not ask for, that are of no group judged, or that
    ask for what another controller than dexplan's own does not record.
    """
    results, asked = [], set(groups)
    for name, check in CHECKS:
        group = find_group(name)
        if group in asked and group in OWN_GROUPS and case.controller is not None:
            note = f"{case.controller} is asked for its controls alone"
            results.append(CheckResult(name, "not_recorded", None, None, "", note=note))
            continue
        if group not in asked:
            note = f"the group {group} was not judged"
            results.append(CheckResult(name, "not_applicable", None, None, "", note=note))
            continue
        is_idle, why = NOT_APPLICABLE.get(name, (None, ""))
        if is_idle is not None and is_idle(case.problem):
            results.append(CheckResult(name, "not_applicable", None, None, "", note=why))
        else:
            results.append(check(case))
    return tuple(results)


def _describe_physics(case: Case) -> dict[str, Any]:
    """Return what the run was simulated under, read from the compiled model where it is there, and what was believed."""
    problem, replayed, believed = case.problem, case.replay, case.believed_friction
    model, friction = replayed.world.model, problem["friction"]
    # Hertz: mu_t = (3 pi/16) mu a for a patch of radius a.
    patch = 16 * friction["torsional_m"] / (3 * math.pi * friction["sliding"])
    return {
        "profile": problem["control"]["physics_profile"],
        "timestep_s": replayed.world.timestep,
        "control_period_s": case.sample_time,
        "gravity_m_s2": model.opt.gravity.tolist(),
        "impratio": float(model.opt.impratio),
        "noslip_iterations": int(model.opt.noslip_iterations),
        "sliding_friction": friction["sliding"],
        "torsional_friction_m": friction["torsional_m"],
        "friction_safety": friction["safety"],
        "sliding_friction_believed": believed[0],
        "torsional_friction_believed_m": believed[1],
        "implied_patch_radius_mm": 1e3 * patch,
        "object_mass_kg": replayed.world.object_mass,
        "object_mass_believed_kg": (case.believed or problem)["object"]["mass_kg"],
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


def _describe_speed(case: Case) -> dict[str, Any]:
    """Return how fast the object was asked to turn, how fast its reference turned, and what limited that as the plan has it."""
    quat = case.reference[:, 3:]
    known = np.isfinite(quat).all() and len(quat) > 1 and bool((np.linalg.norm(quat, axis=1) > 0).all())
    fastest = 0.0
    if known:
        turn = Rotation.from_quat(quat, scalar_first=True)
        fastest = float(np.degrees((turn[1:] * turn[:-1].inv()).magnitude().max()) / case.sample_time)
    planned = case.plan.get("speed")
    return {
        "speed_asked_deg_s": case.problem["control"]["speed_deg_s"],
        "speed_reached_deg_s": round(fastest, 6) if known else None,
        "speed_limited_by": planned.get("words") if isinstance(planned, Mapping) else None,
    }
