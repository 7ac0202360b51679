"""From a problem to the values that planning and control take: scene, hand, friction, squeeze, limits, timing, options."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from threading import get_ident
from typing import Any

import numpy as np

from dexplan.contact.friction import SoftFinger
from dexplan.control.options import RATE, ControlOptions, compute_torque_fraction
from dexplan.control.rate import choose_rate, limit_joint_speed, limit_object_speed
from dexplan.kinematics.workspace import load_workspace
from dexplan.planning.admissible.hand import HandModel
from dexplan.planning.admissible.limits import AdmissibleLimits
from dexplan.planning.admissible.squeeze import DEPTH, DEPTH_CEILING, Squeeze, choose_squeeze
from dexplan.planning.search.cost import CostWeights, Improvement
from dexplan.plans.forces import NormalForces
from dexplan.plans.goal import RotationGoal
from dexplan.plans.margins import MarginLimits
from dexplan.plans.timing import Timing
from dexplan.problems.problem import AllowedRegion, GoalSection, Problem, Waypoint
from dexplan.problems.shapes import build_shape
from dexplan.scene.description import ContactCone, Obstacle, SceneParameters
from dexplan.scene.library import load_scene_with
from dexplan.scene.penetration import compute_force_at
from dexplan.scene.probe import HandProbe
from dexplan.scene.scene import Scene
from dexplan.spatial import Array, as_pose


def build_scene(problem: Problem) -> Scene:
    """Return the scene of ``problem``."""
    return load_scene_with(
        SceneParameters(
            scene=problem.scene,
            object_shape=build_shape(problem.object),
            object_mass=problem.object.mass_kg,
            object_com=problem.object.com_m,
            object_inertia=problem.object.inertia_kg_m2,
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


@dataclass(frozen=True)
class _HandParts:
    """All that a hand model is made of, as values: equal parts make the same hand."""

    scene: Scene
    regions: tuple[AllowedRegion, ...]
    friction: SoftFinger
    limits: AdmissibleLimits
    normal_force: float
    hover: float
    acceleration: float
    tip_polar_limit: float
    tip_rotation_limit: float


def build_hand(problem: Problem, scene: Scene) -> HandModel:
    """Return what the planner may know of ``scene``, with the friction that ``problem`` believes in.

    Problems that differ in start and goal alone share one hand in a thread, and with it what planning remembers of it.
    """
    timing, squeeze = build_timing(problem), build_squeeze(problem, scene)
    return _build_hand(
        _HandParts(
            scene=scene,
            regions=problem.object.allowed_regions,
            friction=build_friction(problem).scaled(squeeze.friction_share),
            limits=build_limits(problem, squeeze),
            normal_force=squeeze.normal,
            hover=timing.touchdown.hover,
            acceleration=0.5 * np.pi * timing.object_speed / timing.ramp,
            tip_polar_limit=float(np.radians(problem.hand.tip_polar_limit_deg)),
            tip_rotation_limit=float(np.radians(problem.hand.tip_rotation_limit_deg)),
        ),
        get_ident(),
    )


@lru_cache(maxsize=8)
def _build_hand(parts: _HandParts, thread: int) -> HandModel:
    """Return the hand made of ``parts``, one for each ``thread``: its probe answers one question at a time."""
    scene = parts.scene
    center = scene.object.X_WO_home[:3, 3]
    return HandModel(
        fingers=scene.fingers,
        object=replace(scene.object, allowed_regions=_build_cones(parts.regions)),
        workspaces=tuple(load_workspace(finger, center) for finger in scene.fingers),
        friction=parts.friction,
        probe=HandProbe(scene),
        limits=parts.limits,
        normal_force=parts.normal_force,
        hover=parts.hover,
        acceleration=parts.acceleration,
        tip_polar_limit=parts.tip_polar_limit,
        tip_rotation_limit=parts.tip_rotation_limit,
    )


def build_friction(problem: Problem) -> SoftFinger:
    """Return the friction that ``problem`` believes in."""
    return SoftFinger(problem.friction.believed_sliding, problem.friction.believed_torsional_m)


def build_squeeze(problem: Problem, scene: Scene) -> Squeeze:
    """Return how hard the fingers of ``scene`` squeeze the object of ``problem``."""
    friction = build_friction(problem)
    bearable, greatest = (compute_force_at(scene, depth) for depth in (DEPTH, DEPTH_CEILING))
    asked = problem.forces
    forces = NormalForces(asked.normal_N, asked.normal_floor_N, asked.normal_ceiling_N)
    return choose_squeeze(scene.object.mass, friction, bearable, greatest, forces)


def build_limits(problem: Problem, squeeze: Squeeze) -> AdmissibleLimits:
    """Return what states must leave to spare: the margins that ``problem`` asks for, and the normal forces of its squeeze."""
    margins = problem.margins
    joint = float(np.radians(margins.joint_deg))
    return AdmissibleLimits(
        joint_margin=joint,
        # A free finger ends its way where it is to hold, so it cannot be asked for more than holding fingers are.
        travel_margin=min(AdmissibleLimits.travel_margin, joint),
        cone_share=margins.cone_share,
        torque_share=margins.torque_share,
        clearance=1e-3 * margins.clearance_mm,
        normal_floor=squeeze.floor,
        normal_ceiling=squeeze.ceiling,
    )


def build_margin_limits(problem: Problem) -> MarginLimits:
    """Return what plans for ``problem`` have to leave to spare, in the units in which plans state it."""
    margins = problem.margins
    return MarginLimits(
        margins.joint_deg,
        AdmissibleLimits.dexterity,
        margins.cone_share,
        margins.torque_share,
        margins.clearance_mm,
    )


def build_allowed_regions(problem: Problem) -> tuple[ContactCone, ...]:
    """Return the parts of the object that contacts may use; none means all of it."""
    return _build_cones(problem.object.allowed_regions)


def _build_cones(regions: tuple[AllowedRegion, ...]) -> tuple[ContactCone, ...]:
    return tuple(
        ContactCone(np.array(region.axis), float(np.radians(region.half_angle_deg))) for region in regions
    )


def build_goals(problem: Problem, X_WO: Array) -> tuple[RotationGoal, ...]:
    """Return the goals of the object's motion, one after the other, each from where the one before ends; the first from ``X_WO``.

    A goal without a motion is one whose motion goes nowhere.
    """
    goals: list[RotationGoal] = []
    for asked in problem.goal.waypoints or (problem.goal,):
        goals.append(_build_goal(asked, goals[-1].X_WO_goal if goals else X_WO))
    return tuple(goals)


def _build_goal(asked: GoalSection | Waypoint, X_WO: Array) -> RotationGoal:
    shift = np.array(asked.translation_m)
    if asked.rotation is not None:
        axis, angle = np.array(asked.rotation.axis), float(np.radians(asked.rotation.angle_deg))
        return RotationGoal(X_WO, axis, angle, shift)
    if asked.orientation_wxyz is not None:
        R_WO = as_pose([0.0, 0.0, 0.0, *asked.orientation_wxyz])[:3, :3]
        return RotationGoal.from_attitude(X_WO, R_WO, shift)
    return RotationGoal(X_WO, np.array([0.0, 0.0, 1.0]), 0.0, shift)


def build_timing(problem: Problem) -> Timing:
    """Return the timing that the problem's speed and control rate ask for."""
    timing, asked = (
        Timing(object_speed=float(np.radians(problem.control.speed_deg_s))),
        problem.control.rate_hz,
    )
    # A rate that is chosen is never below RATE.
    rate = RATE if asked == "auto" else float(asked)
    timing = replace(timing, joint_speed=limit_joint_speed(timing.joint_speed, rate))
    if asked == "auto":
        return timing
    scene = build_scene(problem)
    room = _compute_twist_room(problem, build_squeeze(problem, scene))
    speed = limit_object_speed(timing.object_speed, rate, room, scene.model.opt.timestep)
    return replace(timing, object_speed=speed)


def _compute_twist_room(problem: Problem, squeeze: Squeeze) -> float:
    """Return which torque about the normal [N m] a contact bears beyond what forces are planned with."""
    planned = build_friction(problem).scaled(squeeze.friction_share).torsional
    return float(squeeze.normal * (problem.friction.torsional_m - planned))


def build_improvement(problem: Problem) -> Improvement:
    """Return how long better plans are looked for, and what makes one better."""
    weights = problem.gait.weights
    return Improvement(
        problem.gait.improvement,
        CostWeights(weights.placement, weights.turn, weights.load, weights.clearance),
    )


def build_options(problem: Problem, **changes: Any) -> ControlOptions:
    """Return the controller's options for ``problem``, with ``changes`` of single fields."""
    scene = build_scene(problem)
    squeeze = build_squeeze(problem, scene)
    friction = build_friction(problem).scaled(squeeze.friction_share)
    room = _compute_twist_room(problem, squeeze)
    asked = problem.control.rate_hz
    rate = choose_rate(room, scene.model.opt.timestep) if asked == "auto" else float(asked)
    options = ControlOptions(
        friction.sliding,
        friction.torsional,
        torque_fraction=compute_torque_fraction(problem.margins.torque_share),
        force_solver=problem.control.force_solver,
        rate=rate,
    )
    return replace(options, **changes)
