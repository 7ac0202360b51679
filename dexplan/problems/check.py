"""What a problem must make sense of, beyond the types of its keys.

Each ``_check_`` function takes a whole :class:`~dexplan.problems.sections.ProblemFields` and the name of its
source; it raises ``ProblemError`` at the first thing that is wrong, with one line that names source, key,
value and what would be accepted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

from dexplan.errors import ProblemError
from dexplan.problems.contact_points import check_contacts
from dexplan.problems.derived import as_name, compute_largest_torsion
from dexplan.problems.rules import (
    BOUNDS,
    JOINT_PATTERN,
    NAME_PATTERN,
    OBSTACLE_SIZES,
    SCENES,
    describe_accepted,
    load_joint_ranges,
    spell,
    suggest,
)
from dexplan.problems.sections import GoalSection, ProblemFields, Waypoint
from dexplan.problems.shapes import build_shape, check_object

SMALLEST_NORM = 1e-9
"""A shorter axis or quaternion counts as zero."""


def check_problem(problem: ProblemFields, source: str) -> None:
    """Raise ``ProblemError`` if ``problem`` makes no sense; ``source`` names where it came from."""
    for check in (
        _check_names,
        _check_numbers,
        _check_object,
        _check_hand,
        _check_friction,
        _check_forces,
        _check_start,
        _check_goal,
        _check_rest,
    ):
        check(problem, source)


def _check_names(problem: ProblemFields, source: str) -> None:
    if not NAME_PATTERN.fullmatch(problem.name):
        accepted = f"{describe_accepted('name')}, such as {spell(as_name(problem.name))}"
        raise ProblemError(source, "name", f"{spell(problem.name)} is no name for a folder", accepted)
    if not (problem.summary.isprintable() and len(problem.summary) <= 200):
        raise ProblemError(
            source, "summary", f"{spell(problem.summary)} is no summary", describe_accepted("summary")
        )
    if problem.scene not in SCENES:
        raise ProblemError(
            source, "scene", f"unknown scene {spell(problem.scene)}", suggest(problem.scene, SCENES)
        )


def _check_numbers(problem: ProblemFields, source: str) -> None:
    for key, value in _walk_numbers(problem.as_dict(), ""):
        bounds = BOUNDS.get(re.sub(r"\[\d+\]", "", key))
        if bounds is not None and not bounds.accepts(value):
            accepted = describe_accepted(key)
            if (
                key.startswith("object.")
                and bounds.unit == "m"
                and abs(value) > 1.0
                and bounds.accepts(1e-3 * value)
            ):
                accepted += f"; {value:g} mm are {1e-3 * value:g} m"
            raise ProblemError(source, key, f"{spell(value)} is out of range", accepted)


def _walk_numbers(value: Any, key: str) -> Iterator[tuple[str, float]]:
    """Yield (key, number) for every number below ``value``."""
    if isinstance(value, dict):
        for name, item in value.items():
            yield from _walk_numbers(item, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _walk_numbers(item, f"{key}[{index}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield key, value


def _check_object(problem: ProblemFields, source: str) -> None:
    check_object(problem.object, source)
    for index, region in enumerate(problem.object.allowed_regions):
        if math.hypot(*region.axis) < SMALLEST_NORM:
            key = f"object.allowed_regions[{index}].axis"
            fact = f"{spell(list(region.axis))} has no direction"
            raise ProblemError(source, key, fact, describe_accepted(key))


def _check_hand(problem: ProblemFields, source: str) -> None:
    hand, wanted = problem.hand, SCENES[problem.scene].finger_count
    for key, values in (("tip_radii_m", hand.tip_radii_m), ("base_azimuths_deg", hand.base_azimuths_deg)):
        if len(values) != wanted:
            accepted = f"accepted: {wanted} numbers, one per finger of {problem.scene}"
            raise ProblemError(
                source, f"hand.{key}", f"{spell(list(values))} has {len(values)} entries", accepted
            )
    for name, (lowest, highest) in hand.joint_ranges_deg.items():
        key = f"hand.joint_ranges_deg.{name}"
        match, known = JOINT_PATTERN.fullmatch(name), load_joint_ranges()
        if match is None or int(match[1]) > hand.finger_count or match[2] not in known:
            accepted = (
                f'accepted: "finger_<i>.<joint>" with i from 1 to {hand.finger_count}, and {", ".join(known)}'
            )
            raise ProblemError(source, key, f"{spell(name)} is no joint of {problem.scene}", accepted)
        least, most = known[match[2]]
        accepted = (
            f"accepted: [lowest, highest] in degrees, lowest below highest, both from {least:g} to {most:g}"
        )
        if not lowest < highest:
            raise ProblemError(source, key, f"{spell([lowest, highest])} is no range", accepted)
        if lowest < least or highest > most:
            fact = f"{spell([lowest, highest])} is wider than the joint of the model, and ranges are only narrowed"
            raise ProblemError(source, key, fact, accepted)


def _check_friction(problem: ProblemFields, source: str) -> None:
    """Refuse a torsional friction that no contact patch on the smallest tip can give: Hertz, mu_t = (3 pi /
    16) mu a.
    """
    friction, tip = problem.friction, min(problem.hand.tip_radii_m)
    curvature = build_shape(problem.object).curvature
    highest = compute_largest_torsion(friction.sliding, tip, curvature)
    if friction.torsional_m > highest * (1.0 + 1e-12):
        patch_mm = 1e3 * friction.torsional_m / (3.0 * math.pi / 16.0 * friction.sliding)
        patch = f"a contact patch of radius {patch_mm:.1f} mm on a tip of {1e3 * tip:g} mm"
        fact = f"{spell(friction.torsional_m)} implies {patch}"
        named = math.floor(highest * 1e7) / 1e7 or highest
        rule = "0.3 * sliding * smallest tip radius"
        if highest < compute_largest_torsion(friction.sliding, tip):
            sizes = f"r {1e3 * tip:g} mm and R {1e3 / curvature:.3g} mm, where the object is roundest,"
            rule = f"0.59 * sliding * r R / (r + R) with {sizes}"
        accepted = f"accepted: at most {rule} = {named:.7g} m"
        raise ProblemError(source, "friction.torsional_m", fact, accepted)


def _check_forces(problem: ProblemFields, source: str) -> None:
    """Refuse a least normal force above the one aimed at, and one aimed at above the greatest."""
    forces = problem.forces
    accepted = "accepted: normal_floor_N <= normal_N <= normal_ceiling_N"
    if forces.normal_floor_N > forces.normal_N:
        fact = f"{spell(forces.normal_floor_N)} is more than the {spell(forces.normal_N)} of forces.normal_N"
        raise ProblemError(source, "forces.normal_floor_N", fact, accepted)
    if forces.normal_N > forces.normal_ceiling_N:
        fact = (
            f"{spell(forces.normal_ceiling_N)} is less than the {spell(forces.normal_N)} of forces.normal_N"
        )
        raise ProblemError(source, "forces.normal_ceiling_N", fact, accepted)


def _check_start(problem: ProblemFields, source: str) -> None:
    if problem.start.contacts_deg != "auto":
        check_contacts(problem, problem.start.contacts_deg, "start.contacts_deg", source)


def _check_motion(goal: GoalSection | Waypoint, table: str, source: str) -> None:
    """Refuse two motions for one goal, an axis without direction and a quaternion that is none."""
    if goal.rotation is not None and goal.orientation_wxyz is not None:
        fact = f"both rotation and orientation_wxyz {spell(list(goal.orientation_wxyz))} are given"
        raise ProblemError(source, table, fact, "accepted: one of the two")
    if goal.rotation is not None and math.hypot(*goal.rotation.axis) < SMALLEST_NORM:
        fact = f"{spell(list(goal.rotation.axis))} has no direction"
        raise ProblemError(source, f"{table}.rotation.axis", fact, describe_accepted("goal.rotation.axis"))
    if goal.orientation_wxyz is not None and math.hypot(*goal.orientation_wxyz) < SMALLEST_NORM:
        fact = f"{spell(list(goal.orientation_wxyz))} is no attitude"
        key = f"{table}.orientation_wxyz"
        raise ProblemError(source, key, fact, describe_accepted("goal.orientation_wxyz"))


def _check_waypoints(goal: GoalSection, source: str) -> None:
    if goal.waypoints is None:
        return
    if not goal.waypoints:
        raise ProblemError(source, "goal.waypoints", "[] names no goal", describe_accepted("goal.waypoints"))
    if goal.kind != "object_manipulation":
        accepted = (
            'accepted: waypoints of the object alone, kind = "object_manipulation", without contacts_deg'
        )
        raise ProblemError(source, "goal.waypoints", f'given for kind = "{goal.kind}"', accepted)
    if goal.rotation is not None or goal.orientation_wxyz is not None or any(goal.translation_m):
        fact = "given beside another motion"
        raise ProblemError(
            source, "goal.waypoints", fact, "accepted: one of the two; the last waypoint is the goal"
        )
    for index, waypoint in enumerate(goal.waypoints):
        _check_motion(waypoint, f"goal.waypoints[{index}]", source)


def _check_goal(problem: ProblemFields, source: str) -> None:
    goal = problem.goal
    _check_motion(goal, "goal", source)
    _check_waypoints(goal, source)
    if goal.kind == "object_manipulation":
        if goal.contacts_deg is not None:
            accepted = 'accepted: none here, or kind = "dextrous_manipulation" to move object and grasp'
            raise ProblemError(
                source, "goal.contacts_deg", 'given for kind = "object_manipulation"', accepted
            )
    elif goal.contacts_deg is None:
        accepted = describe_accepted("goal.contacts_deg")
        raise ProblemError(source, "goal.contacts_deg", f'missing for kind = "{goal.kind}"', accepted)
    else:
        check_contacts(problem, goal.contacts_deg, "goal.contacts_deg", source)
    turns = goal.orientation_wxyz is not None or (
        goal.rotation is not None and goal.rotation.angle_deg != 0.0
    )
    if goal.keep_object and goal.kind != "grasp_adjustment":
        accepted = (
            'accepted: false here, or kind = "grasp_adjustment", which alone may leave the object elsewhere'
        )
        raise ProblemError(source, "goal.keep_object", f'true for kind = "{goal.kind}"', accepted)
    if goal.kind == "grasp_adjustment" and (turns or any(goal.translation_m)):
        accepted = (
            'accepted: no motion of the object, or kind = "dextrous_manipulation" to move object and grasp'
        )
        raise ProblemError(
            source, "goal", 'a motion of the object is given for kind = "grasp_adjustment"', accepted
        )


def _check_rest(problem: ProblemFields, source: str) -> None:
    primitives = problem.gait.primitives
    if len(set(primitives)) != len(primitives):
        accepted = "accepted: each primitive at most once"
        raise ProblemError(source, "gait.primitives", f"{spell(list(primitives))} repeats itself", accepted)
    if not primitives and problem.goal.contacts_deg is not None:
        fact = "[] keeps the contacts as they are, and goal.contacts_deg asks for others"
        accepted = 'accepted: "substitution", "rewind" or both here'
        raise ProblemError(source, "gait.primitives", fact, accepted)
    for index, obstacle in enumerate(problem.obstacles):
        count, words = OBSTACLE_SIZES[obstacle.kind]
        if len(obstacle.size_m) != count:
            fact = f"{spell(list(obstacle.size_m))} has {len(obstacle.size_m)} entries"
            raise ProblemError(
                source, f"obstacles[{index}].size_m", fact, f"accepted: {words} of a {obstacle.kind}"
            )
