"""The five verbs: from a problem to a plan, a trace, a judgement and a film.  Each is a thin line between rooms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dexplan.contact.friction import SoftFinger
from dexplan.control.controller import ControlOptions
from dexplan.control.reference import Timing, build_reference
from dexplan.errors import DexplanError
from dexplan.planning.adjustment import plan_grasp_adjustment
from dexplan.planning.configuration_space import explain_obstruction
from dexplan.planning.cost import CostWeights, Improvement
from dexplan.planning.dextrous import plan_dextrous_manipulation
from dexplan.planning.fixed_contacts import plan_fixed_contacts
from dexplan.planning.goal import RotationGoal
from dexplan.planning.hand import AdmissibleLimits, HandModel
from dexplan.planning.plan import Plan
from dexplan.planning.planner import refuse
from dexplan.planning.rolling_start import plan_object_manipulation
from dexplan.problems.problem import Problem, compute_contact_directions
from dexplan.scene.description import ContactCone, Obstacle, SceneParameters
from dexplan.scene.library import load_scene_with
from dexplan.scene.probe import HandProbe
from dexplan.scene.scene import Scene
from dexplan.scene.workspace import load_workspace
from dexplan.sim import rollout as _rollout
from dexplan.sim.trace import Trace
from dexplan.sim.validate import ValidationReport, validate_run
from dexplan.spatial import Array, as_pose

NORMAL_FORCE = 5.5
"""Normal force that a loaded contact aims at [N]; the force QP raises it where the load asks for more."""


def build_scene(problem: Problem) -> Scene:
    """Return the scene of ``problem``."""
    return load_scene_with(
        SceneParameters(
            scene=problem.scene,
            object_radius=problem.object.radius_m,
            object_mass=problem.object.mass_kg,
            tip_radii=problem.hand.tip_radii_m,
            base_azimuths_deg=problem.hand.base_azimuths_deg,
            joint_ranges_deg=tuple(
                (key, *limits) for key, limits in sorted(problem.hand.joint_ranges_deg.items())
            ),
            sliding_friction=problem.friction.sliding,
            torsional_friction=problem.friction.torsional_m,
            physics_profile=problem.control.physics_profile,
            obstacles=tuple(Obstacle(o.kind, o.pos_m, o.size_m) for o in problem.obstacles),
        )
    )


def build_hand(problem: Problem, scene: Scene) -> HandModel:
    """Return what the planner may know of ``scene``, with the friction that ``problem`` believes in."""
    center = scene.object.X_WO_home[:3, 3]
    timing = build_timing(problem)
    return HandModel(
        fingers=scene.fingers,
        object=replace(scene.object, allowed_regions=build_allowed_regions(problem)),
        workspaces=tuple(load_workspace(finger, center) for finger in scene.fingers),
        friction=SoftFinger(problem.friction.believed_sliding, problem.friction.believed_torsional_m),
        probe=HandProbe(scene),
        limits=AdmissibleLimits(),
        normal_force=NORMAL_FORCE,
        hover=timing.hover,
        acceleration=0.5 * np.pi * timing.object_speed / timing.ramp,
        tip_polar_limit=float(np.radians(problem.hand.tip_polar_limit_deg)),
        tip_rotation_limit=float(np.radians(problem.hand.tip_rotation_limit_deg)),
    )


def build_allowed_regions(problem: Problem) -> tuple[ContactCone, ...]:
    """Return the parts of the object that contacts may use; none means all of it."""
    return tuple(
        ContactCone(np.array(region.axis), float(np.radians(region.half_angle_deg)))
        for region in problem.object.allowed_regions
    )


def build_timing(problem: Problem) -> Timing:
    """Return the timing that the problem's speed asks for."""
    return Timing(object_speed=float(np.radians(problem.control.speed_deg_s)))


def build_improvement(problem: Problem) -> Improvement:
    """Return how long better plans are looked for, and what makes one better."""
    weights = problem.gait.weights
    return Improvement(
        problem.gait.improvement,
        CostWeights(weights.placement, weights.turn, weights.load, weights.clearance),
    )


def plan(problem: Problem) -> Plan:
    """Return a plan for ``problem``; "no plan" is a status with its reason, not an exception."""
    scene = build_scene(problem)
    hand = build_hand(problem, scene)
    X_WO, asked = scene.object.X_WO_home, problem.goal
    shift = np.array(asked.translation_m)
    if asked.rotation is not None:
        axis, angle = np.array(asked.rotation.axis), float(np.radians(asked.rotation.angle_deg))
        goal = RotationGoal(X_WO, axis, angle, shift)
    elif asked.orientation_wxyz is not None:
        goal = RotationGoal.from_attitude(
            X_WO, as_pose([0.0, 0.0, 0.0, *asked.orientation_wxyz])[:3, :3], shift
        )
    else:
        goal = RotationGoal(X_WO, np.array([0.0, 0.0, 1.0]), 0.0, shift)
    if problem.obstacles and (reason := explain_obstruction(hand)):
        return replace(refuse(hand, goal, "blocked", reason), goal_kind=asked.kind)
    contacts = problem.start.contacts_deg
    start = None if isinstance(contacts, str) else compute_contact_directions(contacts)
    means = (problem.gait.node_budget, problem.gait.primitives)
    if asked.contacts_deg is None and not problem.gait.primitives:
        return plan_fixed_contacts(hand, goal, start, problem.gait.node_budget)
    if asked.contacts_deg is None:
        return plan_object_manipulation(hand, goal, start, *means, build_improvement(problem))
    wanted = compute_contact_directions(asked.contacts_deg)
    if asked.kind == "grasp_adjustment":
        return plan_grasp_adjustment(
            hand, X_WO, start, wanted, *means, asked.keep_object, build_improvement(problem)
        )
    timing = build_timing(problem)
    return plan_dextrous_manipulation(
        hand,
        goal,
        start,
        wanted,
        *means,
        order=asked.order,
        compute_duration=lambda found: build_reference(found, scene.fingers, timing).duration,
        improvement=build_improvement(problem),
    )


def rollout(
    problem: Problem,
    plan: Plan,
    *,
    seed: int | None = None,
    progress: Callable[[float], None] | None = None,
    options: ControlOptions | None = None,
    true_scene: Scene | None = None,
    X_WO_start: Array | None = None,
) -> Trace:
    """Run ``plan`` in MuJoCo, closed loop; a failure still returns the trace so far.

    ``options`` replaces the controller's (ablations); ``true_scene`` and ``X_WO_start`` let the world differ from what planner
    and controller believe (uncertainty).  Raises DexplanError for a plan without actions.
    """
    if not plan.actions:
        raise DexplanError(
            f"the plan has no actions to run ({plan.status}: {plan.reason}); a solved plan is accepted"
        )
    scene = build_scene(problem)
    reference = build_reference(plan, scene.fingers, build_timing(problem))
    return _rollout.rollout(
        scene,
        reference,
        options or build_options(problem),
        world=true_scene or scene,
        X_WO_start=X_WO_start,
        meta={"problem": problem.name, "seed": problem.seed if seed is None else seed},
        progress=progress,
    )


def build_options(problem: Problem, **changes: float) -> ControlOptions:
    """Return the controller's options for ``problem``, with ``changes`` of single fields."""
    limits = AdmissibleLimits()
    options = ControlOptions(
        problem.friction.believed_sliding,
        problem.friction.believed_torsional_m,
        normal_floor=limits.normal_floor,
        normal_ceiling=limits.normal_ceiling,
    )
    return replace(options, **changes)


def validate(problem: Problem, plan: Plan, trace: Trace) -> ValidationReport:
    """Judge a run by replaying it; uses problem and plan as data only."""
    return validate_run(problem.as_dict(), plan.as_dict(), trace)


def render(trace: Trace, path: str | Path, plan: Plan | None = None) -> None:
    """Film a trace offscreen, in a process of its own.  Raises RenderError where no renderer can be started."""
    from dexplan.viz.video import render_video

    render_video(trace, plan, Path(path))


def render_run(folder: str | Path) -> None:
    """Film a saved run: writes ``video.mp4`` into its folder."""
    from dexplan.viz.video import render_run as film

    film(Path(folder))


def save_run(
    folder: str | Path, problem: Problem, plan: Plan, trace: Trace, report: ValidationReport
) -> None:
    """Write the run folder: problem, plan, model, trace, report and the summary figure."""
    from dexplan.viz.figure import draw_summary

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    problem.save(folder / "problem.toml")
    plan.save(folder / "plan.json")
    partial = folder / ".model.xml.partial"
    partial.write_text(trace.model_xml, encoding="utf-8")
    partial.replace(folder / "model.xml")
    trace.save(folder / "trace.npz")
    report.save(folder / "report.json")
    draw_summary(problem.as_dict(), plan, trace, report, folder / "summary.png")


def load_run(folder: str | Path) -> tuple[Problem, Plan, Trace]:
    """Return the problem, plan and trace of a run folder.  Raises RunFolderError for anything else."""
    folder = Path(folder)
    return (
        Problem.load(folder / "problem.toml"),
        Plan.load(folder / "plan.json"),
        Trace.load(folder / "trace.npz"),
    )


def inspect(problem: Problem, folder: str | Path) -> str:
    """Draw what the hand can do in ``problem`` into ``folder`` and return the numbers as text."""
    from dexplan.viz.maps import describe_reach, draw_reach

    scene = build_scene(problem)
    hand = build_hand(problem, scene)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    draw_reach(hand, folder / "inspect.png")
    return describe_reach(hand)
