"""Which body a model's object is: read off its geoms, so that a trace can be drawn without its problem."""

from __future__ import annotations

import mujoco
import numpy as np

from dexplan.contact.bodies.body import ConvexBody
from dexplan.contact.bodies.edged import BoxBody, CylinderBody
from dexplan.contact.bodies.polyhedron import PolyhedronBody
from dexplan.contact.bodies.smooth import BallBody, CapsuleBody, EllipsoidBody
from dexplan.spatial import Array

SURFACE = "object/surface"
"""The geom with which the object collides."""


def read_body(model: mujoco.MjModel) -> ConvexBody | None:
    """Return the object's body in the axes of its MuJoCo body; None for a shape that is not known here."""
    k = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, SURFACE)
    if k < 0:
        return None
    size = [float(x) for x in model.geom_size[k]]
    match int(model.geom_type[k]):
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
        case mujoco.mjtGeom.mjGEOM_MESH:
            return PolyhedronBody(_read_vertices(model, k))
    return None


def find_body(xml: str) -> ConvexBody | None:
    """Return the object's body in the model of the text ``xml``; None for a shape that is not known here."""
    return read_body(mujoco.MjModel.from_xml_string(xml))


def _read_vertices(model: mujoco.MjModel, geom: int) -> Array:
    """Return a mesh's vertices (V, 3) [m] in the axes of its body; MuJoCo keeps them about the mesh's own centre of mass."""
    mesh = int(model.geom_dataid[geom])
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.geom_quat[geom])
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    return np.asarray(vertices @ R.reshape(3, 3).T + model.geom_pos[geom])
