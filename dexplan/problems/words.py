"""A problem in words: what is asked, where it starts, and with which means."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dexplan.problems.object_section import ObjectSection
from dexplan.problems.sections import ContactPoint, ContactSpec, GoalSection, ProblemFields, Waypoint
from dexplan.problems.shapes import build_shape
from dexplan.sim.judge.limits import find_loose_limits


def describe_problem(problem: ProblemFields) -> tuple[tuple[str, str], ...]:
    """Return (what, words) about ``problem``, in the order in which they are to be read."""
    return tuple(_describe(problem))


def spell_problem(problem: ProblemFields) -> str:
    """Return ``problem`` in words, a line for each thing."""
    rows = describe_problem(problem)
    width = max(len(what) for what, _ in rows)
    return "\n".join(f"{what:<{width}}  {words}" for what, words in rows)


def _describe(problem: ProblemFields) -> Iterator[tuple[str, str]]:
    yield "problem", f"{problem.name}: {problem.summary}" if problem.summary else problem.name
    yield "goal", _describe_goal(problem.goal)
    if problem.goal.contacts_deg is not None:
        yield "goal contacts", _describe_contacts(problem.goal.contacts_deg)
    start = problem.start.contacts_deg
    yield "start contacts", "chosen by the planner" if isinstance(start, str) else _describe_contacts(start)
    thing = problem.object
    yield "object", f"{describe_shape(thing)} and {1e3 * thing.mass_kg:g} g{_describe_mass(thing)}"
    tips = ", ".join(f"{1e3 * radius:g}" for radius in problem.hand.tip_radii_m)
    yield "hand", f"{problem.hand.finger_count} fingers of {problem.scene}, tips of radius {tips} mm"
    friction = problem.friction
    yield (
        "friction",
        f"sliding {friction.sliding:g}, torsional {1e3 * friction.torsional_m:.3g} mm; planner and controller believe "
        f"{friction.believed_sliding:.3g} and {1e3 * friction.believed_torsional_m:.3g} mm",
    )
    means = " and ".join(problem.gait.primitives) or "none, the contacts stay as they are"
    yield "gaits", f"{means}; at most {problem.gait.node_budget} nodes"
    if problem.obstacles:
        yield "obstacles", ", ".join(o.kind for o in problem.obstacles)
    control = problem.control
    yield (
        "carried out",
        f"at {control.speed_deg_s:g} deg/s in the profile {control.physics_profile}, seed {problem.seed}",
    )
    loose = find_loose_limits(problem.acceptance)
    yield (
        "judged by",
        f"limits looser than default: {', '.join(map(str, loose))}"
        if loose
        else "no limit looser than default",
    )


def describe_shape(thing: ObjectSection) -> str:
    """Return the object's shape in words."""
    shape = thing.shape
    if shape is None:
        return f"a ball of radius {_as_mm(thing.radius_m)} mm"
    match shape.kind:
        case "ellipsoid":
            return f"an ellipsoid of semi-axes {_as_mm(*shape.semi_axes_m or ())} mm"
        case "box":
            return f"a box of {_as_mm(*(2.0 * x for x in shape.half_sizes_m or ())).replace(', ', ' x ')} mm"
        case "capsule":
            return f"a capsule of radius {_as_mm(shape.radius_m)} and half length {_as_mm(shape.half_length_m)} mm"
        case "cylinder":
            rim = f", its rims rounded by {_as_mm(shape.rim_m)} mm" if shape.rim_m else ""
            return f"a cylinder of radius {_as_mm(shape.radius_m)} and half length {_as_mm(shape.half_length_m)} mm{rim}"
    body = build_shape(thing).as_body()
    corners = f"{len(shape.vertices_m or ())} points within {1e3 * body.bound:.3g} mm"
    more = 100.0 * (body.solid.volume / (shape.mesh_volume_m3 or body.solid.volume) - 1.0)
    if shape.taken_from is None:
        return f"the convex hull of {corners}"
    if more < 0.05:
        return f"the convex mesh {shape.taken_from} of {corners}"
    return f"the convex hull of {shape.taken_from}, {more:.2g} % more volume than the mesh, {corners}"


def _describe_mass(thing: ObjectSection) -> str:
    given = [
        word
        for word, value in (("centre of mass", thing.com_m), ("inertia", thing.inertia_kg_m2))
        if value is not None
    ]
    return f", {' and '.join(given)} given" if given else ""


def _as_mm(*lengths: float | None) -> str:
    return ", ".join(f"{1e3 * (x or 0.0):g}" for x in lengths)


def _describe_goal(goal: GoalSection) -> str:
    if goal.waypoints is not None:
        ways = "; then ".join(
            " and ".join(_describe_motion(one)) or "hold the object" for one in goal.waypoints
        )
        return f"{ways} ({goal.kind.replace('_', ' ')})"
    parts = _describe_motion(goal)
    if goal.contacts_deg is not None:
        parts.append("touch the object elsewhere")
    words = " and ".join(parts) or "keep the object where it is"
    if goal.kind == "dextrous_manipulation":
        words += f", {goal.order.replace('_', ' ')}"
    return f"{words} ({goal.kind.replace('_', ' ')})"


def _describe_motion(goal: GoalSection | Waypoint) -> list[str]:
    parts = []
    if goal.rotation is not None:
        axis = ", ".join(f"{x:g}" for x in goal.rotation.axis)
        parts.append(f"turn the object by {goal.rotation.angle_deg:g} deg about ({axis}) of the world")
    if goal.orientation_wxyz is not None:
        attitude = np.asarray(goal.orientation_wxyz) / np.linalg.norm(goal.orientation_wxyz)
        parts.append(
            f"bring the object to the attitude ({', '.join(f'{x:.3f}' for x in attitude)}) (w, x, y, z)"
        )
    if any(goal.translation_m):
        shift = ", ".join(f"{1e3 * x:g}" for x in goal.translation_m)
        parts.append(f"shift the object by ({shift}) mm in the world")
    return parts


def _describe_contacts(contacts: Sequence[ContactSpec]) -> str:
    return (
        "; ".join(f"finger {k} {_describe_contact(c)}" for k, c in enumerate(contacts, 1)) + " (object frame)"
    )


def _describe_contact(contact: ContactSpec) -> str:
    if isinstance(contact, ContactPoint):
        return f"at ({', '.join(f'{1e3 * x:.1f}' for x in contact.point_m)}) mm"
    if isinstance(contact, str):
        return contact
    return f"at azimuth {contact[0]:g}, elevation {contact[1]:g} deg"
