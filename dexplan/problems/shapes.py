"""The object of a problem file: which keys a kind of shape has, and the shape, mass and inertia that they make.

``resolve_object`` works on the plain dict of a file before its types are checked; ``check_object`` on the value.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dexplan.errors import ProblemError
from dexplan.grasp.wrench import MassProperties
from dexplan.problems.mesh_shape import KEY, MOST_CORNERS, resolve_mesh
from dexplan.problems.object_section import ObjectSection, ShapeSection
from dexplan.problems.rules import describe_accepted, spell, suggest
from dexplan.scene.shape import Shape
from dexplan.spatial import Array

SHAPE_KEYS = {
    "ellipsoid": ("semi_axes_m",),
    "capsule": ("radius_m", "half_length_m"),
    "cylinder": ("radius_m", "half_length_m", "rim_m"),
    "box": ("half_sizes_m",),
    "mesh": ("vertices_m",),
}
"""Kind of a shape -> the keys that it needs."""
MORE_KEYS = {"mesh": ("path", "scale", "origin_m", "taken_from", "mesh_volume_m3")}
"""Kind of a shape -> the keys that it may have besides."""
SMALLEST_VOLUME = 1e-9
"""A body of less than a cubic millimetre [m^3] counts as one without volume."""


def choose_rival(data: dict[str, Any], overrides: Mapping[str, object]) -> None:
    """Take the ball's radius out of ``data`` where an override gives a shape, and the shape where one gives the radius."""
    thing = data.get("object")
    if not isinstance(thing, dict):
        return
    given = {
        "shape" if key.startswith(KEY) else "radius_m"
        for key in overrides
        if key.startswith(KEY) or key == "object.radius_m"
    }
    shape = thing.get("shape")
    if isinstance(shape, dict) and f"{KEY}.path" in overrides:
        read = ("vertices_m", "taken_from", "mesh_volume_m3")
        thing = {**thing, "shape": {key: value for key, value in shape.items() if key not in read}}
        data["object"] = thing
    if len(given) == 1:
        rival = "radius_m" if given == {"shape"} else "shape"
        data["object"] = {key: value for key, value in thing.items() if key != rival}


def resolve_object(data: dict[str, Any], source: str, folder: Path) -> None:
    """Refuse keys that do not go together, read the mesh file that is named, relative to ``folder``, and write principal moments
    of inertia as the matrix that they stand for.
    """
    thing = data.get("object")
    if not isinstance(thing, dict):
        return
    thing = dict(thing)
    if "shape" in thing:
        if "radius_m" in thing:
            raise ProblemError(
                source,
                "object",
                "both radius_m and shape are given",
                "accepted: one of the two; radius_m alone is a ball",
            )
        if isinstance(thing["shape"], dict):
            thing["shape"] = _resolve_shape(thing["shape"], source, folder)
    moments = thing.get("inertia_kg_m2")
    if isinstance(moments, list | tuple) and len(moments) == 3 and all(_is_number(x) for x in moments):
        thing["inertia_kg_m2"] = np.diag(moments).astype(float).tolist()
    data["object"] = thing


def _resolve_shape(shape: Mapping[str, Any], source: str, folder: Path) -> Mapping[str, Any]:
    kind = shape.get("kind")
    if "kind" not in shape:
        raise ProblemError(source, f"{KEY}.kind", "missing", describe_accepted(f"{KEY}.kind"))
    if kind in ("sphere", "ball"):
        raise ProblemError(
            source, f"{KEY}.kind", f"{spell(kind)} is no shape", "accepted: object.radius_m, which is a ball"
        )
    if kind not in SHAPE_KEYS:
        accepted = suggest(kind, SHAPE_KEYS) if isinstance(kind, str) else describe_accepted(f"{KEY}.kind")
        raise ProblemError(source, f"{KEY}.kind", f"unknown shape {spell(kind)}", accepted)
    if kind == "mesh" and "path" in shape:
        shape = resolve_mesh(shape, source, folder)
    if kind == "cylinder":
        shape = {**shape, "rim_m": shape.get("rim_m", 0.0)}
    needed, more = SHAPE_KEYS[kind], MORE_KEYS.get(kind, ())
    for name in shape:
        if name != "kind" and name not in (*needed, *more):
            accepted = f"accepted for {kind}: {', '.join((*needed, *more))}"
            raise ProblemError(source, f"{KEY}.{name}", f"given for a {kind}", accepted)
    for name in needed:
        if name not in shape:
            raise ProblemError(
                source, f"{KEY}.{name}", f"missing for a {kind}", describe_accepted(f"{KEY}.{name}")
            )
    return shape


def build_shape(thing: ObjectSection) -> Shape:
    """Return the shape; raises ValueError for lengths that no such body has."""
    shape = thing.shape
    if shape is None:
        return Shape.ball(thing.radius_m or 0.0)
    match shape.kind:
        case "ellipsoid":
            return Shape("ellipsoid", shape.semi_axes_m or ())
        case "box":
            return Shape("box", shape.half_sizes_m or ())
        case "capsule":
            return Shape("capsule", (shape.radius_m or 0.0, shape.half_length_m or 0.0))
        case "cylinder":
            sizes = (shape.radius_m or 0.0, shape.half_length_m or 0.0, shape.rim_m or 0.0)
            return Shape("cylinder", sizes)
    return Shape("polyhedron", vertices=shape.vertices_m or ())


def check_object(thing: ObjectSection, source: str) -> None:
    """Refuse a shape without volume, a centre of mass outside of it, and an inertia that no body has."""
    if thing.shape is not None and thing.shape.kind == "mesh":
        _check_vertices(thing.shape, source)
    try:
        body = build_shape(thing).as_body()
    except ValueError as error:
        fact, _, accepted = str(error).partition("; ")
        raise ProblemError(source, KEY, fact, f"accepted: {accepted.removesuffix(' is accepted')}") from None
    if (volume := body.solid.volume) < SMALLEST_VOLUME:
        fact = f"it has a volume of {1e9 * volume:.3g} mm^3"
        raise ProblemError(source, KEY, fact, "accepted: a body of at least 1 mm^3")
    if thing.com_m is not None and not body.project(thing.com_m).distance < 0.0:
        fact = f"{spell(list(thing.com_m))} lies outside the object"
        middle = ", ".join(f"{x:.4g}" for x in body.solid.com)
        accepted = f"accepted: a point inside it, in the object frame in metres; homogeneous it is [{middle}]"
        raise ProblemError(source, "object.com_m", fact, accepted)
    if thing.inertia_kg_m2 is not None:
        _check_inertia(thing, np.array(thing.inertia_kg_m2), source)


def _check_vertices(shape: ShapeSection, source: str) -> None:
    vertices = shape.vertices_m or ()
    if not 4 <= len(vertices) <= MOST_CORNERS:
        accepted = f"accepted: 4 to {MOST_CORNERS} points, of which the convex hull is taken"
        raise ProblemError(source, f"{KEY}.vertices_m", f"has {len(vertices)} points", accepted)


def _check_inertia(thing: ObjectSection, inertia: Array, source: str) -> None:
    key = "object.inertia_kg_m2"
    try:
        MassProperties(thing.mass_kg, np.zeros(3), inertia)
    except ValueError as error:
        fact, _, accepted = str(error).partition("; ")
        raise ProblemError(source, key, fact, f"accepted: {accepted.removesuffix(' is accepted')}") from None
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 0.0:
        raise ProblemError(
            source,
            key,
            f"it has the principal moment {moments[0]:.3g}",
            "accepted: three positive moments [kg m^2], or a symmetric 3 x 3 matrix",
        )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
