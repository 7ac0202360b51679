"""A mesh that a problem file names: read, checked, and replaced by the corners of its convex hull."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from dexplan.errors import DexplanError, ProblemError
from dexplan.problems.rules import describe_accepted, spell
from dexplan.spatial import Array

if TYPE_CHECKING:
    from dexplan.scene.mesh_file import Mesh

KEY = "object.shape"
MOST_CORNERS = 2_000
"""A body of more corners costs more in planning and physics than a fingertip can feel."""
MOST_FILLED = 1.25
"""A hull of more than this times the mesh's volume is another body than the one in the file."""
LARGEST, SMALLEST = 1.0, 2e-3
"""Extents [m] of a body that fingers hold; beyond these a file is in another unit."""


def resolve_mesh(shape: Mapping[str, Any], source: str, folder: Path) -> dict[str, Any]:
    """Return ``shape`` with the vertices of the file that its ``path`` names, relative to ``folder``, in the place of ``path``,
    ``scale`` and ``origin_m``.

    Raises ProblemError for a file that is no closed mesh of a body's size about its origin, and for one whose hull is
    another body.
    """
    if "vertices_m" in shape:
        raise ProblemError(source, KEY, "both path and vertices_m are given", "accepted: one of the two")
    path, scale, origin = shape["path"], shape.get("scale", 1.0), shape.get("origin_m", [0.0, 0.0, 0.0])
    for name, value, fits in (
        ("path", path, isinstance(path, str) and path),
        ("scale", scale, _is_number(scale) and scale > 0.0),
        (
            "origin_m",
            origin,
            isinstance(origin, list | tuple) and len(origin) == 3 and all(map(_is_number, origin)),
        ),
    ):
        if not fits:
            raise ProblemError(
                source, f"{KEY}.{name}", f"{spell(value)} does not fit", describe_accepted(f"{KEY}.{name}")
            )
    # MuJoCo is only asked for where there is a mesh: reading problems is light.
    from dexplan.scene.mesh_file import read_mesh

    try:
        mesh = read_mesh(folder / path)
    except DexplanError as error:
        fact, _, accepted = str(error).partition("; ")
        raise ProblemError(
            source, f"{KEY}.path", f"{spell(path)}: {fact}", f"accepted: {_cut(accepted)}"
        ) from None
    hull = _take_hull(mesh, float(scale), np.array(origin, dtype=np.float64), f"{spell(path)}: ", source)
    kept = {key: value for key, value in shape.items() if key not in ("path", "scale", "origin_m")}
    volume = mesh.compute_volume() * float(scale) ** 3
    return {**kept, "vertices_m": hull.tolist(), "taken_from": Path(path).name, "mesh_volume_m3": volume}


def _take_hull(mesh: Mesh, scale: float, origin: Array, who: str, source: str) -> Array:
    """Return the corners (V, 3) [m] of the hull, to a nanometre."""

    def refuse(fact: str, accepted: str, key: str = "path") -> ProblemError:
        return ProblemError(source, f"{KEY}.{key}", who + fact, f"accepted: {accepted}")

    size = scale * mesh.size
    if not SMALLEST <= size <= LARGEST:
        unit = "; in millimetres it needs scale = 0.001" if size > LARGEST and size * 1e-3 <= LARGEST else ""
        raise refuse(f"it is {size:.4g} m long", f"metres, from {SMALLEST:g} to {LARGEST:g} m{unit}")
    if count := mesh.count_open_edges():
        raise refuse(
            f"it is open: {count} edges do not belong to exactly two triangles",
            "a closed mesh, which encloses a volume",
        )
    points = np.round(scale * mesh.vertices - origin, 9)
    volume = scale**3 * mesh.compute_volume()
    try:
        hull = ConvexHull(points)
    except QhullError:
        raise refuse("it is flat", "a mesh that encloses a volume") from None
    if volume <= 1e-6 * hull.volume:
        raise refuse("it encloses no volume", "a mesh that encloses a volume")
    if hull.volume > MOST_FILLED * volume:
        more = 100.0 * (hull.volume / volume - 1.0)
        raise refuse(
            f"it is not convex: its hull has {more:.0f} % more volume",
            f"a mesh whose hull has at most {100.0 * (MOST_FILLED - 1.0):.0f} % more; or vertices_m, if the hull is meant",
        )
    if hull.equations[:, 3].max() >= 0.0:
        middle = ", ".join(f"{x:.4g}" for x in points[hull.vertices].mean(axis=0) + origin)
        raise refuse(
            "its origin is not inside", f"origin_m = [{middle}], a point inside, or another", "origin_m"
        )
    if len(hull.vertices) > MOST_CORNERS:
        raise refuse(
            f"its hull has {len(hull.vertices)} corners", f"at most {MOST_CORNERS}; simplify the mesh"
        )
    return np.asarray(points[np.sort(hull.vertices)])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cut(accepted: str) -> str:
    return accepted.removesuffix(" is accepted").removesuffix(" are accepted")
