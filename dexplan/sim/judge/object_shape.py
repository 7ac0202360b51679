"""What the object of a problem has to be in the model: its geom, mass, centre of mass and inertia, worked out anew here.

Bodies of revolution are integrated along their axis, boxes by formula, polyhedra over the tetrahedra of their hull: none of it
is code of what writes the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial import ConvexHull

from dexplan.spatial import Array, lock_arrays

_NEAR = 1e-6
"""Corners of a mesh may be so far [m] from where the problem has them: MuJoCo keeps them in single precision."""
_EXACT, _MESHED = 1e-6, 1e-4
"""Relative error of an inertia: of a text with nine digits, and of a mesh whose corners are in single precision."""
_SAGITTA = 1e-3
"""How far a mesh may be off the rounded cylinder that it stands for, inside or outside, in radii: it has flat facets."""
_SHARP_COSINE = float(np.cos(np.radians(20.0)))
"""Facets whose normals have a cosine of at most this meet in a sharp edge: less bent, and they stand for a round surface."""


@dataclass(frozen=True, eq=False)
class Solid:
    """Volume [m^3], centre of mass (3,) [m], and inertia (3, 3) about it [m^5], at density 1."""

    volume: float
    com: Array
    inertia: Array

    def __post_init__(self) -> None:
        lock_arrays(self)


def find_departures_of_object(model: mujoco.MjModel, geom: int, section: Mapping[str, Any]) -> Iterator[str]:
    """Yield in words where geom and body of the object are not what ``section``, a problem's ``object``, says."""
    shape = section.get("shape") or {"kind": "sphere", "radius_m": section.get("radius_m")}
    yield from _compare_geom(model, geom, shape)
    yield from _compare_mass(model, int(model.geom_bodyid[geom]), section, shape)


# -- the geom ------------------------------------------------------------------------------------------------------------


def _compare_geom(model: mujoco.MjModel, geom: int, shape: Mapping[str, Any]) -> Iterator[str]:
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    is_mesh = shape["kind"] == "mesh" or bool(shape.get("rim_m"))
    wanted = "mesh" if is_mesh else str(shape["kind"])
    if kind != wanted:
        yield f"object/surface is of type {kind}, not a {wanted}"
    elif is_mesh:
        yield from _compare_corners(read_corners(model, geom), shape)
    else:
        size = _list_sizes(shape)
        if not np.allclose(model.geom_size[geom][: len(size)], size, rtol=_EXACT, atol=0.0):
            yield f"size of object/surface is {model.geom_size[geom].tolist()}, not {size}"
        if np.any(model.geom_pos[geom]) or np.any(model.geom_quat[geom] != [1.0, 0.0, 0.0, 0.0]):
            yield "object/surface is not in the place of its body"


def _list_sizes(shape: Mapping[str, Any]) -> list[float]:
    """Return what MuJoCo's primitive of this kind has as its size [m]."""
    match shape["kind"]:
        case "sphere":
            return [float(shape["radius_m"])]
        case "ellipsoid":
            return [float(x) for x in shape["semi_axes_m"]]
        case "box":
            return [float(x) for x in shape["half_sizes_m"]]
    return [float(shape["radius_m"]), float(shape["half_length_m"])]


def read_corners(model: mujoco.MjModel, geom: int) -> Array:
    """Return the corners (N, 3) [m] of a mesh geom in the axes of its body."""
    mesh = int(model.geom_dataid[geom])
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.geom_quat[geom])
    corners = model.mesh_vert[start : start + count].astype(np.float64)
    return np.asarray(corners @ R.reshape(3, 3).T + model.geom_pos[geom])


def _compare_corners(corners: Array, shape: Mapping[str, Any]) -> Iterator[str]:
    """A mesh has the corners of the problem's hull; one that stands for a rounded cylinder lies on it and fills it."""
    if shape["kind"] == "mesh":
        asked = np.asarray(shape["vertices_m"], dtype=np.float64)
        missing = _measure_beyond(asked, corners)
        beyond = _measure_beyond(corners, asked)
        if max(missing, beyond) > _NEAR:
            yield f"the hull of object/surface is {1e3 * max(missing, beyond):.4f} mm off the problem's"
        return
    radius, half, rim = (float(shape[key]) for key in ("radius_m", "half_length_m", "rim_m"))
    # A rounded cylinder is the points within ``rim`` of a smaller one.
    across = np.maximum(np.hypot(corners[:, 0], corners[:, 1]) - (radius - rim), 0.0)
    along = np.maximum(np.abs(corners[:, 2]) - (half - rim), 0.0)
    off = np.abs(np.hypot(across, along) - rim).max()
    turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    polar = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 91)[:, None]
    directions = np.stack(
        np.broadcast_arrays(np.cos(polar) * np.cos(turn), np.cos(polar) * np.sin(turn), np.sin(polar)), -1
    ).reshape(-1, 3)
    flat = np.hypot(directions[:, 0], directions[:, 1])
    reach = (radius - rim) * flat + (half - rim) * np.abs(directions[:, 2]) + rim
    short = (reach - (corners @ directions.T).max(axis=0)).max()
    if max(off, short) > _SAGITTA * radius:
        yield f"object/surface does not fill the problem's cylinder: {1e3 * max(off, short):.4f} mm off"


def _measure_beyond(points: Array, corners: Array) -> float:
    """Return how far [m] the farthest of ``points`` (N, 3) is outside the hull of ``corners`` (M, 3)."""
    planes = ConvexHull(corners).equations
    return float((points @ planes[:, :3].T + planes[:, 3]).max())


def find_on_ray(section: Mapping[str, Any], direction: Array) -> Array:
    """Return the point (3,) [m] at which the ray from the object's origin along ``direction`` (3,) leaves its surface."""
    shape, d = section["shape"], direction / np.linalg.norm(direction)
    if shape["kind"] == "ellipsoid":
        return np.asarray(d / np.linalg.norm(d / np.asarray(shape["semi_axes_m"])))
    if shape["kind"] == "box":
        return np.asarray(d / np.max(np.abs(d) / np.asarray(shape["half_sizes_m"])))
    if shape["kind"] == "mesh":
        planes = ConvexHull(np.asarray(shape["vertices_m"], dtype=np.float64)).equations
        return np.asarray(d / np.max(planes[:, :3] @ d / -planes[:, 3]))
    radius, half = float(shape["radius_m"]), float(shape["half_length_m"])
    across, along, rim = float(np.hypot(d[0], d[1])), abs(float(d[2])), float(shape.get("rim_m") or 0.0)
    # What is rounded is all within ``rim`` of a core: of a capsule a line, of a cylinder a smaller cylinder.
    core = 0.0
    if shape["kind"] == "capsule":
        rim = radius
    else:
        core, half = radius - rim, half - rim

    def depth(s: float) -> float:
        return float(np.hypot(max(s * across - core, 0.0), max(s * along - half, 0.0))) - rim

    if not rim:
        return np.asarray(d / max(across / core, along / half))
    return np.asarray(d * brentq(depth, 0.0, 2.0 * (core + half + rim), xtol=1e-15))


# -- its edges ----------------------------------------------------------------------------------------------------------


def has_edges(section: Mapping[str, Any]) -> bool:
    """Return whether the object of a problem has sharp edges."""
    shape = section.get("shape") or {"kind": "sphere"}
    if shape["kind"] == "mesh":
        return len(_list_edges(np.asarray(shape["vertices_m"], dtype=np.float64))) > 0
    return shape["kind"] == "box" or (shape["kind"] == "cylinder" and not shape.get("rim_m"))


def measure_edge_distance(section: Mapping[str, Any], points: Array) -> Array:
    """Return how far (N,) [m] points (N, 3) of the object's surface are from its nearest sharp edge."""
    shape = section["shape"]
    if shape["kind"] == "mesh":
        edges = _list_edges(np.asarray(shape["vertices_m"], dtype=np.float64))
        if not len(edges):
            return np.full(len(points), np.inf)
        first, along = edges[:, 0], edges[:, 1] - edges[:, 0]
        share = np.einsum("nei,ei->ne", points[:, None] - first, along) / np.sum(along**2, axis=1)
        nearest = first + np.clip(share, 0.0, 1.0)[..., None] * along
        return np.asarray(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1))
    if shape["kind"] == "box":
        gaps = np.sort(np.abs(np.asarray(shape["half_sizes_m"]) - np.abs(points)), axis=1)
    else:
        across = float(shape["radius_m"]) - np.hypot(points[:, 0], points[:, 1])
        gaps = np.stack([across, float(shape["half_length_m"]) - np.abs(points[:, 2])], axis=1)
    return np.asarray(np.hypot(gaps[:, 0], gaps[:, 1]))


def _list_edges(points: Array) -> Array:
    """Return the edges (E, 2, 3) [m] of the hull of points (N, 3) at which its surface bends sharply."""
    hull = ConvexHull(points)
    found = []
    for facet, (corners, others) in enumerate(zip(hull.simplices, hull.neighbors, strict=True)):
        for k, other in enumerate(others):
            if other > facet and hull.equations[facet, :3] @ hull.equations[other, :3] <= _SHARP_COSINE:
                found.append(points[np.delete(corners, k)])
    return np.array(found).reshape(-1, 2, 3)


# -- its mass ------------------------------------------------------------------------------------------------------------


def _compare_mass(
    model: mujoco.MjModel, body: int, section: Mapping[str, Any], shape: Mapping[str, Any]
) -> Iterator[str]:
    mass = float(section["mass_kg"])
    solid = integrate(shape)
    tolerance = _MESHED if shape["kind"] == "mesh" or shape.get("rim_m") else _EXACT
    if not np.isclose(model.body_mass[body], mass, rtol=_EXACT, atol=0.0):
        yield f"object mass is {model.body_mass[body]}, not {mass}"
    given = section.get("com_m")
    com = solid.com if given is None else np.asarray(given, dtype=np.float64)
    size = float(np.cbrt(solid.volume))
    if not np.allclose(model.body_ipos[body], com, rtol=0.0, atol=tolerance * size):
        yield f"the object's centre of mass is at {model.body_ipos[body].tolist()} m, not {com.tolist()}"
    given = section.get("inertia_kg_m2")
    inertia = mass / solid.volume * solid.inertia if given is None else np.asarray(given, dtype=np.float64)
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[body])
    axes = R.reshape(3, 3)
    found = axes @ np.diag(model.body_inertia[body]) @ axes.T
    if not np.allclose(found, inertia, rtol=0.0, atol=tolerance * np.abs(inertia).max()):
        yield f"object inertia is {found.tolist()}, not {inertia.tolist()}"


def integrate(shape: Mapping[str, Any]) -> Solid:
    """Return volume, centre of mass and inertia of a problem's shape at density 1."""
    match shape["kind"]:
        case "mesh":
            return _integrate_hull(np.asarray(shape["vertices_m"], dtype=np.float64))
        case "box":
            a, b, c = (float(x) for x in shape["half_sizes_m"])
            volume = 8.0 * a * b * c
            moments = volume / 3.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
            return Solid(volume, np.zeros(3), np.diag(moments))
        case "ellipsoid" | "sphere":
            radius = shape.get("radius_m")
            a, b, c = (float(x) for x in (shape["semi_axes_m"] if radius is None else [radius] * 3))
            volume = 4.0 / 3.0 * np.pi * a * b * c
            moments = volume / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
            return Solid(volume, np.zeros(3), np.diag(moments))
    radius, half = float(shape["radius_m"]), float(shape["half_length_m"])
    if shape["kind"] == "capsule":
        rim, half = radius, half + radius
    else:
        rim = float(shape.get("rim_m") or 0.0)

    def outline(z: float) -> float:
        above = max(abs(z) - (half - rim), 0.0)
        return radius - rim + float(np.sqrt(max(rim * rim - above * above, 0.0)))

    return _revolve(outline, half, half - rim)


def _revolve(outline: Callable[[float], float], half: float, bend: float) -> Solid:
    """Return the solid that an ``outline``, its radius [m] at a height [m], makes around z between -``half`` and ``half``.

    ``bend``: the height at which the outline begins to bend.
    """

    def over(f: Callable[[float], float]) -> float:
        parts = [(0.0, bend), (bend, half)] if 0.0 < bend < half else [(0.0, half)]
        return 2.0 * sum(float(quad(f, *part, epsabs=0.0, epsrel=1e-10)[0]) for part in parts)

    volume = np.pi * over(lambda z: outline(z) ** 2)
    spin = 0.5 * np.pi * over(lambda z: outline(z) ** 4)
    across = 0.5 * spin + np.pi * over(lambda z: (z * outline(z)) ** 2)
    return Solid(volume, np.zeros(3), np.diag([across, across, spin]))


def _integrate_hull(points: Array) -> Solid:
    """Return the solid of the hull of ``points`` (N, 3), over tetrahedra from a point inside."""
    hull = ConvexHull(points)
    middle = points[hull.vertices].mean(axis=0)
    edges = points[hull.simplices] - middle
    volumes = np.abs(np.linalg.det(edges)) / 6.0
    volume = float(volumes.sum())
    com = (volumes[:, None] * edges.sum(axis=1) / 4.0).sum(axis=0) / volume
    # Second moments of a tetrahedron with one corner in the origin: V/20 (sum x_i x_i^T + s s^T).
    sums = edges.sum(axis=1)
    second = np.einsum("t,tki,tkj->ij", volumes, edges, edges) + np.einsum("t,ti,tj->ij", volumes, sums, sums)
    second = second / 20.0 - volume * np.outer(com, com)
    return Solid(volume, middle + com, np.trace(second) * np.eye(3) - second)
