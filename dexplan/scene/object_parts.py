"""The object in a model: how a shape is written as MJCF, and how body and mass are read back from the compiled model.

MuJoCo has a primitive for each shape but two.  A polyhedron is a mesh with its vertices in the text; so is a cylinder with a
rounded rim, whose radius, half length and rim stand beside it as numbers.  MuJoCo moves a mesh into its own centre and axes
when it compiles; the geom is then placed so that the *body's* frame stays what the text says, which is the object's frame O.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import BallBody, CapsuleBody, EllipsoidBody
from dexplan.errors import DexplanError
from dexplan.grasp.wrench import MassProperties
from dexplan.scene.description import SceneParameters
from dexplan.scene.shape import tessellate_cylinder
from dexplan.spatial import Array

if TYPE_CHECKING:
    from dm_control import mjcf

SURFACE = "object/surface"
"""The geom that fingertips touch."""
ROUNDED = "rounded_cylinder"
"""Name of the numbers (radius, half length, rim) [m] that say which cylinder a mesh stands for."""
_NEAR = 1e-6
"""A mesh that stands for a cylinder keeps as near to it as this [m], beyond what its corners make up."""
_UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Entries of a symmetric matrix in MJCF's order."""


def compute_mass_properties(parameters: SceneParameters) -> MassProperties:
    """Return mass, centre of mass and inertia of the object: as given, or those of a homogeneous body of its shape.

    An inertia that is left out is the homogeneous one about its own centre of mass; with ``object_com`` given it is taken about
    that point, unchanged.
    """
    solid = parameters.object_shape.as_body().solid
    mass, com, inertia = parameters.object_mass, parameters.object_com, parameters.object_inertia
    return MassProperties(
        mass,
        solid.com if com is None else np.array(com),
        mass / solid.volume * solid.inertia if inertia is None else np.array(inertia),
    )


def write_object(part: mjcf.RootElement, parameters: SceneParameters) -> None:
    """Write the shape into ``part``, the object's own model: the geom that is touched, and its mesh where it takes one."""
    shape, geom = parameters.object_shape, part.find("geom", "surface")
    body = shape.as_body()
    geom.mass = parameters.object_mass
    if isinstance(body, CylinderBody) and body.rim > 0.0:
        part.custom.add("numeric", name=ROUNDED, data=[body.radius, body.half_length, body.rim])
        _write_mesh(part, geom, tessellate_cylinder(body))
    elif isinstance(body, PolyhedronBody):
        _write_mesh(part, geom, body.hull)
    else:
        geom.type = shape.kind
        # A sharp rim of 0 is nothing that MuJoCo's cylinder has.
        geom.size = shape.sizes[:2] if isinstance(body, CylinderBody) else shape.sizes


def write_inertial(frame: mjcf.Element, parameters: SceneParameters) -> None:
    """Write mass, centre of mass and inertia into the object's body where MuJoCo would not find the same by itself."""
    is_mesh = _is_mesh(parameters.object_shape.as_body())
    if parameters.object_com is None and parameters.object_inertia is None and not is_mesh:
        return
    own = compute_mass_properties(parameters)
    frame.add("inertial", pos=own.com, mass=own.mass, fullinertia=[float(own.inertia[ij]) for ij in _UPPER])


def read_object(model: mujoco.MjModel) -> tuple[ConvexBody, MassProperties]:
    """Return the object's shape and mass, both in the axes of its MuJoCo body.

    Raises DexplanError for an object of more than one geom, a shape that is none of ours, and one that is not in its place.
    """
    geom = model.geom(SURFACE).id
    body = int(model.geom_bodyid[geom])
    if (count := int(model.body_geomnum[body])) != 1:
        raise DexplanError(f"the object consists of {count} geoms; one, named 'object/surface', is accepted")
    R = _as_matrix(model.body_iquat[body])
    properties = MassProperties(
        float(model.body_mass[body]), model.body_ipos[body], R @ np.diag(model.body_inertia[body]) @ R.T
    )
    return _read_body(model, geom), properties


def _read_body(model: mujoco.MjModel, geom: int) -> ConvexBody:
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), [float(x) for x in model.geom_size[geom]]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _read_mesh(model, geom)
    if np.any(model.geom_pos[geom]) or np.any(model.geom_quat[geom] != [1.0, 0.0, 0.0, 0.0]):
        raise DexplanError(
            f"the object's surface is {model.geom_pos[geom].tolist()} m from the origin of its body and turned by the quaternion "
            f"{model.geom_quat[geom].tolist()}; no offset and no turn are accepted"
        )
    match kind:
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return BallBody(size[0])
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return EllipsoidBody(*size)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return CapsuleBody(size[0], size[1])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return CylinderBody(size[0], size[1])
        case mujoco.mjtGeom.mjGEOM_BOX:
            return BoxBody(*size)
    raise DexplanError(
        f"geom {SURFACE!r} is of type {kind.name.removeprefix('mjGEOM_').lower()}; sphere, ellipsoid, capsule, cylinder, box and "
        "mesh are accepted"
    )


def _read_mesh(model: mujoco.MjModel, geom: int) -> ConvexBody:
    """Return the polyhedron, or the cylinder that it stands for."""
    mesh = int(model.geom_dataid[geom])
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    vertices = vertices @ _as_matrix(model.geom_quat[geom]).T + model.geom_pos[geom]
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, f"object/{ROUNDED}")
    if number < 0:
        return PolyhedronBody(vertices)
    first = int(model.numeric_adr[number])
    body = CylinderBody(*model.numeric_data[first : first + 3].tolist())
    asked, found = (
        points[np.lexsort(np.round(points, 7).T)] for points in (tessellate_cylinder(body), vertices)
    )
    off = np.abs(body.project(found).distance).max() - np.abs(body.project(asked).distance).max()
    if len(asked) != len(found) or off > _NEAR:
        raise DexplanError(
            f"the mesh {SURFACE!r} is not the cylinder that {ROUNDED!r} names; the vertices that come with these "
            "numbers are accepted"
        )
    return body


def _is_mesh(body: ConvexBody) -> bool:
    return isinstance(body, PolyhedronBody) or (isinstance(body, CylinderBody) and body.rim > 0.0)


def _write_mesh(part: mjcf.RootElement, geom: mjcf.Element, vertices: Array) -> None:
    part.asset.add("mesh", name="surface", vertex=vertices.ravel())
    geom.type, geom.mesh = "mesh", "surface"
    del geom.size


def _as_matrix(quaternion: Sequence[float] | Array) -> Array:
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, np.asarray(quaternion, dtype=np.float64))
    return R.reshape(3, 3)
