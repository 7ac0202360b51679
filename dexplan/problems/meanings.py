"""What each key of a problem file means, in one sentence: what templates, schemas and references say of it.

Numbers of ``[acceptance]`` are described beside their defaults, in the packaged ``sim/judge/limits.toml``.
"""

from __future__ import annotations

import importlib.resources
import re
from functools import cache

TABLES = {
    "object": "the object: a ball of radius_m, or another convex shape; homogeneous unless com_m or inertia_kg_m2 say otherwise",
    "hand": "the hand, one entry per finger in finger order",
    "friction": "friction between fingertips and object",
    "start": "where the fingers touch at the start; the object is at the scene's home pose",
    "goal": "what is asked for: a motion of the object, contacts, or both; at most one of rotation and orientation_wxyz",
    "gait": "what the planner may use, and how long it may look",
    "gait.weights": "what a plan costs; the search goes on for a cheaper one while gait.improvement allows",
    "obstacles": "static bodies in the world; a table [[obstacles]] for each",
    "control": "how the plan is carried out",
    "forces": "how hard a contact presses that bears its full load; normal_floor_N <= normal_N <= normal_ceiling_N",
    "margins": "what plans leave to spare; what runs are judged by stands in [acceptance]",
    "acceptance": "what a run is judged by; a limit looser than its default is told in the verdict",
}
"""Table -> what it is about."""

KEYS = {
    "name": "the problem's name, which is that of its folder under runs/ as well; left out: the file's name",
    "summary": "one line about the problem, shown by `dexplan list` and in reports",
    "scene": "the world with hand and object; `dexplan list` names all scenes",
    "seed": 'what is drawn is drawn from this, such as orientation_wxyz = "random"',
    "object.radius_m": "radius of the ball",
    "object.shape": "another convex shape than a ball, about the object's origin, in place of radius_m: ellipsoid with "
    "semi_axes_m, box with half_sizes_m, capsule or cylinder (along z) with radius_m and half_length_m, mesh with "
    "vertices_m or path",
    "object.shape.kind": "which shape: ellipsoid, capsule, cylinder (both along z), box, or mesh, whose convex hull is taken",
    "object.shape.semi_axes_m": "semi-axes of an ellipsoid along x, y, z",
    "object.shape.half_sizes_m": "half sizes of a box along x, y, z",
    "object.shape.radius_m": "radius of a capsule or cylinder",
    "object.shape.half_length_m": "half of a cylinder's length, or of the distance between a capsule's centres",
    "object.shape.rim_m": "radius with which a cylinder's edges are rounded; 0: sharp",
    "object.shape.path": "mesh file, OBJ or binary STL, relative to the problem file; a run folder's copy has "
    "vertices_m instead",
    "object.shape.scale": "metres per unit of the mesh file; left out: 1",
    "object.shape.origin_m": "point of the scaled mesh that becomes the object's origin; left out: the mesh's own",
    "object.shape.vertices_m": "points whose convex hull the object is, about its origin, which has to be inside",
    "object.shape.taken_from": "name of the file that the vertices were read from; written by dexplan",
    "object.shape.mesh_volume_m3": "volume inside the mesh that the vertices are the hull of; written by dexplan",
    "object.mass_kg": "mass of the object",
    "object.com_m": "centre of mass in the object frame; left out: a homogeneous body's",
    "object.inertia_kg_m2": "inertia about the centre of mass, object axes; left out: a homogeneous body's",
    "object.allowed_regions": "contacts may only be made inside one of these cones around the object's centre, object frame; "
    "none: anywhere",
    "object.allowed_regions.axis": "the cone's axis in the object frame, of any length",
    "object.allowed_regions.half_angle_deg": "angle between the cone's axis and its border",
    "hand.tip_radii_m": "radius of each fingertip",
    "hand.tip_polar_limit_deg": "largest angle between a tip's pole and the contact on that tip",
    "hand.tip_rotation_limit_deg": "how far a tip may roll along its equator (the paper's gamma)",
    "hand.base_azimuths_deg": "where each finger stands around the object's home, about world z from x",
    "hand.joint_ranges_deg": "narrows the range of a joint, never widens it; left out: the model's ranges",
    "friction.sliding": "coefficient of sliding friction (mu) in the simulation",
    "friction.torsional_m": "coefficient of torsional friction in the simulation, as a length (MuJoCo's unit); at most "
    "0.3 * sliding * smallest tip radius, less on a body that is rounder than the tips; left out: the smaller of this number "
    "and that bound",
    "friction.safety": "planner and controller believe sliding / safety and torsional_m / safety",
    "start.contacts_deg": 'one entry per finger, on the object in its own frame; "free": off the object; "auto" instead of the '
    "list: the planner chooses",
    "start.contacts_deg.point_m": "a point of the object's surface, object frame",
    "goal.kind": "left out: what the other keys ask for, a motion (object_manipulation), contacts (grasp_adjustment) or both "
    "(dextrous_manipulation)",
    "goal.rotation": "a turn about the object's centre",
    "goal.rotation.axis": "the axis of the turn in world axes, of any length",
    "goal.rotation.angle_deg": "how far to turn; beyond 360 means more turns",
    "goal.orientation_wxyz": "a goal attitude in the world, taken the shortest way",
    "goal.translation_m": "how far the object's centre is to be shifted, in world axes",
    "goal.contacts_deg": "where the fingers have to touch in the end, one entry per finger as in start.contacts_deg",
    "goal.contacts_deg.point_m": "a point of the object's surface, object frame",
    "goal.order": "what a dextrous manipulation does first: the paper's (a), (b), (c)",
    "goal.keep_object": "grasp adjustment only: the object has to be back where it was at the end",
    "goal.waypoints": "several goals in a row, each asked of the object where the one before left it; in place of rotation, "
    "orientation_wxyz and translation_m",
    "goal.waypoints.rotation": "a turn about the object's origin",
    "goal.waypoints.rotation.axis": "the axis of the turn in world axes, of any length",
    "goal.waypoints.rotation.angle_deg": "how far to turn; beyond 360 means more turns",
    "goal.waypoints.orientation_wxyz": "a goal attitude in the world, taken the shortest way",
    "goal.waypoints.translation_m": "how far the object's origin is to be shifted from there, in world axes",
    "gait.primitives": "how fingers may be exchanged; none: the contacts stay as they are",
    "gait.node_budget": "how many nodes the search may open before it gives up",
    "gait.improvement": "how much longer than for the first plan the search goes on for a cheaper one; 0: not at all",
    "gait.weights.placement": "cost of placing a finger once",
    "gait.weights.turn": "cost of a radian of the object's path",
    "gait.weights.load": "cost of the plan's worst load, as the used share of the believed friction cone",
    "gait.weights.clearance": "cost of the plan's smallest clearance",
    "obstacles.kind": "shape of the obstacle",
    "obstacles.pos_m": "its centre in the world",
    "obstacles.size_m": "its size; a capsule stands along z",
    "control.physics_profile": "contact settings of the simulation: firm uses MuJoCo's noslip solver, "
    "portable does without it and creeps more",
    "control.speed_deg_s": "how fast the object turns while it moves; less where the hand or the grasp asks for it",
    "control.force_solver": "which solver finds the contact forces of each tick; osqp also stands behind daqp",
    "control.rate_hz": "how often the controller is asked and a sample recorded; auto: 250, "
    "more where torsional friction is thin",
    "forces.normal_N": "the normal force a loaded contact aims at; less where the object is light",
    "forces.normal_floor_N": "least normal force; left out: less than this where normal_N is less than usual",
    "forces.normal_ceiling_N": "greatest normal force; left out: normal_N where that is more",
    "margins.joint_deg": "how far holding fingers' joints keep from their limits",
    "margins.clearance_mm": "distance kept between bodies that are not to touch",
    "margins.cone_share": "share of the believed friction cone that planned forces may use",
    "margins.torque_share": "share of the torque limits that planned forces may use; the controller may use 0.07 more",
}
"""Key with its indices dropped -> what it means."""

_LIMIT = re.compile(r"(\w+)\s*=[^#]*#\s*(.*)")


@cache
def read_limit_meanings() -> dict[str, str]:
    """Return what each name of ``[acceptance]`` limits: the comments of the packaged ``limits.toml``."""
    resource = importlib.resources.files("dexplan.sim.judge").joinpath("limits.toml")
    found: dict[str, str] = {}
    name = ""
    for line in resource.read_text(encoding="utf-8").splitlines():
        if match := _LIMIT.match(line):
            name = match[1]
            found[name] = match[2]
        elif line.startswith(" ") and name:
            # A long comment goes on in the next line.
            found[name] += " " + line.strip().lstrip("# ")
        else:
            name = ""
    return found


def describe_meaning(key: str) -> str:
    """Return what ``key`` (dotted, indices dropped) means; KeyError for a key that is none."""
    table, _, name = key.partition(".")
    if table == "acceptance" and name:
        return read_limit_meanings()[name]
    return TABLES[key] if key in TABLES else KEYS[key]
